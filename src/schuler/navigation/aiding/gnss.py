"""What GNSS says about position and velocity, on the time axis of the IMU."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.schedule import (
    POSITION,
    VELOCITY,
    AidingSchedule,
    schedule_rows,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray, IntArray

NEAREST_POLE = np.radians(89.99)
"""Latitude beyond which the axes north, east, down turn too fast for a run over them."""
LEAST_POSITION_SD, LEAST_VELOCITY_SD = 1e-4, 1e-5
"""Standard deviations in m and m/s that no receiver reaches: less is a slip of units or a word
for "not known", and would be believed to the last bit."""
LEAST_WHITE = 0.02
"""Share of a receiver's variance that is white noise at least."""
SLOW_SHAPE = np.array([1.0, 1.0, 1.5])
"""Slow errors of a receiver north, east and down, by the horizontal ones."""
APART, FEWEST_CLAIMED, MOST_LEVELS = 3.0, 10, 3
"""Claims so many times larger, with nothing between, are of another solution (fixed, float)."""


@dataclass(frozen=True, slots=True)
class CorrelatedGnss:
    """Errors of GNSS positions that last: multipath, orbits, ambiguities held a little wrong.

    Parameters
    ----------
    sigma : float
        Horizontal standard deviation of the slow part, m; the vertical is 1.5 times it.
    correlation_time : float
        Seconds.
    place : int
        Of the first of its three states (north, east, down); -1: not placed.

    Notes
    -----
    A receiver's own deviation is taken as that of both parts together: what is left for the white
    part is its square less that of the slow part, and at least 2 % of it.

    Examples
    --------
    >>> from schuler import CorrelatedGnss
    >>> CorrelatedGnss(sigma=1.5, correlation_time=60.0).sigma
    1.5
    """

    sigma: float
    correlation_time: float
    place: int = -1

    def to_dict(self) -> dict[str, Any]:
        """Return a line for people and plain values for JSON."""
        return {
            "gnss_errors": f"{self.sigma:g} m last about {self.correlation_time:.0f} s (given)",
            "gnss_correlation_time_s": self.correlation_time,
        }

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, CorrelatedGnss]:
        """Return the model with the three states, and this with their place.

        Raises
        ------
        InputError
            Numbers that are not positive.
        """
        if not (self.sigma > 0.0 and self.correlation_time > 0.0):
            raise InputError(
                f"slow errors of {self.sigma:g} m over {self.correlation_time:g} s",
                expected="two positive numbers",
            )
        wider = model.with_states(
            [f"GNSS error {d}" for d in ("north", "east", "down")],
            self.sigma * SLOW_SHAPE,
            correlation_time=self.correlation_time,
        )
        return wider, replace(self, place=model.size)

    def applied(self, schedule: AidingSchedule, claimed: FloatArray) -> AidingSchedule:
        """Return positions whose slow part is a state and whose noise is the rest."""
        slow = (self.sigma * SLOW_SHAPE) ** 2
        white = np.maximum(schedule.variance - slow, LEAST_WHITE * schedule.variance)
        offset = np.tile(self.place + np.arange(3), (schedule.size, 1))
        return replace(schedule, variance=white, offset_state=offset)


