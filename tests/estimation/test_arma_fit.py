"""ARMA by exact maximum likelihood: the likelihood itself, estimates, errors, flags (spec 5.1)."""

from __future__ import annotations

import importlib
import json
import math
import warnings

import numpy as np
import pytest

from schuler.errors import EstimationError, InputError
from schuler.estimation.arma.fit import ArmaFit, fit_arma
from schuler.estimation.arma.likelihood import innovations, likelihood
from schuler.estimation.arma.selection import select_arma
from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.noise import GaussMarkov, WhiteNoise
from schuler.noise.arma import ARMA
from schuler.noise.arma_exchange import gauss_markov_sum_to_arma

TABLE_1 = ARMA((1.666, -0.671), (-1.086, 0.160), 1.0, 0.01)
TRUTH = {"phi_1": 1.666, "phi_2": -0.671, "theta_1": -1.086, "theta_2": 0.160}


def w2() -> np.ndarray:
    """360 000 samples, as the stored reference was made."""
    e = np.random.default_rng(1).standard_normal(361_000)
    return TABLE_1.respond_to(e)[1000:]


@pytest.fixture(scope="module")
def long_fit() -> ArmaFit:
    return fit_arma(w2(), 2, 2, rate=100.0)


@pytest.mark.parametrize(
    ("phi", "theta"),
    [
        ((1.666, -0.671), (-1.086, 0.160)),
        ((0.999,), ()),
        ((), (0.9, 0.4, -0.2)),
        ((0.4,), (0.3, -0.2, 0.1, 0.2)),
        ((0.3, 0.1, -0.2, 0.1, 0.2), (0.5,)),
        ((0.5,), (0.2, 0.1, 0.1, 0.1, 0.1, 0.3)),
        ((1.2, -0.95), (-0.999,)),
    ],
)
def test_likelihood_is_the_multivariate_normal_density(
    phi: tuple[float, ...], theta: tuple[float, ...]
) -> None:
    from scipy.linalg import cho_factor, cho_solve, toeplitz

    n = 60
    process = ARMA(phi, theta, 1.0, 1.0)
    x = np.random.default_rng(2).standard_normal(n) * 2.0 + 0.7
    coefficients = np.array([*phi, *theta])
    covariance = toeplitz(process.autocovariance(np.arange(n)))
    factor = cho_factor(covariance, lower=True)
    # mean and variance at their best, in closed form
    one = np.ones(n)
    mean = (one @ cho_solve(factor, x)) / (one @ cho_solve(factor, one))
    variance = (x - mean) @ cho_solve(factor, x - mean) / n
    log_determinant = 2.0 * np.log(np.diag(factor[0])).sum()
    expected = -0.5 * (n * math.log(2.0 * math.pi * variance) + log_determinant + n)
    found = likelihood(x, coefficients, len(phi))
    assert found.value == pytest.approx(expected, rel=1e-9)
    assert found.mean == pytest.approx(mean, rel=1e-8, abs=1e-10)
    assert found.variance == pytest.approx(variance, rel=1e-9)
    # innovations are uncorrelated by construction: L^-1 x
    whitened = np.linalg.solve(np.tril(factor[0]), x - mean)
    residual = innovations(x - mean, coefficients, len(phi)).residual
    np.testing.assert_allclose(residual, whitened, atol=1e-8 * np.abs(whitened).max())


