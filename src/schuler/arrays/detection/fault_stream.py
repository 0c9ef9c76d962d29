"""Faults of redundant sensors looked for block by block, as samples come."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.arrays.detection.fault_log import FaultRecord, fault_records
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.lever_arms import arm_coefficients
from schuler.arrays.redundant import RedundantSensors
from schuler.arrays.tracking import Followed, outputs_of_block, tuning_of_stream
from schuler.types import BoolArray, FloatArray


class FaultStream:
    """The tests of `detect_faults` for one kind of sensor, entered once a block.

    Parameters
    ----------
    learnt : Followed
        Of a recording of the same sensors: noise, bias differences, calibration of the tests.
    settings : FaultSettings
        Of the tests.
    """

    __slots__ = ("_axes", "_constants", "_memory", "_redundancy", "_seen", "sensors", "size")

    def __init__(self, learnt: Followed, settings: FaultSettings) -> None:
        from schuler.kernels.arrays.redundancy_data import Redundancy, RedundantAxes, Remembered

        of, self.size = learnt.sensors, learnt.block
        self.sensors: RedundantSensors = of
        watch = settings.watch(of)
        self._constants = watch.time_constants
        hold = max(round(watch.hold / (self.size * of.step)), 1)
        self._memory = Remembered.begin(
            learnt.bias.copy(), learnt.variance[-1].copy(), len(watch.time_constants), hold
        )
        self._memory.factor[:] = learnt.factor
        self._seen = float(of.time.size)
        self._axes = RedundantAxes(
            measurements=np.empty((self.size, of.count)),
            arm_tensor=np.zeros((self.size if of.spacing > 0.0 else 0, 9)),
            arm=np.ascontiguousarray(arm_coefficients(of.axes, of.arms)),
            extra=np.zeros(0),
            axes=np.ascontiguousarray(of.axes),
            unit=np.ascontiguousarray(of.unit, dtype=np.int64),
            given=np.zeros((0, of.count)),
        )
        self._redundancy = Redundancy.of(
            self._axes,
            of.units,
            tuning_of_stream(learnt, settings.online_of(of.sensor), watch),
            self._memory,
            outputs_of_block(self.size, of.count, len(watch.time_constants)),
        )

    @property
    def arms(self) -> bool:
        """Whether rotation shows in these sensors by their places."""
        return len(self._axes.arm_tensor) > 0

    @property
    def out(self) -> BoolArray:
        """Which axes are taken out, (M,)."""
        return np.asarray(self._memory.status > 0)

    @property
    def variance(self) -> FloatArray:
        """Of a sample of every axis as it is used, (M,)."""
        return np.asarray(self._redundancy.out.variances[0])

    def take(
        self, time: FloatArray, measurements: FloatArray, tensor: FloatArray | None
    ) -> tuple[FaultRecord, ...]:
        """Take one block of samples; who was taken out in it."""
        from schuler.kernels.arrays.redundancy import follow

        memory, r = self._memory, self._redundancy
        self._axes.measurements[:] = measurements
        if tensor is not None and len(self._axes.arm_tensor):
            self._axes.arm_tensor[:] = tensor
        self._seen += self.size
        # the kernel counts blocks from here on: what was taken out before is one block older
        memory.taken[:] -= 1
        memory.events[0] = 0
        number = follow(replace(r, tuning=replace(r.tuning, bias_samples=self._seen)))
        if not number:
            return ()
        here = replace(self.sensors, time=time, measurements=self._axes.measurements)
        return fault_records(r.out.events[:number], here, self._constants)