@dataclass(frozen=True, slots=True)
class GnssErrorModel:
    """Errors of GNSS positions, split into what is white and what lasts, as shares of the claim.

    What a receiver claims is split: states of unit variance are seen with the slow share of it;
    the rest is white noise. The sum is the receiver's word unless the drive speaks against it.
    Claims of another level (fixed, float) are of another solution, whose errors are its own.

    Parameters
    ----------
    white, slow : float
        Shares of the claimed variance.
    correlation_time : float
        Of the slow part, s.
    fit : bool
        Whether the innovations of the drive decide on shares and time; they start at these.
    place : int
        Of the first of its states (north, east, down of every level); -1: not placed.
    told : bool
        Whether the drive has told more of the slow part than was supposed.
    bounds : tuple of float
        Claims between the levels, m; each level has three states.

    Examples
    --------
    >>> from schuler import GnssErrorModel
    >>> GnssErrorModel(white=0.2, slow=0.8, correlation_time=30.0).fit
    True
    """

    white: float = 0.36
    slow: float = 0.64
    correlation_time: float = 60.0
    fit: bool = True
    place: int = -1
    told: bool = False
    bounds: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not (self.white > 0.0 and self.slow >= 0.0 and self.correlation_time > 0.0):
            raise InputError(
                f"shares of {self.white:g} and {self.slow:g} over {self.correlation_time:g} s",
                expected="a positive white share and correlation time, a slow share of 0 or more",
            )

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, GnssErrorModel]:
        """Return the model with the states, and this with their place."""
        levels = ["of its claim", "of its second claim", "of its third claim"]
        levels = levels[: len(self.bounds) + 1]
        names = [f"GNSS error {d}, {level}" for level in levels for d in ("north", "east", "down")]
        wider = model.with_states(names, 1.0, correlation_time=self.correlation_time)
        return wider, replace(self, place=model.size)

    def to_dict(self) -> dict[str, Any]:
        """Return a line for people and plain values for JSON."""
        white, slow = (100.0 * float(np.sqrt(s)) for s in (self.white, self.slow))
        why = "told by the drive" if self.told else "this drive does not tell"
        return {
            "gnss_errors": f"{white:.0f} % of the claimed sd is white, {slow:.0f} % lasts about "
            f"{self.correlation_time:.0f} s ({why if self.fit else 'given'})",
            "gnss_white_share": self.white,
            "gnss_lasting_share": self.slow,
            "gnss_correlation_time_s": self.correlation_time,
        }

    def in_model(self, model: SensorErrorModel) -> SensorErrorModel:
        """Return a model in which its states are with another correlation time of theirs."""
        drift, diffusion = model.drift.copy(), model.diffusion.copy()
        own = self.places
        drift[own, 0] = -1.0 / self.correlation_time
        diffusion[own, 0] = 2.0 / self.correlation_time
        return replace(model, drift=drift, diffusion=diffusion)

    @property
    def places(self) -> IntArray:
        """All of its states."""
        return np.arange(self.place, self.place + 3 * (len(self.bounds) + 1))

    def levelled(self, gnss: GnssRecording) -> GnssErrorModel:
        """Return it with the levels of what a receiver claims; one where they do not lie apart."""
        assert gnss.position_sd is not None
        claimed = gnss.position_sd[:, :2].max(axis=1)
        order = np.sort(claimed[np.isfinite(claimed)])
        edges = np.flatnonzero(order[1:] > APART * order[:-1]) + 1
        counts = np.diff(np.concatenate([[0], edges, [order.size]]))
        bounds = np.sqrt(order[edges] * order[edges - 1])
        few = counts.min(initial=order.size) < FEWEST_CLAIMED or edges.size >= MOST_LEVELS
        turns = np.count_nonzero(np.diff(np.searchsorted(bounds, claimed)))
        if few or turns > order.size / FEWEST_CLAIMED:
            return self
        return replace(self, bounds=tuple(bounds.tolist()))

    def states(self, claimed: FloatArray) -> IntArray:
        """Return the states (n, 3) in which positions with such claimed variances are seen."""
        level = np.searchsorted(np.square(self.bounds), claimed[:, :2].max(axis=1))
        return np.asarray(self.place + 3 * level[:, None] + np.arange(3))

    def applied(self, schedule: AidingSchedule, claimed: FloatArray) -> AidingSchedule:
        """Return positions whose slow part is a state and whose noise is the white share."""
        return replace(
            schedule,
            variance=self.white * schedule.variance,
            offset_state=self.states(claimed),
            offset_scale=np.sqrt(self.slow * schedule.variance),
        )


