"""Whether gyros and accelerometers whose unit nobody named can be in rad/s and m/s²."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.errors import InputError
from schuler.io.source import Notes
from schuler.types import FloatArray
from schuler.unit_grammar import STANDARD_GRAVITY

_MANY = 40_000  # samples that suffice
_FASTEST = 100.0  # rad/s, and
_STRONGEST = 50.0 * STANDARD_GRAVITY  # m/s^2: no motion that is not said to be one
_NOISIEST = 0.06  # deg/s/sqrt(Hz): no gyro of a chip is noisier
_TURNED = 0.15  # rad/s in the median: nothing at rest turns so fast

# What a sensor at rest shows in other units than m/s^2.
_FORCES = (
    (1.0, "g"),
    (1000.0, "mg"),
    (1e6, "ug"),
    (STANDARD_GRAVITY / 0.3048, "ft/s^2"),
    (100.0 * STANDARD_GRAVITY, "cm/s^2"),
    (STANDARD_GRAVITY**2, "m/s^2 multiplied by g once more"),
)
_COUNTS = (256.0, 512.0, 1024.0, 2048.0, 4096.0, 8192.0, 16384.0, 1365.0, 16393.0, 4000.0)


@dataclass(frozen=True, slots=True)
class Taken:
    """Which sensors were taken to be in SI although no unit is named."""

    # gyro, accel: True: nobody named a unit
    gyro: bool
    accel: bool


def confirm_units(
    time: FloatArray, gyro: FloatArray, accel: FloatArray, taken: Taken, notes: Notes, where: str
) -> None:
    """Confirm units that were taken for granted; raise where physics says that they are others."""
    every = max(1, time.size // _MANY)
    size = "no unit is named"
    if taken.accel and np.isfinite(accel[0]).all():
        force = float(np.median(np.linalg.norm(accel[::every], axis=1)))
        _refuse_force(force, accel[::every], where)
        size += f"; the median of |f| is {force:.3g}"
    if taken.accel and np.isfinite(accel[0]).any():
        notes.assumed(f"accel taken as m/s^2: {size}")
    if not taken.gyro or not np.isfinite(gyro[0]).any():
        return
    shown = "no unit is named"
    if np.isfinite(gyro[0]).all():
        _refuse_rate(gyro, where)
        if np.isfinite(accel[0]).all():
            shown += _evidence(time, gyro, accel, where)
    notes.assumed(f"gyro taken as rad/s: {shown}")


def _refuse_force(force: float, accel: FloatArray, where: str) -> None:
    """Raise when the median of specific force cannot be that of m/s^2 under gravity."""
    if 0.6 * STANDARD_GRAVITY < force < 2.0 * STANDARD_GRAVITY:
        return
    text = (
        f"accel names no unit, and the median of |f| is {force:.4g}: under gravity m/s^2 give 9.8"
    )
    whole = bool(np.all(accel == np.round(accel)))
    if whole and force > 50.0:
        counts = min(_COUNTS, key=lambda c: abs(np.log(c / force)))
        raise InputError(
            f"{text}; whole numbers are counts of the chip, perhaps {counts:g} LSB per g",
            expected="the scale of accelerometer and gyro",
            cure=f"say accel_unit='LSB {counts:g}/g' and gyro_unit='LSB 131/(deg/s)', with the "
            "numbers of your settings",
            where=where,
        )
    for rest, unit in _FORCES:
        if 0.8 < force / rest < 1.25:
            named = unit.split(" ")[0]
            raise InputError(
                f"{text}, {unit} give {rest:.4g}",
                expected="the unit of the accelerometer",
                cure=f"say accel_unit='{named}' if it is that",
                where=where,
            )
    if force < 0.5 * STANDARD_GRAVITY:
        raise InputError(
            f"{text}: gravity seems to have been removed, or the unit is another",
            expected="specific force, which holds gravity",
            cure="name the columns with gravity, or say accel_unit='m/s^2' if it is right",
            where=where,
        )
    raise InputError(
        text,
        expected="the unit of the accelerometer",
        cure="say it, e.g. accel_unit='mg' or accel_unit='LSB 16384/g'",
        where=where,
    )


def _refuse_rate(gyro: FloatArray, where: str) -> None:
    """Raise when rates are too large for rad/s."""
    size = np.abs(gyro)
    largest, usual = float(np.percentile(size, 99.0)), float(np.median(size))
    if largest < 35.0 and usual < 8.0:
        return
    whole = bool(np.all(gyro == np.round(gyro)))
    unit = "LSB 131/(deg/s)" if whole else "mdps" if largest > 4000.0 or usual > 100.0 else "deg/s"
    raise InputError(
        f"gyro names no unit, and rates of {usual:.3g} in the median and {largest:.3g} at most are "
        "too large for rad/s",
        expected="the unit or the scale of the gyro",
        cure=f"say it, e.g. gyro_unit='{unit}'",
        where=where,
    )


def _evidence(time: FloatArray, gyro: FloatArray, accel: FloatArray, where: str) -> str:
    """Hold the gyro against gravity, which turns with it, and against the noise of chips."""
    usual = float(np.median(np.abs(gyro)))
    ratio = turning_ratio(time, gyro, accel)
    if ratio is not None:
        for factor, unit in ((57.29578, "deg/s"), (57295.78, "mdps")):
            if 0.4 < ratio * factor < 2.5:
                raise InputError(
                    f"gyro names no unit, and gravity turns {1.0 / ratio:.3g} times slower than "
                    "it would for rad/s",
                    expected="the unit of the gyro",
                    cure=f"say gyro_unit='{unit}'",
                    where=where,
                )
        if 0.4 < ratio < 2.5:
            return "; gravity turns as it should"
    noise = _rest_noise(time, gyro, accel)
    if noise is None:
        return ""
    if noise > _NOISIEST or usual > _TURNED:
        millis = noise > 1e3 * _NOISIEST or usual > 1e2 * _TURNED
        unit, scale = ("mdps", 57295.78) if millis else ("deg/s", 57.29578)
        raise InputError(
            f"gyro names no unit, and at rest it shows {usual:.3g} in the median and noise of "
            f"{noise:.2g} deg/s/sqrt(Hz) if that is rad/s: no chip does; {noise / scale:.2g} if "
            f"it is {unit}",
            expected="the unit of the gyro",
            cure=f"say gyro_unit='{unit}', or gyro_unit='rad/s' if it is right",
            where=where,
        )
    return f"; at rest its noise is then {noise:.2g} deg/s/sqrt(Hz)"


def turning_ratio(time: FloatArray, gyro: FloatArray, accel: FloatArray) -> float | None:
    """Return by how much gravity turns for one unit of the gyro; None where it does not turn.

    Over a fifth of a second specific force changes by minus the angle turned times itself.
    """
    gyro, accel, time = gyro[:_MANY], accel[:_MANY], time[:_MANY]
    step = float(np.median(np.diff(time)))
    span = max(1, round(0.2 / step))
    count = time.size // span
    if count < 20:
        return None
    turned = gyro[: count * span].reshape(count, span, 3).sum(axis=1) * step
    force = accel[: count * span].reshape(count, span, 3).mean(axis=1)
    angle = 0.5 * (turned[1:] + turned[:-1])
    change = np.diff(force, axis=0)
    expected = -np.cross(angle, 0.5 * (force[1:] + force[:-1]))
    ee, ec, cc = (float(np.sum(a * b)) for a, b in
                  ((expected, expected), (expected, change), (change, change)))  # fmt: skip
    if ee <= 0.0 or cc <= 0.0 or ec <= 0.0 or ec * ec < 0.25 * ee * cc:
        return None
    return ec / ee


def _rest_noise(time: FloatArray, gyro: FloatArray, accel: FloatArray) -> float | None:
    """Return the noise of the gyro in deg/s/sqrt(Hz) if it is rad/s; None where nothing rests."""
    step = float(np.median(np.diff(time)))
    window = max(4, round(1.0 / step))
    count = time.size // window
    if count < 3:
        return None
    force = accel[: count * window].reshape(count, window, 3)
    spread = force.std(axis=1).max(axis=1)
    mean = force.mean(axis=1)
    quiet = spread < 3.0 * np.percentile(spread, 10.0)
    quiet &= spread < 0.3
    if quiet.sum() < max(3, 0.05 * count):
        return None
    if np.linalg.norm(mean[quiet] - np.median(mean[quiet], axis=0), axis=1).max() > 3.0:
        return None
    rates = gyro[: count * window].reshape(count, window, 3)[quiet]
    jumps = np.diff(rates, axis=1) / np.sqrt(2.0)
    return float(np.degrees(np.sqrt(np.median(np.mean(jumps**2, axis=(1, 2))))) * np.sqrt(step))


def refuse_impossible(gyro: FloatArray, accel: FloatArray, said: Taken, where: str) -> None:
    """Raise for rates and forces that no motion has, unless the user said the unit himself."""
    for sensor, values, most, unit, known in (
        ("gyro", gyro, _FASTEST, "rad/s", said.gyro),
        ("accel", accel, _STRONGEST, "m/s^2", said.accel),
    ):
        if known or not np.isfinite(values[0]).any():
            continue
        part = np.abs(values[:: max(1, len(values) // _MANY)])
        largest = float(np.nanpercentile(part, 95.0))
        if largest > most:
            raise InputError(
                f"{sensor} is above {largest:.3g} {unit} in 5 % of the samples: no motion is",
                expected=f"values up to {most:.3g} {unit}",
                cure=f"say the right unit with {sensor}_unit=",
                where=where,
            )
