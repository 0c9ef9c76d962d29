"""Autocorrelation: equal to statsmodels, bands of the right width; Gauss-Markov fit of it."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from statsmodels.tsa.stattools import acf

from schuler.curves.autocorrelation import autocorrelation
from schuler.errors import EstimationError, InputError
from schuler.estimation.gauss_markov_correlation import fit_gauss_markov
from schuler.noise import GaussMarkov, Process, RandomWalk, WhiteNoise


@pytest.mark.parametrize("offset", [0.0, 9.81])
def test_equals_statsmodels_to_twelve_digits(offset: float) -> None:
    rng = np.random.default_rng(1)
    signal = (WhiteNoise(0.1) + GaussMarkov(1.0, 0.3)).simulate(5000, 0.01, rng) + offset
    for kind, adjusted in (("biased", False), ("unbiased", True)):
        curve = autocorrelation(signal, 100.0, 20.0, kind)  # type: ignore[arg-type]
        theirs = acf(signal, adjusted=adjusted, fft=True, nlags=2000)
        np.testing.assert_allclose(curve.correlation, theirs, atol=1e-12)
    assert curve.autocovariance[0] == pytest.approx(np.var(signal), rel=1e-12)
    assert curve.lag[7] == pytest.approx(0.07)


def test_equals_the_sum_it_is_defined_by() -> None:
    signal = np.random.default_rng(2).standard_normal(60).cumsum()
    centred = signal - signal.mean()
    direct = [centred[: 60 - k] @ centred[k:] / 60 for k in range(60)]
    curve = autocorrelation(signal, 1.0, 1e9)
    np.testing.assert_allclose(curve.autocovariance, direct, atol=1e-12 * direct[0])
    # the biased estimate is positive semidefinite
    from scipy.linalg import toeplitz

    assert np.linalg.eigvalsh(toeplitz(curve.autocovariance)).min() > -1e-10 * direct[0]


def test_a_box_car_of_fifteen_taps_at_a_tenth_leaves_a_third_at_lag_one() -> None:
    # 1 kHz white noise through 15 taps, every tenth kept: figure 10 of S004
    fast = np.random.default_rng(3).standard_normal(2_000_000)
    sums = np.cumsum(fast)
    box = (sums[15:] - sums[:-15])[::10] / 15.0
    curve = autocorrelation(box, 100.0, 1.0)
    band = 4.0 / math.sqrt(box.size)
    assert curve.correlation[1] == pytest.approx(1.0 / 3.0, abs=band)
    assert (np.abs(curve.correlation[2:]) < 1.2 * band).all()


def test_bands_hold_ninety_five_lags_of_a_hundred_only_robustly_when_the_variance_moves() -> None:
    rng = np.random.default_rng(4)
    plain, robust = [], []
    for _ in range(20):
        n = 20_000
        shock = rng.standard_normal(n)
        variance, signal = np.ones(n), np.empty(n)
        signal[0] = shock[0]
        for t in range(1, n):
            variance[t] = 0.05 + 0.3 * signal[t - 1] ** 2 + 0.65 * variance[t - 1]
            signal[t] = math.sqrt(variance[t]) * shock[t]
        curve = autocorrelation(signal, 1.0, 5.0)
        plain.append(np.abs(curve.correlation[1:]) <= curve.band[1:])
        robust.append(np.abs(curve.correlation[1:]) <= curve.robust_band[1:])
    assert np.mean(plain) < 0.8
    # 100 lags: 95 % less 4 sd
    assert np.mean(robust) > 0.86
    white = autocorrelation(rng.standard_normal(50_000), 1.0, 50.0)
    np.testing.assert_allclose(white.robust_band[1:], white.band[1:], rtol=0.05)
    assert white.white
    assert not autocorrelation(np.cumsum(rng.standard_normal(500)), 1.0).white


def test_first_crossing_of_gauss_markov_noise_is_its_time() -> None:
    signal = GaussMarkov(1.0, 5.0).simulate(400_000, 0.1, np.random.default_rng(5))
    curve = autocorrelation(signal, 10.0, 60.0)
    crossing = curve.lag[np.argmax(curve.correlation < 1.0 / math.e)]
    assert crossing == pytest.approx(5.0, rel=3.0 * math.sqrt(2.0 * 5.0 / 40_000.0))


def test_correlation_time_within_the_sampling_law() -> None:
    # spec 2.1: Tc 20 s, 2 h at 100 Hz
    signal = GaussMarkov(2.0, 20.0).simulate(720_000, 0.01, np.random.default_rng(6))
    fit = fit_gauss_markov(autocorrelation(signal, 100.0, 120.0))
    law = math.sqrt(2.0 * 20.0 / 7200.0)
    assert fit.sampling_error == pytest.approx(law, rel=0.2)
    assert fit.correlation_time == pytest.approx(20.0, rel=3.0 * law)
    assert fit.sigma == pytest.approx(2.0, rel=1.5 * law)
    assert fit.exponential
    assert "white part not resolved" in fit.flags
    noise = fit.process.components[-1]
    assert isinstance(noise, GaussMarkov)
    assert noise.correlation_time == fit.correlation_time


@pytest.mark.parametrize(
    "truth",
    [
        WhiteNoise(0.1) + GaussMarkov(1.0, 2.0),
        WhiteNoise(0.6) + GaussMarkov(0.5, 2.0),
    ],
    ids=["clear", "buried"],
)
def test_errors_are_claimed_as_they_are(truth: Process) -> None:
    rng = np.random.default_rng(7)
    fits = [
        fit_gauss_markov(autocorrelation(truth.simulate(20_000, 0.1, rng), 10.0, 20.0))
        for _ in range(60)
    ]
    white, noise = truth.components
    wanted = {
        "sigma": noise.parameters["sigma"],
        "correlation_time": 2.0,
        "white_variance": white.parameters["density"] ** 2 / 0.1,
    }
    for name, value in wanted.items():
        found = np.array([getattr(f, name) for f in fits])
        claimed = np.array([f.standard_errors[name] for f in fits])
        z = (found - value) / claimed
        assert abs(np.mean(z)) < 0.6
        assert 0.7 < np.std(z) < 1.45
    # the shape is right and must not be rejected more than by chance: 1 % of 60
    assert sum(not f.exponential for f in fits) <= 5


def test_a_mixture_is_not_exponential() -> None:
    # figure 2 of S003: real correlations are not those of one Gauss-Markov noise
    rng = np.random.default_rng(8)
    mixture = GaussMarkov(1.0, 0.5) + GaussMarkov(0.7, 6.0)
    for _ in range(5):
        signal = mixture.simulate(60_000, 0.1, rng)
        fit = fit_gauss_markov(autocorrelation(signal, 10.0, 30.0))
        assert not fit.exponential
        assert "not exponential" in fit.flags
    # nor is a resonance
    from scipy.signal import lfilter

    poles = 0.97 * np.exp(0.2j)
    ringing = lfilter([1.0], np.poly([poles, poles.conj()]).real, rng.standard_normal(60_000))
    assert not fit_gauss_markov(autocorrelation(ringing, 10.0, 20.0)).exponential


def test_a_short_record_says_so() -> None:
    signal = GaussMarkov(1.0, 100.0).simulate(6000, 0.1, np.random.default_rng(9))
    assert "record too short" in fit_gauss_markov(autocorrelation(signal, 10.0, 200.0)).flags


def test_a_ramp_or_a_walk_is_no_gauss_markov_noise() -> None:
    rng = np.random.default_rng(10)
    ramp = 1e-3 * np.arange(20_000) + 0.1 * rng.standard_normal(20_000)
    walk = RandomWalk(1.0).simulate(20_000, 1.0, rng)
    for signal in (ramp, walk):
        fit = fit_gauss_markov(autocorrelation(signal, 1.0))
        assert fit.flags != ()
        assert "record too short" in fit.flags or "not exponential" in fit.flags


def test_white_noise_has_no_correlation_to_fit() -> None:
    rng = np.random.default_rng(11)
    with pytest.raises(EstimationError, match="no correlation"):
        fit_gauss_markov(autocorrelation(rng.standard_normal(20_000), 10.0, 20.0))
    # one huge outlier hides everything else, and is white
    signal = GaussMarkov(1.0, 2.0).simulate(5000, 0.1, rng)
    signal[100] = 1e9
    with pytest.raises(EstimationError, match="no correlation"):
        fit_gauss_markov(autocorrelation(signal, 10.0, 20.0))


@pytest.mark.parametrize("scale", [1e-100, 1e-12, 1e12, 1e100])
def test_scale_does_not_matter(scale: float) -> None:
    signal = GaussMarkov(1.0, 2.0).simulate(20_000, 0.1, np.random.default_rng(12))
    unit, scaled = (autocorrelation(s * signal, 10.0, 20.0) for s in (1.0, scale))
    np.testing.assert_allclose(scaled.correlation, unit.correlation, atol=1e-11)
    np.testing.assert_allclose(scaled.autocovariance, scale**2 * unit.autocovariance, rtol=1e-6)
    np.testing.assert_allclose(scaled.robust_band, unit.robust_band, rtol=1e-9)
    fits = [fit_gauss_markov(c) for c in (unit, scaled)]
    assert fits[1].correlation_time == pytest.approx(fits[0].correlation_time, rel=1e-6)
    assert fits[1].sigma == pytest.approx(scale * fits[0].sigma, rel=1e-6)


@pytest.mark.parametrize("value", [0.0, 9.81, 1e-300])
def test_constant_signal_is_flagged(value: float) -> None:
    curve = autocorrelation(np.full(1000, value), 100.0)
    assert curve.flags == ("constant",)
    assert curve.autocovariance[0] == 0.0
    assert np.isnan(curve.correlation).all()
    assert "NaN" not in json.dumps(curve.to_dict())
    with pytest.raises(EstimationError, match="does not vary"):
        fit_gauss_markov(curve)


@pytest.mark.parametrize(
    ("signal", "rate", "lag", "words"),
    [
        (np.array([1.0, np.nan, 3.0]), 1.0, None, "row 1"),
        (np.array([1.0, np.inf, 3.0]), 1.0, None, "not finite"),
        (np.array([1.0]), 1.0, None, "1 samples"),
        (np.zeros((4, 2)), 1.0, None, "shape"),
        (np.arange(4.0), 0.0, None, "rate"),
        (np.arange(4.0), 1.0, -1.0, "lag"),
        (np.arange(4.0), 1.0, np.nan, "lag"),
        (np.array(["a", "b"]), 1.0, None, "numbers"),
        (np.array([1.0, 1e200]), 1.0, None, "1e120"),
    ],
)
def test_bad_input_is_refused_in_one_line(signal: Any, rate: float, lag: Any, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        autocorrelation(signal, rate, lag)
    assert "\n" not in str(caught.value)


def test_a_fit_wants_a_biased_curve_of_some_lags() -> None:
    signal = np.random.default_rng(13).standard_normal(100)
    with pytest.raises(InputError, match="biased"):
        fit_gauss_markov(autocorrelation(signal, 1.0, 20.0, "unbiased"))
    with pytest.raises(InputError, match="lags"):
        fit_gauss_markov(autocorrelation(signal, 1.0, 2.0))