@dataclass(frozen=True, slots=True, eq=False)
class GnssPosition:
    """Positions of a GNSS antenna."""

    recording: GnssRecording  # with known standard deviations
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)  # (3,): antenna from IMU in the body frame, m
    time_offset: float = 0.0  # added to GNSS time to get the time on the IMU's axis, s
    sd_factor: float = 1.0  # multiplies the receiver's own standard deviations
    slow: CorrelatedGnss | GnssErrorModel | None = None  # errors that last, whose states are placed

    def rows(self) -> AidingSchedule:
        """Return one row an epoch."""
        sd = _known(self.recording.position_sd, self.recording, "position")
        rows = schedule_rows(
            self.recording.time + self.time_offset,
            POSITION,
            self.recording.position,
            (sd * self.sd_factor) ** 2,
            lever_arm=_arm(self.lever_arm),
        )
        return rows if self.slow is None else self.slow.applied(rows, sd**2)


@dataclass(frozen=True, slots=True, eq=False)
class GnssVelocity:
    """Velocities of a GNSS antenna, north, east, down. Parameters as `GnssPosition`."""

    recording: GnssRecording
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    time_offset: float = 0.0
    sd_factor: float = 1.0

    def rows(self) -> AidingSchedule:
        """Return one row an epoch, none if the receiver gave no velocity."""
        arm, velocity = _arm(self.lever_arm), self.recording.velocity
        if velocity is None:
            return schedule_rows(np.empty(0), VELOCITY, np.empty((0, 3)), np.empty((0, 3)))
        sd = _known(self.recording.velocity_sd, self.recording, "velocity")
        time = self.recording.time + self.time_offset
        return schedule_rows(time, VELOCITY, velocity, (sd * self.sd_factor) ** 2, lever_arm=arm)


def require_possible(gnss: GnssRecording) -> None:
    """Refuse fixes at a pole, and deviations that no receiver reaches."""
    nearest = float(np.abs(gnss.position[:, 0]).max())
    if nearest > NEAREST_POLE:
        raise InputError(
            f"GNSS comes within {np.degrees(0.5 * np.pi - nearest) * 111_700.0:.0f} m of a pole, "
            "where north and east do not exist",
            expected=f"latitudes within +-{np.degrees(NEAREST_POLE):.2f} deg",
            where=gnss.name,
        )
    for sd, least, what, unit in (
        (gnss.position_sd, LEAST_POSITION_SD, "position", "m"),
        (gnss.velocity_sd, LEAST_VELOCITY_SD, "velocity", "m/s"),
    ):
        low = np.zeros(0) if sd is None else sd[sd < least]
        if low.size:
            raise InputError(
                f"GNSS {what} standard deviations down to {low.min():.1e} {unit}: no receiver is "
                "that sure, and the filter would believe it",
                expected=f"{least:g} {unit} or more",
                cure=f"check their unit, or give one for all with --gnss-{what}-sd",
                where=gnss.name,
            )


def require_overlap(gnss: GnssRecording, start: float, stop: float) -> None:
    """Raise when no GNSS epoch falls inside the time of the IMU."""
    if gnss.time[-1] < start or gnss.time[0] > stop:
        raise NavigationError(
            f"GNSS covers {gnss.time[0]:.3f} to {gnss.time[-1]:.3f} s, the IMU "
            f"{start:.3f} to {stop:.3f} s: they do not overlap",
            expected="recordings of the same time on one time axis",
            cure="bring both to one time scale (leap seconds, week, epoch)",
            where=gnss.name,
        )


def _arm(lever_arm: ArrayLike) -> FloatArray:
    arm = np.asarray(lever_arm, dtype=np.float64)
    if arm.shape != (3,) or not np.isfinite(arm).all():
        raise InputError(f"lever arm is {lever_arm!r}", expected="three finite numbers in m")
    return arm


def _known(sd: FloatArray | None, recording: GnssRecording, what: str) -> FloatArray:
    if sd is None or np.isnan(sd).any():
        missing = recording.size if sd is None else int(np.isnan(sd).any(axis=1).sum())
        raise InputError(
            f"GNSS {what} has no standard deviation in {missing} of {recording.size} epochs",
            expected="one for every epoch",
            cure=f"give one for all with --gnss-{what}-sd",
            where=recording.name,
        )
    return sd
