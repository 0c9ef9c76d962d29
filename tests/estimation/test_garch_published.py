"""The published benchmark of GARCH software, and Student's law."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.estimation.garch.fit import fit_garch

# 1974 daily returns of the Deutschmark in pounds, 3 January 1984 to 31 December 1991, in per cent.
# Origin: the authors' file in the data archive of the Journal of Business and Economic Statistics,
# April 1996 (Bollerslev and Ghysels 1996, 14:139), which states no terms; the archive was made for
# checks like this one, and AER (MarkPound), rugarch (dmbp), MSGARCH and timeSeries (dem2gbp) ship
# the same numbers. They are rates of the market, and only this test reads them.
RETURNS = np.loadtxt(Path(__file__).parent / "deutschmark_pound.txt")
MEAN = -0.00619041


def test_deutschmark_pound_with_the_published_start() -> None:
    """Fiorentini, Calzolari and Panattoni (1996), as cited by Brooks, Burke and Persand (2001)."""
    found = fit_garch(RETURNS - MEAN, mean="zero", start="sample")
    assert found.alpha0 == pytest.approx(0.0107613, rel=2e-5)
    assert found.values["alpha_1"] == pytest.approx(0.153134, abs=6e-7)
    assert found.values["beta_1"] == pytest.approx(0.805974, abs=6e-7)
    # their standard errors, with the mean estimated too: Hessian and Bollerslev-Wooldridge
    assert found.hessian_standard_errors["alpha_1"] == pytest.approx(0.0265228, rel=0.01)
    assert found.hessian_standard_errors["beta_1"] == pytest.approx(0.0335527, rel=0.01)
    assert found.standard_errors["alpha_1"] == pytest.approx(0.0535, rel=0.02)
    assert found.standard_errors["beta_1"] == pytest.approx(0.0725, rel=0.02)


def test_a_start_is_a_word_or_a_variance() -> None:
    given = fit_garch(RETURNS - MEAN, mean="zero", start=float(np.mean((RETURNS - MEAN) ** 2)))
    same = fit_garch(RETURNS - MEAN, mean="zero", start="sample")
    assert given.values == pytest.approx(same.values, rel=1e-6)
    with pytest.raises(InputError, match="backcast"):
        fit_garch(RETURNS, start=-1.0)
    with pytest.raises(InputError, match="student"):
        fit_garch(RETURNS, distribution="cauchy")  # type: ignore[arg-type]


def test_heavy_tails_are_estimated_and_held_back() -> None:
    rng = np.random.default_rng(3)
    normal, variance = simulate_garch(12_000, 0.02, 0.05, 0.93, rng)
    heavy = np.sqrt(variance) * rng.standard_t(5.0, normal.size) * np.sqrt(0.6)
    found = fit_garch(heavy, distribution="student")
    assert found.converged
    assert found.degrees_of_freedom_error is not None
    assert abs((found.degrees_of_freedom or 0.0) - 5.0) < 4.0 * found.degrees_of_freedom_error
    assert found.log_likelihood > fit_garch(heavy).log_likelihood
    plain = fit_garch(normal, distribution="student")
    assert any("normal" in flag for flag in plain.flags)
