"""Fast Orthogonal Search against plain forward selection, least squares, and chance."""

from __future__ import annotations

import json
from itertools import combinations_with_replacement

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import binom

from schuler.errors import InputError, SchulerError
from schuler.estimation.autoregressive.fit import fit_ar
from schuler.estimation.orthogonal_search.protocol import search_by_protocol
from schuler.estimation.orthogonal_search.search import FosFit, fast_orthogonal_search
from schuler.estimation.products import _threads_of_blas, one_blas_thread

FloatArray = NDArray[np.float64]


def w5(n: int, seed: int) -> FloatArray:
    """Draw the load W5: five terms, two of them products."""
    e = 0.1 * np.random.default_rng(seed).standard_normal(n + 200)
    y = [0.0] * (n + 200)
    for k in range(5, n + 200):
        y[k] = (
            1.2 * y[k - 1] - 0.5 * y[k - 2] + 0.1 * y[k - 5]
            + 0.3 * y[k - 1] * y[k - 3] - 0.25 * y[k - 2] ** 2 + e[k]
        )  # fmt: skip
    return np.array(y[200:])


W5_TERMS = {(1,), (2,), (5,), (1, 3), (2, 2)}


def columns_of(y: FloatArray, max_lag: int) -> dict[tuple[int, ...], FloatArray]:
    lags = {k: y[max_lag - k : y.size - k] for k in range(1, max_lag + 1)}
    found: dict[tuple[int, ...], FloatArray] = {(k,): v for k, v in lags.items()}
    for i, j in combinations_with_replacement(range(1, max_lag + 1), 2):
        found[(i, j)] = lags[i] * lags[j]
    return found


def forward_selection(
    y: FloatArray, max_lag: int, terms: int
) -> tuple[list[tuple[int, ...]], FloatArray, float]:
    """Choose by brute force: at every step the term whose QR leaves the least residual."""
    columns, now = columns_of(y, max_lag), y[max_lag:]
    chosen: list[tuple[int, ...]] = []

    def fit(names: list[tuple[int, ...]]) -> tuple[FloatArray, float]:
        rows = np.column_stack([np.ones(now.size), *(columns[n] for n in names)])
        q, r = np.linalg.qr(rows)
        left = now - q @ (q.T @ now)
        return np.linalg.solve(r, q.T @ now), float(left @ left) / now.size

    for _ in range(terms):
        chosen.append(
            min((n for n in columns if n not in chosen), key=lambda n: fit([*chosen, n])[1])
        )
    weights, error = fit(chosen)
    return chosen, weights, error


# ---------------------------------------------------------------- identities


@pytest.mark.parametrize("offset", [0.0, 9.8])
def test_all_lags_are_the_covariance_method_with_intercept(offset: float) -> None:
    # spec 4.6 (i); E-003-2
    y = lfilter([1.0], [1.0, -1.6, 0.9, -0.1], np.random.default_rng(1).standard_normal(4000))
    y = y + offset
    fit = fast_orthogonal_search(y, 8, stopping=None)
    rows = np.column_stack([np.ones(y.size - 8), *(y[8 - k : y.size - k] for k in range(1, 9))])
    weights, *_ = np.linalg.lstsq(rows, y[8:], rcond=None)
    order = np.argsort([t[0] for t in fit.terms])
    np.testing.assert_allclose(fit.coefficients[order], weights[1:], rtol=0, atol=1e-10)
    assert fit.intercept == pytest.approx(weights[0], abs=1e-9)
    error = float(np.mean((y[8:] - rows @ weights) ** 2))
    assert fit.training_mean_square_error == pytest.approx(error, rel=1e-12)
    # the covariance method takes the mean off instead: the same to the order of one end
    covariance = fit_ar(y, 8, "covariance")
    np.testing.assert_allclose(fit.coefficients[order], -covariance.coefficients, atol=2e-3)
    # FOS of degree 1 can never beat it on the same samples by more than the constant
    assert fit.training_mean_square_error <= covariance.innovation_variance * (1.0 + 1e-12)
    variances = np.diag(np.linalg.inv(rows.T @ rows)) * error * (y.size - 8) / (y.size - 17)
    np.testing.assert_allclose(fit.standard_errors[order], np.sqrt(variances[1:]), rtol=1e-6)


