"""Signals and settings that no autoregressive model can be fitted to: one clear line each."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.errors import InputError, ModelError, SchulerError
from schuler.estimation.autoregressive.fit import fit_ar, fit_ar_orders, select_ar

METHODS = ("burg", "yule-walker", "covariance", "modified covariance")
NOISE = np.random.default_rng(1).standard_normal(200)
BAD = {
    "constant": (np.full(100, 9.81), "does not vary"),
    "constant zero": (np.zeros(100), "does not vary"),
    "short": (NOISE[:9], "9 samples"),
    "nan": (np.where(np.arange(200) == 17, np.nan, NOISE), "row 17"),
    "infinite": (np.where(np.arange(200) == 5, -np.inf, NOISE), "row 5"),
    "two columns": (NOISE.reshape(100, 2), "shape"),
    "text": (np.array(["a"] * 50), "type"),
    "overflowing": (np.array([1e308, -1e308] * 50), "another unit"),
    "square overflows": (NOISE * 1e200, "another unit"),
    "square vanishes": (NOISE * 1e-200, "another unit"),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", list(BAD))
def test_bad_signals(case: str, method: str) -> None:
    signal, words = BAD[case]
    for work in (fit_ar, fit_ar_orders):
        with pytest.raises(SchulerError, match=words):
            work(signal, 4, method)  # type: ignore[operator]
    with pytest.raises(SchulerError, match=words):
        select_ar(signal, 4, method=method)  # type: ignore[arg-type]


def test_bad_settings() -> None:
    with pytest.raises(InputError, match="'maximum entropy'; expected 'burg'"):
        fit_ar(NOISE, 2, "maximum entropy")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="whole number"):
        fit_ar(NOISE, -1)
    with pytest.raises(InputError, match="rate is 0 Hz"):
        fit_ar(NOISE, 2, rate=0.0)
    with pytest.raises(InputError, match="criterion 'best'"):
        select_ar(NOISE, 4, "best")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="by AICc"):
        select_ar(NOISE[:24], 11, "aicc")
    with pytest.raises(InputError, match="0 to 3"):
        fit_ar_orders(NOISE, 3).polynomial(4)


def test_process_needs_a_rate_and_a_stable_model() -> None:
    with pytest.raises(ModelError, match="rate"):
        _ = fit_ar(NOISE, 2).process
    growing = 1.05 ** np.arange(200.0) + 0.01 * NOISE
    fit = fit_ar(growing, 1, "covariance", rate=10.0, remove_mean=False)
    assert fit.coefficients[0] == pytest.approx(-1.05, abs=1e-4)
    assert "unstable" in fit.flags
    with pytest.raises(ModelError, match="inside the unit circle"):
        _ = fit.process


def test_nearly_constant_signals_in_any_unit() -> None:
    for unit in (1e-120, 1e-30, 1e100):
        fit = fit_ar(NOISE * unit, 2)
        reference = fit_ar(NOISE, 2)
        np.testing.assert_allclose(fit.coefficients, reference.coefficients, rtol=1e-9)
    # counts of an idle converter: two neighbouring values, one sample apart
    idle = np.zeros(500)
    idle[250] = 1.0
    fit = fit_ar(idle, 3)
    assert "outlier" in fit.flags
