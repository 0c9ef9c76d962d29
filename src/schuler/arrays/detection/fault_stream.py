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
    """The tests of `detect_faults` for one kind of sensor, entered once a block (`watch_block`).

    Parameters
    ----------
    learnt : Followed
        Of a recording of the same sensors: noise, bias differences, calibration of the tests.
    settings : FaultSettings
        Of the tests.
    """

    __slots__ = ("_axes", "_constants", "_memory", "sensors", "size", "tests")

    def __init__(self, learnt: Followed, settings: FaultSettings) -> None:
        from schuler.kernels.arrays.redundancy_data import Redundancy, RedundantAxes, Remembered

        of, self.size = learnt.sensors, learnt.block
        self.sensors: RedundantSensors = of
        watch = settings.watch(of)
        turned = of.sensor == "accel" and of.spacing > 0.0
        self._constants = watch.time_constants
        hold = max(round(watch.hold / (self.size * of.step)), 1)
        self._memory = Remembered.begin(
            learnt.bias.copy(), learnt.variance[-1].copy(), len(watch.time_constants), hold
        )
        self._memory.factor[:] = learnt.factor
        self._memory.seen[:] = of.time.size
        self._axes = RedundantAxes(
            measurements=np.empty((self.size, of.count)),
            arm_tensor=np.zeros((self.size if turned else 0, 9)),
            arm=np.ascontiguousarray(arm_coefficients(of.axes, of.arms)),
            extra=np.zeros(0),
            axes=np.ascontiguousarray(of.axes),
            unit=np.ascontiguousarray(of.unit, dtype=np.int64),
            given=np.zeros((0, of.count)),
        )
        self.tests = Redundancy.of(
            self._axes,
            of.units,
            tuning_of_stream(learnt, settings.online_of(of.sensor), watch),
            self._memory,
            outputs_of_block(self.size, of.count, len(watch.time_constants)),
        )

    @property
    def out(self) -> BoolArray:
        """Which axes are taken out, (M,)."""
        return np.asarray(self._memory.status > 0)

    @property
    def variance(self) -> FloatArray:
        """Of a sample of every axis as it is used, (M,)."""
        return np.asarray(self.tests.out.variances[0])

    def log(self, number: int, time: FloatArray) -> tuple[FaultRecord, ...]:
        """What the tests said of the last block, whose samples were taken at these times."""
        if not number:
            return ()
        here = replace(self.sensors, time=time, measurements=self._axes.measurements)
        return fault_records(self.tests.out.events[:number], here, self._constants)
