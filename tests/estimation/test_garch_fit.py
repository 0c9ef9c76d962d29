"""GARCH by quasi maximum likelihood: likelihood, scaling, errors, coverage, flags (spec 5.2)."""

from __future__ import annotations

import importlib
import json
import math
import warnings

import numpy as np
import pytest

from schuler.errors import InputError, ModelError
from schuler.estimation.garch.arma_garch import fit_arma_garch
from schuler.estimation.garch.conditional_variance import (
    backcast,
    ewma_variance,
    garch_conditional_variance,
    garch_log_likelihood,
    simulate_garch,
)
from schuler.estimation.garch.fit import GarchFit, fit_garch
from schuler.estimation.garch.likelihood import garch_slopes
from schuler.estimation.garch.selection import select_garch
from schuler.kernels.noise.garch import arma_garch_slopes
from schuler.noise.arma import ARMA

W3 = {"alpha0": 1.3e-7, "alpha_1": 0.0175, "beta_1": 0.98}


def w3() -> np.ndarray:
    """360 000 samples in rad/s, nearly integrated, as the peers were measured on."""
    return simulate_garch(360_000, 1.3e-7, 0.0175, 0.98, np.random.default_rng(3))[0]


@pytest.fixture(scope="module")
def long_fit() -> GarchFit:
    return fit_garch(w3(), mean="zero", rate=100.0)


def written_out(e: np.ndarray, a0: float, alpha: list[float], beta: list[float]) -> float:
    """The log likelihood as the definition has it."""
    weight = 0.94 ** np.arange(75)
    before = float(np.sum(weight * e[:75] ** 2) / weight.sum())
    variance: list[float] = []
    total = 0.0
    for t in range(e.size):
        s = a0
        for i, a in enumerate(alpha, 1):
            s += a * (e[t - i] ** 2 if t >= i else before)
        for j, b in enumerate(beta, 1):
            s += b * (variance[t - j] if t >= j else before)
        variance.append(s)
        total -= 0.5 * (math.log(2.0 * math.pi) + math.log(s) + e[t] ** 2 / s)
    return total


@pytest.mark.parametrize(
    ("alpha", "beta"),
    [([0.05], [0.9]), ([0.05, 0.1], [0.3, 0.4]), ([0.3], []), ([0.1, 0.05], [0.5])],
)
def test_likelihood_by_definition_and_by_arch(alpha: list[float], beta: list[float]) -> None:
    e = simulate_garch(900, 0.05, 0.05, 0.90, np.random.default_rng(1))[0]
    found = garch_log_likelihood(e, 0.04, alpha, beta)
    assert found == pytest.approx(written_out(e, 0.04, alpha, beta), abs=1e-9)
    univariate = importlib.import_module("arch.univariate")
    model = univariate.ZeroMean(e, rescale=False)
    model.volatility = univariate.GARCH(p=len(alpha), q=len(beta))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = model.fix([0.04, *alpha, *beta]).loglikelihood
    assert found == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize(("p", "q"), [(1, 1), (2, 1), (1, 2), (2, 0)])
def test_gradient_and_information(p: int, q: int) -> None:
    e = simulate_garch(4000, 0.05, 0.05, 0.90, np.random.default_rng(2))[0]
    evaluate = garch_slopes(e, p, q, backcast(e))
    here = np.array([0.2, *[0.06 / p] * p, *[0.7 / max(q, 1)] * q])
    outer = np.zeros((here.size, here.size))
    _, gradient, information = evaluate(here, outer)
    none = np.zeros((0, 0))
    for k in range(here.size):
        step = np.zeros(here.size)
        step[k] = 1e-6
        slope = (evaluate(here + step, none)[0] - evaluate(here - step, none)[0]) / 2e-6
        assert gradient[k] == pytest.approx(slope, rel=1e-5, abs=1e-3)
    assert np.all(np.linalg.eigvalsh(information) > 0.0)
    assert np.trace(outer) > 0.0


