"""What several IMUs on one body recorded at the same stamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data._checks import check_time, frozen, median_step
from schuler.data.exportable import Exportable
from schuler.data.imu import ImuRecording
from schuler.data.mounting import Mounting, chosen_imus
from schuler.errors import InputError
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ImuArray(Exportable):
    """Angular rates and specific forces of k IMUs on one body, at the same stamps.

    Every IMU speaks in its own axes; `mounting` takes them to the body. A value that is missing
    (a lost sample, a sensor that fell silent, a saturated count that was masked) is NaN. A column
    of NaN throughout is a channel that was not recorded.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds, strictly increasing, common to all.
    gyro : (n, k, 3) ndarray
        Angular rate of each IMU in its own axes, rad/s.
    accel : (n, k, 3) ndarray
        Specific force of each IMU in its own axes, m/s².
    mounting : Mounting
        Of the k IMUs.
    names : tuple of str
        Of the IMUs; "imu 1", "imu 2", ... if empty.
    history : tuple of str
        What was done to the data since the files, oldest first.
    assumptions : tuple of str
        What was taken for granted on reading the IMUs.

    Raises
    ------
    InputError
        Wrong shapes, fewer than two samples, time not increasing, infinite values, two IMUs of
        the same name, or an IMU without any value.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting
    >>> still = np.tile((0.0, 0.0, -9.81), (200, 2, 1))
    >>> two = Mounting(np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3)))
    >>> array = ImuArray(np.arange(200) / 100.0, np.zeros((200, 2, 3)), still, two)
    >>> array.gyro.shape
    (200, 2, 3)
    """

    time: FloatArray
    gyro: FloatArray
    accel: FloatArray
    mounting: Mounting
    names: tuple[str, ...] = ()
    history: tuple[str, ...] = field(default=())
    assumptions: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        time = frozen(self.time, "IMU array time", (None,))
        n, k = time.size, self.mounting.count
        if n < 2:
            raise InputError(
                f"IMU array has {n} sample{'' if n == 1 else 's'}",
                expected="at least 2",
                cure="check that the files are complete",
            )
        check_time(time, "IMU array")
        gyro = frozen(self.gyro, "gyro of the array", (n, k, 3))
        accel = frozen(self.accel, "accel of the array", (n, k, 3))
        names = tuple(self.names) or tuple(f"imu {i + 1}" for i in range(k))
        if len(names) != k or len(set(names)) != k:
            raise InputError(
                f"{len(names)} names ({', '.join(names)}) for {k} IMUs",
                expected="a different name for each",
            )
        for array, sensor in ((gyro, "gyro"), (accel, "accel")):
            infinite = np.isinf(array)
            if infinite.any():
                row, imu, axis = (int(x[0]) for x in np.nonzero(infinite))
                raise InputError(
                    f"{sensor}_{'xyz'[axis]} of {names[imu]} is infinite at row {row}",
                    expected="finite numbers, or NaN where a value is missing",
                )
        for i in range(k):
            if np.isnan(gyro[:, i]).all() and np.isnan(accel[:, i]).all():
                raise InputError(
                    f"{names[i]} has no value at all",
                    expected="IMUs that recorded something",
                    cure="leave it out of the array",
                )
        for attribute, value in (("time", time), ("gyro", gyro), ("accel", accel)):
            object.__setattr__(self, attribute, value)
        object.__setattr__(self, "names", names)

    @classmethod
    def from_recordings(
        cls,
        recordings: Sequence[ImuRecording],
        mounting: Mounting | None = None,
        *,
        tolerance: float | None = None,
    ) -> ImuArray:
        """Return the array of recordings that share one clock.

        Rows of the same stamp are put side by side; where a recording lacks a row that another
        has, its values are missing.

        Parameters
        ----------
        recordings : sequence of ImuRecording
            In their own axes.
        mounting : Mounting, optional
            Of the IMUs, in the same order; all aligned with the body, at its origin, if not given.
        tolerance : float, optional
            Stamps that differ by less are the same, s; a hundredth of the sampling interval if not
            given.

        Returns
        -------
        ImuArray
            At all stamps that any recording has.

        Raises
        ------
        InputError
            No recording, a mounting of another number of IMUs, or stamps that fall between one
            another, as clocks that run apart give them.
        """
        if not recordings:
            raise InputError("an array of no recording", expected="at least one")
        k = len(recordings)
        mounting = Mounting.aligned(k) if mounting is None else mounting
        if mounting.count != k:
            raise InputError(
                f"{k} recordings and mountings of {mounting.count} IMUs", expected="as many of each"
            )
        step = float(np.median(np.concatenate([np.diff(r.time) for r in recordings])))
        time = _common_stamps(recordings, 0.01 * step if tolerance is None else tolerance, step)
        gyro = np.full((time.size, k, 3), np.nan)
        accel = np.full((time.size, k, 3), np.nan)
        for i, recording in enumerate(recordings):
            # stamps are apart by more than the tolerance, so the nearest one is the one
            rows = np.searchsorted(0.5 * (time[1:] + time[:-1]), recording.time)
            gyro[rows, i], accel[rows, i] = recording.gyro, recording.accel
        names = [r.name for r in recordings]
        if len(set(names)) < k:
            names = [f"{name} {i + 1}" for i, name in enumerate(names)]
        lines = [
            f"{name}: {line}"
            for name, recording in zip(names, recordings, strict=True)
            for line in recording.history
        ]
        assumed = dict.fromkeys(line for r in recordings for line in r.assumptions)
        return cls(time, gyro, accel, mounting, tuple(names), tuple(lines), tuple(assumed))

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def count(self) -> int:
        """Number of IMUs."""
        return self.mounting.count

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.time[-1] - self.time[0])

    @property
    def rate(self) -> float:
        """Samples a second: the inverse of the median step."""
        return 1.0 / median_step(self.time)

    @property
    def missing(self) -> FloatArray:
        """Share of the samples that are missing, (k, 6) by IMU and channel of `CHANNELS`."""
        gaps = [np.isnan(values).mean(axis=0) for values in (self.gyro, self.accel)]
        return np.concatenate(gaps, axis=1)

    def to_columns(self) -> dict[str, FloatArray]:
        """Return named columns that `read_array` understands: imu1_gyro_x_rad_s and so on.

        Returns
        -------
        dict of str to (n,) ndarray
            Units are in the names.
        """
        columns = {"time_s": self.time}
        for i in range(self.count):
            for sensor, unit, values in (
                ("gyro", "rad_s", self.gyro), ("accel", "m_s2", self.accel)
            ):  # fmt: skip
                columns |= {
                    f"imu{i + 1}_{sensor}_{axis}_{unit}": values[:, i, k]
                    for k, axis in enumerate("xyz")
                }
        return columns

    def imu(self, index: int) -> ImuRecording:
        """Return what one IMU recorded, in its own axes.

        Parameters
        ----------
        index : int
            Counted from zero.

        Returns
        -------
        ImuRecording
            Rows at which any of its recorded channels is missing are left out.

        Raises
        ------
        InputError
            There is no such IMU, or fewer than two of its rows are whole.
        """
        if not -self.count <= index < self.count:
            raise InputError(
                f"IMU {index} of an array", expected=f"a number from 0 to {self.count - 1}"
            )
        values = np.hstack([self.gyro[:, index], self.accel[:, index]])
        gaps = np.isnan(values)
        recorded = np.logical_not(gaps.all(axis=0))
        whole = np.logical_not(gaps[:, recorded].any(axis=1))
        name, dropped = self.names[index], int(np.count_nonzero(~whole))
        if self.size - dropped < 2:
            raise InputError(
                f"{name} has {self.size - dropped} rows in which all of its channels are there",
                expected="at least 2",
            )
        history = self.history if not dropped else (*self.history, f"{dropped} rows missing")
        return ImuRecording(
            self.time[whole], values[whole, :3], values[whole, 3:], name=name, history=history
        )

    def recordings(self) -> tuple[ImuRecording, ...]:
        """Return what each IMU recorded, in its own axes, without the rows that it lacks."""
        return tuple(self.imu(i) for i in range(self.count))

    def in_body(self) -> ImuArray:
        """Return the array with all vectors in the axes of the body.

        Returns
        -------
        ImuArray
            Its mounting turns nothing any more; positions stay. A vector that lacks a component
            is missing as a whole unless its axes are those of the body already.
        """
        turned = [
            np.stack([v[:, i] @ c.T for i, c in enumerate(self.mounting.rotation)], axis=1)
            if not np.array_equal(self.mounting.rotation, np.tile(np.eye(3), (self.count, 1, 1)))
            else v
            for v in (self.gyro, self.accel)
        ]
        mounting = Mounting(np.tile(np.eye(3), (self.count, 1, 1)), self.mounting.position)
        history = (*self.history, "turned into the axes of the body")
        return replace(self, gyro=turned[0], accel=turned[1], mounting=mounting, history=history)

    def select(self, imus: ArrayLike) -> ImuArray:
        """Return some of the IMUs.

        Parameters
        ----------
        imus : (m,) array_like of int or bool
            Which, counted from zero, or a mask.

        Returns
        -------
        ImuArray
            In the order asked for.

        Raises
        ------
        InputError
            There is no such IMU, or none is left.
        """
        chosen = chosen_imus(imus, self.count)
        names = tuple(self.names[i] for i in chosen)
        return replace(
            self,
            gyro=self.gyro[:, chosen],
            accel=self.accel[:, chosen],
            mounting=self.mounting.select(chosen),
            names=names,
            history=(*self.history, f"only {', '.join(names)}"),
        )

    def between(self, start: float, stop: float) -> ImuArray:
        """Return the samples with start <= time < stop.

        Parameters
        ----------
        start, stop : float
            Seconds on the array's own time axis.

        Returns
        -------
        ImuArray
            The part, with a line of history.
        """
        a, b = np.searchsorted(self.time, [start, stop], side="left")
        return replace(
            self,
            time=self.time[a:b],
            gyro=self.gyro[a:b],
            accel=self.accel[a:b],
            history=(*self.history, f"cut to {start:.3f} .. {stop:.3f} s"),
        )


def _common_stamps(recordings: Sequence[ImuRecording], tolerance: float, step: float) -> FloatArray:
    """Stamps of all recordings, those within the tolerance made one."""
    stamps = [r.time for r in recordings]
    if all(s.size == stamps[0].size and np.array_equal(s, stamps[0]) for s in stamps):
        return stamps[0]
    merged = np.unique(np.concatenate(stamps))
    time: FloatArray = merged[np.concatenate([[True], np.diff(merged) > tolerance])]
    gap = np.diff(time)
    # a stamp of another recording inside an interval that this one sampled: clocks apart
    for recording in recordings:
        own = np.searchsorted(0.5 * (time[1:] + time[:-1]), recording.time)
        if np.unique(own).size < own.size:
            raise InputError(
                f"recording '{recording.name}' has stamps closer than the tolerance of "
                f"{tolerance:.3g} s",
                expected="stamps further apart",
                cure="give a smaller tolerance",
            )
    close = gap < 0.5 * step
    if np.count_nonzero(close) > 0.01 * time.size:
        k = int(np.argmax(close))
        raise InputError(
            f"the recordings' stamps fall between one another (at {time[k]:.6f} s and "
            f"{time[k + 1]:.6f} s, {1e3 * gap[k]:.3g} ms apart, the first of {close.sum()})",
            expected=f"stamps of one clock, equal within {1e3 * tolerance:.3g} ms",
            cure="bring the clocks together and resample first",
        )
    return time
