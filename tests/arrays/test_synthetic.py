"""The synthetic IMU: S000's Table 4, weights that follow the past, gaps, lever arms, frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.arrays.synthesis.array_noise import array_noise
from schuler.arrays.synthesis.fused_noise import combine_noise_models
from schuler.arrays.synthesis.least_squares import least_squares
from schuler.arrays.synthesis.synthetic import Weights, synthesize
from schuler.arrays.tracking import OnlineSettings
from schuler.data import CHANNELS, ImuArray, Mounting
from schuler.errors import EstimationError, InputError
from schuler.noise import (
    GaussMarkov,
    NoiseModel,
    RandomWalk,
    TurnOnBias,
    WhiteNoise,
)
from schuler.simulation import motorcycle, simulate_array

S000 = np.array([0.0207, 0.0146, 0.0146, 0.0290])
"""Deviations that reproduce the paper's figures (spec 8.1), rad/s."""


def at_rest(sigma: np.ndarray, seconds: float, seed: int, rate: float = 100.0) -> ImuArray:
    """Aligned IMUs at rest, gyros of the given deviations (k,) or (k, 3)."""
    rng = np.random.default_rng(seed)
    n, k = round(seconds * rate), len(sigma)
    sd = np.broadcast_to(np.asarray(sigma).reshape(k, -1), (k, 3))
    gyro = sd * rng.standard_normal((n, k, 3))
    accel = 0.02 * rng.standard_normal((n, k, 3)) + [0.0, 0.0, -9.81]
    return ImuArray(np.arange(n) / rate, gyro, accel, Mounting.aligned(k))


def disturbed(a: float, seed: int, sensor: int = 0) -> ImuArray:
    """S000 (13) with the factor a that it lacks: a sin(6 pi t / t_max) N(0, s_1²) on axis x."""
    array = at_rest(S000, 600.0, seed)
    rng = np.random.default_rng(seed + 1000)
    gyro = array.gyro.copy()
    wave = a * np.sin(6 * np.pi * array.time / array.time[-1])
    gyro[:, sensor, 0] += wave * S000[sensor] * rng.standard_normal(array.size)
    return replace(array, gyro=gyro)


ALONG = np.sqrt([0.434, 0.283, 0.283])
"""Direction of the turning. The table is of the norm, which feels the disturbed axis by its share
of the rate: 0.434 is what the paper's 0.0262 asks for, its 0.0156 and all ratios follow."""


def deviation(
    array: ImuArray, weights: Weights, along: object = (1, 0, 0), **options: object
) -> float:
    """Of the fused gyro after the beginning that is learnt from: the truth is zero."""
    imu = synthesize(array, weights, **options).imu  # type: ignore[arg-type]
    return float((imu.gyro[1000:] @ np.asarray(along)).std())


def test_table_4_of_s000_with_weights_from_the_past_alone() -> None:
    equal = {a: deviation(disturbed(a, 1), "equal", ALONG) for a in (0, 5, 10)}
    # the paper: 0.0103, 0.0156, 0.0262
    for a, printed in ((0, 0.0103), (5, 0.0156), (10, 0.0262)):
        assert equal[a] == pytest.approx(printed, rel=0.04)
    assert equal[10] / equal[0] == pytest.approx(2.5, abs=0.15)
    weighted = {a: deviation(disturbed(a, 1), "ewma", ALONG) for a in (0, 5, 10)}
    assert weighted[10] / weighted[0] < 1.3
    # oracle weights: 0.0088, 0.0092, 0.0092; spec 8.1 has 0.0091, 0.0096, 0.0097 with the hat
    for a, best in ((0, 0.0088), (5, 0.0090), (10, 0.0090)):
        assert best * 0.98 < weighted[a] < best * 1.05
    assert 0.84 < weighted[0] / equal[0] < 0.90