def test_joint_gradient_and_information() -> None:
    x = ARMA((0.6, 0.2), (0.3, 0.1), 1.0, 1.0).respond_to(
        simulate_garch(3000, 0.05, 0.05, 0.90, np.random.default_rng(4))[0]
    )
    here = np.array([0.1, 0.5, 0.2, 0.3, 0.1, 0.1, 0.06, 0.03, 0.7])
    k = here.size

    def evaluate(u: np.ndarray) -> tuple[float, np.ndarray]:
        score, information, outer = np.empty(k), np.empty((k, k)), np.empty((k, k))
        work = np.empty((2, x.size))
        value = arma_garch_slopes(x, u, (2, 2, 2, 1), 1.0, score, information, outer, work)
        assert np.all(np.linalg.eigvalsh(information) > 0.0)
        return value, score

    gradient = evaluate(here)[1]
    for m in range(k):
        step = np.zeros(k)
        step[m] = 1e-6
        slope = (evaluate(here + step)[0] - evaluate(here - step)[0]) / 2e-6
        assert gradient[m] == pytest.approx(slope, rel=1e-5, abs=1e-3)


def test_long_load_in_rad_per_second(long_fit: GarchFit) -> None:
    e = w3()
    assert long_fit.converged
    assert long_fit.method == "maximum likelihood"
    # at least the likelihood of the truth, and no more above it than chance gives (chi-square 3)
    gain = long_fit.log_likelihood - garch_log_likelihood(e, 1.3e-7, 0.0175, 0.98)
    assert 0.0 <= gain < 8.2
    for name, value in W3.items():
        assert abs(long_fit.values[name] - value) < 3.0 * long_fit.standard_errors[name]
    # every start ended at the same place of the middle part
    assert np.ptp([s.log_likelihood for s in long_fit.starts]) < 1e-2
    assert all(s.converged for s in long_fit.starts)
    assert long_fit.persistence == pytest.approx(0.9975, abs=6e-4)
    assert long_fit.half_life == pytest.approx(math.log(0.5) / math.log(long_fit.persistence))
    assert math.sqrt(long_fit.unconditional_variance) == pytest.approx(0.0072, rel=0.05)
    assert long_fit.process.density == pytest.approx(
        math.sqrt(long_fit.unconditional_variance / 100.0)
    )
    assert long_fit.log_likelihood == pytest.approx(
        garch_log_likelihood(e, long_fit.alpha0, long_fit.alpha, long_fit.beta), abs=1e-5
    )


def test_equal_to_arch_started_at_the_truth() -> None:
    # arch 8.0 finds the maximum on data of unit variance when it starts beside it
    arch = importlib.import_module("arch")
    e = simulate_garch(8000, 0.01, 0.05, 0.90, np.random.default_rng(5))[0]
    ours = fit_garch(e, mean="zero")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model = arch.arch_model(e, mean="Zero", rescale=False)
        theirs = model.fit(
            disp="off", starting_values=np.array([0.01, 0.05, 0.9]), options={"ftol": 1e-14}
        )
    assert ours.log_likelihood >= theirs.loglikelihood - 1e-7
    for name, value, error in zip(
        ("alpha0", "alpha_1", "beta_1"), theirs.params, theirs.std_err, strict=True
    ):
        assert abs(ours.values[name] - value) < 0.02 * error
        # both are QMLE sandwiches; second derivatives differ by how they are taken
        assert ours.standard_errors[name] == pytest.approx(error, rel=0.01)


@pytest.mark.parametrize("scale", [1e-12, 1e-3, 1e12])
def test_scale_does_not_matter(scale: float) -> None:
    e = simulate_garch(5000, 0.01, 0.05, 0.90, np.random.default_rng(6))[0]
    one, other = fit_garch(e), fit_garch(scale * e)
    assert other.alpha0 == pytest.approx(scale**2 * one.alpha0, rel=1e-6)
    assert other.alpha[0] == pytest.approx(one.alpha[0], rel=1e-6)
    assert other.standard_errors["beta_1"] == pytest.approx(one.standard_errors["beta_1"], rel=1e-4)
    assert other.log_likelihood + e.size * math.log(scale) == pytest.approx(
        one.log_likelihood, abs=1e-6
    )
    assert other.converged


