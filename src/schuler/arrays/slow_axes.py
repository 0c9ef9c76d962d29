"""IMUs that turn slowly against one another, or whose clocks drift, followed on line. S002 (12).

Every block of samples tells by how much each IMU has turned and lags behind the others since the
block before: what its rates differ by, regressed on the rotation that all feel and its change. The
mean of a block is left out, so that biases play no part. What was learnt corrects the samples
after it, so nothing is taken from the future.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.arrays.clocks.resampling import LONGEST_STEP
from schuler.data import ImuArray
from schuler.data.exportable import Exportable
from schuler.data.mounting import Mounting
from schuler.errors import InputError
from schuler.rotations import dcm_from_rotation_vector, rotation_vector_from_dcm, skew
from schuler.types import BoolArray, FloatArray

BLOCK, ROW = 2.0, 0.1
"""Seconds between updates, and seconds of the means from which one is made: vibration, which IMUs
do not share, is gone in them."""
TURN_WALK = float(np.radians(0.03))
"""Of a mounting that moves slowly, rad/sqrt(s): 0.02 deg/s is followed within 0.1 deg."""
DELAY_WALK = 3e-4
"""Of a clock, s/sqrt(s): 300 ppm are followed within a millisecond."""
FIRST_TURN, FIRST_DELAY = float(np.radians(0.1)), 2e-3
"""Standard deviations before anything is known, rad and s; never larger later on. A mounting is
believed until motion tells better: a wrong turn at rest shows gravity in the wrong place, and
lively motion tells turns of many degrees all the same."""
LARGEST_DELAY = 0.25
"""Seconds; more is not a delay but another time."""
MEMORY = 0.1
"""Weight of the latest block in the noise of an IMU."""
FEWEST = 8
"""Rows of a block that tell something."""
KNOWN = 0.5
"""Of the first standard deviation: below this something has been learnt."""
BEFORE = 4
"""Samples between which values are taken."""


@dataclass(frozen=True, slots=True, eq=False)
class SlowAxes(Exportable):
    """How the IMUs of an array turned against one another, and lagged, through time.

    Parameters
    ----------
    names : tuple of str
        Of the IMUs.
    time : (b,) ndarray
        From when on each row holds, s.
    turn : (b, k, 3) ndarray
        Rotation vectors from the axes of each IMU, as the mounting has them, into the body, rad;
        that of most IMUs stays zero.
    turn_sd : (b, k, 3) ndarray
        Standard deviations.
    delay, delay_sd : (b, k) ndarray
        Seconds by which the values of an IMU lag behind its stamps, against most of them.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, SlowAxes, follow_axes
    >>> rng, time = np.random.default_rng(1), np.arange(3_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> gyro = np.repeat(rate, 3, axis=1) + 1e-3 * rng.standard_normal((3_000, 3, 3))
    >>> array = ImuArray(time, gyro, np.ones_like(gyro), Mounting.aligned(3))
    >>> _, found = follow_axes(array)
    >>> isinstance(found, SlowAxes), found.turn.shape[1:]
    (True, (3, 3))
    """

    names: tuple[str, ...]
    time: FloatArray
    turn: FloatArray
    turn_sd: FloatArray
    delay: FloatArray
    delay_sd: FloatArray

    @property
    def lines(self) -> tuple[str, ...]:
        """What each IMU did, in words."""
        lines = []
        for i, name in enumerate(self.names):
            angle = np.degrees(np.linalg.norm(self.turn[:, i], axis=1))
            sd = np.degrees(np.linalg.norm(self.turn_sd[-1, i]))
            text = f"{name}: axes followed, at the end turned by {angle[-1]:.2f} deg (sd {sd:.2f})"
            if np.any(self.delay_sd[-1]):
                late, late_sd = 1e3 * self.delay[-1, i], 1e3 * self.delay_sd[-1, i]
                text += f", {late:+.1f} ms late (sd {late_sd:.1f})"
            lines.append(text)
        return tuple(lines)


class AxesFollower:
    """Follows the axes and clocks of an array's IMUs in a stream.

    Parameters
    ----------
    mounting : Mounting
        Of the IMUs, as they were mounted.
    rate : float
        Samples a second, about.
    clocks : bool
        Whether delays are followed as well; what comes out is then so many samples old that all
        IMUs have been heard of its time.

    Notes
    -----
    Turns about an axis that nothing rotates about are not seen; they stay as they were, with a
    standard deviation that grows. At least three IMUs tell which one has moved: the turn of most
    of them is taken for none. With two, each has moved by half.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import AxesFollower, Mounting
    >>> rng, time = np.random.default_rng(1), np.arange(3_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> gyro = np.repeat(rate, 4, axis=1) + 1e-3 * rng.standard_normal((3_000, 4, 3))
    >>> gyro[:, 3, :2] = gyro[:, 3, 1::-1] * (1, -1) * 0.05 + gyro[:, 3, :2]
    >>> follower = AxesFollower(Mounting.aligned(4), 50.0, clocks=False)
    >>> for k in range(3_000):
    ...     time_k, turned, force = follower.add(time[k], gyro[k], np.zeros((4, 3)))
    >>> round(float(abs(follower.turn[3, 2])), 2)
    0.05
    """

    def __init__(self, mounting: Mounting, rate: float, *, clocks: bool = True) -> None:
        if not rate > 0.0:
            raise InputError(f"a rate of {rate} Hz", expected="a positive number")
        k = mounting.count
        self.turn, self.delay = np.zeros((k, 3)), np.zeros(k)
        first = [FIRST_TURN**2] * 3 + [FIRST_DELAY**2 if clocks else 0.0]
        self._most = np.array(first)
        self._covariance = np.tile(np.diag(self._most), (k, 1, 1))
        self._walk = np.array([TURN_WALK**2] * 3 + [DELAY_WALK**2 if clocks else 0.0])
        self._mounted, self._clocks, self._rate = mounting.rotation, clocks, rate
        self._noise = np.full(k, np.nan)
        self._matrix = np.tile(np.eye(3), (k, 1, 1))
        self.block = max(round(BLOCK * rate), 2 * FEWEST)
        # samples that came, the first of which nobody has been given, and what was given
        back = int((LARGEST_DELAY if clocks else 0.0) * rate) + BEFORE
        self._keep, self._came, self._next = back, 0, 0
        self._time, self._sample = np.zeros(4 * back), np.zeros((4 * back, 2, k, 3))
        self._given, self._given_time = np.zeros((self.block, k, 3)), np.zeros(self.block)
        self._count = 0

    @property
    def turn_sd(self) -> FloatArray:
        """Standard deviations of the turns, (k, 3) rad."""
        return np.asarray(np.sqrt(np.diagonal(self._covariance, axis1=1, axis2=2)[:, :3]))

    @property
    def delay_sd(self) -> FloatArray:
        """Standard deviations of the delays, (k,) s."""
        return np.asarray(np.sqrt(np.maximum(self._covariance[:, 3, 3], 0.0)))

    def begin(self, turn: FloatArray, delay: FloatArray) -> None:
        """Start from turns (k, 3) and delays (k,) that are known from elsewhere."""
        self.turn, self.delay = turn.copy(), delay.copy()
        self._turn_back()

    def _turn_back(self) -> None:
        """Write how samples are turned from now on."""
        mounted = self._mounted
        self._matrix = np.swapaxes(mounted, 1, 2) @ dcm_from_rotation_vector(self.turn) @ mounted

    def learn(self, time: FloatArray, gyro: FloatArray) -> None:
        """Learn from a block that was corrected by what was known: stamps (n,), rates (n, k, 3)."""
        body = np.einsum("kij,nkj->nki", self._mounted, gyro)
        step = float(time[-1] - time[0]) / max(len(time) - 1, 1)
        count = max(round(ROW / step), 1) if step > 0.0 else 1
        rows = len(time) // count
        self._covariance += np.diag(self._walk * step * len(time))
        if rows >= FEWEST:
            self._update(body[: rows * count].reshape(rows, count, *body.shape[1:]), step)
        own = np.diagonal(self._covariance, axis1=1, axis2=2)
        # what nobody has seen for long is not less known than at first
        shrink = np.sqrt(np.minimum(self._most / np.maximum(own, 1e-300), 1.0))
        self._covariance *= shrink[:, :, None] * shrink[:, None, :]
        self._turn_back()

    def _update(self, body: FloatArray, step: float) -> None:
        """Kalman: each IMU against the middle of all, rows (r, samples, k, 3) in the body."""
        means = body.mean(axis=1)
        there = np.isfinite(means).all(axis=2)
        good = there.sum(axis=1) > 1
        if np.count_nonzero(good) < FEWEST:
            return
        # one that is stuck or broken does not move the middle of three or more
        middle = np.zeros(means[:, 0].shape)
        middle[good] = np.nanmedian(np.where(there[..., None], means, np.nan)[good], axis=1)
        slope = np.gradient(middle, body.shape[1] * step, axis=0)
        design = np.concatenate([skew(middle), -slope[:, :, None]], axis=2)
        seen = np.zeros(len(self.delay), bool)
        for i in range(len(self.delay)):
            rows = there[:, i] & good
            seen[i] = np.count_nonzero(rows) >= FEWEST
            if seen[i]:
                self._of_one(i, design[rows], means[rows, i] - middle[rows])
        if seen.any():
            self._gauge(seen)

    def _of_one(self, i: int, design: FloatArray, off: FloatArray) -> None:
        a = (design - design.mean(axis=0)).reshape(-1, 4)
        r = (off - off.mean(axis=0)).ravel()
        a[:, 3] *= self._clocks
        own = self._covariance[i]
        left = r - a @ np.linalg.lstsq(a, r, rcond=None)[0]
        now = max(float(left @ left) / (len(r) - 7), 1e-20)
        # a fault in the middle of a block makes all of it worth little
        noise = np.nanmax([now, self._noise[i]])
        before = self._noise[i] if np.isfinite(self._noise[i]) else now
        self._noise[i] = before + MEMORY * (min(now, 4.0 * before) - before)
        information = a.T @ a / noise
        gain = np.linalg.solve(np.eye(4) + own @ information, own)
        change = gain @ (a.T @ r) / noise
        self._covariance[i] = 0.5 * (gain + gain.T)
        turned = dcm_from_rotation_vector(change[:3]) @ dcm_from_rotation_vector(self.turn[i])
        self.turn[i] = rotation_vector_from_dcm(turned)
        self.delay[i] += change[3]

    def _gauge(self, seen: BoolArray) -> None:
        """Most IMUs have not moved."""
        self.turn[seen] -= np.median(self.turn[seen], axis=0)
        self.delay[seen] -= np.median(self.delay[seen])
        np.clip(self.delay, -LARGEST_DELAY, LARGEST_DELAY, out=self.delay)

    def add(
        self, time: float, gyro: ArrayLike, accel: ArrayLike
    ) -> tuple[float, FloatArray, FloatArray] | None:
        """Take one sample of all IMUs; return one that is in common axes, and of one time.

        Parameters
        ----------
        time : float
            Seconds; later than the sample before.
        gyro, accel : (k, 3) array_like
            In the axes of each IMU, rad/s and m/s²; NaN where an IMU is silent.

        Returns
        -------
        tuple of float, ndarray, ndarray, or None
            For `ArrayFilter.add_array`; None while IMUs that lag have not been heard.
        """
        rates, forces = np.asarray(gyro, np.float64), np.asarray(accel, np.float64)
        if not rates.shape == forces.shape == self.turn.shape:
            raise InputError(
                f"a sample of shape {np.shape(gyro)} and {np.shape(accel)}",
                expected=f"numbers of shape {self.turn.shape}, twice",
            )
        if self._came == len(self._time):
            self._move_up()
        row, self._came = self._came, self._came + 1
        self._time[row], self._sample[row, 0], self._sample[row, 1] = time, rates, forces
        now = float(self._time[self._next])
        if self._clocks and time < now + float(self.delay.max()) + (BEFORE - 1.5) / self._rate:
            return None
        held = slice(max(self._next - self._keep, 0), self._came)
        if not self._clocks:
            held = slice(row, row + 1)
        at = self._time[self._next : self._next + 1]
        gyro_now, accel_now = self.corrected(self._time[held], self._sample[held], at)[0]
        self._next += 1
        self._given_time[self._count], self._given[self._count] = now, gyro_now
        self._count += 1
        if self._count == self.block:
            self._count = 0
            self.learn(self._given_time, self._given)
        return now, gyro_now, accel_now

    def _move_up(self) -> None:
        """Forget what is too old to be asked for."""
        first = min(max(self._next - self._keep, 1), self._came)
        for rows in (self._time, self._sample):
            rows[: self._came - first] = rows[first : self._came].copy()
        self._came, self._next = self._came - first, self._next - first

    def corrected(self, time: FloatArray, samples: FloatArray, at: FloatArray) -> FloatArray:
        """Return samples (n, 2, k, 3) as they would be at some times (m,) with common axes."""
        if self._clocks:
            samples = _between(time, samples, at[:, None] + self.delay, 1.0 / self._rate)
        elif len(at) != len(time):
            samples = samples[np.searchsorted(time, at)]
        return np.asarray(np.einsum("kij,nckj->ncki", self._matrix, samples))


def _between(time: FloatArray, values: FloatArray, at: FloatArray, step: float) -> FloatArray:
    """Values (n, 2, k, 3) at times (m, k), by cubics; straight across gaps, NaN outside."""
    n, imus = len(time), np.arange(values.shape[2])
    if n < BEFORE:
        return np.full((len(at), *values.shape[1:]), np.nan)
    right = np.clip(np.searchsorted(time, at - 1e-9), 1, n - 1)
    rows = np.clip(right - 2, 0, n - 4)[..., None] + np.arange(4)
    stamps = time[rows]
    off, apart = at[..., None] - stamps, stamps[..., :, None] - stamps[..., None, :]
    weight = np.empty_like(off)
    for a, (b, c, d) in enumerate(((1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2))):
        weight[..., a] = off[..., b] * off[..., c] * off[..., d]
        weight[..., a] /= apart[..., a, b] * apart[..., a, c] * apart[..., a, d]
    gap = stamps[..., 3] - stamps[..., 0] > 3.0 * LONGEST_STEP * step
    if gap.any():
        left = (rows == right[..., None] - 1)[gap]
        part = ((at - time[right - 1]) / (time[right] - time[right - 1]))[gap][:, None]
        weight[gap] = np.where(left, 1.0 - part, np.where(np.roll(left, 1, axis=1), part, 0.0))
    out = np.einsum("mka,mkacx->mckx", weight, values[rows, :, imus[None, :, None]])
    outside = (at < time[0] - 1e-9) | (at > time[-1] + 1e-9)
    if outside.any():
        np.moveaxis(out, 1, 2)[outside] = np.nan
    return np.asarray(out)


def follow_axes(array: ImuArray, *, clocks: bool = True) -> tuple[ImuArray, SlowAxes]:
    """Bring an array whose IMUs turn slowly, or whose clocks drift, to common axes and one time.

    Parameters
    ----------
    array : ImuArray
        At least two IMUs; the mounting need be right to some degrees at the beginning only.
    clocks : bool
        Whether delays are followed as well.

    Returns
    -------
    array : ImuArray
        In the axes that the mounting says. Every sample is corrected by what was known before it,
        the beginning by what the first lively motion told.
    found : SlowAxes
        What was found through time.

    Raises
    ------
    InputError
        One IMU only.

    Notes
    -----
    S002 (12), in rotation vectors: small rotations must not be added to Euler angles. See
    `AxesFollower` for the same sample by sample.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, follow_axes
    >>> rng, time = np.random.default_rng(1), np.arange(6_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> gyro = np.repeat(rate, 4, axis=1) + 1e-3 * rng.standard_normal((6_000, 4, 3))
    >>> angle = 1e-3 * time
    >>> gyro[:, 3, 0] += angle * gyro[:, 3, 1]
    >>> gyro[:, 3, 1] -= angle * gyro[:, 3, 0]
    >>> array = ImuArray(time, gyro, np.ones_like(gyro), Mounting.aligned(4))
    >>> followed, found = follow_axes(array, clocks=False)
    >>> round(float(found.turn[-1, 3, 2]), 2)
    0.12
    """
    if array.count < 2:
        raise InputError("one IMU: there are no others to follow its axes by", expected="two")
    samples = np.stack([array.gyro, array.accel], axis=1)
    follower = AxesFollower(array.mounting, array.rate, clocks=clocks)
    out, found = _followed(array, samples, follower)
    # what lively motion tells first was so before: the beginning is done once more
    known = (found.turn_sd.max(axis=(1, 2)) < KNOWN * FIRST_TURN) & (
        found.delay_sd.max(axis=1) < KNOWN * FIRST_DELAY
    )
    if known.any():
        again = AxesFollower(array.mounting, array.rate, clocks=clocks)
        first = int(np.argmax(known))
        again.begin(found.turn[first], found.delay[first])
        out, found = _followed(array, samples, again)
    moved = replace(array, gyro=out[:, 0], accel=out[:, 1], history=(*array.history, *found.lines))
    return moved, found


def _followed(
    array: ImuArray, samples: FloatArray, follower: AxesFollower
) -> tuple[FloatArray, SlowAxes]:
    """Feed samples (n, 2, k, 3) to a follower, block by block."""
    out, block = np.empty_like(samples), follower.block
    states = []
    for start in range(0, array.size, block):
        rows = slice(start, min(start + block, array.size))
        out[rows] = follower.corrected(array.time, samples, array.time[rows])
        states.append(
            (follower.turn.copy(), follower.turn_sd, follower.delay.copy(), follower.delay_sd)
        )
        if rows.stop - start == block:
            follower.learn(array.time[rows], out[rows, 0])
    turn, turn_sd, delay, delay_sd = (np.array(v) for v in zip(*states, strict=True))
    return out, SlowAxes(array.names, array.time[::block], turn, turn_sd, delay, delay_sd)
