"""GARCH that holds wild samples back, and several noises with correlations that change."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import schuler
from schuler.errors import InputError
from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.estimation.garch.dynamic_correlation import DccFit, fit_dcc
from schuler.estimation.garch.fit import fit_garch
from schuler.types import FloatArray

MEAN = np.array([[1.0, 0.5, 0.2], [0.5, 1.0, 0.3], [0.2, 0.3, 1.0]])
A, B = 0.04, 0.93


def drawn(n: int, seed: int) -> FloatArray:
    """Engle's equations one after the other."""
    rng = np.random.default_rng(seed)
    q, z, e, h = MEAN.copy(), np.zeros(3), np.zeros((n, 3)), np.ones(3)
    for t in range(n):
        if t:
            q = (1.0 - A - B) * MEAN + A * np.outer(z, z) + B * q
            h = 0.05 + 0.08 * e[t - 1] ** 2 + 0.87 * h
        d = np.sqrt(np.diag(q))
        z = np.linalg.cholesky(q / np.outer(d, d)) @ rng.standard_normal(3)
        e[t] = z * np.sqrt(h)
    return e - e.mean(axis=0)


@pytest.fixture(scope="module")
def fitted() -> tuple[FloatArray, DccFit]:
    e = drawn(2500, 7)
    return e, fit_dcc(e)


def test_equal_to_the_peer(fitted: tuple[FloatArray, DccFit]) -> None:
    _, fit = fitted
    # multiarch 0.2.0, DCC(e, mean="zero").fit(): its C has no unit diagonal
    assert fit.a == pytest.approx(0.0371705, abs=5e-6)
    assert fit.b == pytest.approx(0.9223043, abs=1e-5)
    assert fit.log_likelihood == pytest.approx(-9649.1364, abs=3e-3)


def test_likelihood_and_covariances_by_hand(fitted: tuple[FloatArray, DccFit]) -> None:
    e, fit = fitted
    h = np.array([g.conditional_variance(x, before=g.start_variance)
                  for x, g in zip(e.T, fit.garches, strict=True)]).T  # fmt: skip
    z = (e - [g.mean for g in fit.garches]) / np.sqrt(h)
    q, total = fit.correlation.copy(), 0.0
    covariances = fit.covariances(e)
    for t in range(len(e)):
        if t:
            last = np.outer(z[t - 1], z[t - 1])
            q = (1.0 - fit.a - fit.b) * fit.correlation + fit.a * last + fit.b * q
        d = np.sqrt(np.diag(q))
        covariance = q / np.outer(d, d) * np.sqrt(np.outer(h[t], h[t]))
        if t % 500 == 0:
            np.testing.assert_allclose(covariances[t], covariance, rtol=1e-9)
        total += float(multivariate_normal.logpdf(z[t] * np.sqrt(h[t]), cov=covariance))
    assert fit.log_likelihood == pytest.approx(total, abs=1e-6)


def test_truth_lies_within_the_errors_and_weights_give_the_least_variance() -> None:
    e = drawn(8000, 8)
    fit = fit_dcc(e)
    assert fit.converged
    assert abs(fit.a - A) < 3.5 * fit.standard_errors["a"]
    assert abs(fit.b - B) < 3.5 * fit.standard_errors["b"]
    weights = fit.weights(e)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    assert np.mean((weights * e).sum(axis=1) ** 2) < np.mean(e.mean(axis=1) ** 2)


def test_correlations_that_do_not_change_are_said_to() -> None:
    rng = np.random.default_rng(9)
    steady = rng.standard_normal((3000, 2)) @ np.linalg.cholesky(MEAN[:2, :2]).T
    fit = fit_dcc(steady)
    assert (fit.a, fit.b) == (0.0, 0.0)
    assert any("no changing correlation" in flag for flag in fit.flags)
    assert fit.correlations(steady)[-1, 0, 1] == pytest.approx(fit.correlation[0, 1])
    with pytest.raises(InputError, match="k two or more"):
        fit_dcc(steady[:, :1])


def test_knocks_move_neither_a_robust_fit_nor_its_variance() -> None:
    rng = np.random.default_rng(10)
    clean, _ = simulate_garch(20_000, 0.02, 0.05, 0.93, rng)
    struck = clean.copy()
    struck[rng.choice(clean.size, 60, replace=False)] += 30.0
    plain, robust, wanted = fit_garch(struck), fit_garch(struck, robust=True), fit_garch(clean)
    error = wanted.standard_errors["persistence"]
    assert abs(robust.persistence - wanted.persistence) < 2.0 * error
    assert abs(robust.alpha[0] - wanted.alpha[0]) < 3.0 * wanted.standard_errors["alpha_1"]
    assert abs(plain.alpha[0] - wanted.alpha[0]) > 6.0 * wanted.standard_errors["alpha_1"]
    assert any("held back" in flag for flag in robust.flags)
    truth = wanted.volatility(clean)
    # four deviations are what a knock may still do, and two of them may fall together
    assert np.abs(robust.volatility(struck) / truth - 1.0).max() < 0.8
    assert (plain.volatility(struck) / truth).max() > 3.0
    # where nothing is wild, nothing is lost
    same = fit_garch(clean, robust=True)
    assert same.values == pytest.approx(wanted.values, rel=0.1)


def test_robust_averaged_volatility_is_that_without_outliers() -> None:
    rng = np.random.default_rng(11)
    gyro = 1e-3 * rng.standard_normal((4000, 4, 3))
    struck = gyro.copy()
    rows = rng.choice(4000, 40, replace=False)
    struck[rows, 0, 0] += 1e-2
    struck[2000, 1, 2] += 0.5

    def level(vectors: FloatArray, robust: bool) -> FloatArray:
        array = schuler.ImuArray(
            np.arange(4000) / 100.0,
            vectors,
            np.tile((0.0, 0.0, -9.81), (4000, 4, 1)),
            schuler.Mounting.aligned(4),
        )
        return schuler.averaged_volatility(array, robust=robust).deviation

    clean = level(gyro, False)
    # a few in one window of 101 moments still count as four deviations each
    assert np.abs(level(struck, True) / clean - 1.0).max() < 0.06
    assert (level(struck, False) / clean).max() > 5.0
    np.testing.assert_allclose(level(gyro, True), clean, rtol=0.01)