def test_means_and_coverage() -> None:
    # S000 (8): p + q + 1 = 3 parameters; 120 of the 200 seeds of benchmarks/garch_coverage.py
    truth = {"alpha0": 0.01, "alpha_1": 0.05, "beta_1": 0.90}
    rng = np.random.default_rng(7)
    count = 120
    values: dict[str, list[float]] = {name: [] for name in truth}
    inside = dict.fromkeys(truth, 0)
    for _ in range(count):
        fit = fit_garch(simulate_garch(20_000, 0.01, 0.05, 0.90, rng)[0], mean="zero")
        assert fit.converged
        for name, value in truth.items():
            values[name].append(fit.values[name])
            inside[name] += abs(fit.values[name] - value) < 1.96 * fit.standard_errors[name]
    assert fit.covariance.shape == (3, 3)
    for name in truth:
        assert 0.88 <= inside[name] / count <= 0.99, name
        scatter = np.std(values[name]) / math.sqrt(count)
        bias = np.mean(values[name]) - truth[name]
        assert abs(bias) < 0.02 * truth[name] + 2.0 * scatter, name
    # the unconditional variance is 0.2
    assert np.mean(values["alpha_1"]) == pytest.approx(0.05, rel=0.02)
    assert np.mean(values["beta_1"]) == pytest.approx(0.90, rel=0.02)


def test_nearly_integrated_truth_of_table_2() -> None:
    rng = np.random.default_rng(8)
    alphas, persistences, significant = [], [], 0
    count = 30
    for _ in range(count):
        fit = fit_garch(simulate_garch(60_000, 1.3e-7, 0.0175, 0.982, rng)[0], mean="zero")
        assert fit.converged
        alphas.append(fit.alpha[0])
        persistences.append(fit.persistence)
        significant += fit.t_values["alpha_1"] > 3.0
        assert fit.log_likelihood > -math.inf
    assert np.mean(np.abs(np.array(alphas) - 0.0175) < 0.004) >= 0.9
    assert np.mean(np.array(persistences) > 0.997) >= 0.9
    assert significant == count


def test_errors_hold_for_heavy_tails() -> None:
    # Student noise with 8 degrees of freedom: the Gaussian information alone is too optimistic
    rng = np.random.default_rng(9)
    estimates, errors = [], []
    for _ in range(100):
        z = rng.standard_t(8.0, 6200) / math.sqrt(8.0 / 6.0)
        e, s = np.empty(z.size), 1.0
        for t in range(z.size):
            e[t] = z[t] * math.sqrt(s)
            s = 0.05 + 0.10 * e[t] ** 2 + 0.85 * s
        fit = fit_garch(e[200:], mean="zero")
        estimates.append(fit.alpha[0])
        errors.append(fit.standard_errors["alpha_1"])
    # the scatter of 100 draws is known to 7 %
    assert np.median(errors) == pytest.approx(np.std(estimates), rel=0.25)


def test_variance_targeting() -> None:
    rng = np.random.default_rng(10)
    scatter, errors, variance_errors, variances = [], [], [], []
    for _ in range(80):
        e = simulate_garch(6000, 0.01, 0.05, 0.90, rng)[0]
        fit = fit_garch(e, mean="zero", variance_targeting=True)
        assert fit.method == "variance targeting"
        assert fit.unconditional_variance == pytest.approx(np.mean(e**2), rel=1e-9)
        full = fit_garch(e, mean="zero")
        assert full.log_likelihood >= fit.log_likelihood - 1e-8
        scatter.append([fit.alpha0, fit.alpha[0], fit.beta[0]])
        errors.append([fit.standard_errors[k] for k in ("alpha0", "alpha_1", "beta_1")])
        loss = 1.0 - fit.persistence
        slope = np.array([1.0 / loss, fit.alpha0 / loss**2, fit.alpha0 / loss**2])
        variance_errors.append(math.sqrt(slope @ fit.covariance @ slope))
        variances.append(fit.unconditional_variance)
    np.testing.assert_allclose(np.median(errors, axis=0), np.std(scatter, axis=0), rtol=0.3)
    # the error of the sample variance itself, correlation of the squares included
    assert np.median(variance_errors) == pytest.approx(np.std(variances), rel=0.25)


def test_changing_variance_is_gone_after_the_fit() -> None:
    rng = np.random.default_rng(11)
    gone = 0
    for _ in range(25):
        fit = fit_garch(simulate_garch(8000, 0.01, 0.08, 0.88, rng)[0])
        assert fit.before is not None
        assert fit.after is not None
        assert fit.before.arch_lm.p_value < 1e-3
        gone += fit.after.arch_lm.p_value > 0.01
    assert gone >= 23


