"""Tables 2 to 5, figures 10 to 17: the static record of the laboratory, and what is read off it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler import (
    ImuRecording,
    SensorDenoising,
    WhiteNoise,
    allan_deviation,
    autocorrelation,
    autoregressive_fits,
    box_car,
    denoise,
    fit_ar,
    identify,
    identify_spectrum,
    power_spectral_density,
    slope_method,
)
from schuler_papers.experiment import FloatArray, Numbers, Size, generator, numbers
from schuler_papers.quinchia2013.sensor import (
    CHANNELS,
    FLICKER_LEVEL,
    PAPER,
    RATE,
    TRUE,
    process,
    scales,
    static_record,
)

ACCELS = tuple(c for c in CHANNELS if c.startswith("accel"))
GYROS = tuple(c for c in CHANNELS if c.startswith("gyro"))
KEYS = ("white_noise.density", "bias_instability.level", "random_walk.density")
LETTERS = ("N", "B", "K")
LEVELS_OF_FIGURE_17 = (3, 8)
_SHOWN = 160


def run(seed: int, size: Size) -> Numbers:
    """Simulate the static record and read everything off it that the paper reads."""
    rng = generator(seed, PAPER, "static")
    record = static_record(size, rng)
    found: dict[str, FloatArray | float] = {}
    for channel in CHANNELS:
        found |= _curves(channel, record.channel(channel))
    for order, fits in autoregressive_fits(record).items():
        for channel, fit in fits.items():
            found[f"{channel}:ar{order}"] = np.array([*fit.coefficients, fit.driving_variance])
    six = denoise(record.channel("gyro_x"), level=6, details="zero").signal
    one, three = (fit_ar(six, p, method="burg").innovation_variance for p in (1, 3))
    found["six levels"] = one / three
    found |= _figure_17(record.channel("accel_z"))
    return numbers(**found)


def _curves(channel: str, signal: FloatArray) -> dict[str, FloatArray | float]:
    model = process(channel)
    allan = identify(signal, RATE, model=model)
    psd = identify_spectrum(signal, RATE, model)
    found: dict[str, FloatArray | float] = {}
    keys = KEYS[:2] if channel in GYROS else KEYS
    for name, fit in (("allan", allan), ("psd", psd)):
        values = [fit.parameters[k] for k in keys]
        errors = [fit.standard_errors.get(k, math.nan) for k in keys]
        per = scales(channel)[: len(keys)]
        found[f"{channel}:{name}"] = np.array([values, errors]) / np.array(per)
    curve = allan_deviation(signal, RATE)
    readings = slope_method(curve)
    flat, white, walk = readings.bias_instability, readings.white_noise, readings.random_walk
    low = float(curve.deviation[curve.tau < 1000.0].min()) / FLICKER_LEVEL
    found[f"{channel}:read"] = np.array(
        [
            math.nan if white is None else white.value / scales(channel)[0],
            math.nan if flat is None else flat.value / scales(channel)[1],
            low / scales(channel)[1],
            math.nan if flat is None else flat.start,
            math.nan if flat is None else flat.stop,
            math.nan if flat is None else flat.relative_error,
            math.nan if walk is None else walk.value / scales(channel)[2],
        ]
    )
    keep = _thin(curve.tau.size)
    found[f"{channel}:tau"], found[f"{channel}:deviation"] = curve.tau[keep], curve.deviation[keep]
    spectrum = power_spectral_density(signal, RATE, onesided=True)
    found[f"{channel}:frequency"] = spectrum.frequency
    found[f"{channel}:density"] = spectrum.density
    return found


def _thin(size: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, size - 1, _SHOWN).round().astype(np.int64))


def _figure_17(signal: FloatArray) -> dict[str, FloatArray | float]:
    factors = np.unique(np.geomspace(1, 60_000, 60).round().astype(int))
    raw = allan_deviation(signal, RATE, taus=factors / RATE)
    found: dict[str, FloatArray | float] = {"17:tau": raw.tau, "17:raw": raw.deviation}
    for level in LEVELS_OF_FIGURE_17:
        quiet = denoise(signal, level=level, details="zero").signal
        found[f"17:{level}"] = allan_deviation(quiet, RATE, taus=raw.tau).deviation
    return found


def run_correlation(seed: int, size: Size) -> Numbers:
    """Record white noise and slow bias through the device's filter, and correlate it."""
    rng = generator(seed, PAPER, "correlation")
    n = 600_000 if size == "quick" else 2_400_000
    found: dict[str, FloatArray | float] = {}
    inner = {c: WhiteNoise(r.white_noise).simulate(n, 1e-3, rng) for c, r in TRUE.items()}
    fast = ImuRecording(
        np.arange(1, n + 1, dtype=np.float64) * 1e-3,
        np.stack([inner[c] for c in CHANNELS[:3]], axis=-1),
        np.stack([inner[c] for c in CHANNELS[3:]], axis=-1),
    )
    slow = box_car(fast, 15, 10)
    levels = SensorDenoising.table_7().levels
    for channel in CHANNELS:
        parts = process(channel).parts[1:]
        drift = sum(p.simulate(slow.size, 1.0 / RATE, rng) for p in parts)
        signal = slow.channel(channel) + drift
        found[f"{channel}:sd"] = float(slow.channel(channel).std())
        raw = autocorrelation(signal, RATE, max_lag=0.5)
        quiet = denoise(signal, level=6, details="zero").signal
        after = autocorrelation(quiet, RATE, max_lag=4.0)
        found["lag"], found["lag_after"] = raw.lag, after.lag
        found[f"{channel}:raw"], found[f"{channel}:after"] = raw.correlation, after.correlation
        white = autocorrelation(slow.channel(channel), RATE, max_lag=0.5).correlation
        found[f"{channel}:white"] = white
        alone = denoise(slow.channel(channel), level=levels[channel], details="zero").signal
        crossing = autocorrelation(alone, RATE, max_lag=4.0).correlation
        found[f"{channel}:zero"] = float(np.argmax(crossing <= 0.0)) / 2.0 ** levels[channel]
    return numbers(**found)
