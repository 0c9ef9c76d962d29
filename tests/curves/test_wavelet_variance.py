"""The wavelet variance is half the Allan variance, scatters as it says, and resists outliers."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from schuler.curves.allan import allan_deviation
from schuler.curves.robust import biweight_tuning, robust_variance
from schuler.curves.wavelet_variance import wavelet_variance
from schuler.errors import EstimationError, InputError
from schuler.noise import GaussMarkov, Process, RandomWalk, WhiteNoise

# accelerometer of the design documents at 100 Hz: a sample of white noise has 7.5e-3 m/s²
ACCEL = WhiteNoise(7.5e-4) + GaussMarkov(1.376e-3, 7.0) + RandomWalk(1.157e-4)
SAMPLE = 7.5e-3


def modwt_pyramid(signal: np.ndarray, levels: int) -> list[np.ndarray]:
    """Interior Haar MODWT coefficients by the pyramid algorithm (Percival and Walden 2000)."""
    smooth, details = signal, []
    for level in range(levels):
        lag = 2**level
        details.append(0.5 * (smooth[lag:] - smooth[:-lag]))
        smooth = 0.5 * (smooth[lag:] + smooth[:-lag])
    return details


def test_equals_the_pyramid_algorithm_and_half_the_allan_variance() -> None:
    signal = 9.8 + ACCEL.simulate(5000, 0.01, np.random.default_rng(1))
    curve = wavelet_variance(signal, 100.0)
    direct = [np.mean(w**2) for w in modwt_pyramid(signal, curve.scale.size)]
    np.testing.assert_allclose(curve.variance, direct, rtol=1e-9)
    allan = allan_deviation(signal, 100.0, curve.scale)
    np.testing.assert_allclose(curve.variance, 0.5 * allan.deviation**2, rtol=1e-12)
    np.testing.assert_allclose(curve.scale, 0.01 * 2.0 ** np.arange(11))
    np.testing.assert_allclose(curve.allan.deviation, allan.deviation, rtol=1e-12)


WHITE = WhiteNoise(0.3)
WALK = RandomWalk(0.2)
DRIFTING = GaussMarkov(1.0, 20.0) + WhiteNoise(0.5)


# robust at the sample needs noise that is about white from sample to sample: not a bare walk
@pytest.mark.parametrize(
    ("process", "robust"),
    [
        *((p, r) for p in (WHITE, DRIFTING) for r in (False, "samples", "coefficients")),
        (WALK, False),
        (WALK, "coefficients"),
    ],
)
def test_intervals_cover_the_closed_form(process: Process, robust: bool) -> None:
    hits = []
    for seed in range(30):
        signal = process.simulate(20_000, 0.1, np.random.default_rng([1, seed]))
        curve = wavelet_variance(signal, 10.0, robust)
        slow = curve.factors >= 4  # the closed form averages between samples, too
        truth = process.wavelet_variance(curve.scale)
        hits.append(((curve.lower <= truth) & (truth <= curve.upper))[slow])
    # 30 runs of 11 scales that hang together by pairs: 95 % less 4 sd
    assert 0.88 < np.mean(hits) < 0.99


def test_tuning_gives_the_efficiency_it_promises() -> None:
    rng = np.random.default_rng(5)
    draws = [rng.standard_normal(2000) for _ in range(400)]
    plain = np.var([np.mean(d**2) for d in draws])
    for efficiency in (0.4, 0.6, 0.9):
        tuning = biweight_tuning(efficiency)
        found = np.array([robust_variance(d, tuning) for d in draws])
        # sd of a ratio of two variances of 400, correlated: below 10 %
        assert plain / np.var(found[:, 0]) == pytest.approx(efficiency, rel=0.3)
        assert found[:, 0].mean() == pytest.approx(1.0, abs=0.01)
        assert found[:, 1].mean() == pytest.approx(np.std(found[:, 0]), rel=0.15)
    assert biweight_tuning(0.6).cut == pytest.approx(3.18, abs=0.02)


@pytest.mark.parametrize("kind", ["samples", "coefficients"])
def test_robust_equals_plain_on_clean_noise(kind: str) -> None:
    signal = ACCEL.simulate(400_000, 0.01, np.random.default_rng(2))
    plain = wavelet_variance(signal, 100.0)
    robust = wavelet_variance(signal, 100.0, kind)  # type: ignore[arg-type]
    count = 8
    np.testing.assert_allclose(robust.variance[:count], plain.variance[:count], rtol=0.03)
    np.testing.assert_allclose(robust.variance[0], plain.variance[0], rtol=0.01)
    assert robust.outliers < 0.003
    assert (robust.degrees_of_freedom[:count] < plain.degrees_of_freedom[:count]).all()
    # no better than its efficiency, no worse than independent coefficients would be
    assert (robust.degrees_of_freedom > 0.5 * plain.degrees_of_freedom).all()


@pytest.mark.parametrize(
    ("share", "size", "bias"),
    # the more outliers hide among the good, the more is left: theory of the biweight psi
    [(0.01, 20.0, 0.02), (0.05, 10.0, 0.04), (0.10, 10.0, 0.06), (0.15, 8.0, 0.10)],
)
def test_contaminated_samples_do_not_move_any_scale(share: float, size: float, bias: float) -> None:
    rng = np.random.default_rng(3)
    clean = ACCEL.simulate(1_000_000, 0.01, rng)
    outliers = (rng.random(clean.size) < share) * rng.standard_normal(clean.size) * size * SAMPLE
    reference = wavelet_variance(clean, 100.0).variance[:10]
    plain = wavelet_variance(clean + outliers, 100.0).variance[:10]
    robust = wavelet_variance(clean + outliers, 100.0, True)
    assert robust.robust == "samples"
    assert np.max(plain / reference) > 4.0
    ratio = robust.variance[:10] / reference
    assert np.all(np.abs(ratio - 1.0) < bias + 0.02)
    # deviations: half of it
    assert np.all(np.abs(np.sqrt(ratio) - 1.0) < 0.06)


def test_knocks_of_many_samples_are_held_back() -> None:
    rng = np.random.default_rng(4)
    clean = WhiteNoise(7.5e-4).simulate(300_000, 0.01, rng)
    knocked = clean.copy()
    for start in rng.integers(0, 290_000, 10):
        knocked[start : start + 100] += 60.0 * SAMPLE * np.sin(np.arange(100) / 3.0)
    reference = wavelet_variance(clean, 100.0).variance[:10]
    plain = wavelet_variance(knocked, 100.0).variance[:10]
    robust = wavelet_variance(knocked, 100.0, True).variance[:10]
    assert plain[3] / reference[3] > 10.0
    np.testing.assert_allclose(robust / reference, 1.0, atol=0.08)


# robust at the coefficient is not for contamination: coarse coefficients all hold outliers then
@pytest.mark.parametrize(
    ("kind", "share"), [("samples", 0.0), ("samples", 0.1), ("coefficients", 0.0)]
)
def test_robust_estimates_scatter_as_claimed(kind: str, share: float) -> None:
    found, freedom = [], []
    for seed in range(80):
        rng = np.random.default_rng([6, seed])
        signal = WhiteNoise(1.0).simulate(20_000, 1.0, rng)
        signal += (rng.random(signal.size) < share) * rng.standard_normal(signal.size) * 10.0
        curve = wavelet_variance(signal, 1.0, kind)  # type: ignore[arg-type]
        found.append(curve.variance[:8] / WhiteNoise(1.0).wavelet_variance(curve.scale[:8]))
        freedom.append(curve.degrees_of_freedom[:8])
    claimed = np.sqrt(2.0 / np.mean(freedom, axis=0)) * np.mean(found, axis=0)
    # sd of an sd of 80 is 8 %
    np.testing.assert_allclose(np.std(found, axis=0) / claimed, 1.0, atol=0.35)


def test_scales_with_the_unit_and_survives_one_huge_sample() -> None:
    signal = WhiteNoise(1.0).simulate(30_000, 1.0, np.random.default_rng(7))
    for robust in (False, True, "coefficients"):
        curve = wavelet_variance(signal, 1.0, robust)  # type: ignore[arg-type]
        for factor in (1e-12, 1e12):
            other = wavelet_variance(factor * signal, 1.0, robust)  # type: ignore[arg-type]
            np.testing.assert_allclose(other.variance, factor**2 * curve.variance, rtol=1e-8)
    struck = signal.copy()
    struck[777] = 1e6
    clean = wavelet_variance(signal, 1.0, True).variance
    np.testing.assert_allclose(wavelet_variance(struck, 1.0, True).variance, clean, rtol=0.02)


def test_seven_hours_take_a_fraction_of_a_second() -> None:
    signal = np.random.default_rng(8).standard_normal(2_520_000)
    wavelet_variance(signal[:5000], 100.0, True)
    start = time.process_time()
    curve = wavelet_variance(signal, 100.0)
    plain = time.process_time() - start
    wavelet_variance(signal, 100.0, True)
    assert plain < 0.3  # 0.03 on a quiet machine
    assert time.process_time() - start < 4.0  # 0.6
    assert math.log2(curve.factors[-1]) == 19


@pytest.mark.parametrize(
    ("signal", "error", "text"),
    [
        (np.zeros((100, 2)), InputError, "one channel"),
        (np.ones(10), EstimationError, "10 samples"),
        (np.where(np.arange(500) == 5, np.nan, 1.0), InputError, "row 5"),
        (np.where(np.arange(500) == 9, np.inf, 1.0), InputError, "row 9"),
        (np.ones(500, dtype=complex), InputError, "complex"),
    ],
)
def test_bad_signals_are_refused(signal: np.ndarray, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text) as caught:
        wavelet_variance(signal, 100.0)
    assert "\n" not in str(caught.value)


def test_wrong_wishes_are_refused() -> None:
    signal = np.random.default_rng(0).standard_normal(1000)
    with pytest.raises(InputError, match="rate"):
        wavelet_variance(signal, -1.0)
    with pytest.raises(InputError, match="efficiency"):
        wavelet_variance(signal, 1.0, True, efficiency=1.0)
    with pytest.raises(InputError, match="robust"):
        wavelet_variance(signal, 1.0, "median")  # type: ignore[arg-type]
    with pytest.raises(EstimationError, match="robust=False"):
        wavelet_variance(np.round(0.2 * signal), 1.0, True)


def test_contaminated_gyro(data_folder: object) -> None:
    import polars as pl

    table = pl.read_parquet(f"{data_folder}/mtig-gyro-static/gyro_x.parquet")
    signal = table["gyro_x_rad_s"].to_numpy()
    plain, robust = wavelet_variance(signal, 100.0), wavelet_variance(signal, 100.0, True)
    # median absolute deviation says 2.0e-3 where the plain deviation is 5.6e-3
    assert math.sqrt(2.0 * plain.variance[0]) == pytest.approx(5.6e-3, rel=0.02)
    assert math.sqrt(2.0 * robust.variance[0]) < 2.0e-3
    assert robust.outliers > 0.2
    # white contamination hides the core at every scale up to 10 s
    ratio = plain.variance / robust.variance
    assert np.all(ratio[:8] > 10.0)
