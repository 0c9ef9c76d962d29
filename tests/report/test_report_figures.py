"""Traces keep what matters: every extreme, every gap, and the numbers themselves."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schuler.report.figures import band, encode, limits, line, marks, plain, thin
from schuler.report.numbers import compact_with_error, duration, number, with_error


def decoded(values: dict[str, str]) -> np.ndarray:
    assert values["dtype"] == "f4"
    return np.frombuffer(base64.b64decode(values["bdata"]), dtype="<f4")


@given(st.integers(1, 60_000), st.integers(0, 59_999), st.integers(0, 2**31))
def test_thinning_keeps_a_single_spike_wherever_it_is(n: int, where: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    y = rng.uniform(-1.0, 1.0, n)
    up, down = where % n, (where * 7 + 3) % n
    y[up], y[down] = 40.0, -50.0
    keep = thin(np.arange(n, dtype=float), y)
    assert np.all(np.diff(keep) > 0)
    assert y[keep].max() == y.max()
    assert y[keep].min() == y.min()
    assert keep[0] == 0
    assert keep[-1] == n - 1
    assert keep.size <= 1010


def test_thinning_keeps_extremes_of_every_stretch_and_the_gaps() -> None:
    n = 100_000
    y = np.sin(np.linspace(0, 40 * np.pi, n))
    y[50_000] = np.nan
    keep = thin(np.arange(n, dtype=float), y)
    assert 50_000 in keep
    for part in np.array_split(np.arange(n), 20):
        inside = keep[(keep >= part[0]) & (keep <= part[-1])]
        assert np.nanmax(y[inside]) == pytest.approx(1.0, abs=1e-6)
        assert np.nanmin(y[inside]) == pytest.approx(-1.0, abs=1e-6)


def test_a_line_carries_its_numbers_to_32_bits_and_nan_as_a_gap() -> None:
    trace = line([0.0, 1.0, 2.0], [1.5, np.nan, -2e-5], "@x", "a <b>")
    y = decoded(trace["y"])
    assert y[0] == 1.5
    assert np.isnan(y[1])
    assert y[2] == np.float32(-2e-5)
    assert decoded(encode([1, 2])).tolist() == [1.0, 2.0]


def test_a_band_lies_between_its_two_lines() -> None:
    low, high = band([0, 1], [-1, -2], [3, 4], "@band/0.2", "2 sigma")
    assert decoded(low["y"]).tolist() == [-1.0, -2.0]
    assert decoded(high["y"]).tolist() == [3.0, 4.0]
    assert high["fill"] == "tonexty"
    assert "fill" not in low


def test_text_for_plots_cannot_be_markup() -> None:
    assert plain("<b>&") == "&lt;b&gt;&amp;"
    assert marks([1], [1], "@x", "n", text=("<i>",))["text"] == ["&lt;i&gt;"]


def test_limits_hold_all_finite_numbers() -> None:
    low, high = limits([1.0, np.nan, np.inf], [-3.0])
    assert low < -3.0
    assert 1.0 < high < 2.0
    low, high = limits([0.0, 1e-4, 10.0], log=True)
    assert 0.0 < low < 1e-4
    assert high > 10.0
    low, high = limits([300.0, 300.0])
    assert low < 300.0 < high
    assert limits([np.nan]) == (-1.0, 1.0)


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.24123, 0.00083, "0.24123 ± 0.00083"),
        (6.981e-5, 1.2e-7, "(6.981 ± 0.012)·10⁻⁵"),
        (123.4, 5.6, "123.4 ± 5.6"),
        (-2.0, 0.5, "−2.00 ± 0.50"),
        (2.5, 0.0, "2.500"),
        (2.5, float("nan"), "2.500"),
        (float("nan"), 1.0, "–"),
    ],
)
def test_numbers_carry_their_error_to_its_second_digit(
    value: float, error: float, text: str
) -> None:
    assert with_error(value, error) == text


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (0.24123, 0.00083, "0.24123(83)"),
        (6.981e-5, 1.2e-7, "6.981(12)·10⁻⁵"),
        (123.4, 5.6, "123.4(5.6)"),
        (142.0, 41.0, "142(41)"),
        (2.5, 0.0, "2.500"),
    ],
)
def test_compact_errors_are_those_of_the_last_digits(value: float, error: float, text: str) -> None:
    assert compact_with_error(value, error) == text


def test_numbers_and_durations_for_people() -> None:
    assert number(0.0) == "0"
    assert number(12345.6, 4) == "12346"
    assert number(6.98e-5) == "6.98·10⁻⁵"
    assert number(float("inf")) == "–"
    assert number(0.0412345) == "0.0412"
    assert duration(9999.99) == "2 h 47 min"
    assert duration(599.99) == "10 min"
    assert duration(548.6) == "9 min 9 s"
    assert duration(7200.0) == "2 h"
    assert duration(345_600.0) == "4.0 days"
    assert duration(30.0) == "30.0 s"