def test_equal_to_statsmodels_on_the_long_load(long_fit: ArmaFit) -> None:
    # statsmodels 0.15.0: ARIMA(x, order=(2, 0, 2), trend="c").fit() for the likelihood and the
    # errors (62 s), .fit(method="innovations_mle") for the estimates (14 s), whose optimiser
    # stops a little closer to the maximum
    names = ("mean", "phi_1", "phi_2", "theta_1", "theta_2", "innovation_variance")
    errors = (
        0.02512765457170119,
        0.003999885148817106,
        0.0038762043680249814,
        0.004497984081406078,
        0.003209601785892005,
        0.0023372540076079854,
    )
    estimates = (
        -0.040048376537872174,
        1.6672159866783351,
        -0.6720439287907647,
        -1.0894050541131717,
        0.16229942015708398,
        0.9975173971434287,
    )
    for name, error, estimate in zip(names, errors, estimates, strict=True):
        assert long_fit.standard_errors[name] == pytest.approx(error, rel=1e-3)
        assert abs(long_fit.values[name] - estimate) < 1e-3 * error
    # not below the likelihood that statsmodels reached
    assert long_fit.log_likelihood > -510371.13704701804
    assert long_fit.log_likelihood == pytest.approx(-510371.13668833, abs=1e-4)
    assert long_fit.converged
    assert long_fit.flags == ()


def test_long_load_is_recovered_where_hannan_rissanen_is_nine_errors_off(
    long_fit: ArmaFit,
) -> None:
    for name, value in TRUTH.items():
        assert abs(long_fit.values[name] - value) < 3.0 * long_fit.standard_errors[name]
    assert long_fit.innovation_variance == pytest.approx(1.0, abs=3.0 * math.sqrt(2.0 / 360_000))
    np.testing.assert_allclose(long_fit.poles.real, [0.98429, 0.68171], atol=0.008)


@pytest.mark.parametrize(("p", "q"), [(2, 2), (1, 0), (0, 2), (1, 1), (3, 1)])
def test_slope_of_the_peer_is_zero_at_our_estimate(p: int, q: int) -> None:
    arima = importlib.import_module("statsmodels.tsa.arima.model")
    x = TABLE_1.simulate(1500, 0.01, np.random.default_rng(5)) + 3.0
    ours = fit_arma(x, p, q)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = arima.ARIMA(x, order=(p, 0, q), trend="c")
        parameters = np.array(
            [ours.mean, *ours.phi, *ours.theta, ours.innovation_variance], dtype=np.float64
        )
        assert model.loglike(parameters) == pytest.approx(ours.log_likelihood, abs=1e-7)
        # the peer gives the information of one sample
        information = model.opg_information_matrix(parameters, transformed=True) * x.size
        score = model.score(parameters, transformed=True)
    covariance = np.linalg.inv(information)
    errors = np.sqrt(np.diag(covariance))
    # one Newton step from ours, in standard errors
    assert np.all(np.abs(covariance @ score) < 1e-3 * errors)
    names = ["mean", *(f"phi_{i + 1}" for i in range(p)), *(f"theta_{j + 1}" for j in range(q))]
    mine = [ours.standard_errors[name] for name in [*names, "innovation_variance"]]
    np.testing.assert_allclose(mine, errors, rtol=1e-3)


def test_two_kinds_of_errors_agree_on_gaussian_noise(long_fit: ArmaFit) -> None:
    x = w2()[:60_000]
    product = fit_arma(x, 2, 2)
    information = fit_arma(x, 2, 2, errors="information")
    for name, error in information.standard_errors.items():
        assert product.standard_errors[name] == pytest.approx(error, rel=0.05)
        assert product.robust_standard_errors[name] == pytest.approx(error, rel=0.05)
    # errors shrink with the root of the length
    for name in TRUTH:
        ratio = product.standard_errors[name] / long_fit.standard_errors[name]
        assert ratio == pytest.approx(math.sqrt(6.0), rel=0.1)


def test_coverage_of_the_intervals() -> None:
    # S000 (11): asymptotic normality; p + q + 2 parameters
    rng = np.random.default_rng(30)
    count, inside = 150, dict.fromkeys([*TRUTH, "mean", "innovation_variance"], 0)
    truth = {**TRUTH, "mean": 0.5, "innovation_variance": 1.0}
    for _ in range(count):
        fit = fit_arma(TABLE_1.simulate(6000, 0.01, rng) + 0.5, 2, 2)
        assert fit.converged
        for name in inside:
            error = abs(fit.values[name] - truth[name])
            inside[name] += error < 1.96 * fit.standard_errors[name]
    assert fit.covariance.shape == (6, 6)
    for name, hits in inside.items():
        assert 0.90 <= hits / count <= 0.985, name