@pytest.mark.parametrize("offset", [0.0, 0.7])
def test_search_is_forward_selection_by_qr(offset: float) -> None:
    y = w5(1500, 2) + offset
    chosen, weights, error = forward_selection(y, 5, 8)
    fit = fast_orthogonal_search(y, 5, 2, 8, stopping=None)
    assert list(fit.terms) == chosen
    np.testing.assert_allclose(fit.coefficients, weights[1:], rtol=1e-7, atol=1e-9)
    assert fit.intercept == pytest.approx(weights[0], abs=1e-9)
    assert fit.training_mean_square_error == pytest.approx(error, rel=1e-10)
    # on benign data the recursion agrees with the explicit residual
    variance = float(y[5:].var())
    assert fit.ranking[-1].remaining == pytest.approx(error / variance, rel=1e-8)
    shares = [r.error_reduction for r in fit.ranking]
    assert sum(shares) + fit.ranking[-1].remaining == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("start", ["as drawn", "zero"])
def test_true_terms_of_w5(start: str) -> None:
    y = w5(36_000, 3)
    if start == "zero":  # regressors begin with exact zeros: a peer's Householder fails here
        y = np.concatenate([np.zeros(12), y])
    fit = fast_orthogonal_search(y, 10, 2, 10, held_out=w5(10_000, 4))
    assert set(fit.terms) == W5_TERMS
    truth = {(1,): 1.2, (2,): -0.5, (5,): 0.1, (1, 3): 0.3, (2, 2): -0.25}
    for term, weight, error in zip(fit.terms, fit.coefficients, fit.standard_errors, strict=True):
        assert abs(weight - truth[term]) < 4.0 * error
    assert fit.held_out_mean_square_error == pytest.approx(0.01, rel=0.06)
    assert fit.mean_square_error == fit.held_out_mean_square_error
    assert sum(r.error_reduction for r in fit.ranking) <= 1.0
    assert fit.candidates == 65
    assert fit.stopped == "no term left is stronger than chance"


def test_a_stand_in_for_later_terms_is_taken_out_again() -> None:
    # in this draw y(n-1) y(n-4) leads the two true products and is needless behind them
    y = w5(36_000, 100)
    plain = fast_orthogonal_search(y, 10, 2, prune=False)
    fit = fast_orthogonal_search(y, 10, 2)
    assert set(plain.terms) > W5_TERMS
    assert set(fit.terms) == W5_TERMS
    assert len(fit.pruned) == len(plain.terms) - 5
    assert [r.term for r in fit.ranking] == list(plain.names)
    loss = fit.training_mean_square_error / plain.training_mean_square_error - 1.0
    assert 0.0 < loss < len(fit.pruned) * 11.5 / fit.samples


# ---------------------------------------------------------------- statistics (spec 4.6)


def test_family_wise_threshold_finds_the_exact_terms_and_the_single_one_does_not() -> None:
    runs, exact = 40, {"family-wise": 0, "single": 0}
    wanted = {((1,), (0,)), ((1, 3), (1, 1))}
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        x, e = rng.standard_normal((2, 20_000))
        drive = 0.5 * e
        drive[3:] += 0.3 * x[2:-1] * x[:-3]
        y = lfilter([1.0], [1.0, -0.6], drive)
        for stopping in exact:
            fit = fast_orthogonal_search(
                y,
                4,
                2,
                12,
                inputs=[x],
                input_lags=4,
                stopping=stopping,  # type: ignore[arg-type]
            )
            assert fit.candidates == 54
            exact[stopping] += set(zip(fit.terms, fit.sources, strict=True)) == wanted
    # 92 % and 17 % of 60 seeds in the specification
    assert exact["family-wise"] >= binom.ppf(0.001, runs, 0.92)
    low, high = binom.interval(0.9999, runs, 0.17)
    assert low <= exact["single"] <= high


def test_products_cannot_help_a_gaussian_process() -> None:
    # spec 4.6 (iii): every product let in
    ratios = []
    for seed in range(8):
        y = lfilter([1.0], [1.0, -1.6, 0.7], np.random.default_rng(seed).standard_normal(20_000))
        train, unseen = y[:8000], y[8000:]
        one = fast_orthogonal_search(train, 5, 1, stopping=None, held_out=unseen)
        two = fast_orthogonal_search(train, 5, 2, stopping=None, held_out=unseen)
        assert two.training_mean_square_error < one.training_mean_square_error
        ratios.append(two.mean_square_error / one.mean_square_error)
    assert 1.0 < np.mean(ratios) < 1.05
    assert min(ratios) > 0.998


def test_exactly_the_lags_of_an_ar2() -> None:
    # spec 4.6 (iv)
    runs = 60
    found = 0
    for seed in range(runs):
        y = lfilter([1.0], [1.0, -1.2, 0.6], np.random.default_rng(seed).standard_normal(3000))
        fit = fast_orthogonal_search(y, 10, 1)
        found += set(fit.terms) == {(1,), (2,)}
    low, high = binom.interval(0.9999, runs, 0.95)
    assert low <= found <= high


