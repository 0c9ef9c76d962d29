"""The overlapping Allan deviation: equal to peers and to ten lines of NumPy, at any layout."""

from __future__ import annotations

import tracemalloc

import allantools
import numpy as np
import pytest
from numpy.typing import NDArray

from schuler.curves.allan import allan_deviation, default_factors
from schuler.errors import InputError
from schuler.noise import RandomWalk, WhiteNoise

FloatArray = NDArray[np.float64]


def twin(signal: FloatArray, rate: float, factors: NDArray[np.int64]) -> FloatArray:
    """Spec 2.3 word by word."""
    theta = np.concatenate([[0.0], np.cumsum(signal - signal.mean())]) / rate
    out = []
    for n in factors:
        second = theta[2 * n :] - 2.0 * theta[n : theta.size - n] + theta[: theta.size - 2 * n]
        tau = n / rate
        out.append(np.sqrt(np.sum(second**2) / (2.0 * tau**2 * second.size)))
    return np.array(out)


@pytest.mark.parametrize("factors", [[1], [1, 2], [1, 2, 3, 7, 20, 49, 50], [50]])
def test_kernel_equals_its_numpy_twin(factors: list[int]) -> None:
    # odd and even counts, pairs that end at different rows, one term alone at half the record
    signal = np.random.default_rng(1).standard_normal(100)
    wanted = np.array(factors)
    curve = allan_deviation(signal, 4.0, wanted / 4.0)
    np.testing.assert_array_equal(curve.factors, wanted)
    np.testing.assert_allclose(curve.deviation, twin(signal, 4.0, wanted), rtol=1e-12)


def test_blocks_join_without_a_seam() -> None:
    signal = np.random.default_rng(2).standard_normal(9001)
    wanted = np.array([1, 5, 1000, 2047, 2048, 4096, 4500])
    curve = allan_deviation(signal, 1.0, wanted)
    np.testing.assert_allclose(curve.deviation, twin(signal, 1.0, wanted), rtol=1e-11)


@pytest.mark.parametrize("offset", [0.0, 9.81, 1e6])
def test_equals_allantools_to_ten_digits(offset: float) -> None:
    rng = np.random.default_rng(3)
    process = WhiteNoise(1e-3) + RandomWalk(1e-4)
    signal = process.simulate(50_000, 0.01, rng) + np.round(offset, 2)
    curve = allan_deviation(signal, 100.0)
    tau, deviation, _, _ = allantools.oadev(signal, rate=100.0, data_type="freq", taus=curve.tau)
    np.testing.assert_allclose(tau, curve.tau, rtol=1e-12)
    # at 1e6 the samples themselves carry 1e-10 of rounding against noise of 1e-2
    np.testing.assert_allclose(deviation, curve.deviation, rtol=1e-10 if offset < 1e5 else 1e-7)


def test_columns_strides_and_types_do_not_matter() -> None:
    rng = np.random.default_rng(4)
    table = rng.standard_normal((3000, 5))
    whole = allan_deviation(table, 50.0)
    assert whole.deviation.shape == (whole.tau.size, 5)
    for j in range(5):
        alone = allan_deviation(table[:, j], 50.0)
        assert alone.deviation.shape == alone.lower.shape == alone.tau.shape
        np.testing.assert_allclose(alone.deviation, whole.deviation[:, j], rtol=1e-13)
        np.testing.assert_allclose(alone.upper, whole.column(j).upper, rtol=1e-13)
    fortran = allan_deviation(np.asfortranarray(table[::-1]), 50.0)
    np.testing.assert_allclose(fortran.deviation, whole.deviation, rtol=1e-11)
    counts = np.round(1000 * table[:, 0]).astype(np.int16)
    np.testing.assert_allclose(
        allan_deviation(counts, 50.0).deviation,
        allan_deviation(counts.astype(np.float64), 50.0).deviation,
        rtol=1e-13,
    )


def test_data_are_not_copied_as_a_whole() -> None:
    table = np.random.default_rng(5).standard_normal((1_000_000, 6))
    table.flags.writeable = False
    allan_deviation(table[:1000], 100.0)
    tracemalloc.start()
    try:
        allan_deviation(table, 100.0, [0.01, 1.0, 100.0])
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 70e6 + 1e6


def test_default_taus_are_twenty_a_decade_up_to_a_ninth() -> None:
    factors = default_factors(1_000_000)
    assert factors[0] == 1
    assert factors[-1] == 111_111
    assert (np.diff(factors) > 0).all()
    in_a_decade = np.count_nonzero((factors >= 1000) & (factors < 10_000))
    assert 19 <= in_a_decade <= 21
    np.testing.assert_array_equal(default_factors(3), [1])


def test_taus_the_record_cannot_hold_are_dropped() -> None:
    curve = allan_deviation(np.random.default_rng(6).standard_normal(101), 10.0, [0.1, 5.0, 5.1, 9])
    np.testing.assert_allclose(curve.tau, [0.1, 5.0])
    assert curve.duration == pytest.approx(10.1)


def test_constant_signal_has_no_deviation_and_no_warning() -> None:
    curve = allan_deviation(np.full(500, 9.81), 100.0)
    assert np.abs(curve.deviation).max() < 1e-14
    assert np.isfinite(curve.degrees_of_freedom).all()


@pytest.mark.parametrize(
    ("signal", "rate", "taus", "words"),
    [
        (np.array([1.0, 2.0]), 1.0, None, "2 samples"),
        (np.zeros((3, 3, 3)), 1.0, None, "shape"),
        (np.array(["a", "b", "c"]), 1.0, None, "numbers"),
        (np.arange(9.0), 0.0, None, "rate"),
        (np.arange(9.0), np.nan, None, "rate"),
        (np.arange(9.0), 1.0, [-1.0], "above zero"),
        (np.arange(9.0), 1.0, [np.nan], "above zero"),
        (np.arange(9.0), 1.0, [100.0], "no cluster time"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    signal: FloatArray, rate: float, taus: list[float] | None, words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        allan_deviation(signal, rate, taus)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_single_bad_sample_is_found_and_named(value: float) -> None:
    table = np.random.default_rng(7).standard_normal((400, 3))
    table[123, 1] = value
    with pytest.raises(InputError, match=r"1 samples .* row 123 of column 1"):
        allan_deviation(table, 1.0)