def test_reductions_are_those_of_the_paper_under_their_right_names() -> None:
    fused = synthesize(at_rest(S000, 300.0, 2), "equal").gyro
    assert fused is not None
    assert 0.46 < fused.reduction < 0.50
    best = synthesize(at_rest(S000, 300.0, 2), "inverse_variance").gyro
    assert best is not None and 0.54 < best.reduction < 0.58
    same = synthesize(at_rest(np.full(4, 0.0194), 300.0, 3), "equal").gyro
    assert same is not None
    assert same.reduction == pytest.approx(0.5, abs=0.005)
    assert same.gain == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(same.effective_sensors, 4.0, rtol=0.02)
    # one over the sum of the information (S000 (1))
    np.testing.assert_allclose(np.diag(best.mean_covariance), 1 / np.sum(S000**-2.0), rtol=0.03)


@pytest.mark.parametrize("weights", ["inverse_variance", "averaged_volatility", "ewma", "garch"])
def test_equal_sensors_lose_less_than_one_percent(weights: Weights) -> None:
    array = at_rest(np.full(4, 0.02), 300.0, 4)
    learnt = {"settings": OnlineSettings(learning=20.0)}
    loss = deviation(array, weights, **learnt) / deviation(array, "equal", **learnt)
    assert 0.999 < loss < 1.01


def test_the_bias_of_one_sensor_enters_by_its_share_or_by_its_weight() -> None:
    # S000 Figure 6: b_4 = 0.0102 rad/s, synthetic 2.55e-3
    array = at_rest(S000, 600.0, 5)
    gyro = array.gyro.copy()
    gyro[:, 3] += 0.0102
    array = replace(array, gyro=gyro)
    equal = synthesize(array, "equal").imu.gyro[1000:, 0]
    assert equal.mean() == pytest.approx(0.0102 / 4, rel=0.05)
    # differences of biases removed: the mean of all biases stays, whatever the weights
    followed = synthesize(array, "ewma").imu.gyro[1000:, 0]
    assert followed.mean() == pytest.approx(0.0102 / 4, rel=0.1)
    kept = synthesize(array, "ewma", settings=OnlineSettings(keep_biases=True)).imu.gyro[1000:, 0]
    assert kept.mean() < 0.7 * 0.0102 / 4
    ratio = np.mean(kept**2) / np.mean(equal**2)
    assert 0.65 < ratio < 0.78


@pytest.mark.parametrize("weights", ["ewma", "averaged_volatility", "garch"])
def test_the_future_does_not_change_the_past(weights: Weights) -> None:
    array = disturbed(5, 6).between(0.0, 60.0)
    gyro, accel = array.gyro.copy(), array.accel.copy()
    gyro[4000:, :2] *= 30.0
    accel[4000:] += 1.0
    other = replace(array, gyro=gyro, accel=accel)
    first, second = synthesize(array, weights), synthesize(other, weights)
    # the beginning is learnt from both alike; 10 s by default
    np.testing.assert_allclose(first.imu.gyro[:4000], second.imu.gyro[:4000], atol=1e-12)
    np.testing.assert_allclose(first.imu.accel[:4000], second.imu.accel[:4000], atol=1e-11)
    assert np.abs(first.imu.gyro[4100:] - second.imu.gyro[4100:]).max() > 1e-3


def test_claimed_covariance_is_that_of_the_errors_sample_by_sample() -> None:
    array = disturbed(10, 7)
    weights: Weights
    for weights in ("ewma", "garch", "averaged_volatility"):
        # GARCH learns what changes from a period in which it does
        settings = OnlineSettings(learning=100.0 if weights == "garch" else 10.0)
        synthetic = synthesize(array, weights, settings=settings)
        claimed = np.sqrt(synthetic.covariance("gyro")[1000:, 0, 0])
        score = synthetic.imu.gyro[1000:, 0] / claimed
        # one variance for all axes says too little of one noisy axis among twelve: sqrt(3)
        band = (1.5, 2.0) if weights == "averaged_volatility" else (0.97, 1.05)
        assert band[0] < np.sqrt(np.mean(score**2)) < band[1]
        density = synthetic.noise_density("gyro")[1000:, 0]
        np.testing.assert_allclose(density, claimed / 10.0)


