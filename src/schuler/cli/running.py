"""What a navigation run may be told, as options that `navigate` and `outages` share."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Annotated, Any

from cyclopts import Parameter


@dataclass(frozen=True)
class RunOptions:
    """What is known about the run.

    Parameters
    ----------
    lever_arm : str
        X,Y,Z from the IMU to the antenna in m, in the axes of the IMU.
    mounting : str, optional
        ROLL,PITCH,YAW in deg that turn the vehicle's axes (forward, right, down) into those of
        the IMU; needed only where motion does not tell the heading.
    heading : float, optional
        Heading of the IMU's x axis at the start in deg; found from GNSS if not given.
    time_offset : str, optional
        Seconds to add to GNSS time to get IMU time: one number, or POSITION,VELOCITY; estimated
        if not given.
    tune_noise : bool, optional
        Scale the noise by the likelihood of the drive; done only when no noise model is given.
    aid : tuple of str
        What is known of the vehicle: nhc, it has wheels and rolls along its forward axis; zupt,
        it does not move while the IMU feels no motion; wheel (with nhc), the vibration of its
        wheels tells its speed in outages. May be repeated.
    """

    lever_arm: str = "0,0,0"
    mounting: str | None = None
    heading: float | None = None
    time_offset: str | None = None
    tune_noise: Annotated[bool | None, Parameter(negative="--no-tune-noise")] = None
    aid: Annotated[tuple[str, ...], Parameter(negative=())] = ()

    def keywords(self) -> dict[str, Any]:
        """Return them as `schuler.navigate.prepare` and `evaluate_outages` want them.

        Returns
        -------
        dict
            In SI and radians.

        Raises
        ------
        InputError
            Numbers that are not understood.
        """
        from schuler.cli.loading import parse_numbers
        from schuler.navigate.vehicle import check_constraints

        known: dict[str, Any] = {
            "lever_arm": parse_numbers(
                self.lever_arm, 3, "--lever-arm X,Y,Z in m, such as 0,-0.05,0"
            ),
            "heading": None if self.heading is None else radians(self.heading),
            "tune_noise": self.tune_noise,
            "aiding": check_constraints(self.aid),
        }
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
