"""Screening of values: stuck axes, saturation, wrong units, gravity, quantisation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from schuler.data import ImuRecording
from schuler.screening.finding import Finding
from schuler.types import FloatArray
from schuler.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from schuler.screening.motion import Rest

_PILED = 8  # samples at the very end of the range that make a pile
_MANY = 20_000  # samples that suffice to find the grid


def stuck_axes(imu: ImuRecording) -> list[Finding]:
    """Find channels that never change."""
    found = []
    for name in imu.channels:
        signal = imu.channel(name)
        if signal.max() > signal.min():
            continue
        what = "zero" if signal[0] == 0.0 else f"{signal[0]:.6g}"
        text = f"{name} is {what} in all {imu.size} samples: no sensor does that; "
        text += f"read without it with columns={{'{name}': None}}, or record again"
        found.append(Finding("stuck axis", "error", text, (name,), value=float(signal[0])))
    return found


def saturation(imu: ImuRecording) -> list[Finding]:
    """Find channels whose values pile up at the end of their range."""
    found = []
    for name in imu.channels:
        signal = imu.channel(name)
        count = sum(_piled(s) for s in (signal, -signal)) if signal.max() > signal.min() else 0
        if not count:
            continue
        extreme = float(np.abs(signal).max())
        rows = np.flatnonzero(np.abs(signal) == extreme)
        text = f"{name} saturates: {count} samples lie at the end of its range ({extreme:.4g} SI)"
        times = (float(imu.time[rows[0]]), float(imu.time[rows[-1]]))
        found.append(Finding("saturation", "warning", text, (name,), (times,), float(count)))
    return found


def saturation_limits(signal: FloatArray) -> tuple[float, float]:
    """Return the ends of the range at which a signal saturates."""
    if not signal.max() > signal.min():
        return -np.inf, np.inf
    low = float(signal.min()) if _piled(-signal) else -np.inf
    high = float(signal.max()) if _piled(signal) else np.inf
    return low, high


def _piled(signal: FloatArray) -> int:
    """Return how many samples lie at the maximum, if they pile up there; else 0."""
    top = signal.max()
    count = int(np.count_nonzero(signal == top))
    if count < _PILED:
        return 0
    reach = float(top - np.median(signal))
    for share in (0.05, 0.25):
        _, counts = np.unique(signal[signal > top - share * reach], return_counts=True)
        if counts.size > 3:
            return count if count > 4.0 * float(counts[:-1][-8:].mean()) else 0
    return 0


def suspected_units(imu: ImuRecording, still: Rest) -> list[Finding]:
    """Compare the specific force with gravity, and the rate at rest with what gyros show."""
    found = []
    accel = ("accel_x", "accel_y", "accel_z")
    if all(c in imu.channels for c in accel):
        force = float(np.median(np.sqrt(np.einsum("ij,ij->i", imu.accel, imu.accel))))
        ratio = force / STANDARD_GRAVITY
        steady = float(np.linalg.norm(imu.accel.mean(axis=0))) > 0.5 * force
        guess = _force_unit(ratio, steady)
        if guess:
            text = f"the specific force is {force:.4g} m/s^2 in the median: {guess}"
            found.append(Finding("units", "warning", text, accel, value=force))
        elif still.static and not 0.9 < ratio < 1.1:
            text = f"at rest the specific force is {force:.4g} m/s^2, not near gravity"
            found.append(Finding("units", "warning", text, accel, value=force))
    gyro = tuple(c for c in imu.channels if c.startswith("gyro"))
    if gyro:
        signals = np.concatenate([np.abs(imu.channel(c)) for c in gyro])
        rate = float(np.median(signals))
        # No sensor turns at 0.1 rad/s all the time while gravity stays where it is.
        if (still.level and rate > 0.1) or float(signals.max()) > 80.0:
            text = (
                f"the angular rate is {rate:.3g} rad/s in the median, {signals.max():.3g} at most: "
                "the file may hold deg/s (say so with gyro_unit='deg/s')"
            )
            found.append(Finding("units", "warning", text, gyro, value=rate))
    return found


def _force_unit(ratio: float, steady: bool) -> str:
    """Say what a median of |f| in g tells; `steady`: its direction stays, as gravity's does."""
    for scale, unit in (
        (1.0 / STANDARD_GRAVITY, "g"),
        (1000.0 / STANDARD_GRAVITY, "mg"),
        (1.0 / 0.3048, "ft/s^2"),
    ):
        if 0.85 < ratio / scale < 1.15:
            return f"the file seems to hold {unit} (say so with accel_unit='{unit}')"
    if 0.85 < ratio / STANDARD_GRAVITY < 1.15:
        return "it seems to be multiplied by g twice (say accel_unit='m/s^2')"
    if ratio < 0.05 and steady:
        return f"{1.0 / ratio:.3g} times less than gravity: the unit is another (say accel_unit=)"
    if ratio < 0.5:
        return "gravity seems to have been removed: take the columns that hold it"
    return ""


def gravity(imu: ImuRecording, still: Rest) -> list[Finding]:
    """Say which axis gravity lies on."""
    if not all(f"accel_{a}" in imu.channels for a in "xyz") or not still.rest:
        return []
    start, stop = max(still.rest, key=lambda r: r[1] - r[0])
    a, b = np.searchsorted(imu.time, [start, stop])
    mean = imu.accel[a : max(b, a + 1)].mean(axis=0)
    k = int(np.argmax(np.abs(mean)))
    axis = "xyz"[k]
    way = "up" if mean[k] > 0 else "down"
    tilt = float(np.degrees(np.arccos(min(1.0, abs(mean[k]) / np.linalg.norm(mean)))))
    text = (
        f"at rest {axis} reads {mean[k]:+.3f} m/s^2: the {axis} axis points {way}, within "
        f"{tilt:.1f} deg; |f| is {np.linalg.norm(mean):.3f} m/s^2"
    )
    return [Finding("gravity", "info", text, (f"accel_{axis}",), value=float(mean[k]))]


def grids(imu: ImuRecording) -> list[Finding]:
    """Find the steps of quantisation."""
    steps: dict[str, float] = {}
    for name in imu.channels:
        step = grid_step(imu.channel(name)[:_MANY])
        if step:
            steps[name] = step
    found = []
    while steps:
        first, step = next(iter(steps.items()))
        alike = tuple(
            c for c, s in steps.items() if c[0] == first[0] and abs(s - step) < 0.01 * step
        )
        unit = "rad/s" if first.startswith("gyro") else "m/s^2"
        text = f"{', '.join(alike)}: values lie on a grid of {step:.4g} {unit}"
        found.append(Finding("grid", "info", text, alike, value=step))
        steps = {c: s for c, s in steps.items() if c not in alike}
    return found


def grid_step(signal: FloatArray) -> float:
    """Return the step of quantisation of a signal."""
    values = np.unique(signal)
    if values.size < 2 or values.size > 0.3 * signal.size:
        return 0.0
    difference = np.diff(values)
    noise = 1e-9 * float(np.abs(values).max())
    difference = difference[difference > noise]
    if not difference.size:
        return 0.0
    step = float(difference.min())
    multiple = difference / step
    if np.abs(multiple - np.round(multiple)).max() > 0.02:
        return 0.0
    return float(difference.sum() / np.round(multiple).sum())