def test_garch_with_arma_predicts_what_is_predictable() -> None:
    # correlated noise, different in every sensor: the conditional mean takes it out (S000 (12))
    rng = np.random.default_rng(8)
    array = at_rest(np.full(4, 1e-3), 200.0, 8)
    slow = np.stack(
        [GaussMarkov(0.005, 0.6).simulate(array.size, 0.01, rng) for _ in range(12)], axis=1
    ).reshape(-1, 4, 3)
    array = replace(array, gyro=array.gyro + slow, accel=np.full_like(array.accel, np.nan))
    settings = OnlineSettings(learning=60.0)
    plain = synthesize(array, "garch", settings=settings)
    better = synthesize(array, "garch", settings=settings, arma=(1, 1))
    assert plain.gyro is not None and better.gyro is not None
    # only differences between sensors can be predicted: the mean of equal sensors stays
    # (weights from correlated residuals lose 5 %: measured 1.054)
    assert 1.0 <= plain.imu.gyro[6000:].std() / better.imu.gyro[6000:].std() < 1.1
    # but what is left of each is the innovation: 1.7e-3 of 5.1e-3
    ratio = better.gyro.mean_deviation / plain.gyro.mean_deviation
    np.testing.assert_allclose(ratio, 0.34, atol=0.06)
    assert np.isnan(plain.imu.accel).all()


def test_wavelet_weights_prefer_the_sensor_that_is_stable_for_long() -> None:
    # sensor 1: quiet but wandering; the others: noisy but stable
    rng = np.random.default_rng(9)
    array = at_rest(np.array([0.2e-3, 1e-3, 1e-3, 1e-3]), 2000.0, 9, rate=20.0)
    gyro = array.gyro.copy()
    for axis in range(3):
        gyro[:, 0, axis] += RandomWalk(2e-3).simulate(array.size, 0.05, rng) * 0.1
    array = replace(array, gyro=gyro)
    half = array.between(0.0, 1000.0)
    scored = array.between(1000.0, 2000.0)

    def angle_error(weights: Weights) -> float:
        keep = OnlineSettings(keep_biases=True)
        imu = synthesize(
            scored,
            weights,
            static=half,
            scales=(20.0,),
            settings=keep,
            noise=None if weights == "wavelet" else array_noise(half),
        ).imu
        means = imu.gyro[:19_200].reshape(-1, 400, 3).mean(axis=1)
        return float(np.sqrt(np.mean(np.diff(means, axis=0) ** 2)))

    assert angle_error("wavelet") < 0.6 * angle_error("inverse_variance")
    with pytest.raises(EstimationError, match=r"differences of 200 s.*shorter scales"):
        synthesize(scored, "wavelet", static=half, scales=(200.0,))


def test_weights_of_a_held_out_recording_are_used_as_they_are() -> None:
    noise = array_noise(at_rest(S000, 100.0, 10))
    np.testing.assert_allclose(noise.gyro_deviation, S000[:, None] * np.ones(3), rtol=0.05)
    short = at_rest(S000, 30.0, 11)
    fused = synthesize(short, "inverse_variance", noise=noise).gyro
    assert fused is not None
    expected = S000**-2.0 / np.sum(S000**-2.0) / 3
    np.testing.assert_allclose(
        fused.weight[0].reshape(4, 3), expected[:, None] * np.ones(3), rtol=0.1
    )
    # at half the rate white noise has half the variance
    sensors = synthesize(at_rest(S000, 60.0, 12, rate=50.0), "equal", noise=noise).gyro
    assert sensors is not None
    np.testing.assert_allclose(
        sensors.mean_deviation.reshape(4, 3), noise.gyro_deviation / np.sqrt(2), rtol=1e-9
    )