def test_mean_and_variance_of_z_do_not_choose_a_model() -> None:
    # E-000-8: a wrong model gives mean 0 and variance 1 as well; ARCH-LM tells
    e = simulate_garch(20_000, 0.01, 0.10, 0.88, np.random.default_rng(12))[0]
    wrong = fit_garch(e, 1, 0)
    z = wrong.standardized_residuals(e)
    assert abs(z.mean()) < 0.02
    assert z.var() == pytest.approx(1.0, abs=0.02)
    assert wrong.after is not None
    assert wrong.after.arch_lm.p_value < 1e-6
    assert any(f.startswith("changing variance left") for f in wrong.flags)


def test_variances_come_from_the_past_alone(long_fit: GarchFit) -> None:
    e, true = simulate_garch(5000, 1.3e-7, 0.0175, 0.98, np.random.default_rng(13))
    variance = long_fit.conditional_variance(e)
    changed = e.copy()
    changed[3000:] *= 50.0
    other = long_fit.conditional_variance(changed)
    np.testing.assert_array_equal(other[:3001], variance[:3001])
    assert other[3001] > 2.0 * variance[3001]
    assert variance[0] == pytest.approx(long_fit.unconditional_variance, rel=1e-9)
    # Fig 12 of S000: it follows the true variance
    assert np.corrcoef(np.log(variance), np.log(true))[0, 1] > 0.9
    np.testing.assert_allclose(long_fit.volatility(e) ** 2, variance, rtol=1e-12)


def test_forecast_starts_at_the_next_variance_and_ends_at_the_mean_one(long_fit: GarchFit) -> None:
    e = simulate_garch(2000, 1.3e-7, 0.0175, 0.98, np.random.default_rng(14))[0]
    ahead = long_fit.forecast(e, 6000)
    longer = long_fit.conditional_variance(np.append(e, 0.0))
    assert ahead[0] == pytest.approx(longer[-1], rel=1e-12)
    mean = long_fit.unconditional_variance
    expected = mean + (ahead[0] - mean) * long_fit.persistence ** np.arange(6000)
    np.testing.assert_allclose(ahead, expected, rtol=1e-9)


def test_variance_dies_without_alpha0() -> None:
    # E-000-9: the equation as quoted, without its constant
    rng = np.random.default_rng(15)
    z = rng.standard_normal(50_000)
    s = 2.6e-4
    for value in z:
        s = 0.0175 * value**2 * s + 0.982 * s
    assert s < 1e-12
    with pytest.raises(ModelError, match="alpha0"):
        garch_log_likelihood(np.zeros(3000), 0.0, 0.5, 0.0)


def test_simulation_has_the_unconditional_variance_and_kurtosis() -> None:
    noise, variance = simulate_garch(400_000, 0.05, 0.10, 0.80, np.random.default_rng(16))
    assert noise.var() == pytest.approx(0.5, rel=0.02)
    assert variance.mean() == pytest.approx(0.5, rel=0.02)
    kurtosis = np.mean(noise**4) / np.mean(noise**2) ** 2
    # 3 (1 - P²)/(1 - P² - 2 alpha²)
    assert kurtosis == pytest.approx(3.0 * (1 - 0.81) / (1 - 0.81 - 0.02), rel=0.03)
    z = noise / np.sqrt(variance)
    assert z.var() == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / 400_000))


def test_ewma() -> None:
    e = np.random.default_rng(17).standard_normal(20_000) * 3.0
    variance = ewma_variance(e, 0.98, before=9.0)
    by_hand = 9.0
    for t in range(100):
        assert variance[t] == pytest.approx(by_hand, rel=1e-12)
        by_hand = 0.98 * by_hand + 0.02 * e[t] ** 2
    assert variance.mean() == pytest.approx(9.0, rel=0.05)
    with pytest.raises(InputError, match="decay"):
        ewma_variance(e, 1.0)


def test_orders() -> None:
    e = simulate_garch(20_000, 0.01, 0.05, 0.90, np.random.default_rng(18))[0]
    fit = select_garch(e)
    assert fit.order == (1, 1)
    assert len(fit.candidates) == 6
    rich = simulate_garch(40_000, 0.05, [0.05, 0.25], [0.6], np.random.default_rng(19))[0]
    chosen = select_garch(rich, 2, 1)
    assert chosen.order == (2, 1)
    assert chosen.alpha[1] == pytest.approx(0.25, abs=0.04)