def test_white_noise_is_left_alone() -> None:
    empty = [
        len(fast_orthogonal_search(np.random.default_rng(s).standard_normal(1500), 6, 2).terms)
        for s in range(60)
    ]
    low, high = binom.interval(0.9999, 60, 0.95)
    assert low <= empty.count(0) <= high
    fit = fast_orthogonal_search(np.random.default_rng(0).standard_normal(1500) + 5.0, 1)
    assert fit.intercept == pytest.approx(5.0, abs=0.2)


def test_bic_takes_a_term_that_pays_for_itself() -> None:
    y = lfilter([1.0], [1.0, -1.2, 0.6], np.random.default_rng(5).standard_normal(3000))
    fit = fast_orthogonal_search(y, 8, 1, stopping="bic")
    assert set(fit.terms) >= {(1,), (2,)}
    n, errors = fit.samples, [1.0, *(r.remaining for r in fit.ranking)]
    gains = n * np.log(np.array(errors[1:]) / errors[:-1]) + np.log(n)
    assert (gains < 0.0).all()
    more = fast_orthogonal_search(y, 8, 1, len(fit.terms) + 1, stopping=None)
    assert n * np.log(more.ranking[-1].remaining / errors[-1]) + np.log(n) > 0.0


# ---------------------------------------------------------------- explicit errors


@pytest.mark.parametrize("offset", [0.0, 1.0, 9.8])
def test_no_error_is_ever_negative_or_below_rounding(offset: float) -> None:
    # spec 4.3: on exactly predictable data the recursion goes negative (E-003-3)
    time = np.arange(3000)
    y = np.sin(0.11 * time) + 0.3 * np.sin(0.037 * time + 1.0) + offset
    fit = fast_orthogonal_search(y, 10, 2, stopping=None)
    again = fit.residuals(y)[10 - fit.memory :]
    assert fit.training_mean_square_error >= 0.0
    assert np.mean(again**2) < 1e-9 * y.var()
    assert fit.training_mean_square_error < 1e-9 * y.var()
    json.dumps(fit.to_dict(), allow_nan=False)


def test_explicit_error_is_that_of_the_predictions() -> None:
    y, unseen = w5(3000, 6) + 0.4, w5(3000, 7) + 0.4
    fit = fast_orthogonal_search(y, 5, 2, 6, held_out=unseen)
    columns = columns_of(unseen, 5)
    foreseen = fit.intercept + sum(
        a * columns[t] for t, a in zip(fit.terms, fit.coefficients, strict=True)
    )
    assert fit.memory == 5
    expected = float(np.mean((unseen[5:] - foreseen) ** 2))
    assert fit.held_out_mean_square_error == pytest.approx(expected, rel=1e-9)


def test_many_steps_ahead_run_the_model_on() -> None:
    y = w5(2000, 8)
    rng = np.random.default_rng(9)
    x = rng.standard_normal(y.size)
    y = y + 0.2 * np.concatenate([np.zeros(1), x[:-1]])
    fit = fast_orthogonal_search(y, 4, 2, 8, inputs=[x], input_lags=2, stopping=None)
    assert any(1 in s for s in fit.sources)
    origin = 700
    path = list(y[: origin + 1])
    for n in range(origin + 1, origin + 31):
        value = fit.intercept
        for weight, lags, sources in zip(fit.coefficients, fit.terms, fit.sources, strict=True):
            for lag, source in zip(lags, sources, strict=True):
                weight = weight * (path[n - lag] if source == 0 else x[n - lag])
            value += weight
        path.append(value)
    found = fit.predict(y, (1, 7, 30), inputs=[x], origins=[origin])
    np.testing.assert_allclose(
        found[0], [path[origin + 1], path[origin + 7], path[origin + 30]], rtol=1e-9
    )


def test_runaway_predictions_stay_finite() -> None:
    y = w5(3000, 10)
    fit = fast_orthogonal_search(y, 5, 2)
    wild = fit.predict(y * 50.0, (1000,))
    assert np.isfinite(wild).all()


def test_protocol_keeps_the_simple_model_and_its_error_at_the_floor() -> None:
    y = lfilter([1.0], [1.0, -1.2, 0.6], np.random.default_rng(11).standard_normal(30_000))
    result = search_by_protocol(y, 6000, 6000, horizons=(1, 10, 100))
    assert result.max_lag == 2
    assert result.degree == 1
    assert len(result.evaluated) == 8
    # one step: the innovation; far ahead: the variance of the process
    process_variance = float(y.var())
    assert result.mean_square_error[0] == pytest.approx(1.0, rel=0.06)
    assert result.mean_square_error[2] == pytest.approx(process_variance, rel=0.1)
    assert result.innovation_variance == pytest.approx(1.0, rel=0.06)
    product = search_by_protocol(w5(40_000, 12), 16_000, 16_000, max_lags=(2, 5), horizons=(1,))
    assert product.degree == 2
    assert product.max_lag == 5
    json.dumps(product.to_dict(), allow_nan=False)


