"""A GNSS recording held against itself: its velocity against the change of its positions."""

from __future__ import annotations

import numpy as np

from schuler.data.vertical_velocity import trouble_of_vertical_velocity
from schuler.errors import InputError
from schuler.io.source import Notes
from schuler.types import BoolArray, FloatArray

_SPAN = 4.0  # s over which positions are differenced: their noise is then small
_LEAST = 15.0  # m that must be covered in all
_AGREES = 0.1  # share of the motion that may stay unexplained by what is right
_DOUBTFUL = 0.4  # share from which it is said even where nothing explains it
_NAMED = 0.06  # and by what is named instead of it
_RADIUS = 6.371e6
_HELD = 0.3  # share of repeated positions from which fixes are held
_SCALES = (
    (3.6, "velocity is in km/h", "velocity_unit='km/h'"),
    (1.943844, "velocity is in knots", "velocity_unit='kn'"),
    (2.236936, "velocity is in miles an hour", "velocity_unit='mph'"),
    (3.28084, "velocity is in ft/s", "velocity_unit='ft/s'"),
    (100.0, "velocity is in cm/s", "velocity_unit='cm/s'"),
    (1000.0, "velocity is in mm/s", "velocity_unit='mm/s'"),
    (57.29578, "latitude and longitude are in radians", "angle_unit='rad'"),
    (1.0 / 57.29578, "latitude and longitude are in degrees", "angle_unit='deg'"),
)


def unfixed(position: FloatArray) -> BoolArray:
    """Return which epochs lie at 0, 0: what receivers write before their first fix."""
    return np.asarray((np.abs(position[:, 0]) < 1e-12) & (np.abs(position[:, 1]) < 1e-12))


def held(time: FloatArray, position: FloatArray, velocity: FloatArray | None) -> BoolArray:
    """Return which epochs repeat the one before: fixes held between two of the receiver."""
    repeats = np.zeros(time.size, dtype=bool)
    repeats[1:] = (position[1:] == position[:-1]).all(axis=1)
    if velocity is not None:
        repeats[1:] &= (velocity[1:] == velocity[:-1]).all(axis=1)
    again = np.zeros(time.size, dtype=bool)
    again[1:] = repeats[1:] & (np.diff(time) == 0.0)
    if repeats.mean() < _HELD:
        return again
    starts = np.flatnonzero(~repeats)
    if starts.size < 3:
        return again
    lengths = np.diff(starts)
    low, high = np.percentile(lengths, [10.0, 90.0])
    moving = velocity is not None and float(np.median(np.hypot(*velocity[:, :2].T))) > 0.5
    regular = low > 1.0 and high <= 1.5 * low + 1.0
    return repeats if moving or regular else again


def check_motion(
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray | None,
    notes: Notes,
    where: str,
) -> None:
    """Raise when velocity and positions contradict each other in a way that has a name."""
    if velocity is None or time.size < 8:
        return
    moved, driven = _displacements(time, position, velocity)
    if moved is None or driven is None:
        return
    size = float(np.sum(driven[:, :2] ** 2))
    path = float(np.sum(np.hypot(*moved[:, :2].T)))
    least = min(path, float(np.sum(np.hypot(*driven[:, :2].T))))
    if size <= 0.0 or least < _LEAST / 100.0 or max(path, size**0.5) < _LEAST:
        return
    plain = _unexplained(driven[:, :2], moved[:, :2])
    if plain > _AGREES:
        _name_the_cause(driven[:, :2], moved[:, :2], position, plain, notes, where)


def _displacements(
    time: FloatArray, position: FloatArray, velocity: FloatArray
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return north, east, down between epochs: by positions, and by the integral of velocity."""
    step = np.diff(time)
    usual = float(np.median(step))
    span = max(1, round(_SPAN / usual))
    if time.size <= span + 2:
        span = 1
    whole = np.zeros((time.size, 3))
    whole[1:] = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * step[:, np.newaxis], axis=0)
    local = np.column_stack(
        [
            (position[:, 0] - position[0, 0]) * _RADIUS,
            (position[:, 1] - position[0, 1]) * _RADIUS * np.cos(position[0, 0]),
            -(position[:, 2] - position[0, 2]),
        ]
    )
    even = time[span:] - time[:-span] < 1.5 * span * usual
    moved, driven = local[span:] - local[:-span], whole[span:] - whole[:-span]
    keep = even & np.isfinite(moved[:, :2]).all(axis=1)
    sizes = np.hypot(*moved[:, :2].T)
    usual_size = float(np.median(sizes[keep])) if keep.any() else 0.0
    keep &= sizes < 20.0 * usual_size + 1e-9  # jumps are another matter
    if keep.sum() < 5:
        return None, None
    return moved[keep], driven[keep]


def _unexplained(driven: FloatArray, moved: FloatArray) -> float:
    """Return the share of the integrated velocity that the positions do not explain."""
    size = max(float(np.sum(driven**2)), float(np.sum(moved**2)))
    return float(np.sum((driven - moved) ** 2)) / max(size, 1e-12)


def _name_the_cause(
    driven: FloatArray,
    moved: FloatArray,
    position: FloatArray,
    plain: float,
    notes: Notes,
    where: str,
) -> None:
    for text, cure, turned in _hypotheses(moved, position):
        if _unexplained(driven, turned) < min(_NAMED, plain / 4.0):
            raise InputError(
                f"velocity and the change of positions contradict each other: {text}",
                expected="velocity as the change of positions a second",
                cure=cure,
                where=where,
            )
    if plain > _DOUBTFUL and float(np.median(np.hypot(*driven.T))) > _SPAN:
        notes.assumed("velocity does not fit the change of positions: check units and axes of both")


def _hypotheses(moved: FloatArray, position: FloatArray) -> list[tuple[str, str, FloatArray]]:
    """Return what may be wrong, its cure, and what velocity would then show."""
    found = [(text, f"say {cure}", moved * scale) for scale, text, cure in _SCALES]
    swap = moved[:, ::-1]
    found.append(
        (
            "north and east velocity are exchanged",
            "say columns={'velocity_north': ..., 'velocity_east': ...} the other way round",
            swap,
        )
    )
    latitude, longitude = float(np.median(position[:, 0])), float(np.median(position[:, 1]))
    exchanged = np.column_stack(
        [moved[:, 1] / max(np.cos(latitude), 1e-3), moved[:, 0] * np.cos(longitude)]
    )
    found.append(
        (
            "latitude and longitude are swapped",
            "say columns={'latitude': ..., 'longitude': ...} the other way round",
            exchanged,
        )
    )
    for sign, word in (((-1, 1), "north velocity has"), ((1, -1), "east velocity has"),
                       ((-1, -1), "both velocities have")):  # fmt: skip
        found.append((f"{word} the wrong sign", "turn the sign in the file", moved * sign))
    turned = np.column_stack([moved[:, 1], -moved[:, 0]])
    found.append(("the axes of velocity are turned by 90 deg", "correct them in the file", turned))
    found.append(("the axes of velocity are turned by 90 deg", "correct them in the file", -turned))
    return found


def check_vertical(
    time: FloatArray, position: FloatArray, velocity: FloatArray, where: str
) -> bool:
    """Return whether a vertical velocity was measured at all; raise when it points up."""
    trouble = trouble_of_vertical_velocity(time, position[:, 2], velocity)
    if trouble == "points up":
        raise InputError(
            "vertical velocity has the other sign than the change of height: it points up",
            expected="velocity down, positive downwards",
            cure="say columns={'velocity_up': ...}, or turn the sign in the file",
            where=where,
        )
    return trouble is None
