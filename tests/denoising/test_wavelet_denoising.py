"""Wavelet de-noising: reconstruction, Stein's risk, levels, what it leaves of the Allan curve."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
import pywt

from schuler.curves.autocorrelation import autocorrelation
from schuler.denoising import allan_effect, denoise, soft_risk, stein_threshold, universal_threshold
from schuler.denoising.wavelet import level_for_band
from schuler.errors import InputError
from schuler.estimation.autoregressive.fit import fit_ar
from schuler.noise import BiasInstability, GaussMarkov, ProcessSum, RandomWalk, WhiteNoise
from schuler.units import parse


@pytest.mark.parametrize("wavelet", ["db4", "haar", "sym8", "coif2", "bior2.4"])
@pytest.mark.parametrize("samples", [1000, 1001, 1023])
def test_nothing_taken_off_leaves_the_signal(wavelet: str, samples: int) -> None:
    signal = np.random.default_rng(1).standard_normal(samples) + 9.81
    result = denoise(signal, wavelet=wavelet, level=4, threshold="none")
    assert result.signal.shape == signal.shape
    # PyWavelets stores the taps of the longer ones with 12 digits
    np.testing.assert_allclose(
        result.signal, signal, atol=1e-12 if wavelet in ("db4", "haar") else 1e-9
    )
    np.testing.assert_array_equal(result.thresholds, 0.0)


def test_stein_risk_is_the_mean_squared_error_of_soft_thresholding() -> None:
    rng = np.random.default_rng(2)
    truth = np.concatenate([np.zeros(300), rng.uniform(-4.0, 4.0, 100)])
    for threshold in (0.0, 0.7, 1.5, 3.0):
        estimated, real = [], []
        for _ in range(400):
            x = truth + rng.standard_normal(truth.size)
            shrunk = np.sign(x) * np.maximum(np.abs(x) - threshold, 0.0)
            estimated.append(soft_risk(x, threshold))
            real.append(np.mean((shrunk - truth) ** 2))
        gap = np.array(estimated) - np.array(real)
        assert abs(gap.mean()) < 4.0 * gap.std() / math.sqrt(400)
        assert np.std(gap) > 0.0 or threshold == 0.0


def test_stein_threshold_is_the_best_of_all_candidates() -> None:
    rng = np.random.default_rng(3)
    for strength in (0.0, 2.0, 6.0):
        x = rng.standard_normal(257) + strength * (rng.uniform(size=257) < 0.2)
        found = stein_threshold(x)
        risks = [soft_risk(x, t) for t in np.abs(x)]
        assert soft_risk(x, found) == pytest.approx(min(risks), rel=1e-12)
        assert np.isclose(np.abs(x), found).any()
    assert universal_threshold(1000) == pytest.approx(3.7169, abs=1e-4)


@pytest.mark.parametrize("scale", ["mln", "sln"])
@pytest.mark.parametrize("threshold", ["sure", "universal"])
def test_noise_goes_and_motion_stays(scale: Any, threshold: Any) -> None:
    rng = np.random.default_rng(4)
    t = np.arange(20_000) / 100.0
    motion = np.sin(2 * np.pi * 0.1 * t) + np.where(t > 120.0, 1.0, 0.0)
    signal = motion + 0.35 * rng.standard_normal(t.size)
    result = denoise(signal, level=6, threshold=threshold, scale=scale)
    error = math.sqrt(float(np.mean((result.signal - motion) ** 2)))
    assert error < 0.35 / 5.0
    np.testing.assert_allclose(result.noise_scales, 0.35, rtol=0.2)
    if threshold == "universal":
        np.testing.assert_allclose(
            result.thresholds, result.noise_scales * math.sqrt(2.0 * math.log(20_000))
        )
        assert result.kept[0] < 0.001
    # Stein's rule follows a burst that removing all details would smear
    if threshold == "sure":
        zero = denoise(signal, level=8, details="zero")
        stein = denoise(signal, level=8, threshold=threshold, scale=scale)
        near = np.abs(t - 120.0) < 2.0
        spread = [np.mean((r.signal - motion)[near] ** 2) for r in (zero, stein)]
        assert spread[1] < 0.8 * spread[0]


def test_equals_coefficients_thresholded_by_hand() -> None:
    signal = np.random.default_rng(5).standard_normal(777).cumsum()
    coefficients = pywt.wavedec(signal, "db4", mode="symmetric", level=3)
    for mode in ("soft", "hard"):
        by_hand = [coefficients[0]]
        for d in coefficients[1:]:
            sd = np.median(np.abs(d)) / 0.6744897501960817
            by_hand.append(pywt.threshold(d, sd * math.sqrt(2 * math.log(777)), mode))
        wanted = pywt.waverec(by_hand, "db4", mode="symmetric")[:777]
        result = denoise(signal, level=3, threshold="universal", mode=mode)  # type: ignore[arg-type]
        np.testing.assert_allclose(result.signal, wanted, atol=1e-10)


def test_unit_noise_scaling_of_sensor_data_removes_all_details() -> None:
    # E-004-8: what "Soft SURE" with one as scale does to data of 1e-2
    signal = 1e-2 * np.random.default_rng(6).standard_normal(20_000)
    one = denoise(signal, level=5, scale="one")
    zero = denoise(signal, level=5, details="zero")
    rms = np.std(one.signal - zero.signal)
    assert rms < 0.05 * np.std(signal)
    unit = denoise(100.0 * signal, level=5, scale="one")
    by_level = denoise(100.0 * signal, level=5, scale="mln")
    np.testing.assert_allclose(unit.thresholds, by_level.thresholds, rtol=0.2)
    assert math.isinf(zero.thresholds[0])


def test_levels_by_band_are_those_of_the_paper() -> None:
    # S004 5.6: 100 Hz, 3 levels 6.25 Hz, 8 levels 0.195 Hz; S003's 12.5 Hz is level 3 of 200 Hz
    assert level_for_band(5.0, 100.0) == 3
    assert level_for_band(6.25, 100.0) == 3
    assert level_for_band(6.3, 100.0) == 2
    assert level_for_band(0.19, 100.0) == 8
    assert level_for_band(12.5, 200.0) == 3
    signal = np.random.default_rng(7).standard_normal(5000)
    result = denoise(signal, band=5.0, rate=100.0)
    assert result.level == 3
    assert result.approximation_band == (0.0, 6.25)
    assert denoise(signal, level=7, rate=100.0).approximation_band[1] == pytest.approx(0.390625)
    assert result.reach == 7 * 7
    assert not result.causal


def test_figure_17_attenuation_below_and_equality_above() -> None:
    rng = np.random.default_rng(8)
    signal = 0.05 * rng.standard_normal(400_000)
    for level in (3, 8):
        result = denoise(signal, level=level, details="zero", rate=100.0)
        effect = allan_effect(signal, 100.0, result)
        step = 0.01 * 2**level
        assert effect.attenuated_below == pytest.approx(step)
        ratio, tau = effect.ratio, effect.raw.tau
        assert (ratio[tau < step] < 0.85).all()
        assert ratio[0] < 0.1 if level == 8 else ratio[0] < 0.35
        assert (np.abs(ratio[tau > effect.equal_above] - 1.0) < 0.03).all()
        assert (np.abs(ratio[tau > 4 * step] - 1.0) < 0.04).all()
        assert any("keep N" in text for text in effect.findings())
        json.dumps(effect.to_dict(), allow_nan=False)
    with pytest.raises(InputError, match="same length"):
        allan_effect(signal[1:], 100.0, result)


def test_white_noise_density_is_what_it_was() -> None:
    # position error after 60 s of twice integrated white noise does not change (spec 2.5)
    rng = np.random.default_rng(9)
    raw, smooth = [], []
    for _ in range(40):
        noise = rng.standard_normal(12_000)
        low = denoise(noise, level=7, details="zero").signal
        inside = slice(3000, 9000)
        raw.append(np.cumsum(np.cumsum(noise[inside]))[-1])
        smooth.append(np.cumsum(np.cumsum(low[inside]))[-1])
    assert np.corrcoef(raw, smooth)[0, 1] > 0.98
    assert np.std(smooth) == pytest.approx(np.std(raw), rel=0.03)


def test_figure_11_correlation_after_six_levels_crosses_zero_near_the_step() -> None:
    noise = np.random.default_rng(10).standard_normal(400_000)
    low = denoise(noise, level=6, details="zero").signal
    curve = autocorrelation(low, 1.0, 400.0)
    crossing = curve.lag[np.argmax(curve.correlation < 0.0)]
    assert 0.7 * 64 < crossing < 1.4 * 64


def _sensor(n: str, b: str, k: str, kind: str) -> ProcessSum:
    walk = [RandomWalk(parse(k, f"{kind} random walk"))] if k else []
    flicker = BiasInstability(parse(b, f"{kind} bias instability"), 0.05, 1e4)
    return ProcessSum((WhiteNoise(parse(n, f"{kind} white noise")), flicker, *walk))


# Table 2 of S004 as printed: AR(3) coefficients, its variance, the variance of AR(1)
TABLE_2 = {
    "gyro_x": (
        _sensor("2.42 deg/sqrt(h)", "44.533 deg/h", "", "gyro"),
        7,
        (-2.564, 2.131, -0.567),
        2.739e-13,
        1.014e-10,
        (370.0, 15.0),
    ),
    "accel_x": (
        _sensor("0.045 m/s/sqrt(h)", "2.65 m/s/h", "166.3 m/s/h^1.5", "accel"),
        7,
        (-2.582, 2.166, -0.585),
        4.973e-13,
        2.129e-10,
        (428.0, 40.0),
    ),
    "accel_z": (
        _sensor("0.047 m/s/sqrt(h)", "1.30 m/s/h", "13.53 m/s/h^1.5", "accel"),
        6,
        None,
        7.964e-12,
        1.014e-9,
        (130.0, 12.0),
    ),
}


@pytest.mark.parametrize("axis", sorted(TABLE_2))
def test_table_2_is_the_low_pass_and_not_the_sensor(axis: str) -> None:
    process, level, coefficients, third, first, (ratio, band) = TABLE_2[axis]
    signal = process.simulate(1_260_000, 0.01, np.random.default_rng(11))
    low = denoise(signal, level=level, details="zero").signal
    three, one = fit_ar(low, 3, method="burg"), fit_ar(low, 1, method="burg")
    assert three.innovation_variance == pytest.approx(third, rel=0.35)
    assert one.innovation_variance == pytest.approx(first, rel=0.35)
    assert one.innovation_variance / three.innovation_variance == pytest.approx(ratio, abs=band)
    if coefficients is not None:
        np.testing.assert_allclose(three.coefficients, coefficients, atol=0.02)
    if axis == "gyro_x":
        # true Stein thresholds, level by level, give nothing like it (spec 2.5)
        stein = fit_ar(denoise(signal[:300_000], level=level).signal, 3, method="burg")
        assert abs(stein.coefficients[0] - coefficients[0]) > 0.5
        # and white noise alone has the fingerprint of db4 at 7 levels
        white = np.random.default_rng(12).standard_normal(400_000)
        bare = fit_ar(denoise(white, level=7, details="zero").signal, 3, method="burg")
        np.testing.assert_allclose(bare.coefficients, (-2.556, 2.116, -0.560), atol=0.02)


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_scale_does_not_matter(scale: float) -> None:
    signal = np.random.default_rng(13).standard_normal(3000).cumsum()
    unit, scaled = denoise(signal, level=4), denoise(scale * signal, level=4)
    np.testing.assert_allclose(scaled.signal, scale * unit.signal, rtol=1e-8, atol=1e-9 * scale)
    np.testing.assert_allclose(scaled.thresholds, scale * unit.thresholds, rtol=1e-8)


def test_constant_and_coarse_signals_are_flagged() -> None:
    still = denoise(np.full(500, 9.81))
    assert still.flags == ("constant",)
    np.testing.assert_allclose(still.signal, 9.81, rtol=1e-14)
    coarse = np.round(0.3 * np.random.default_rng(14).standard_normal(5000))
    held = np.repeat(coarse[:500], 40)
    result = denoise(held, level=3)
    assert "coarse steps" in result.flags
    assert np.isfinite(result.signal).all()
    assert (result.noise_scales > 0.0).all()


def test_an_outlier_does_not_move_the_scale() -> None:
    signal = np.random.default_rng(15).standard_normal(4000)
    struck = signal.copy()
    struck[2000] = 1e9
    clean, hit = denoise(signal, level=4), denoise(struck, level=4)
    np.testing.assert_allclose(hit.noise_scales, clean.noise_scales, rtol=0.2)


def test_motion_taken_for_noise_is_told() -> None:
    t = np.arange(100_000) / 100.0
    motion = np.sin(2 * np.pi * 0.21 * t)
    signal = motion + 0.1 * np.random.default_rng(18).standard_normal(t.size)
    by_level = denoise(signal, level=8)
    assert "motion in details" in by_level.flags
    assert np.std(by_level.signal - motion) > 0.3
    finest = denoise(signal, level=8, scale="sln")
    assert finest.flags == ()
    assert np.std(finest.signal - motion) < 0.05
    assert denoise(signal, level=5).flags == ()


def test_slow_gauss_markov_noise_survives() -> None:
    rng = np.random.default_rng(16)
    slow = GaussMarkov(1.0, 20.0).simulate(60_000, 0.01, rng)
    result = denoise(slow + rng.standard_normal(slow.size), level=6, details="zero")
    assert np.std(result.signal - slow) < 0.2


def test_results_are_json() -> None:
    result = denoise(np.random.default_rng(17).standard_normal(500), level=2, details="zero")
    back = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert back["thresholds"] == [None, None]
    assert back["causal"] is False


@pytest.mark.parametrize(
    ("signal", "how", "words"),
    [
        (np.zeros(0), {}, "0 samples"),
        (np.append(np.zeros(100), 1e200), {}, "1e120"),
        (np.arange(7.0), {}, "longer signal"),
        (np.arange(100.0), {"level": 4}, "from 1 to 3"),
        (np.arange(100.0), {"level": 0}, "0 levels"),
        (np.arange(100.0), {"level": 2.5}, "whole number"),
        (np.append(np.zeros(100), np.nan), {}, "row 100"),
        (np.append(np.zeros(100), np.inf), {}, "not finite"),
        (np.zeros((100, 2)), {}, "shape"),
        (np.arange(100.0), {"wavelet": "db99"}, "db99"),
        (np.arange(100.0), {"wavelet": "morl"}, "morl"),
        (np.arange(100.0), {"threshold": "stein"}, "threshold"),
        (np.arange(100.0), {"mode": "garrote"}, "mode"),
        (np.arange(100.0), {"scale": "two"}, "scale"),
        (np.arange(100.0), {"details": "keep"}, "details"),
        (np.arange(100.0), {"band": 5.0}, "without a rate"),
        (np.arange(100.0), {"band": 5.0, "rate": 100.0, "level": 3}, "both"),
        (np.arange(100.0), {"band": 50.0, "rate": 100.0}, "at most 25 Hz"),
        (np.arange(100.0), {"band": 5.0, "rate": -1.0}, "rate"),
    ],
)
def test_bad_input_is_refused_in_one_line(signal: Any, how: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        denoise(signal, **how)
    assert "\n" not in str(caught.value)