# ---------------------------------------------------------------- scale and bad input


def same_model(one: FosFit, two: FosFit, unit: float) -> None:
    assert two.terms == one.terms
    degree = np.array([len(t) for t in one.terms])
    np.testing.assert_allclose(
        two.coefficients * unit ** (degree - 1.0), one.coefficients, rtol=1e-7
    )
    assert two.training_mean_square_error == pytest.approx(
        one.training_mean_square_error * unit**2, rel=1e-9
    )


@pytest.mark.parametrize("unit", [1e-12, 1e12])
def test_results_do_not_depend_on_the_unit(unit: float) -> None:
    y = w5(4000, 13) + 0.3
    same_model(fast_orthogonal_search(y, 5, 2, 6), fast_orthogonal_search(y * unit, 5, 2, 6), unit)


def test_collinear_candidates_are_rejected() -> None:
    rng = np.random.default_rng(14)
    x = rng.standard_normal(3000)
    y = lfilter([0.0, 1.0], [1.0, -0.5], x) + 0.1 * rng.standard_normal(3000)
    fit = fast_orthogonal_search(
        y, 1, 1, inputs=[x, 3.0 * x + 1.0, np.sign(x)], input_lags=1, stopping=None
    )
    twins = [t for t in zip(fit.terms, fit.sources, strict=True) if t[1][0] in (1, 2)]
    assert len(twins) == 2  # x(n) and x(n-1) once each
    assert fit.stopped == "every term left is a combination of chosen ones"
    squares = fast_orthogonal_search(y, 1, 2, inputs=[np.sign(x)], input_lags=1, stopping=None)
    # the square of a sign is constant: no column of it may be chosen
    assert ((1, 1), (1, 1)) not in list(zip(squares.terms, squares.sources, strict=True))
    assert np.abs(squares.coefficients).max() < 10.0


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (np.full(500, 2.0), "does not vary"),
        (np.random.default_rng(0).standard_normal(20), "20 samples"),
        (np.where(np.arange(500) == 3, np.nan, 1.0 * (np.arange(500) % 7)), "row 3"),
        (np.where(np.arange(500) == 8, np.inf, 1.0 * (np.arange(500) % 7)), "row 8"),
        (np.zeros((50, 3)), "shape"),
    ],
)
def test_bad_signals(signal: FloatArray, words: str) -> None:
    with pytest.raises(SchulerError, match=words):
        fast_orthogonal_search(signal, 10, 2, 10)


def test_bad_settings() -> None:
    y = np.random.default_rng(15).standard_normal(300)
    for call, words in (
        ({"max_lag": 0}, "lags up to 0"),
        ({"max_lag": 2, "degree": 3}, "degree 3"),
        ({"max_lag": 2, "max_terms": 0}, "at most 0"),
        ({"max_lag": 2, "stopping": "never"}, "stopping 'never'"),
        ({"max_lag": 2, "significance": 1.5}, "significance 1.5"),
        ({"max_lag": 2, "inputs": [y[:-1]]}, "input 1 has 299"),
        ({"max_lag": 2, "inputs": [np.ones(300)]}, "does not vary"),
    ):
        with pytest.raises(SchulerError, match=words):
            fast_orthogonal_search(y, **call)  # type: ignore[arg-type]
    fit = fast_orthogonal_search(y, 2, stopping=None)
    with pytest.raises(InputError, match="origins"):
        fit.predict(y, (1,), origins=[0])
    with pytest.raises(InputError, match="steps"):
        fit.predict(y, (0,))


def test_outlier_and_ramp() -> None:
    y = np.random.default_rng(16).standard_normal(2000)
    y[77] = 1e5
    assert "outlier" in fast_orthogonal_search(y, 3).flags
    ramp = np.arange(2000.0)
    fit = fast_orthogonal_search(ramp, 3, 2, stopping=None)
    assert fit.training_mean_square_error >= 0.0
    assert "rounding" in fit.flags


def test_blas_has_one_thread_inside_and_its_own_number_again_after() -> None:
    found = _threads_of_blas()
    if found is None:
        pytest.skip("NumPy brings no OpenBLAS here")
    tell, set_to = found
    before = tell()
    set_to(2)
    try:
        with one_blas_thread(), one_blas_thread():
            assert tell() == 1
        assert tell() == 2
    finally:
        set_to(before)
