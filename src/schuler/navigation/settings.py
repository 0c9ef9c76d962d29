"""What a user says about a run, in one object that is handed from function to function."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.keywords import refuse_unknown
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.aiding.options import PLAIN, MeasurementOptions
from schuler.navigation.aiding.vehicle import check_constraints
from schuler.navigation.engine import SMOOTHER_MEMORY
from schuler.navigation.error_models.sensor_error_model import TURN_ON_ACCEL, TURN_ON_GYRO
from schuler.types import FloatArray

FALSE_ALARM = 1e-6
"""Probability of refusing a good measurement."""

TimeOffset: TypeAlias = Literal["estimate"] | float | tuple[float, float]
Progress: TypeAlias = Callable[[str], None]


class NavigationOptions(TypedDict, total=False):
    """Keywords that everything takes that navigates; explained at `navigate`."""

    lever_arm: ArrayLike | Literal["estimate"]
    heading: float | None
    mounting: FloatArray | None
    time_offset: TimeOffset
    tune_noise: bool | None
    aiding: Sequence[str]
    false_alarm: float
    smoother_memory: float
    turn_on_accel: float
    turn_on_gyro: float
    measurements: MeasurementOptions


class RunOptions(NavigationOptions, total=False):
    """With those that `navigate` names itself, for what has many of its own."""

    outages: Sequence[tuple[float, float]]
    smooth: bool | Literal["fixed-lag"]
    lag: float
    progress: Progress | None


@dataclass(frozen=True, slots=True, eq=False)
class NavigationSettings:
    """What is known of a run, and how it is filtered; the keywords of `navigate`.

    Parameters
    ----------
    lever_arm, heading, mounting, time_offset, tune_noise, aiding, false_alarm, smoother_memory,
    turn_on_accel, turn_on_gyro, measurements
        As for `navigate`, where each is explained.

    Raises
    ------
    InputError
        A lever arm that is no three numbers, or an aiding that is not known.

    Examples
    --------
    >>> from schuler import NavigationSettings
    >>> NavigationSettings(lever_arm=(0.2, 0.0, -1.1), aiding=("nhc",)).time_offset
    'estimate'
    """

    lever_arm: ArrayLike | Literal["estimate"] = (0.0, 0.0, 0.0)
    heading: float | None = None
    mounting: FloatArray | None = None
    time_offset: TimeOffset = "estimate"
    tune_noise: bool | None = None
    aiding: Sequence[str] = ()
    false_alarm: float = FALSE_ALARM
    smoother_memory: float = SMOOTHER_MEMORY
    turn_on_accel: float = TURN_ON_ACCEL
    turn_on_gyro: float = TURN_ON_GYRO
    measurements: MeasurementOptions = PLAIN
    arm: FloatArray = field(init=False)
    constraints: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        if self.estimates_arm and not isinstance(self.measurements.correlated, GnssErrorModel):
            raise InputError(
                "a lever arm to be estimated while errors of GNSS are taken as given",
                expected="slow errors that the drive decides on: they look like an arm",
                cure="leave out --gnss-correlated, or give the arm (--lever-arm X,Y,Z)",
            )
        told = (0.0, 0.0, 0.0) if self.estimates_arm else self.lever_arm
        arm = np.asarray(told, dtype=np.float64)
        if arm.shape != (3,) or not np.isfinite(arm).all():
            raise InputError(
                f"lever arm is {self.lever_arm!r}", expected="three finite numbers in m"
            )
        object.__setattr__(self, "arm", arm)
        object.__setattr__(self, "constraints", check_constraints(self.aiding))

    @property
    def estimates_arm(self) -> bool:
        """Whether the antenna is looked for."""
        return isinstance(self.lever_arm, str) and self.lever_arm == "estimate"

    @property
    def estimates_offset(self) -> bool:
        """Whether time offsets are looked for."""
        return isinstance(self.time_offset, str)


def navigation_settings(
    function: Callable[..., object], options: NavigationOptions, **fixed: Any
) -> NavigationSettings:
    """Settings from the keywords of a function, but for those that it sets itself."""
    refuse_unknown(function, options, NavigationOptions, fixed)
    return NavigationSettings(**options, **fixed)


def nobody_listens(_: str) -> None:
    """Progress that is told to nobody."""