def test_never_below_the_likelihood_of_the_truth() -> None:
    # random roots, slow and fast, real and complex: no start is stuck on a false maximum
    rng = np.random.default_rng(60)

    def polynomial(order: int) -> np.ndarray:
        roots: list[complex] = []
        while len(roots) < order:
            radius = 1.0 - 10.0 ** rng.uniform(-2.3, -0.1)
            if order - len(roots) >= 2 and rng.random() < 0.5:
                turn = np.exp(1j * rng.uniform(0.1, 3.0))
                roots += [radius * turn, radius / turn]
            else:
                roots.append(radius * rng.choice([-1.0, 1.0]))
        return np.poly(roots).real[1:] if order else np.zeros(0)

    for _ in range(60):
        p, q = (int(v) for v in rng.integers(0, 4, 2))
        phi, theta = -polynomial(p), polynomial(q)
        x = ARMA(tuple(phi), tuple(theta), 1.0, 1.0).simulate(2500, 1.0, rng)
        x /= x.std()
        fit = fit_arma(x, p, q)
        truth = likelihood(x - x.mean(), np.concatenate([phi, theta]), p).value
        gain = fit.log_likelihood - truth
        # half a chi-square with p + q degrees of freedom: 99.99 % of six are below 14
        assert -1e-6 <= gain < 14.0


def test_robust_errors_hold_where_the_variance_changes() -> None:
    # E-000-12: GARCH innovations widen the scatter beyond what the Gaussian information says
    rng = np.random.default_rng(31)
    estimates, plain, robust = [], [], []
    for _ in range(120):
        e, _ = simulate_garch(5200, 0.02, 0.15, 0.83, rng)
        fit = fit_arma(ARMA((0.8,), (), 1.0, 1.0).respond_to(e)[200:], 1, 0, errors="information")
        estimates.append(fit.phi[0])
        plain.append(fit.standard_errors["phi_1"])
        robust.append(fit.robust_standard_errors["phi_1"])
    scatter = np.std(estimates)
    # the scatter of 120 draws is known to 6.5 %
    assert np.mean(robust) == pytest.approx(scatter, rel=0.25)
    assert np.mean(plain) < 0.8 * scatter
    assert any(flag.startswith("changing variance") for flag in fit.flags)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_scale_and_offset(scale: float) -> None:
    x = TABLE_1.simulate(4000, 0.01, np.random.default_rng(32)) + 5.0
    one, other = fit_arma(x, 2, 2), fit_arma(scale * x, 2, 2)
    np.testing.assert_allclose(other.phi, one.phi, rtol=1e-5)
    assert other.mean == pytest.approx(scale * one.mean, rel=1e-6)
    assert other.constant == pytest.approx(other.mean * (1.0 - other.phi.sum()))
    assert other.innovation_variance == pytest.approx(scale**2 * one.innovation_variance, rel=1e-6)
    shift = x.size * math.log(scale)
    assert other.log_likelihood + shift == pytest.approx(one.log_likelihood, abs=1e-5)
    assert other.converged


def test_prediction_uses_the_past_only() -> None:
    x = TABLE_1.simulate(3000, 0.01, np.random.default_rng(33)) + 1.0
    fit = fit_arma(x, 2, 2)
    residual = fit.residuals(x)
    np.testing.assert_allclose(fit.predict(x) + residual, x, atol=1e-12)
    changed = x.copy()
    changed[2000:] += 100.0
    np.testing.assert_allclose(fit.predict(changed)[:2001], fit.predict(x)[:2001], atol=1e-12)
    assert residual[100:].var() == pytest.approx(fit.innovation_variance, rel=0.02)
    # nobody predicts better than the floor
    assert residual.var() > 0.98 * fit.process.innovation_variance(1.0)


