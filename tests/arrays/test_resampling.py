"""Values between samples, derivatives and filters that respect gaps."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.arrays.clocks.resampling import low_pass, rate_of_change, resample
from schuler.errors import InputError


def test_polynomials_of_fifth_degree_pass_unchanged_on_uneven_stamps() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(60) * 0.01 + rng.uniform(-0.0025, 0.0025, 60)
    at = rng.uniform(time[3], time[-4], 400)
    coefficients = rng.normal(size=6)
    moved = resample(time, np.polyval(coefficients, time), at)
    np.testing.assert_allclose(moved.values[:, 0], np.polyval(coefficients, at), atol=1e-11)


def test_the_noise_gain_is_what_happens_to_white_noise() -> None:
    rng = np.random.default_rng(2)
    time = np.arange(200_000.0)
    noise = rng.standard_normal(time.size)
    for fraction in (0.0, 0.2, 0.5):
        moved = resample(time, noise, time[10:-10] + fraction)
        gain = moved.noise_gain[0]
        # variance of a variance of weakly correlated samples: 2 / n, a few times that at most
        assert moved.values.var() / noise.var() == pytest.approx(gain, rel=0.015)
    # (3, -25, 150)/256 on both sides: the middle of Lagrange's six points
    assert gain == pytest.approx(2 * (3**2 + 25**2 + 150**2) / 256**2, rel=1e-9)
    assert resample(time, noise, time[5:9]).noise_gain == pytest.approx(1.0)


def test_nothing_is_bridged() -> None:
    time = np.arange(100.0)
    values = np.sin(0.1 * time)
    values[40] = np.nan
    at = np.array([38.5, 39.0, 39.5, 40.0, 40.5, 41.0, 41.5, -0.5, 99.5])
    moved = resample(time, values, at).values[:, 0]
    assert np.isnan(moved[[2, 3, 4, 7, 8]]).all()
    np.testing.assert_allclose(moved[[1, 5]], np.sin(0.1 * at[[1, 5]]), atol=1e-14)
    # two samples only are left on one side of the gap
    np.testing.assert_allclose(moved[[0, 6]], np.sin(0.1 * at[[0, 6]]), atol=2e-3)


def test_the_derivative_is_exact_for_cubics_and_uses_no_missing_sample() -> None:
    time = np.arange(50) * 0.02
    values = np.stack([time**3, 2.0 - time], axis=1)
    broken = values.copy()
    broken[20] = np.nan
    expected = np.stack([3 * time**2, -np.ones(50)], axis=1)
    np.testing.assert_allclose(rate_of_change(time, values)[2:-2], expected[2:-2], atol=1e-11)
    slope = rate_of_change(time, broken)
    # five samples less the missing one determine a cubic still
    np.testing.assert_allclose(slope[18:23], expected[18:23], atol=1e-10)
    assert np.isnan(slope[[0, -1]]).all()


def test_the_low_pass_has_half_its_gain_at_the_bandwidth_and_no_delay() -> None:
    time = np.arange(4000) / 100.0
    wave = np.stack([np.sin(2 * np.pi * f * time) for f in (1.0, 8.0, 25.0)], axis=1)
    out = low_pass(time, wave, 8.0)[500:-500]
    inner = wave[500:-500]
    gain = np.sum(out * inner, axis=0) / np.sum(inner**2, axis=0)
    np.testing.assert_allclose(gain, [1.0, 0.5, 0.0], atol=2e-3)
    wave[2000] = np.nan
    out = low_pass(time, wave, 8.0)
    assert np.isnan(out[1995:2006]).any() and np.isfinite(out[[1990, 2010]]).all()


def test_what_cannot_be_is_said() -> None:
    with pytest.raises(InputError, match="half the sampling rate of 100 Hz"):
        low_pass(np.arange(100) / 100.0, np.zeros((100, 1)), 60.0)
    with pytest.raises(InputError, match="shape"):
        resample(np.arange(5.0), np.zeros(4), np.zeros(1))
