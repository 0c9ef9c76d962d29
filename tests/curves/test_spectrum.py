"""Power spectral density: equal to SciPy, Parseval, limits that cover, both conventions."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from scipy.signal import welch

from schuler.curves.spectrum import group_covariance, power_spectral_density
from schuler.errors import InputError
from schuler.noise import GaussMarkov, Quantization, RandomWalk, WhiteNoise


@pytest.mark.parametrize("segment", [256, 255, 2000])
def test_single_bins_equal_scipy(segment: int) -> None:
    signal = GaussMarkov(1.0, 0.3).simulate(4000, 0.01, np.random.default_rng(1)) + 9.81
    curve = power_spectral_density(
        signal, 100.0, onesided=True, segment=segment, bins_per_octave=None
    )
    frequency, density = welch(
        signal, fs=100.0, nperseg=segment, noverlap=segment // 2, detrend="constant"
    )
    np.testing.assert_allclose(curve.frequency, frequency, rtol=1e-12)
    np.testing.assert_allclose(curve.density, density, rtol=1e-9)


def test_one_sided_is_twice_two_sided_and_says_so() -> None:
    signal = 3.0 * np.random.default_rng(2).standard_normal(40_000)
    one = power_spectral_density(signal, 100.0, onesided=True)
    two = power_spectral_density(signal, 100.0, onesided=False)
    np.testing.assert_allclose(one.density, 2.0 * two.density, rtol=1e-12)
    np.testing.assert_allclose(one.two_sided, two.density, rtol=1e-12)
    # N² = variance/rate, two-sided
    assert np.mean(two.density[-8:]) == pytest.approx(9.0 / 100.0, rel=0.03)


def test_power_is_the_variance() -> None:
    signal = GaussMarkov(2.0, 0.2).simulate(200_000, 0.01, np.random.default_rng(3))
    curve = power_spectral_density(signal, 100.0, onesided=True, segment=8192, bins_per_octave=None)
    power = np.sum(curve.density) * 100.0 / 8192
    assert power == pytest.approx(np.var(signal), rel=0.01)
    averaged = power_spectral_density(signal, 100.0, onesided=False, segment=8192)
    widths = averaged.count * 100.0 / 8192
    assert 2.0 * np.sum(averaged.density * widths) == pytest.approx(np.var(signal), rel=0.01)


def test_the_default_segment_keeps_the_low_frequencies_of_a_long_record() -> None:
    # 2**20 samples for 7 h at 100 Hz, as S004 has it
    signal = np.random.default_rng(4).standard_normal(2_520_000)
    curve = power_spectral_density(signal, 100.0, onesided=False)
    assert curve.segment == 2**20
    assert curve.frequency[0] == pytest.approx(2.0 * 100.0 / 2**20)
    inside = (curve.frequency > 0.1) & (curve.frequency < 40.0)
    octaves = np.log2(curve.frequency[inside][-1] / curve.frequency[inside][0])
    assert (np.count_nonzero(inside) - 1) / octaves == pytest.approx(8.0, rel=0.02)


def test_limits_cover_a_gauss_markov_spectrum() -> None:
    # spec 2.2 asks for 90 % of the points
    rng = np.random.default_rng(5)
    process = GaussMarkov(1.0, 2.0) + WhiteNoise(0.2)
    inside = []
    for _ in range(60):
        curve = power_spectral_density(process.simulate(20_000, 0.1, rng), 10.0, onesided=False)
        truth = process.sampled_psd(curve.frequency * 0.1, 0.1) * 0.1
        inside.append((curve.lower <= truth) & (truth <= curve.upper))
    share = np.mean(inside, axis=0)
    assert np.mean(share) == pytest.approx(0.95, abs=0.02)
    assert share.min() > 0.8


def test_scatter_is_the_claimed_one_with_its_correlation() -> None:
    rng = np.random.default_rng(6)
    curves = [
        power_spectral_density(rng.standard_normal(1500), 1.0, onesided=False) for _ in range(800)
    ]
    density = np.array([c.density for c in curves])
    relative = density / density.mean(axis=0)
    claimed = group_covariance(curves[0])
    np.testing.assert_allclose(
        2.0 / np.var(relative, axis=0), curves[0].degrees_of_freedom, rtol=0.3
    )
    assert np.mean(np.var(relative, axis=0) / np.diag(claimed)) == pytest.approx(1.0, abs=0.05)
    found = np.cov(relative.T)
    scale = np.sqrt(np.outer(np.diag(claimed), np.diag(claimed)))
    # 1/sqrt(800) of scatter in a correlation
    assert np.abs((found - claimed) / scale)[~np.eye(len(found), dtype=bool)].max() < 5.0 / 28.0
    assert np.abs(np.mean(np.diag(found - claimed, 1) / np.diag(scale, 1))) < 0.03


@pytest.mark.parametrize(
    ("process", "power", "low", "high"),
    [
        (Quantization(1.0), 2.0, 0.01, 0.6),
        (WhiteNoise(1.0), 0.0, 0.01, 4.0),
        (RandomWalk(1.0), -2.0, 0.01, 0.5),
        (GaussMarkov(1.0, 100.0), -2.0, 0.02, 0.5),
    ],
    ids=lambda v: getattr(v, "kind", ""),
)
def test_slopes_of_power_laws(process: Any, power: float, low: float, high: float) -> None:
    # figure 5 of S004: within 0.05 where one process rules
    signal = process.simulate(400_000, 0.1, np.random.default_rng(7))
    curve = power_spectral_density(signal, 10.0, onesided=False)
    use = (curve.frequency > low) & (curve.frequency < high)
    x, y = np.log(curve.frequency[use]), np.log(curve.density[use])
    weight = np.sqrt(np.minimum(curve.degrees_of_freedom[use], 1000.0))
    slope = np.polyfit(x, y, 1, w=weight)[0]
    assert slope == pytest.approx(power, abs=0.05)


@pytest.mark.parametrize("scale", [1e-120, 1e-12, 1e12, 1e110])
def test_scale_does_not_matter(scale: float) -> None:
    signal = np.random.default_rng(8).standard_normal(2000)
    unit = power_spectral_density(signal, 10.0, onesided=False)
    scaled = power_spectral_density(scale * signal, 10.0, onesided=False)
    np.testing.assert_allclose(scaled.density, scale**2 * unit.density, rtol=1e-9)


def test_constant_signals_and_ramps_are_flagged() -> None:
    still = power_spectral_density(np.full(500, 9.81), 100.0, onesided=False)
    assert still.flags == ("constant",)
    np.testing.assert_array_equal(still.density, 0.0)
    noise = np.random.default_rng(9).standard_normal(2000)
    ramp = power_spectral_density(0.05 * np.arange(2000) + noise, 10.0, onesided=False)
    assert ramp.flags == ("trend",)
    assert power_spectral_density(noise, 10.0, onesided=False).flags == ()
    text = json.dumps(still.to_dict(), allow_nan=False)
    assert json.loads(text)["flags"] == ["constant"]


@pytest.mark.parametrize(
    ("signal", "rate", "how", "words"),
    [
        (np.full(40, np.nan), 1.0, {}, "not finite"),
        (np.append(np.zeros(40), np.inf), 1.0, {}, "row 40"),
        (np.zeros(31), 1.0, {}, "31 samples"),
        (np.zeros((40, 2)), 1.0, {}, "shape"),
        (np.zeros(40), 0.0, {}, "rate"),
        (np.zeros(40), 1.0, {"segment": 41}, "segment"),
        (np.zeros(40), 1.0, {"segment": 8}, "segment"),
        (np.zeros(40), 1.0, {"bins_per_octave": 0}, "octave"),
        (np.append(np.zeros(40), 1e200), 1.0, {}, "1e120"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    signal: Any, rate: float, how: dict[str, int], words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        power_spectral_density(signal, rate, onesided=False, **how)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