def test_process_draws_what_was_fitted(long_fit: ArmaFit) -> None:
    assert long_fit.process.interval == 0.01
    x = w2()
    lags = np.arange(0, 200, 20)
    sample = np.array([np.mean(x[: x.size - k] * x[k:]) for k in lags])
    model = long_fit.process.autocovariance(lags * 0.01)
    # correlated over 63 samples: about 360 000/130 independent ones
    assert np.all(np.abs(sample - model) < 4.0 * model[0] * math.sqrt(2.0 * 130.0 / 360_000))


def test_orders_are_found() -> None:
    # AIC picks (2, 2) or a neighbour, BIC the truth where the record is long
    picked_aic, picked_bic = [], []
    for seed in range(6):
        x = TABLE_1.simulate(30_000, 0.01, np.random.default_rng(40 + seed))
        fit = select_arma(x, 3, 3)
        picked_aic.append(fit.order)
        allowed = [c for c in fit.candidates if not c.rejected]
        best = min(allowed, key=lambda c: c.bic)
        picked_bic.append((best.p, best.q))
        assert len(fit.candidates) == 16
        assert min(c.aic for c in allowed) == pytest.approx(fit.aic, abs=0.05)
        # a larger model never has the lower likelihood
        value = {(c.p, c.q): c.log_likelihood for c in fit.candidates}
        for (p, q), higher in value.items():
            for smaller in ((p - 1, q), (p, q - 1)):
                assert higher >= value.get(smaller, -math.inf) - 0.02
    near = {(2, 2), (2, 1), (1, 2), (2, 3), (3, 2), (3, 1)}
    assert sum(order in near for order in picked_aic) >= 5
    assert sum(order in near for order in picked_bic) == 6
    assert picked_bic.count((2, 2)) >= 4


def test_white_noise_needs_no_model() -> None:
    x = np.random.default_rng(50).standard_normal(5000)
    assert select_arma(x, 2, 2, criterion="bic").order == (0, 0)
    fit = fit_arma(x, 1, 1)
    assert any(f.startswith(("common factor", "not identified")) for f in fit.flags) or (
        abs(fit.poles[0] - fit.zeros[0]) > 0.02
    )
    flat = fit_arma(x, 0, 0)
    assert flat.innovation_variance == pytest.approx(x.var(), rel=1e-9)
    assert flat.mean == pytest.approx(x.mean(), abs=1e-12)


def test_common_factor_is_said_and_a_slow_bias_is_not_one() -> None:
    twin = ARMA((0.9, -0.14), (-0.7,), 1.0, 1.0)  # (1 - 0.7 B)(1 - 0.2 B) over (1 - 0.7 B)
    x = twin.simulate(20_000, 1.0, np.random.default_rng(51))
    fits = [fit_arma(x, 2, 1), select_arma(x, 2, 1)]
    assert any("reduces to ARMA(1, 0)" in f for f in fits[0].flags) or (
        min(abs(fits[0].poles - fits[0].zeros[0])) > 0.02
    )
    assert fits[1].order in {(1, 0), (0, 1)}
    # pole 0.998 and zero 0.98 under white noise: nearly the same, and worth a lot of likelihood
    slow = gauss_markov_sum_to_arma(WhiteNoise(1.0) + GaussMarkov(0.2, 500.0), 1.0)
    assert abs(slow.poles[0] - slow.zeros[0]) < 0.02
    y = slow.simulate(60_000, 1.0, np.random.default_rng(52))
    fit = fit_arma(y, 1, 1)
    assert not any("common factor" in f for f in fit.flags)
    assert fit.converged
    assert -1.0 / math.log(fit.poles[0].real) == pytest.approx(500.0, rel=0.4)


