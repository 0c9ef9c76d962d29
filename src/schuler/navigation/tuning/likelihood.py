"""How likely the innovations of a drive are, GNSS thinned or not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.gnss import VELOCITY
from schuler.navigation.engine import gate_thresholds
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.segments import run_in_pieces
from schuler.navigation.stepping import NO_VEHICLE
from schuler.types import FloatArray

# slowest IMU rate used while tuning (Hz)
TUNING_RATE = 20.0
# innovations beyond this many standard deviations count with a Cauchy tail
OUTLYING = 4.0


def slower_imu(imu: ImuRecording, rate: float = TUNING_RATE) -> ImuRecording:
    """Average neighbouring samples so that the rate is just above the given one.

    Means of whole groups: the increments stay exact, only coning within a group is lost, which
    is of no weight beside the noise that is being tuned.
    """
    group = int(imu.rate / rate + 1e-6)
    if group < 2:
        return imu
    count = (imu.size - 1) // group
    stop = count * group + 1
    step = np.diff(imu.time)[: stop - 1, None]
    span = step.reshape(count, group, 1).sum(axis=1)

    def mean(values: FloatArray) -> FloatArray:
        sums = (values[1:stop] * step).reshape(count, group, 3).sum(axis=1)
        return np.concatenate([values[:1], sums / span])

    return replace(
        imu,
        time=imu.time[:stop:group],
        gyro=mean(imu.gyro),
        accel=mean(imu.accel),
        temperature=None,
        history=(*imu.history, f"means of {group} samples"),
    )


def thin(gnss: GnssRecording, interval: float) -> GnssRecording:
    """Keep one epoch in every `interval` seconds."""
    if interval <= 0.0:
        return gnss
    cell = np.floor((gnss.time - gnss.time[0]) / interval + 1e-6)
    return gnss.select(np.concatenate([[True], np.diff(cell) > 0.0]))


@dataclass(frozen=True, slots=True, eq=False)
class InnovationSequence:
    """Scalar innovations (k,), their claimed variances (k,) and, where needed, times (k,)."""

    value: FloatArray
    variance: FloatArray
    time: FloatArray = field(default_factory=lambda: np.empty(0))

    @property
    def log_likelihood(self) -> float:
        """Robust log-likelihood: Gaussian, with a Cauchy tail beyond `OUTLYING`."""
        square = self.value**2 / self.variance
        limit = OUTLYING**2
        tail = limit * (1.0 + np.log(np.maximum(square, limit) / limit))
        cost = np.where(square > limit, tail, square) + np.log(2.0 * np.pi * self.variance)
        return float(-0.5 * cost.sum())

    @property
    def weight(self) -> FloatArray:
        """Derivative of the cost by the normalised square: 1, and less in the tail."""
        square = self.value**2 / self.variance
        return np.minimum(1.0, OUTLYING**2 / np.maximum(square, 1e-300))


def innovations(
    imu: ImuRecording,
    gnss: Sequence[GnssRecording],
    setup: RunSetup,
    level: FloatArray | None = None,
) -> InnovationSequence:
    """Filter a drive once for every thinning of GNSS and gather the innovations of GNSS.

    What is known of a vehicle takes part in the filter, but only GNSS judges.
    """
    initial = setup.initial_state(imu, gnss[0])
    gate = gate_thresholds(0.0)
    scale = None
    if level is not None and setup.vibration.active:
        scale = setup.vibration.white_scale(level)
    scale = setup.condition.noise_scale(imu.time, scale, setup.model.white_density)
    restarts = setup.restarts(gnss[0])
    vehicle = NO_VEHICLE if setup.vehicle is None else setup.vehicle.states
    flat, times = [], []
    for fixes in gnss:
        schedule = setup.schedule(imu, fixes)
        done = run_in_pieces(
            imu,
            initial,
            restarts,
            setup.model,
            schedule,
            gate=gate,
            white_scale=scale,
            vehicle=vehicle,
            keep_samples=False,
            keep_nodes=False,
            node_interval=1e9,
        )
        judges = schedule.kind <= VELOCITY
        scalar = done.aiding.scalar[judges].reshape(-1, 2)
        used = scalar[:, 1] > 0.0
        flat.append(scalar[used])
        times.append(np.repeat(schedule.time[judges], 3)[used])
    both = np.concatenate(flat)
    return InnovationSequence(both[:, 0], both[:, 1], np.concatenate(times))
