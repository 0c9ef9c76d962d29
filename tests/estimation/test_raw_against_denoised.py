"""What S003 compares, done fairly: the same data for all, raw and low-passed apart (spec 8.3)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from schuler.errors import EstimationError
from schuler.estimation.autoregressive.fit import fit_ar, fit_ar_orders
from schuler.estimation.orthogonal_search.search import fast_orthogonal_search
from schuler.estimation.predictors.innovation_floor import check_prediction_floor
from schuler.noise import GaussMarkov, WhiteNoise

FloatArray = NDArray[np.float64]
DT = 1.0 / 200.0
MODEL = WhiteNoise(1e-3) + GaussMarkov(2e-3, 100.0)
HALF = 80_000
METHODS = ("yule-walker", "covariance", "modified covariance", "burg")


@pytest.fixture(scope="module")
def raw() -> FloatArray:
    return MODEL.simulate(2 * HALF + 4000, DT, np.random.default_rng(10))


@pytest.fixture(scope="module")
def smooth(raw: FloatArray) -> FloatArray:
    """Low-passed to 6.25 Hz, the band of four wavelet levels at 200 Hz, without phase."""
    low_pass = butter(2, 6.25, fs=1.0 / DT, output="sos")
    return np.asarray(sosfiltfilt(low_pass, raw)[2000:-2000])


def held_out(signal: FloatArray, order: int) -> dict[str, float]:
    """One-step errors of every method, trained on the first half, on the second."""
    train, unseen = signal[:HALF], signal[HALF : 2 * HALF]
    errors = {}
    for method in METHODS:
        residuals = fit_ar(train, order, method).residuals(unseen)  # type: ignore[arg-type]
        errors[method] = float(residuals @ residuals) / residuals.size
    for degree in (1, 2):
        fit = fast_orthogonal_search(train, order, degree, stopping=None, held_out=unseen)
        errors[f"FOS {degree}"] = fit.mean_square_error
    return errors


@pytest.mark.parametrize("order", [1, 10])
def test_on_raw_data_all_methods_are_equal_and_none_beats_the_floor(
    raw: FloatArray, order: int
) -> None:
    errors = held_out(raw, order)
    floor = MODEL.innovation_variance(DT)
    # white noise of 1e-3 (m/s²)/sqrt(Hz) at 200 Hz is 2e-4 (m/s²)²
    assert floor == pytest.approx(2e-4, rel=0.01)
    values = np.array(list(errors.values()))
    np.testing.assert_allclose(values / errors["covariance"], 1.0, atol=0.02)
    assert values.min() > floor * (1.0 - 4.0 * math.sqrt(2.0 / HALF))


def test_on_smooth_data_the_order_matters_and_the_methods_keep_their_rank(
    smooth: FloatArray,
) -> None:
    one, ten = held_out(smooth, 1), held_out(smooth, 10)
    assert ten["covariance"] < one["covariance"] / 10.0
    for errors in (one, ten):
        # FOS of degree 1 is the covariance method, degree 2 cannot help (E-003-2, E-003-11)
        assert errors["FOS 1"] == pytest.approx(errors["covariance"], rel=1e-3)
        assert 0.9999 < errors["FOS 2"] / errors["covariance"] < 1.01
        assert errors["burg"] == pytest.approx(errors["covariance"], rel=1e-3)
    assert ten["yule-walker"] > 1.2 * ten["covariance"]


def test_coefficients_of_equation_29_are_those_of_smooth_data_only(
    raw: FloatArray, smooth: FloatArray
) -> None:
    # as printed: sum 1.01, sum of squares 8.81, white noise amplified 9.8 times (E-003-10)
    low = fast_orthogonal_search(smooth[:HALF], 10, 1, 9, stopping=None).coefficients
    assert 0.97 < low.sum() <= 1.0001
    assert low @ low > 5.0
    white = fast_orthogonal_search(raw[:HALF], 10, 1, 9, stopping=None).coefficients
    assert white.sum() < 0.2
    assert white @ white < 0.05


def test_an_offset_left_in_floors_yule_walker_at_both_orders(smooth: FloatArray) -> None:
    # the likely cause of 5e-9 at order 1 and order 10 alike (E-003-6)
    offset = smooth[:HALF] + 0.042
    floor = (offset[0] ** 2 + offset[-1] ** 2) / offset.size
    own = fit_ar_orders(offset, 10, "yule-walker", remove_mean=False).innovation_variance
    plain = fit_ar_orders(offset, 10, "covariance", remove_mean=False).innovation_variance
    assert plain[10] < 1e-3 * floor
    # a window cannot end softer than at (y1² + yN²)/N, spread over the order
    assert own[10] > 0.5 * floor
    assert own[10] == pytest.approx(floor, rel=1.0)


def test_a_smooth_result_may_not_be_set_against_raw_data(
    raw: FloatArray, smooth: FloatArray
) -> None:
    # the central claim of S003: FOS on raw data below covariance on de-noised data (E-003-1)
    floor = MODEL.innovation_variance(DT)
    on_raw = held_out(raw, 10)["FOS 2"]
    on_smooth = held_out(smooth, 10)["covariance"]
    assert on_raw > 1000.0 * on_smooth
    assert check_prediction_floor(on_raw, floor, samples=HALF) > 0.97
    with pytest.raises(EstimationError, match="held-out raw data"):
        check_prediction_floor(on_smooth, floor, samples=HALF)