def test_complex_poles_near_the_circle() -> None:
    radius, angle = 0.9995, 0.3
    phi = (2.0 * radius * math.cos(angle), -(radius**2))
    x = ARMA(phi, (), 1.0, 1.0).simulate(20_000, 1.0, np.random.default_rng(53))
    fit = fit_arma(x, 2, 0)
    assert fit.converged
    assert abs(fit.poles[0]) == pytest.approx(radius, abs=4.0 * math.sqrt((1 - radius) / 20_000))
    assert abs(np.angle(fit.poles[0])) == pytest.approx(angle, abs=1e-3)


@pytest.mark.parametrize("kind", ["ramp", "walk", "noisy ramp"])
def test_what_is_not_stationary_is_said(kind: str) -> None:
    rng = np.random.default_rng(54)
    n = 4000
    x = {
        "ramp": np.arange(n, dtype=float),
        "walk": np.cumsum(rng.standard_normal(n)),
        "noisy ramp": np.arange(n) * 0.01 + rng.standard_normal(n),
    }[kind]
    for p, q in ((1, 0), (1, 1), (2, 1)):
        fit = fit_arma(x, p, q)
        said = ("unit root", "correlation left") if (p, q) == (1, 0) else ("unit root",)
        assert any(f.startswith(said) for f in fit.flags), (p, q)
        assert np.all(np.abs(fit.poles) < 1.0)
        assert json.dumps(fit.to_dict(), allow_nan=False)


def test_a_ramp_that_is_foreseen_without_error_is_refused() -> None:
    with pytest.raises(EstimationError, match="not noise"):
        fit_arma(np.arange(700.0), 5, 1)


def test_over_differenced_noise_is_said() -> None:
    x = np.diff(np.random.default_rng(55).standard_normal(3000))
    fit = fit_arma(x, 0, 1)
    assert fit.theta[0] == pytest.approx(-1.0, abs=1e-3)
    assert any(f.startswith("unit zero") for f in fit.flags)
    assert not fit.converged


def test_one_wild_sample_is_said() -> None:
    x = TABLE_1.simulate(3000, 0.01, np.random.default_rng(56))
    x[1234] = 1e6
    fit = fit_arma(x, 2, 2)
    assert any(f.startswith("outlier: row 1234") for f in fit.flags)


def test_correlation_left_is_said() -> None:
    x = TABLE_1.simulate(20_000, 0.01, np.random.default_rng(57))
    assert any(f.startswith("correlation left") for f in fit_arma(x, 1, 0).flags)
    assert not any(f.startswith("correlation left") for f in fit_arma(x, 2, 2).flags)


def test_bad_input() -> None:
    x = np.random.default_rng(58).standard_normal(500)
    for broken in (np.nan, np.inf):
        with pytest.raises(InputError, match="row 7"):
            fit_arma(np.where(np.arange(500) == 7, broken, x), 1, 1)
    with pytest.raises(EstimationError, match="does not vary"):
        fit_arma(np.full(500, 9.81), 1, 1)
    with pytest.raises(EstimationError, match="20 samples"):
        fit_arma(x[:20], 2, 2)
    with pytest.raises(InputError, match="shape"):
        fit_arma(x.reshape(250, 2), 1, 1)
    with pytest.raises(InputError, match="orders"):
        fit_arma(x, -1, 1)
    with pytest.raises(InputError, match="errors"):
        fit_arma(x, 1, 1, errors="wrong")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="criterion"):
        select_arma(x, 1, 1, criterion="hqc")  # type: ignore[arg-type]


def test_dictionary_is_json(long_fit: ArmaFit) -> None:
    told = json.loads(json.dumps(long_fit.to_dict(), allow_nan=False))
    assert told["parameters"]["phi_1"]["value"] == pytest.approx(long_fit.phi[0])
    assert told["parameters"]["phi_1"]["t_value"] == pytest.approx(
        long_fit.phi[0] / long_fit.standard_errors["phi_1"]
    )
    assert told["converged"] is True
