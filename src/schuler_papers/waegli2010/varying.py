"""GARCH against averaged volatilities when one gyro varies: figure 14 and Table 3."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from schuler import (
    OnlineSettings,
    averaged_volatility,
    conditional_noise,
    ewma_variance,
    fit_garch,
    redundant_sensors,
    simulate_garch,
)
from schuler_papers.experiment import (
    FloatArray,
    Numbers,
    Results,
    Size,
    generator,
    numbers,
    stacked,
)
from schuler_papers.judging import Found, plain
from schuler_papers.outcome import Curve, Panel
from schuler_papers.waegli2010.fusion import RATE, Weights, fused_rate, gyros_at_rest
from schuler_papers.waegli2010.series import PAPER, TABLE_2


def run(seed: int, size: Size) -> Numbers:
    """Let one gyro of four vary by Table 2's GARCH, and see whose variance each method shows."""
    rng = generator(seed, PAPER, "one-varies")
    n = 20_000 if size == "quick" else 60_000
    noise = 0.0146 * rng.standard_normal((n, 4, 3))
    noise[:, 0, 0], true = simulate_garch(n, *TABLE_2, rng)
    learning = n // 4
    residual = noise[:, 0, 0] - noise[:, :, 0].mean(axis=1)
    ways: dict[str, Callable[[], FloatArray]] = {
        "garch": lambda: _conditional(noise, learning),
        "averaged": lambda: _averaged(noise),
        "ewma": lambda: ewma_variance(residual, before=float(true[0])),
    }
    seconds, named = [], {}
    after = slice(learning, None)
    for name, way in ways.items():
        begin = time.process_time()
        named[name] = way()[after]
        seconds.append(time.process_time() - begin)
    log_true, squares = np.log(true[after]), noise[after, 0, 0] ** 2
    thin = slice(None, None, 50)
    return numbers(
        correlation=[np.corrcoef(np.log(v), log_true)[0, 1] for v in named.values()],
        loss=[np.mean(np.log(v) + squares / v) for v in named.values()],
        mean_ratio=[v.mean() / true[after].mean() for v in named.values()],
        seconds=seconds,
        time=np.arange(n)[learning::50] / RATE,
        true=np.sqrt(true[after][thin]),
        garch=np.sqrt(named["garch"][thin]),
        averaged=np.sqrt(named["averaged"][thin]),
        **_outliers(noise, named, learning, rng),
    )


def _conditional(noise: FloatArray, learning: int) -> FloatArray:
    sensors = redundant_sensors(gyros_at_rest(noise), "gyro")
    return conditional_noise(sensors, learning, OnlineSettings()).variance[:, 0]


def _averaged(noise: FloatArray, *, robust: bool = False) -> FloatArray:
    return averaged_volatility(gyros_at_rest(noise), 50, causal=True, robust=robust).variance


def _outliers(
    noise: FloatArray, named: dict[str, FloatArray], learning: int, rng: np.random.Generator
) -> Numbers:
    """What one per cent of samples of ten times the size does to variances and fused rates."""
    dirty = noise.copy()
    dirty[rng.random(noise.shape[0]) < 0.01, 0, 0] *= 10.0
    weighings: tuple[Weights, ...] = ("equal", "ewma")
    worse = [fused_rate(dirty, w)[:, 0].std() / fused_rate(noise, w)[:, 0].std() for w in weighings]
    seen = _averaged(dirty)[learning:], _conditional(dirty, learning)[learning:]
    clean = named["averaged"], named["garch"]
    wave, held = noise[:, 0, 0], dirty[:, 0, 0]
    robust = [
        _averaged(dirty, robust=True)[learning:].mean() / clean[0].mean(),
        fit_garch(held[:learning], robust=True).conditional_variance(held)[learning:].mean()
        / fit_garch(wave[:learning]).conditional_variance(wave)[learning:].mean(),
    ]
    return numbers(
        outlier=[d.mean() / c.mean() for d, c in zip(seen, clean, strict=True)],
        fused_outlier=worse,
        robust=robust,
    )


def figure_14(results: Results, size: Size) -> Found:
    """GARCH against averaged volatility, and what each costs."""
    loss, seconds = stacked(results, "loss"), stacked(results, "seconds")
    values = {
        **plain(results, size).values,
        "averaged less garch": loss[:, 1] - loss[:, 0],
        "ewma less garch": loss[:, 2] - loss[:, 0],
        "cost": float(np.median(seconds[:, 0] / seconds[:, 1])),
    }
    first = results[0]
    panel = Panel(
        "Noise of the gyro that varies",
        "s",
        "rad/s",
        (
            Curve("true", first["time"], first["true"], "theory"),
            Curve("GARCH, unmixed", first["time"], first["garch"], "ours"),
            Curve("averaged volatility", first["time"], first["averaged"], "paper"),
        ),
        "Standard deviation over time by two methods, and the true one.",
    )
    return Found(values, panels=(panel,))
