"""Degrees of freedom and covariances against exact sums and against simulation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from schuler.curves.allan import allan_deviation
from schuler.curves.confidence import (
    allan_covariance,
    chi_square_bounds,
    local_slope,
    power_law_degrees_of_freedom,
)
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    Quantization,
    RandomWalk,
    WhiteNoise,
)


def dense_twin(process: Process, factors: list[int], samples: int) -> np.ndarray:
    """Relative covariance from the whole covariance matrix of theta (dt = 1, white/walk/q)."""
    k = np.arange(samples + 1)
    low = np.minimum(k[:, None], k[None, :]).astype(np.float64)
    theta = np.zeros((samples + 1, samples + 1))
    for part in process.components:
        if isinstance(part, WhiteNoise):
            theta += part.density**2 * low
        elif isinstance(part, Quantization):
            theta += part.step_density**2 * np.eye(samples + 1)
        elif isinstance(part, RandomWalk):
            # integrated Wiener process: s²(3t - s)/6 for s <= t
            high = np.maximum(k[:, None], k[None, :])
            theta += part.density**2 * low**2 * (3 * high - low) / 6.0
    operators = []
    for n in factors:
        rows = samples + 1 - 2 * n
        d = np.zeros((rows, samples + 1))
        i = np.arange(rows)
        d[i, i], d[i, i + n], d[i, i + 2 * n] = 1.0, -2.0, 1.0
        operators.append(d)
    out = np.empty((len(factors), len(factors)))
    for a, da in enumerate(operators):
        for b, db in enumerate(operators):
            cross = da @ theta @ db.T
            expected = np.trace(da @ theta @ da.T) * np.trace(db @ theta @ db.T)
            out[a, b] = 2.0 * np.sum(cross**2) / expected
    return out


@pytest.mark.parametrize(
    ("process", "rtol"),
    [
        (WhiteNoise(1.0), 1e-5),
        (Quantization(1.0), 1e-9),
        (WhiteNoise(1.0) + Quantization(0.7), 1e-5),
        # the walk's kinks are smooth: integral against sum differ by a part of 1/n²
        (RandomWalk(1.0), 0.12),
        (WhiteNoise(1.0) + RandomWalk(0.1) + Quantization(0.5), 2e-3),
    ],
    ids=["white", "quantization", "white+quantization", "walk", "all"],
)
def test_covariance_equals_the_dense_matrix(process: Process, rtol: float) -> None:
    factors = [1, 2, 3, 6, 13, 40]
    found = allan_covariance(process, np.array(factors), 120, 1.0)
    exact = dense_twin(process, factors, 120)
    np.testing.assert_allclose(np.diag(found), np.diag(exact), rtol=rtol)
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.abs((found - exact) / scale).max() < max(rtol, 1e-9)


def test_white_noise_at_one_sample_has_two_thirds_of_the_terms() -> None:
    n = 100_000
    freedom = power_law_degrees_of_freedom([-1.0], np.array([1]), n)
    assert freedom[0] == pytest.approx(2.0 * n / 3.0, rel=1e-4)


@pytest.mark.parametrize(
    "process",
    [
        WhiteNoise(1.0) + GaussMarkov(0.3, 60.0) + Quantization(1.5) + RandomWalk(0.01),
        WhiteNoise(0.2) + BiasInstability(1.0, 3.0, 3000.0),
    ],
    ids=["composite", "flicker"],
)
def test_covariance_is_what_simulations_scatter(process: Process) -> None:
    n, runs = 2000, 3000
    factors = np.array([5, 20, 100, 300, 600])
    rng = np.random.default_rng(1)
    signals = np.column_stack([process.simulate(n, 1.0, rng) for _ in range(runs)])
    variance = allan_deviation(signals, 1.0, factors).deviation ** 2
    relative = variance / process.allan_variance(factors)[:, None]
    found = np.cov(relative)
    claimed = allan_covariance(process, factors, n, 1.0)
    # relative sd of a variance over the runs, heavier tails at few degrees of freedom
    kurtosis = np.mean((relative.T - relative.mean(axis=1)) ** 4, axis=0) / np.diag(found) ** 2
    band = 4.5 * np.sqrt((kurtosis - 1.0) / runs)
    assert (np.abs(np.diag(found) / np.diag(claimed) - 1.0) < band).all()
    scale = np.sqrt(np.diag(claimed))
    correlation = found / np.outer(scale, scale)
    assert np.abs(correlation - claimed / np.outer(scale, scale)).max() < 0.2
    assert np.abs(found[0, 4]) / scale[0] / scale[4] < 0.12


def test_slow_gauss_markov_scatters_as_a_walk_and_fast_as_white_noise() -> None:
    factors = np.array([10, 100, 700])
    walk = allan_covariance(RandomWalk(1.0), factors, 2000, 1.0)
    slow = allan_covariance(GaussMarkov(1.0, 1e9), factors, 2000, 1.0)
    np.testing.assert_allclose(slow, walk, rtol=1e-4)
    white = allan_covariance(WhiteNoise(1.0), factors[1:], 2000, 1.0)
    fast = allan_covariance(GaussMarkov(1.0, 0.05), factors[1:], 2000, 1.0)
    # white samples against a continuous noise: a part of 1/n²
    np.testing.assert_allclose(fast, white, rtol=3e-3)


COVERED = [
    (WhiteNoise(1.0), 1),
    (BiasInstability(1.0, 1.0, 1e5), 40),
    (RandomWalk(1.0), 7),
    (Quantization(1.0), 1),
    (WhiteNoise(1.0) + RandomWalk(0.05), 1),
]


@pytest.mark.parametrize(("process", "first"), COVERED, ids=lambda p: getattr(p, "kind", str(p)))
def test_intervals_cover_at_short_and_at_long_tau(process: Process, first: int) -> None:
    n, runs = 3000, 500
    rng = np.random.default_rng(11)
    signals = np.column_stack([process.simulate(n, 1.0, rng) for _ in range(runs)])
    curve = allan_deviation(signals, 1.0)
    truth = np.sqrt(process.allan_variance(curve.tau))[:, None]
    shown = np.searchsorted(curve.tau, [first, 30, 100, 333])
    covered = np.mean((curve.lower <= truth) & (truth <= curve.upper), axis=1)[shown]
    # 95 %, give or take 4 sd of 500 runs, and a little for the noise type being estimated
    assert (covered > 0.95 - 4 * math.sqrt(0.95 * 0.05 / runs) - 0.015).all()
    # few clusters do not tell quantisation from white noise: there they are cautious
    assert (covered < 0.99).all() or process.kind == "quantization"


def test_bounds_are_those_of_the_chi_square() -> None:
    from scipy.stats import chi2

    nu = np.array([1.0, 7.3, 400.0])
    down, up = chi_square_bounds(nu)
    np.testing.assert_allclose(down, np.sqrt(nu / chi2.ppf(0.975, nu)), rtol=1e-10)
    np.testing.assert_allclose(up, np.sqrt(nu / chi2.ppf(0.025, nu)), rtol=1e-10)


def test_local_slope_of_power_laws() -> None:
    tau = np.geomspace(0.01, 100.0, 60)
    for power in (-2.0, -1.0, 0.0, 1.0):
        np.testing.assert_allclose(local_slope(tau, tau**power), power, atol=1e-9)
    np.testing.assert_array_equal(local_slope(tau[:1], tau[:1]), [-1.0])
    np.testing.assert_array_equal(local_slope(tau, np.zeros(60)), np.full(60, -1.0))


def test_degrees_of_freedom_exist_up_to_the_whole_record() -> None:
    factors = np.arange(1, 51)
    for slope in (-3.0, -2.0, -1.5, -0.4, 0.0, 0.7, 1.0, 2.5):
        freedom = power_law_degrees_of_freedom(np.full(50, slope), factors, 100)
        assert np.isfinite(freedom).all()
        assert (freedom > 0.9).all()
