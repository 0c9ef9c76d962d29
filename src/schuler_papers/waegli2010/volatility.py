"""Averaged volatilities: figures 7 and 8, equations (2) to (4)."""

from __future__ import annotations

import math

import numpy as np

from schuler import averaged_volatility
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
from schuler_papers.outcome import Curve, Panel, Proof, Role
from schuler_papers.waegli2010.fusion import RATE, gyros_at_rest
from schuler_papers.waegli2010.series import PAPER

HALF_WINDOWS = (5, 25, 125)
WINDOWS = (5, 25, 50, 125)
_AXES: tuple[Role, ...] = ("x", "y", "z")


def run(seed: int, size: Size) -> Numbers:
    """Average volatilities of constant noise and of a step, from residuals and from errors."""
    rng = generator(seed, PAPER, "volatility")
    n = 20_000 if size == "quick" else 60_000
    vectors = rng.standard_normal((n, 4, 3))
    residual = vectors - vectors.mean(axis=1, keepdims=True)
    return (
        _constant(vectors)
        | _step(vectors)
        | numbers(double_mean=np.abs(residual.mean(axis=1)).max())
        | _identity(rng)
    )


def _constant(vectors: FloatArray) -> Numbers:
    """Expectation and scatter by window, and the same window over the errors."""
    array, n = gyros_at_rest(vectors), vectors.shape[0]
    expectation = []
    for half in WINDOWS:
        inner = slice(half, n - half)
        found = [averaged_volatility(array, half, divisor=d) for d in ("paper", "unbiased")]
        expectation.append([f.variance[inner].mean() for f in found])
    scatter = [
        averaged_volatility(array, half).variance[half : n - half : 2 * half + 1].std()
        for half in HALF_WINDOWS
    ]
    # whose mean square the paper takes for the reference
    half = 50
    window = 2 * half + 1
    squares = (vectors**2).sum(axis=(1, 2))
    errors = np.convolve(squares, np.ones(window), "valid") / (3.0 * 4.0 * (window - 1.0))
    inner = slice(half, n - half)
    by_paper = averaged_volatility(array, half, divisor="paper").variance[inner]
    unbiased = averaged_volatility(array, half).variance[inner]
    honest = errors * (window - 1.0) / window
    return numbers(
        expectation=expectation,
        scatter=scatter,
        deviation_ratio=np.sqrt(by_paper.mean() / errors.mean()),
        unbiased_ratio=np.sqrt(unbiased.mean() / honest.mean()),
        by_paper=np.sqrt(by_paper[: 60 * 20 : 20]),
        by_errors=np.sqrt(errors[: 60 * 20 : 20]),
    )


def _step(vectors: FloatArray) -> Numbers:
    """How soon causal windows see a step of the noise level."""
    n = vectors.shape[0]
    level = np.where(np.arange(n) < n // 2, 1.0, 3.0)
    step = gyros_at_rest(vectors * level[:, None, None])
    moving = [averaged_volatility(step, h, causal=True).variance for h in HALF_WINDOWS]
    near = slice(n // 2 - 300, n // 2 + 600)
    return numbers(
        lags=[np.argmax(v[n // 2 - 1 :] > 5.0) / RATE for v in moving],
        step=[np.sqrt(v[near]) for v in moving],
        step_time=(np.arange(near.start, near.stop) - n // 2) / RATE,
        step_level=level[near],
    )


def _identity(rng: np.random.Generator) -> Numbers:
    """Both sides of (4), a thousand times."""
    identity = []
    for _ in range(1000):
        values, reference = rng.standard_normal(4), rng.standard_normal()
        x = values - values.mean()
        left = ((values - reference) ** 2).sum()
        right = (x**2).sum() + 4.0 * (values.mean() - reference) ** 2
        identity.append((abs(left - right) / left, left - (x**2).sum()))
    return numbers(
        identity=np.max([i[0] for i in identity]),
        smallest_excess=np.min([i[1] for i in identity]),
    )


def _proofs(results: Results) -> dict[str, Proof]:
    right = float(stacked(results, "expectation")[:, 2, 1].mean())
    return {
        "freedom": Proof(
            "with 3(2T+1)(n-1) degrees of freedom the same estimate is unbiased",
            right, 0.98, 1.02, "counter-experiment",
        ),
    }  # fmt: skip


def figure_7(results: Results, size: Size) -> Found:
    """Averaged volatility for several windows."""
    found = plain(results, size)
    law = np.sqrt(2.0 / (3.0 * (2.0 * np.array(HALF_WINDOWS) + 1.0) * 3.0))
    values = {
        **found.values,
        "scatter": stacked(results, "scatter") / law,
        "expectation": stacked(results, "expectation")[:, :, 0],
        "right": stacked(results, "expectation")[:, 2, 1],
        "double mean": float(stacked(results, "double_mean").max()),
    }
    first = results[0]
    curves = [
        Curve(f"T = {half}", first["step_time"], first["step"][k], role)
        for k, (half, role) in enumerate(zip(HALF_WINDOWS, _AXES, strict=True))
    ]
    curves.append(Curve("truth", first["step_time"], first["step_level"], "theory", "dash"))
    panel = Panel(
        "A step of the noise level, causal windows",
        "s after the step",
        "standard deviation",
        tuple(curves),
        "Averaged volatility after a step for three windows.",
    )
    return Found(values, proofs=_proofs(results), panels=(panel,))


def figure_8(results: Results, size: Size) -> Found:
    """Residuals against errors."""
    values = {
        **plain(results, size).values,
        "identity": float(stacked(results, "identity").max()),
        "smallest": float(stacked(results, "smallest_excess").min()),
    }
    first = results[0]
    time = np.arange(first["by_paper"].size) * 0.2
    right = first["by_paper"] * math.sqrt(100.0 / 101.0 * 4.0 / 3.0)
    panel = Panel(
        "Noise level of four gyros, T = 50",
        "s",
        "standard deviation, true one = 1",
        (
            Curve("from residuals, as in the paper", time, first["by_paper"], "paper"),
            Curve("from errors", time, first["by_errors"], "data"),
            Curve("residuals, right divisor", time, right, "ours"),
            Curve("truth", time, np.ones(time.size), "theory", "dash"),
        ),
        "Noise level over time from residuals and from errors.",
    )
    return Found(values, proofs=_proofs(results), panels=(panel,))
