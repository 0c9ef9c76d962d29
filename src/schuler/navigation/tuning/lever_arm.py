"""Where the antenna sits, by the likelihood of the innovations, told or not.

An arm that nobody told shows as errors of position that turn with the vehicle: with slow errors
of the receiver beside it the filter takes it for those. The innovations tell them apart. Found
before the noise is tuned, which else would explain it; together with how long errors of GNSS last
and with both time offsets, which an arm looks like as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.innovation_likelihood import slower_imu
from schuler.navigation.preparation.setup import RunSetup, TimeOffsets
from schuler.navigation.tuning.gnss_errors import (
    FEWEST_FIXES,
    SLOW,
    TIME,
    WHITE,
    split_errors,
    split_start,
    with_split,
)
from schuler.navigation.tuning.likelihood import enough_to_tune, find_time_offset
from schuler.navigation.tuning.linear_drive import DriveLikelihood
from schuler.navigation.tuning.scoring import promised_gain
from schuler.navigation.tuning.tune import ARM, ARM_PRIOR_SD, OFFSET_UNIT
from schuler.screening.screen import Finding
from schuler.types import FloatArray

OFFSETS = ("offset position", "offset velocity")
LEAST_GAIN = 15.0
LEAST_CHANGE = 0.3
LEAST_DEVIATIONS = 3.0
"""Gain of log-likelihood, m and standard errors at which an arm that was told is doubted."""
LEAST_SD = 0.05
"""What models leave out looks like so much, m."""
KNOWN = 0.5
"""Standard error in m beyond which a drive does not tell a component."""
PASSES = 3


@dataclass(frozen=True, slots=True, eq=False)
class LeverArm:
    """An antenna as a drive tells it."""

    # arm, sd: (3,) from the IMU, in its axes, and standard errors, m
    arm: FloatArray
    sd: FloatArray
    gain: float  # of the log-likelihood over the arm that was told
    offsets: TimeOffsets  # that go with it

    def differs(self, told: FloatArray) -> bool:
        """Whether it is another than was told."""
        return self.gain > LEAST_GAIN and _another(self.arm, self.sd, told)


def _another(arm: FloatArray, sd: FloatArray, told: FloatArray) -> bool:
    """Whether some component is surely another than was told."""
    change = np.abs(arm - told)
    return bool(np.any(change > np.maximum(LEAST_CHANGE, LEAST_DEVIATIONS * sd)))


def find_lever_arm(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    *,
    asked: bool,
    offsets: bool,
) -> LeverArm | None:
    """Find the arm under which innovations were most likely.

    None where it was not `asked` for and the slope of the likelihood speaks of none. `offsets`:
    whether time offsets are to be found as well.
    """
    split = split_errors(setup)
    if split is None or gnss.size < FEWEST_FIXES:
        return None
    slow = slower_imu(imu).between(-np.inf, enough_to_tune(imu, gnss, setup))
    fit = _Fit(slow, gnss, setup, gnss.velocity is not None, offsets)
    plain = fit.best(setup, arm=False)
    if not asked and fit.promise(plain) < LEAST_GAIN:
        return None
    best, now = None, setup
    for _ in range(PASSES if offsets else 1):
        found = fit.best(now, arm=True)
        if best is None or found.value > best.value + 0.5:
            best = found
        elif best is not None:
            break
        if offsets:
            # the offset that fitted a wrong arm is wrong
            known = fit.at(found.x, now, arm=True)
            shift = find_time_offset(slow, gnss, known)
            moved = TimeOffsets(known.offsets.position + shift, known.offsets.velocity + shift)
            now = replace(setup, offsets=moved, lever_arm=known.lever_arm)
    assert best is not None
    done = best.setup
    sd = np.maximum(best.sd[fit.arm_places], LEAST_SD)
    return LeverArm(done.lever_arm, sd, best.value - plain.value, done.offsets)


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    x: FloatArray
    sd: FloatArray
    value: float
    setup: RunSetup


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Shares and time of slow errors, offsets, and the arm where it is free."""

    imu: ImuRecording
    gnss: GnssRecording
    told: RunSetup
    speed: bool
    offsets: bool

    @property
    def names(self) -> tuple[str, ...]:
        offsets = OFFSETS[: 2 if self.speed else 1] if self.offsets else ()
        return (WHITE, SLOW, TIME, *offsets, *ARM)

    @property
    def arm_places(self) -> slice:
        return slice(len(self.names) - 3, None)

    def at(self, x: FloatArray, base: RunSetup, *, arm: bool) -> RunSetup:
        """The setup at some parameters; the arm in m beside that of `base`."""
        v = dict(zip(self.names, x.tolist(), strict=False))
        moved = TimeOffsets(
            base.offsets.position + OFFSET_UNIT * v.get(OFFSETS[0], 0.0),
            base.offsets.velocity + OFFSET_UNIT * v.get(OFFSETS[1], 0.0),
        )
        place = base.lever_arm + (x[self.arm_places] if arm else 0.0)
        return with_split(replace(base, offsets=moved, lever_arm=place), v)

    def likelihood(self, base: RunSetup, *, arm: bool) -> DriveLikelihood:
        shifts = np.array([n in OFFSETS for n in (self.names if arm else self.names[:-3])])
        return DriveLikelihood(self.imu, [self.gnss], lambda x: self.at(x, base, arm=arm), shifts)

    def best(self, base: RunSetup, *, arm: bool) -> _Found:
        """The likeliest parameters about a setup."""
        names = self.names if arm else self.names[:-3]
        begin, prior, floor = split_start(base, names)
        if arm:
            prior[-3:] = ARM_PRIOR_SD**-2
        found = self.likelihood(base, arm=arm).maximise(begin, prior, floor)
        done = self.at(found.x, base, arm=arm)
        # the prior of the arm is about what was told, wherever the search began
        away = done.lever_arm - self.told.lever_arm
        own = found.x[-3:] if arm else np.zeros(3)
        value = found.log_likelihood + 0.5 * float(own @ own - away @ away) / ARM_PRIOR_SD**2
        return _Found(found.x, found.sd, value, done)

    def promise(self, plain: _Found) -> float:
        """Gain that the slopes promise an arm, at the best without one."""
        x = np.concatenate([plain.x, np.zeros(3)])
        _, prior, _ = split_start(self.told, self.names)
        prior[-3:] = ARM_PRIOR_SD**-2
        return promised_gain(self.likelihood(self.told, arm=True).about(x), x, prior, 3)


def arm_finding(
    arm: FloatArray, covariance: FloatArray, told: FloatArray, *, asked: bool
) -> Finding:
    """What was found of the antenna, in words."""
    sd = np.sqrt(np.diag(covariance))
    place = ", ".join(f"{a:.2f} ± {s:.2f}" for a, s in zip(arm, sd, strict=True))
    given = ", ".join(f"{a:g}" for a in told)
    text = f"the drive puts the antenna at {place} m from the IMU"
    another = _another(arm, sd, told)
    if not asked and another:
        text += f", not at the {given} m that were told; taken as found"
    elif not asked:
        text += f", which may be the {given} m that were told; what that leaves open is claimed"
    unknown = [axis for axis, s in zip("xyz", sd, strict=True) if s > KNOWN]
    cure = "measure it and give it (--lever-arm X,Y,Z)"
    if unknown:
        text += f"; it turns too little to tell {' and '.join(unknown)}"
    return Finding(
        "lever arm",
        "warning" if unknown or (another and not asked) else "info",
        text,
        value=float(np.linalg.norm(arm - told)),
        cure=cure if unknown or not asked else "",
    )