def test_a_users_covariance_weighs_and_correlated_sensors_count_less() -> None:
    rng = np.random.default_rng(13)
    shared = 0.02 * rng.standard_normal((30_000, 1, 3))
    array = at_rest(np.full(4, 0.01), 300.0, 13)
    gyro = array.gyro.copy()
    gyro[:, :2] += shared
    array = replace(array, gyro=gyro)
    full = np.kron(np.diag([1.0, 1, 1, 1]) * 1e-4, np.eye(3))
    full[:6, :6] += np.kron(np.ones((2, 2)) * 4e-4, np.eye(3))
    plain = deviation(array, "equal")
    told = deviation(array, "equal", covariance={"gyro": full})
    a = np.tile(np.eye(3), (4, 1))
    best = np.sqrt(least_squares(a, full).covariance[0, 0])
    assert told == pytest.approx(best, rel=0.02) and told < 0.75 * plain


def ride(seed: int, *, arms: float = 0.05, noise: float = 1e-3) -> tuple[ImuArray, ImuArray]:
    """Four IMUs on a tetrahedron on a motorcycle, and what the centre feels."""
    profile = motorcycle(60.0, seed, standstill=5.0)
    mounting = tetrahedron_mounting(arms)
    models = NoiseModel(
        {c: WhiteNoise(noise * (1e-3 if c.startswith("g") else 1e-2)) for c in CHANNELS}
    )
    made = simulate_array(
        profile, mounting.rotation, mounting.position, models, 100.0, np.random.default_rng(seed)
    )
    centre = simulate_array(
        profile, np.eye(3)[None], np.zeros((1, 3)), None, 100.0, np.random.default_rng(seed)
    )
    return ImuArray.from_recordings(made, mounting), ImuArray.from_recordings(
        centre, Mounting.aligned(1)
    )


def test_skewed_imus_with_lever_arms_say_what_the_centre_feels() -> None:
    array, centre = ride(14, arms=0.2)
    truth = centre.imu(0)
    # off the centre: the size effect of four faces cancels, so three of them are taken
    for part in (array, array.select([0, 1, 2])):
        for causal, accuracy in ((False, 6e-4), (True, 1e-3)):
            imu = synthesize(part, "ewma", causal=causal).imu
            np.testing.assert_allclose(imu.gyro, truth.gyro, atol=1e-4)
            error = np.abs(imu.accel - truth.accel)[1000:-1].max()
            assert error < accuracy
    ignored = replace(
        array.select([0, 1, 2]),
        mounting=Mounting(array.mounting.rotation[:3], np.zeros((3, 3))),
    )
    without = synthesize(ignored, "ewma", causal=False).imu
    assert np.abs(without.accel - truth.accel)[1000:-1].max() > 0.05


def test_a_sensor_dead_for_half_the_run_leaves_no_step() -> None:
    array = at_rest(S000, 120.0, 15)
    gyro = array.gyro + np.array([0.05, -0.02, 0.03, 0.0])[:, None]
    truth = gyro.mean(axis=(0, 1))
    gyro[6000:, 1] = np.nan
    gyro[np.random.default_rng(1).random(gyro.shape) < 0.001] = np.nan
    array = replace(array, gyro=gyro)
    for weights in ("equal", "inverse_variance", "ewma"):
        synthetic = synthesize(array, weights)
        assert synthetic.imu.size == array.size
        first, second = synthetic.imu.gyro[1000:6000], synthetic.imu.gyro[6100:]
        np.testing.assert_allclose(second.mean(axis=0), truth, atol=8e-4)
        claimed = np.sqrt(synthetic.covariance("gyro")[:, 0, 0])
        # its information is gone, and said to be
        assert claimed[8000] > 1.1 * claimed[3000]
        assert second[:, 0].std() / first[:, 0].std() == pytest.approx(
            claimed[8000] / claimed[3000], rel=0.08
        )


