"""Tables 1 and 2, figures 9 to 12, equations (5) to (11): ARMA and GARCH of one gyro.

Tables 1 (x axis) and 2 (z axis) are of different series (E-000-15). Chained here they serve as
one twin with known truth, which is said wherever it matters.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from schuler import (
    ARMA,
    allan_deviation,
    arch_lm_test,
    autocorrelation,
    ewma_variance,
    fast_orthogonal_search,
    fit_arma,
    fit_arma_garch,
    fit_garch,
    garch_log_likelihood,
    ljung_box_test,
    read_imu,
    robust_autocorrelation_band,
    select_arma,
    simulate_garch,
)
from schuler_papers.experiment import FloatArray, Numbers, Size, generator, numbers

PAPER = "waegli2010"
RATE = 100.0
SAMPLES = 60_000
TABLE_1 = ARMA((1.666, -0.671), (-1.086, 0.160), 1.0, 1.0 / RATE)
PARAMETERS = ("phi_1", "phi_2", "theta_1", "theta_2")
TRUTH = np.array([1.666, -0.671, -1.086, 0.160])
PRINTED_ERRORS = np.array([2.12e-2, 2.06e-2, 2.32e-2, 1.76e-2])
SIGMA = 0.0103
TABLE_2 = (1.3e-7, 0.0175, 0.982)
GARCH_NAMES = ("alpha0", "alpha_1", "beta_1")
SHORT = 8_000
"""A record whose GARCH errors are as large as those of Table 2."""
LAGS = 100
TAUS = np.geomspace(0.1, 30.0, 12)
SHOWN = slice(0, 6000, 5)
"""A minute of the series that figure 9 shows."""


def run_arma(seed: int, size: Size) -> Numbers:
    """Fit Table 1's ARMA(2,2) with independent Gaussian innovations."""
    rng = generator(seed, PAPER, "arma")
    fit = fit_arma(SIGMA * TABLE_1.simulate(SAMPLES, 1.0 / RATE, rng), 2, 2, rate=RATE)
    values = np.array([fit.values[name] for name in PARAMETERS])
    errors = np.array([fit.standard_errors[name] for name in PARAMETERS])
    assert fit.diagnostics is not None
    return numbers(
        values=values,
        errors=errors,
        inside=np.abs(values - TRUTH) < 1.96 * errors,
        constant=fit.constant,
        constant_error=fit.standard_errors["constant"],
        constant_p=fit.p_values["constant"],
        t_values=[fit.t_values[name] for name in PARAMETERS],
        entries=fit.covariance.shape[0],
        ljung_box_p=fit.diagnostics.ljung_box.p_value,
        samples=SAMPLES,
    )


def run_order(seed: int, size: Size) -> Numbers:
    """Choose the orders of Table 1's ARMA by AIC and by BIC."""
    rng = generator(seed, PAPER, "order")
    quick = size == "quick"
    signal = SIGMA * TABLE_1.simulate(20_000 if quick else SAMPLES, 1.0 / RATE, rng)
    most = 3 if quick else 4
    fit = select_arma(signal, most, most, rate=RATE)
    allowed = [c for c in fit.candidates if not c.rejected]
    by_bic = min(allowed, key=lambda c: c.bic)
    return numbers(aic=fit.order, bic=(by_bic.p, by_bic.q))


def run_garch(seed: int, size: Size) -> Numbers:
    """Fit ARMA(2,2) with GARCH(1,1) innovations of Tables 1 and 2 together."""
    rng = generator(seed, PAPER, "garch")
    e, variance = simulate_garch(SAMPLES + 1000, *TABLE_2, rng)
    x, true = TABLE_1.respond_to(e)[1000:], variance[1000:]
    return _chained(x, true)


def run_recording(seed: int, size: Size, folder: Path) -> Numbers:
    """Fit ARMA and GARCH to the x gyro of one of six static ADIS16405 recordings."""
    imu = read_imu(folder / "adis16405-static" / f"imu{seed % 6 + 1}.parquet")
    x = imu.gyro[:SAMPLES, 0]
    return _chained(x - x.mean(), None)


