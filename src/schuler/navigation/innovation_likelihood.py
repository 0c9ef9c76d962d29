"""How likely innovations are, and recordings thinned for the filters that are judged by it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.engine import FilterRun
from schuler.types import BoolArray, FloatArray, IntArray

# slowest IMU rate used while tuning (Hz)
TUNING_RATE = 20.0
# innovations beyond this many standard deviations count with a Cauchy tail
OUTLYING = 4.0
RUN = 3 * 2**40
"""More than measurements of a filter have keys."""


@dataclass(frozen=True, slots=True, eq=False)
class InnovationSequence:
    """Scalar innovations (k,), their claimed variances (k,) and, where needed, times (k,).

    `key` (k,) names the measurement of each, and by multiples of `RUN` the filter that met it, so
    that those of other parameters can be compared: a time offset changes the order in which
    measurements come.
    """

    value: FloatArray
    variance: FloatArray
    time: FloatArray = field(default_factory=lambda: np.empty(0))
    key: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @classmethod
    def of_run(
        cls,
        run: FilterRun,
        time: FloatArray | None = None,
        judges: IntArray | None = None,
        key: IntArray | None = None,
    ) -> InnovationSequence:
        """Gather what a run left behind, of some of its measurements, whose keys are given."""
        pairs = run.aiding.scalar if judges is None else run.aiding.scalar[judges]
        found, used = cls.of_scalars(pairs), pairs[..., 1] > 0.0
        if time is not None:
            stamps = np.repeat((time if judges is None else time[judges])[:, None], 3, axis=1)
            found = replace(found, time=stamps[used])
        if key is not None:
            found = replace(found, key=(3 * key[:, None] + np.arange(3))[used])
        return found

    @classmethod
    def of_scalars(cls, pairs: FloatArray) -> InnovationSequence:
        """Gather innovations and variances (u, 3, 2); a variance of zero was not used."""
        scalar = pairs.reshape(-1, 2)
        used = scalar[:, 1] > 0.0
        return cls(scalar[used, 0], scalar[used, 1])

    def select(self, kept: BoolArray | IntArray) -> InnovationSequence:
        """Keep some."""
        return InnovationSequence(
            self.value[kept], self.variance[kept], self.time[kept], self.key[kept]
        )

    @property
    def order(self) -> IntArray:
        """In which the measurements came, filter by filter."""
        return np.lexsort((self.time, self.key // RUN))

    @property
    def misfit(self) -> float:
        """Mean square of the normalised innovations, outliers clipped; 1 where there are none."""
        square = np.minimum(self.value**2 / self.variance, OUTLYING**2)
        return float(np.mean(square)) if square.size else 1.0

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
