"""What a navigation run may be told, as options that `navigate` and `outages` share."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.options.groups import VEHICLE
from schuler.cli.parsing import parse_numbers

if TYPE_CHECKING:
    from schuler.navigation.aiding.options import MeasurementOptions


@Parameter(name="*", group=VEHICLE)
@dataclass(frozen=True)
class RunOptions:
    """What is known about the run.

    Parameters
    ----------
    lever_arm : str
        X,Y,Z from the IMU to the antenna in m, in the axes of the IMU; estimate: found by the
        drive.
    mounting : str, optional
        ROLL,PITCH,YAW in deg that turn the vehicle's axes (forward, right, down) into those of
        the IMU; needed only where motion does not tell the heading.
    heading : float, optional
        Heading of the IMU's x axis at the start in deg; found from GNSS if not given.
    time_offset : str, optional
        Seconds to add to GNSS time to get IMU time: one number, or POSITION,VELOCITY; estimated
        if not given.
    tune_noise : bool, optional
        Scale the noise by the likelihood of the drive; if not said, it is done where no noise
        model is given, or the IMU shakes and the drive contradicts it.
    aid : tuple of str
        What is known of the vehicle: nhc, it has wheels and rolls along its forward axis; zupt,
        it does not move while the IMU feels no motion; wheel (with nhc), the vibration of its
        wheels tells its speed in outages. May be repeated.
    update : str
        What becomes of GNSS that is far off: gate refuses it, huber and student-t give it little
        weight.
    adaptive : bool
        The noise of GNSS follows the innovations.
    gnss_correlated : str, optional
        How long errors of GNSS positions last. auto: a share of what the receiver claims lasts, as
        much as the drive tells; SIGMA:SECONDS, such as 1.5:60, in m; off: all is white noise.
    """

    lever_arm: str = "0,0,0"
    mounting: str | None = None
    heading: float | None = None
    time_offset: str | None = None
    tune_noise: Annotated[bool | None, Parameter(negative="--no-tune-noise")] = None
    aid: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    update: Literal["gate", "huber", "student-t"] = "gate"
    adaptive: bool = False
    gnss_correlated: str = "auto"

    @property
    def weighs(self) -> bool:
        """Whether anything is said of how GNSS is weighted."""
        return (self.gnss_correlated, self.update, self.adaptive) != ("auto", "gate", False)

    def keywords(self) -> dict[str, Any]:
        """Return them as `NavigationSettings` and `evaluate_outages` want them."""
        from schuler.navigation.aiding.vehicle import check_constraints

        known: dict[str, Any] = {
            "lever_arm": self.lever_arm
            if self.lever_arm == "estimate"
            else parse_numbers(
                self.lever_arm, 3, "--lever-arm X,Y,Z in m, such as 0,-0.05,0, or estimate"
            ),
            "heading": None if self.heading is None else radians(self.heading),
            "tune_noise": self.tune_noise,
            "aiding": check_constraints(self.aid),
        }
        if self.weighs:
            known["measurements"] = self._measurements()
        if self.mounting is not None:
            from schuler.rotations import dcm_from_euler

            text = "--mounting ROLL,PITCH,YAW in deg, such as 180,0,90"
            roll, pitch, yaw = (radians(a) for a in parse_numbers(self.mounting, 3, text))
            known["mounting"] = dcm_from_euler(roll, pitch, yaw)
        if self.time_offset is not None:
            both = "," in self.time_offset
            text = "--time-offset SECONDS or POSITION,VELOCITY in s, such as 0.12"
            numbers = parse_numbers(self.time_offset, 2 if both else 1, text)
            known["time_offset"] = tuple(numbers) if both else numbers[0]
        return known

    def _measurements(self) -> MeasurementOptions:
        from schuler.navigation.aiding.gnss import CorrelatedGnss, GnssErrorModel
        from schuler.navigation.aiding.options import (
            USUAL_ERRORS,
            GnssWeighting,
            MeasurementOptions,
        )

        correlated: CorrelatedGnss | GnssErrorModel | None = USUAL_ERRORS
        if self.gnss_correlated == "off":
            correlated = None
        elif self.gnss_correlated != "auto":
            text = "--gnss-correlated SIGMA:SECONDS, such as 1.5:60, or auto or off"
            sigma, seconds = parse_numbers(self.gnss_correlated, 2, text, ":")
            correlated = CorrelatedGnss(sigma, seconds)
        return MeasurementOptions(GnssWeighting(self.update, self.adaptive), correlated)
