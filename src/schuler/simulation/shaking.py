"""How vehicles shake an IMU besides their motion: engine, wheels and road, rotors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.simulation.motions.profile import Profile
from schuler.simulation.vibration import (
    Vibration,
    add_vibration,
    engine_turning_rate,
    wheel_turning_rate,
)

ENGINE = (
    Vibration((0.004, 0.012, 0.004), (0.15, 0.15, 0.3), order=2.0),
    Vibration((0.001, 0.003, 0.001), (0.03, 0.03, 0.06), order=1.0),
)
"""Of a four-cylinder engine: twice and once a turn; aliased as the sampling folds it."""
WHEELS = tuple(Vibration((5e-4, 1e-3, 5e-4), (0.03, 0.02, 0.06), order=float(k)) for k in (1, 2, 3))
"""At 15 m/s; less below."""
ROAD = (Vibration((0.01, 0.01, 0.003), (0.15, 0.2, 0.5), frequency=11.0, bandwidth=8.0),)
ROTORS = (
    Vibration((0.05, 0.05, 0.02), (1.0, 1.0, 2.0), frequency=87.0, bandwidth=3.0),
    Vibration((0.01, 0.01, 0.01), (0.3, 0.3, 0.5), frequency=174.0, bandwidth=6.0),
)
USUAL_SPEED = 15.0
WHEELED = ("car_urban", "car_mixed", "motorcycle")


def shaken(
    ideal: ImuRecording,
    profile: Profile,
    vehicle: str,
    level: float,
    rng: np.random.Generator,
) -> ImuRecording:
    """Return a recording of an IMU that is shaken as on some vehicle."""
    if not level >= 0.0:
        raise InputError(f"a vibration of level {level:g}", expected="zero or more")
    if level == 0.0:
        return ideal
    speed = np.linalg.norm(profile.motion(ideal.time).velocity[:, :2], axis=1)
    if vehicle in WHEELED:
        engine, wheels, road = rng.spawn(3)
        turned = add_vibration(
            ideal, ENGINE, engine, turning_rate=engine_turning_rate(speed), strength=level
        )
        rolling = level * np.minimum(speed / USUAL_SPEED, 2.0)
        turned = add_vibration(
            turned, WHEELS, wheels, turning_rate=wheel_turning_rate(speed), strength=rolling
        )
        shaken_ = add_vibration(turned, ROAD, road, strength=rolling)
    elif vehicle == "drone":
        shaken_ = add_vibration(ideal, ROTORS, rng, strength=level)
    else:
        raise InputError(
            f"vibration of the motion '{vehicle}'", expected=f"one of {', '.join(WHEELED)}, drone"
        )
    return replace(shaken_, history=(*ideal.history, f"shaken as a {vehicle}, level {level:g}"))