def test_joint_fit_is_better_and_says_so() -> None:
    e, true = simulate_garch(21_000, 0.02, 0.15, 0.83, np.random.default_rng(20))
    x = ARMA((0.8,), (-0.3,), 1.0, 1.0).respond_to(e)[1000:] + 2.0
    chained = fit_arma_garch(x, 1, 1)
    joint = fit_arma_garch(x, 1, 1, joint=True)
    assert chained.converged
    assert joint.converged
    assert joint.joint
    assert joint.log_likelihood > chained.log_likelihood
    for fit in (chained, joint):
        truth = {"phi_1": 0.8, "theta_1": -0.3, "mean": 2.0}
        for name, value in truth.items():
            error = fit.arma.standard_errors[name]
            assert abs(fit.arma.values[name] - value) < 3.5 * error
        for name, value in {"alpha0": 0.02, "alpha_1": 0.15, "beta_1": 0.83}.items():
            assert abs(fit.garch.values[name] - value) < 3.5 * fit.garch.standard_errors[name]
        assert json.dumps(fit.to_dict(), allow_nan=False)
    # weighting by the variance makes the ARMA part more precise
    assert joint.arma.standard_errors["phi_1"] < 0.9 * chained.arma.standard_errors["phi_1"]
    mean, variance = joint.predict(x)
    z = (x - mean) / np.sqrt(variance)
    assert z[100:].var() == pytest.approx(1.0, abs=0.04)
    assert np.corrcoef(np.log(variance), np.log(true[1000:]))[0, 1] > 0.97


def test_what_does_not_vary_or_is_short_is_constant_and_flagged() -> None:
    rng = np.random.default_rng(21)
    cases = {
        "constant signal": np.full(2000, 0.3),
        "constant": np.zeros(2000),
        "short record": rng.standard_normal(499),
    }
    for words, signal in cases.items():
        fit = fit_garch(signal)
        assert fit.method == "constant"
        assert not fit.converged
        assert fit.flags[0].startswith(words)
        assert fit.persistence == 0.0
        assert fit.unconditional_variance == pytest.approx(signal.var(), abs=1e-20)
        assert json.dumps(fit.to_dict(), allow_nan=False)


def test_no_changing_variance_is_said() -> None:
    rng = np.random.default_rng(22)
    said = 0
    for _ in range(10):
        fit = fit_garch(rng.standard_normal(5000))
        said += any(f.startswith("no changing variance") for f in fit.flags)
        assert fit.unconditional_variance == pytest.approx(1.0, abs=0.1)
    # 1 % of them look like ARCH by chance
    assert said >= 9


def test_hard_signals_are_flagged_never_falsely_converged() -> None:
    rng = np.random.default_rng(23)
    ramp = fit_garch(np.arange(5000.0))
    assert not ramp.converged
    assert any(f.startswith("correlated") for f in ramp.flags)
    wild = rng.standard_normal(5000)
    wild[2500] = 1e6
    fit = fit_garch(wild)
    assert fit.flags[0].startswith("outlier: row 2500")
    walk = fit_garch(np.cumsum(rng.standard_normal(5000)))
    assert any(f.startswith("correlated") for f in walk.flags)
    # variance that grows without end: no stationary model
    growing = rng.standard_normal(6000) * np.exp(np.linspace(0.0, 8.0, 6000))
    told = fit_garch(growing)
    assert told.flags
    assert told.method != "maximum likelihood" or told.persistence > 0.99
    biased = fit_garch(rng.standard_normal(3000) + 5.0, mean="zero")
    assert any(f.startswith("mean") for f in biased.flags)
    for result in (ramp, fit, walk, told, biased):
        assert json.dumps(result.to_dict(), allow_nan=False)


def test_bad_input() -> None:
    e = np.random.default_rng(24).standard_normal(1000)
    for broken in (np.nan, np.inf):
        with pytest.raises(InputError, match="row 9"):
            fit_garch(np.where(np.arange(1000) == 9, broken, e))
    with pytest.raises(InputError, match="shape"):
        fit_garch(e.reshape(500, 2))
    for p, q in ((0, 1), (1, -1)):
        with pytest.raises(InputError, match="orders"):
            fit_garch(e, p, q)
    with pytest.raises(InputError, match="mean"):
        fit_garch(e, mean="median")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="criterion"):
        select_garch(e, criterion="hqc")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="sum to 1"):
        simulate_garch(10, 0.1, 0.1, 0.9, np.random.default_rng(0))
    with pytest.raises(ModelError, match="alpha"):
        garch_conditional_variance(e, 0.1, -0.1, 0.9, before=1.0)