def _chained(x: FloatArray, true: FloatArray | None) -> Numbers:
    fit = fit_arma_garch(x, 2, 2, rate=RATE)
    garch = fit.garch
    residual = fit.arma.residuals(x)
    mean, variance = fit.predict(x)
    z = (x - mean) / np.sqrt(variance)
    values = [garch.values[name] for name in GARCH_NAMES]
    errors = [garch.standard_errors[name] for name in GARCH_NAMES]
    raw = autocorrelation(x, RATE, LAGS / RATE)
    left = autocorrelation(residual, RATE, LAGS / RATE)
    band = robust_autocorrelation_band(residual, LAGS)
    plain = 2.0 / math.sqrt(residual.size)
    allan = [allan_deviation(s, RATE, TAUS) for s in (x, residual)]
    slopes = [
        np.polyfit(np.log(c.tau), np.log(c.deviation), 1, w=np.sqrt(c.degrees_of_freedom))[0]
        for c in allan
    ]
    flat = np.full(x.size, residual.var())
    weighted = ewma_variance(residual, before=float(residual[:100].var()))
    squares = residual**2
    loss = [float(np.mean(np.log(s) + squares / s)) for s in (variance, flat, weighted)]
    thin = slice(None, None, 100)
    found = numbers(
        arma_values=[fit.arma.values[name] for name in PARAMETERS],
        arma_robust=[fit.arma.robust_standard_errors[name] for name in PARAMETERS],
        arma_plain=[fit_arma(x, 2, 2, rate=RATE).standard_errors[name] for name in PARAMETERS],
        values=values,
        errors=errors,
        alpha0_p=garch.p_values["alpha0"],
        persistence=garch.persistence,
        entries=garch.covariance.shape[0],
        lm_before=arch_lm_test(residual).p_value,
        lm_after=arch_lm_test(z).p_value,
        z_mean=z.mean(),
        z_variance=z.var(),
        series=[x[SHOWN], residual[SHOWN]],
        raw_correlation=raw.correlation[1:],
        correlation=left.correlation[1:],
        band=band,
        plain_band=plain,
        inside=np.mean(np.abs(left.correlation[1:]) < band),
        inside_plain=np.mean(np.abs(left.correlation[1:]) < plain),
        slopes=slopes,
        tau=allan[0].tau,
        raw_allan=allan[0].deviation,
        allan=allan[1].deviation,
        loss=loss,
        volatility=np.sqrt(variance[thin]),
        raw_predictable=ljung_box_test(x, robust=True).p_value,
        left_predictable=ljung_box_test(z, robust=True).p_value,
    )
    if true is not None:
        found |= _against_truth(residual, values)
        shared = [np.log(variance), np.log(weighted)]
        found["log_correlation"] = np.array([np.corrcoef(s, np.log(true))[0, 1] for s in shared])
        found["true_volatility"] = np.sqrt(true[thin])
    return found


def _against_truth(residual: FloatArray, values: list[float]) -> Numbers:
    """What α₀ is worth, and the errors of a record as short as the paper's."""
    whole = garch_log_likelihood(residual, *values)
    without = garch_log_likelihood(residual, 1e-14, values[1], values[2])
    short = fit_garch(residual[:SHORT])
    return numbers(
        without_alpha0=whole - without,
        short_alpha0_p=short.p_values["alpha0"],
        short_errors=[short.standard_errors[name] for name in GARCH_NAMES],
        short_t=[short.t_values[name] for name in GARCH_NAMES],
    )


def run_tests(seed: int, size: Size) -> Numbers:
    """Sizes and powers of the tests that the paper relies on."""
    rng = generator(seed, PAPER, "tests")
    runs = 20 if size == "quick" else 50
    level = power = white = 0
    moments, after = [], []
    gain = []
    for _ in range(runs):
        level += int(arch_lm_test(rng.standard_normal(5000)).p_value < 0.05)
        e, _ = simulate_garch(20_000, 1.0, 0.05, 0.90, rng)
        power += int(arch_lm_test(e).p_value < 0.05)
        n = rng.standard_normal(10_002)
        bilinear = n[2:] + 0.6 * n[1:-1] * n[:-2]
        white += int(ljung_box_test(bilinear, robust=True).p_value > 0.05)
        fit = fast_orthogonal_search(bilinear[:5000], 3, 2, held_out=bilinear[5000:])
        gain.append(1.0 - fit.mean_square_error / bilinear[5000:].var())
        low = fit_garch(e[:5000], 1, 0)
        z = low.standardized_residuals(e[:5000])
        moments.append((z.mean(), z.var()))
        after.append(arch_lm_test(z).p_value)
    return numbers(
        level=level / runs,
        power=power / runs,
        white=white / runs,
        gain=np.mean(gain),
        moments=np.mean(moments, axis=0),
        low_order_rejected=np.mean(np.array(after) < 0.01),
    )