def test_samples_that_too_few_sensors_measured_are_left_out() -> None:
    array = at_rest(S000, 60.0, 16)
    gyro = array.gyro.copy()
    gyro[3000:3100] = np.nan
    gyro[4000, :, 1] = np.nan
    for weights in ("equal", "ewma"):
        synthetic = synthesize(replace(array, gyro=gyro), weights)
        assert synthetic.imu.size == array.size - 101
        assert np.isfinite(synthetic.imu.gyro).all()
        assert "101 samples left out" in synthetic.imu.history[-1]
        np.testing.assert_array_equal(synthetic.imu.time, array.time[synthetic.rows])


def test_the_noise_model_of_the_fused_sensor_is_that_of_its_parts() -> None:
    rate = {
        c: WhiteNoise(4e-4) + GaussMarkov(2e-4, 100.0) + RandomWalk(1e-6, 1e-3) + TurnOnBias(5e-3)
        for c in CHANNELS
    }
    models = [NoiseModel(rate)] * 4
    synthetic = synthesize(at_rest(np.full(4, 0.004), 60.0, 17), "equal", noise_models=models)
    made = synthetic.noise_model.process("gyro_x").parameters
    assert made["white_noise.density"] == pytest.approx(2e-4)
    assert made["gauss_markov.sigma"] == pytest.approx(1e-4)
    assert made["gauss_markov.correlation_time"] == 100.0
    assert made["random_walk.density"] == pytest.approx(5e-7)
    assert made["random_walk.initial_sd"] == pytest.approx(5e-4)
    assert made["turn_on_bias.sigma"] == pytest.approx(2.5e-3)
    # any mixture of shares: variances of independent parts add, also in the spectrum
    shares = np.array([0.7, 0.2, 0.1])
    other = NoiseModel({"gyro_x": WhiteNoise(1e-3) + GaussMarkov(1e-4, 7.0)})
    mixed = combine_noise_models(
        [NoiseModel({"gyro_x": rate["gyro_x"], "gyro_y": WhiteNoise(1), "gyro_z": WhiteNoise(1)})],
        {"gyro": np.eye(3)},
    ).process("gyro_x")
    assert mixed.parameters["white_noise.density"] == pytest.approx(4e-4)
    from schuler.arrays.synthesis.fused_noise import combine_processes

    parts = [rate["gyro_x"], other.process("gyro_x"), WhiteNoise(2e-4)]
    f = np.logspace(-3, 1, 20)
    expected = sum(s**2 * p.psd(f, onesided=True) for s, p in zip(shares, parts, strict=True))
    np.testing.assert_allclose(combine_processes(parts, shares).psd(f, onesided=True), expected)
    # without models: the white noise that the redundancy shows
    shown = synthesize(at_rest(np.full(4, 0.004), 60.0, 17), "equal").noise_model
    assert shown.process("gyro_y").parameters["white_noise.density"] == pytest.approx(
        2e-4, rel=0.03
    )


def test_what_cannot_be_fused_is_refused() -> None:
    array = at_rest(S000, 20.0, 18)
    with pytest.raises(InputError, match="one IMU"):
        synthesize(array.select([0]))
    with pytest.raises(InputError, match="weights 'best'"):
        synthesize(array, "best")  # type: ignore[arg-type]
    with pytest.raises(EstimationError, match="two sensors cannot be told apart"):
        synthesize(array.select([0, 1]), "garch")
    with pytest.raises(EstimationError, match="samples to fit GARCH on"):
        synthesize(array, "garch", settings=OnlineSettings(learning=1.0))
    two = synthesize(array.select([0, 1]))
    assert two.weights == "averaged_volatility" and two.gyro is not None
    np.testing.assert_allclose(two.gyro.weight[100], 1 / 6, rtol=1e-9)
    with pytest.raises(InputError, match="0 samples that enough"):
        alternate = np.where((np.arange(array.size) % 2 == 0)[:, None, None], array.gyro, np.nan)
        accel = np.where((np.arange(array.size) % 2 == 1)[:, None, None], array.accel, np.nan)
        synthesize(replace(array, gyro=alternate, accel=accel), "equal")
