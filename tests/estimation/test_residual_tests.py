"""Tests of residuals: sizes, powers, equality with statsmodels, what whiteness does not say."""

from __future__ import annotations

import importlib
import math

import numpy as np
import pytest

from schuler.errors import EstimationError, InputError
from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.estimation.residuals.diagnostics import diagnose_residuals
from schuler.estimation.residuals.tests import (
    arch_lm_test,
    jarque_bera_test,
    lagged_products,
    ljung_box_test,
    residual_tests,
    robust_autocorrelation_band,
)


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_equal_to_statsmodels() -> None:
    stattools = importlib.import_module("statsmodels.stats.diagnostic")
    from statsmodels.stats.stattools import jarque_bera

    x = simulate_garch(3000, 0.05, 0.05, 0.90, np.random.default_rng(4))[0]
    statistic, p_value = stattools.het_arch(x, nlags=10)[:2]
    ours = arch_lm_test(x, 10)
    assert ours.statistic == pytest.approx(statistic, rel=1e-9)
    assert ours.p_value == pytest.approx(p_value, rel=1e-7)
    theirs = stattools.acorr_ljungbox(x, lags=[20], model_df=4)
    box = ljung_box_test(x, 20, fitted_parameters=4)
    assert box.statistic == pytest.approx(float(theirs["lb_stat"].iloc[0]), rel=1e-9)
    assert box.p_value == pytest.approx(float(theirs["lb_pvalue"].iloc[0]), rel=1e-9)
    shape = jarque_bera(x)
    assert jarque_bera_test(x).statistic == pytest.approx(float(shape[0]), rel=1e-9)


def test_arch_lm_is_n_r_squared_of_the_regression_written_out() -> None:
    x = np.random.default_rng(5).standard_normal(400) ** 3
    squares = x**2
    lags = 4
    design = np.column_stack(
        [np.ones(400 - lags), *(squares[lags - k : 400 - k] for k in range(1, lags + 1))]
    )
    target = squares[lags:]
    fitted = design @ np.linalg.lstsq(design, target, rcond=None)[0]
    explained = np.var(fitted) / np.var(target)
    assert arch_lm_test(x, lags).statistic == pytest.approx((400 - lags) * explained, rel=1e-9)


def test_sizes_on_independent_noise() -> None:
    rng = np.random.default_rng(20)
    count = 1200
    rejected = np.zeros(4)
    for _ in range(count):
        x = rng.standard_normal(1500)
        p_values = (
            arch_lm_test(x).p_value,
            ljung_box_test(x).p_value,
            ljung_box_test(x, robust=True).p_value,
            jarque_bera_test(x).p_value,
        )
        rejected += np.array(p_values) < 0.05
    # 5 % ± 2 %: three standard deviations of the count are 1.9 %
    assert np.all(np.abs(rejected / count - 0.05) < 0.02)


def test_power_of_arch_lm_on_garch() -> None:
    rng = np.random.default_rng(21)
    found = [
        arch_lm_test(simulate_garch(20_000, 0.01, 0.05, 0.90, rng)[0]).p_value < 0.05
        for _ in range(40)
    ]
    assert np.mean(found) > 0.95


def test_changing_variance_fools_the_plain_tests_not_the_robust_ones() -> None:
    rng = np.random.default_rng(22)
    lags, count, n = 20, 150, 6000
    plain = robust = 0
    inside_plain, inside_robust = [], []
    for _ in range(count):
        x = simulate_garch(n, 0.01, 0.12, 0.85, rng)[0]
        plain += ljung_box_test(x, lags).p_value < 0.05
        robust += ljung_box_test(x, lags, robust=True).p_value < 0.05
        centred = x - x.mean()
        correlation = np.array([centred[k:] @ centred[:-k] for k in range(1, lags + 1)])
        correlation = np.abs(correlation) / (centred @ centred)
        inside_plain.append(np.mean(correlation < 2.0 / math.sqrt(n)))
        inside_robust.append(np.mean(correlation < robust_autocorrelation_band(x, lags)))
    assert plain / count > 0.15
    assert abs(robust / count - 0.05) < 0.055
    assert np.mean(inside_plain) < 0.90
    assert abs(np.mean(inside_robust) - 0.954) < 0.012


def test_band_of_independent_noise_is_two_over_root_n() -> None:
    x = np.random.default_rng(23).standard_normal(100_000)
    band = robust_autocorrelation_band(x, 50)
    np.testing.assert_allclose(band, 2.0 / math.sqrt(100_000), rtol=0.03)


def test_white_but_predictable_series() -> None:
    # S000 (5), (6), E-000-12: x(t) = e(t) + b e(t-1) x(t-2) has no correlation, yet its past
    # foretells it; whiteness alone does not make a series unpredictable
    rng = np.random.default_rng(24)
    passed = caught = 0
    for _ in range(20):
        e = rng.standard_normal(4000)
        x = e.copy()
        for t in range(2, x.size):
            x[t] += 0.5 * e[t - 1] * x[t - 2]
        passed += ljung_box_test(x, robust=True).p_value > 0.01
        caught += arch_lm_test(x).p_value < 1e-3
    assert passed >= 18
    assert caught == 20


def test_scale_does_not_matter() -> None:
    x = simulate_garch(5000, 0.01, 0.05, 0.90, np.random.default_rng(25))[0]
    reference = residual_tests(x)
    assert reference is not None
    for scale in (1e-12, 1e12, 1e-160):
        scaled = residual_tests(x * scale)
        assert scaled is not None
        assert scaled.arch_lm.statistic == pytest.approx(reference.arch_lm.statistic, rel=1e-9)
        assert scaled.ljung_box_robust.statistic == pytest.approx(
            reference.ljung_box_robust.statistic, rel=1e-9
        )
        assert scaled.jarque_bera.statistic == pytest.approx(
            reference.jarque_bera.statistic, rel=1e-9
        )


def test_bad_input() -> None:
    rng = np.random.default_rng(26)
    x = rng.standard_normal(100)
    with pytest.raises(EstimationError, match="do not vary"):
        ljung_box_test(np.full(100, 2.0))
    with pytest.raises(EstimationError, match="10 residuals"):
        arch_lm_test(x[:10])
    with pytest.raises(InputError, match="not finite"):
        ljung_box_test(np.append(x, np.nan))
    with pytest.raises(InputError, match="shape"):
        jarque_bera_test(x.reshape(50, 2))
    with pytest.raises(InputError, match="more lags"):
        ljung_box_test(x, 4, fitted_parameters=4)
    with pytest.raises(InputError, match="lags"):
        arch_lm_test(x, 0)
    with pytest.raises(EstimationError, match="squares"):
        arch_lm_test(np.where(rng.random(100) < 0.5, -1.0, 1.0))
    assert residual_tests(np.zeros(200)) is None


def test_products_at_all_lags_are_those_taken_one_by_one() -> None:
    # lengths at the edges of the blocks in which they are summed
    for size in (60, 2048, 2049, 5000):
        values = np.random.default_rng(size).standard_normal(size)
        found = lagged_products(values, 19)
        for k in range(20):
            assert found[k] == pytest.approx(
                float(values[k:] @ values[: size - k]), rel=1e-11, abs=1e-10
            )


def test_quantiles_of_residuals_are_numpys() -> None:
    values = np.random.default_rng(4).standard_t(4, 3001)
    found = diagnose_residuals(values)
    assert found is not None
    centred = values - values.mean()
    share = (np.arange(found.quantiles.size) + 0.5) / found.quantiles.size
    assert found.quantiles == pytest.approx(np.quantile(centred, share) / centred.std(), rel=1e-9)
