"""Noise models as `imu.yaml` of Kalibr, which allan_variance_ros and OpenVINS share."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

from schuler.data.table import write_text
from schuler.errors import ModelError
from schuler.noise import NoiseModel
from schuler.noise.elements import Elements
from schuler.units import format_value

_FAST = 1.0
_ONE_HOUR = 3600.0


@dataclass(frozen=True, slots=True)
class _Number:
    value: float
    reason: str


def kalibr_yaml(noise_model: NoiseModel, *, rate: float | None = None, topic: str = "/imu0") -> str:
    """Write a noise model as Kalibr's imu.yaml.

    Parameters
    ----------
    noise_model : NoiseModel
        With at least one gyro and one accelerometer channel.
    rate : float, optional
        Samples a second; default the rate of the model.
    topic : str
        Name of the ROS topic.

    Returns
    -------
    str
        YAML of plain numbers, with units and reasons in comments. Each number is that of the
        worst axis, as Kalibr has one for three.

    Raises
    ------
    ModelError
        No gyro or no accelerometer, no white noise, or no rate.

    Notes
    -----
    Densities are continuous. Kalibr refuses zeros, so a walk that was not found is written as
    the most that the record does not exclude.

    Examples
    --------
    >>> from schuler import NoiseModel, RandomWalk, WhiteNoise, kalibr_yaml
    >>> gyro, accel = WhiteNoise(5e-5) + RandomWalk(1e-6), WhiteNoise(7e-4) + RandomWalk(1e-5)
    >>> model = NoiseModel.isotropic(gyro, accel)
    >>> "gyroscope_noise_density" in kalibr_yaml(model, rate=100.0)
    True
    """
    wanted = noise_model.rate if rate is None else rate
    if wanted is None or not (math.isfinite(wanted) and wanted > 0.0):
        raise ModelError("the noise model has no rate", expected="rate=samples a second")
    lines = [
        "# IMU noise for Kalibr and its relatives: continuous densities, worst axis of three.",
        f"# Source: {' '.join(noise_model.source.split()) or 'not stated'}",
    ]
    for sensor, word, unit in (("accel", "accelerometer", "m/s^2"), ("gyro", "gyroscope", "rad/s")):
        density, walk = triad(noise_model, sensor, 1.0 / (noise_model.rate or wanted))
        per_second = "m/s^3" if sensor == "accel" else "rad/s^2"
        shown = format_value(density.value, f"{sensor} white noise", digits=4)
        lines += [
            f"# {density.reason}: {shown}",
            f"{word}_noise_density: {_plain(density.value)}  # {unit}/sqrt(Hz)",
        ]
        shown = format_value(walk.value, f"{sensor} random walk", digits=4)
        lines += [
            f"# {walk.reason}: {shown}",
            f"{word}_random_walk: {_plain(walk.value)}  # {per_second}/sqrt(Hz)",
        ]
    lines += [f"rostopic: {json.dumps(topic)}", f"update_rate: {_plain(wanted)}  # Hz"]
    return "\n".join(lines) + "\n"


def write_kalibr(
    path: str | Path, noise_model: NoiseModel, *, rate: float | None = None, topic: str = "/imu0"
) -> None:
    """Write Kalibr's imu.yaml to a file.

    Parameters
    ----------
    path : str or Path
        File to write; it appears only when it is complete.
    noise_model : NoiseModel
        As for `kalibr_yaml`.
    rate : float, optional
        As for `kalibr_yaml`.
    topic : str
        As for `kalibr_yaml`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler import NoiseModel, RandomWalk, WhiteNoise, write_kalibr
    >>> gyro, accel = WhiteNoise(5e-5) + RandomWalk(1e-6), WhiteNoise(7e-4) + RandomWalk(1e-5)
    >>> model = NoiseModel.isotropic(gyro, accel)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_kalibr(Path(folder) / "imu.yaml", model, rate=100.0)
    ...     print((Path(folder) / "imu.yaml").exists())
    True
    """
    write_text(path, kalibr_yaml(noise_model, rate=rate, topic=topic))


def _plain(value: float) -> str:
    """A number that every YAML 1.1 reader takes for a float."""
    text = f"{float(value):.9g}"
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{mark}{exponent}"


def triad(model: NoiseModel, sensor: str, dt: float) -> tuple[_Number, _Number]:
    """Worst white noise and worst walk of the axes of one sensor."""
    channels = [c for c in model.channels if c.startswith(sensor)]
    if not channels:
        raise ModelError(
            f"noise model has no {sensor} channel", expected="gyro and accelerometer for Kalibr"
        )
    seen = {c: model.process(c).elements(dt) for c in channels}
    densities = {c: _density(seen[c], dt, c) for c in channels}
    walks = {c: _walk(model, seen[c], dt, c, densities[c].value) for c in channels}
    # a walk that was found goes before one that is only not excluded
    found = {c: w for c, (w, seen) in walks.items() if seen}
    chosen = found or {c: w for c, (w, _) in walks.items()}
    return (
        max(densities.values(), key=lambda d: d.value),
        max(chosen.values(), key=lambda w: w.value),
    )


def _density(seen: Elements, dt: float, channel: str) -> _Number:
    white = seen.white * dt
    # noise faster than a second is white to whoever integrates for longer
    fast = math.fsum(2.0 * variance * time for variance, time in seen.gauss_markovs if time < _FAST)
    if white + fast <= 0.0:
        cure = "give it a white noise term; Kalibr refuses a density of zero"
        if seen.quantization > 0.0:
            cure += " (quantisation is not white)"
        raise ModelError(f"{channel} has no white noise", cure=cure)
    reason = f"white noise of {channel}"
    if fast > 0.0:
        reason += " with its Gauss-Markov noise faster than 1 s, which acts as white"
    return _Number(math.sqrt(white + fast), reason)


def _walk(
    model: NoiseModel, seen: Elements, dt: float, channel: str, density: float
) -> tuple[_Number, bool]:
    """Return the walk of a channel and whether anything of the kind was found."""
    walk = seen.walk / dt
    slow = math.fsum(
        2.0 * variance / time for variance, time in seen.gauss_markovs if time >= _FAST
    )
    if slow > 0.0:
        parts = "random walk and Gauss-Markov noise" if walk > 0.0 else "Gauss-Markov noise"
        reason = (
            f"equivalent walk of {channel}: its {parts} as the walk that starts as fast, "
            f"K^2 + 2 sigma^2/Tc (a walk has no end, so it overstates the bias beyond Tc)"
        )
        return _Number(math.sqrt(walk + slow), reason), True
    if walk > 0.0:
        return _Number(math.sqrt(walk), f"random walk of {channel}"), True
    limit = model.limits.get(channel, {}).get("random_walk.density", 0.0)
    if limit > 0.0:
        reason = (
            f"no random walk was found in {channel}, but Kalibr refuses zero: the most that the "
            f"record does not exclude (95 %)"
        )
        return _Number(limit, reason), False
    reason = (
        f"{channel} has no random walk, but Kalibr refuses zero: the walk whose Allan deviation "
        f"meets that of the white noise after 1 h"
    )
    return _Number(density * math.sqrt(3.0) / _ONE_HOUR, reason), False
