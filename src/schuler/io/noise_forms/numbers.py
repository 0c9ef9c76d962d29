"""The numbers of a noise model that other programs ask for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from schuler.errors import ModelError
from schuler.io.format import NoiseRequest
from schuler.io.kalibr import triad
from schuler.noise import NoiseModel


@dataclass(frozen=True, slots=True)
class Sensor:
    """What the three axes of a sensor have in common, SI; the worst axis counts."""

    density: float  # white noise
    walk: float  # random walk
    # sigma, correlation_time: of the slowest Gauss-Markov noise of the worst axis; without one,
    # what the walk makes in an hour, and an hour.
    sigma: float
    correlation_time: float


HOUR = 3600.0


def sensor_numbers(model: NoiseModel, sensor: str) -> Sensor:
    """Return the numbers of the gyros or the accelerometers."""
    # densities do not depend on the interval at which the parts are looked at
    dt = 1.0 / (model.rate or 1.0)
    density, walk = triad(model, sensor, dt)
    found = [
        (variance, time)
        for c in model.channels
        if c.startswith(sensor)
        for variance, time in model.process(c).elements(dt).gauss_markovs
        if time >= 1.0 and variance > 0.0
    ]
    if not found:
        return Sensor(density.value, walk.value, walk.value * math.sqrt(HOUR), HOUR)
    variance, time = max(found)
    return Sensor(density.value, walk.value, math.sqrt(variance), time)


def rate_of(model: NoiseModel, request: NoiseRequest) -> float:
    """Return the sampling rate; raise when neither model nor request know it."""
    rate = request.rate if request.rate is not None else model.rate
    if rate is None or not (math.isfinite(rate) and rate > 0.0):
        raise ModelError("the noise model has no rate", expected="rate=samples a second")
    return float(rate)


def source_line(model: NoiseModel, sign: str = "#") -> str:
    """Return a comment on where the model comes from."""
    return f"{sign} schuler; source: {' '.join(model.source.split()) or 'not stated'}"


def number(value: float) -> str:
    """Return a number that every YAML 1.1 reader takes for a float."""
    text = f"{float(value):.9g}"
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}{mark}{exponent}"
