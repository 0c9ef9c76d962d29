"""White noise that changes: followed on line, from the past alone, and worth something."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError, ModelError
from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.evaluation.outage_twin import draw_outage_twin, outage_twin
from schuler.navigation.error_models.changing_noise import (
    ChangingNoise,
    VarianceRecursion,
    averaged_noise,
    fitted_noise,
    one_step_variance,
    rest_variance,
)
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigation.run import run
from schuler.navigation.settings import NavigationSettings
from schuler.noise import NoiseModel, RandomWalk, TurnOnBias, WhiteNoise
from schuler.simulation import car_urban, ideal_imu

DT = 0.01
DENSITY = np.array([2e-3] * 3 + [3e-4] * 3)
ALPHA, BETA = 0.01, 0.9898
TRUE = VarianceRecursion(ALPHA, BETA)
USUAL = {c: float(d**2) / DT for c, d in zip((*CHANNELS[3:], *CHANNELS[:3]), DENSITY, strict=True)}


def garch_noise(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Noise and its variance over the constant one, (n, 6), accelerometers first."""
    noise, scale = np.empty((n, 6)), np.empty((n, 6))
    for c in range(6):
        constant = DENSITY[c] ** 2 / DT
        noise[:, c], variance = simulate_garch(n, (1.0 - ALPHA - BETA) * constant, ALPHA, BETA, rng)
        scale[:, c] = variance / constant
    return noise, scale


def recording(noise: np.ndarray, ideal: ImuRecording | None = None) -> ImuRecording:
    n = len(noise)
    gyro, accel = noise[:, 3:], noise[:, :3]
    if ideal is None:
        return ImuRecording(np.arange(1, n + 1) * DT, gyro, accel)
    return replace(ideal, gyro=ideal.gyro + gyro, accel=ideal.accel + accel)


def test_a_variance_knows_the_past_alone() -> None:
    rng = np.random.default_rng(1)
    signal = rng.standard_normal(2000)
    other = signal.copy()
    other[1000:] += 5.0 * rng.standard_normal(1000)
    one, two = (one_step_variance(s, TRUE, 1.0) for s in (signal, other))
    np.testing.assert_array_equal(one[:1001], two[:1001])
    assert (two[1010:] > one[1010:]).mean() > 0.9


@pytest.mark.parametrize("recursion", [TRUE, VarianceRecursion.averaging(1.0, DT)])
def test_constant_noise_stays_constant_on_average(recursion: VarianceRecursion) -> None:
    # the mean of squares of white noise is its variance, whatever the weights
    signal = 0.3 * np.random.default_rng(2).standard_normal(400_000)
    found = one_step_variance(signal, recursion, 0.09)
    assert found.mean() == pytest.approx(0.09, rel=0.02)
    # an average over 1/a samples of squares of second differences, whose correlations are 4/9
    # and 1/36 at one and two samples
    law = np.sqrt(2.0 * (1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)) * recursion.alpha**2)
    law /= np.sqrt(1.0 - recursion.beta**2)
    assert found.std() / 0.09 == pytest.approx(law, rel=0.05)


def test_what_is_followed_is_the_true_variance() -> None:
    noise, scale = garch_noise(200_000, np.random.default_rng(3))
    imu = recording(noise)
    for changing in (
        ChangingNoise(dict.fromkeys(CHANNELS, TRUE), USUAL),
        averaged_noise(DT, reference=USUAL),
    ):
        found = changing.white_scale(imu)
        for c in range(6):
            truth = np.log(scale[5000:, c])
            assert np.corrcoef(truth, np.log(found[5000:, c]))[0, 1] > 0.95
            assert found[5000:, c].mean() == pytest.approx(scale[5000:, c].mean(), rel=0.02)


def test_motion_is_not_taken_for_noise() -> None:
    ideal = ideal_imu(car_urban(120.0, 4, standstill=10.0), 100.0)
    rng = np.random.default_rng(5)
    white = DENSITY / np.sqrt(DT) * rng.standard_normal((ideal.size, 6))
    changing = averaged_noise(DT, reference=USUAL)
    still = changing.white_scale(recording(white))
    moving = changing.white_scale(recording(white, ideal))
    # 2 % where nothing but a jerk could do it
    assert np.abs(moving[300:] / still[300:] - 1.0).max() < 0.02


def test_a_sensor_that_filters_its_output_is_not_taken_for_quiet() -> None:
    # means of four samples leave 1/24 of the power in second differences, and all of N
    rng = np.random.default_rng(9)
    white = DENSITY / np.sqrt(DT) * rng.standard_normal((40_003, 6))
    smooth = np.stack([np.convolve(w, np.full(4, 0.25), "valid") for w in white.T], axis=-1)
    smooth[20_000:] *= 2.0
    found = averaged_noise(DT).white_scale(recording(smooth))
    quiet, loud = found[1000:19_000].mean(axis=0), found[21_000:].mean(axis=0)
    np.testing.assert_allclose(loud / quiet, 4.0, rtol=0.05)
    np.testing.assert_allclose(found.mean(axis=0), 1.0, rtol=0.02)
    # against a static record as quiet as its first half, the drive is as loud as it is
    told = averaged_noise(DT, reference=rest_variance(recording(smooth[:20_000])))
    np.testing.assert_allclose(
        told.white_scale(recording(smooth))[21_000:].mean(axis=0), 4.0, rtol=0.05
    )


def test_garch_of_a_static_record() -> None:
    rng = np.random.default_rng(6)
    noise, scale = garch_noise(160_000, rng)
    noise[:, 0] = DENSITY[0] / np.sqrt(DT) * rng.standard_normal(len(noise))
    imu = recording(noise)
    fitted = fitted_noise(imu)
    # accelerometer x is constant, and is left so
    assert set(fitted.recursions) == set(CHANNELS) - {"accel_x"}
    for r in fitted.recursions.values():
        assert r.persistence == pytest.approx(ALPHA + BETA, abs=2e-4)
        assert r.alpha == pytest.approx(ALPHA, rel=0.5)
    found = fitted.white_scale(imu)
    assert np.corrcoef(np.log(scale[5000:, 4]), np.log(found[5000:, 4]))[0, 1] > 0.95


def test_a_filter_that_follows_the_noise_is_better() -> None:
    """GNSS is more likely, and the velocity nearer to the truth, seed by seed."""
    slow = NoiseModel(
        {
            c: RandomWalk(2e-4) + TurnOnBias(0.02)
            if c.startswith("accel")
            else RandomWalk(3e-6) + TurnOnBias(5e-4)
            for c in CHANNELS
        }
    )
    told = NoiseModel(
        {
            c: slow.process(c).parts[0] + WhiteNoise(2e-3 if c.startswith("accel") else 3e-4)
            for c in CHANNELS
        }
    )
    profile = car_urban(240.0, 7, standstill=20.0)
    twin = outage_twin(profile, slow, ())
    model = sensor_error_model(told, turn_on_accel=0.02, turn_on_gyro=5e-4)
    likelihood, velocity = [], []
    for seed in range(8):
        rng = np.random.default_rng([8, seed])
        drawn = draw_outage_twin(twin, rng)
        noise, scale = garch_noise(drawn.imu.size, rng)
        imu = recording(noise, drawn.imu)
        setup = RunSetup(
            model,
            NoiseFactors.none(),
            TimeOffsets(),
            drawn.alignment,
            np.zeros(3),
            settings=NavigationSettings(false_alarm=0.0),
        )
        truth = profile.trajectory(imu.time[3000::50]).velocity
        rows = []
        for how in (None, averaged_noise(DT, reference=USUAL).white_scale(imu), scale):
            done = run(imu, drawn.gnss, setup, white_scale=how).causal
            off = np.linalg.norm(done.trajectory.velocity[3000::50] - truth, axis=1)
            rows.append((done.log_likelihood, float(np.sqrt(np.mean(off**2)))))
        likelihood.append([r[0] for r in rows])
        velocity.append([r[1] for r in rows])
    gained = np.array(likelihood)[:, 1] - np.array(likelihood)[:, 0]
    nearer = 1.0 - np.array(velocity)[:, 1] / np.array(velocity)[:, 0]
    for values in (gained, nearer):
        assert values.mean() > 2.0 * values.std(ddof=1) / np.sqrt(values.size)
    # on line gives what the true variance gives
    best = np.array(likelihood)[:, 2] - np.array(likelihood)[:, 0]
    assert gained.mean() == pytest.approx(best.mean(), rel=0.25)


def test_impossible_recursions_are_refused() -> None:
    for alpha, beta in ((-0.1, 0.5), (0.6, 0.6)):
        with pytest.raises(ModelError):
            VarianceRecursion(alpha, beta)
    with pytest.raises(ModelError):
        VarianceRecursion.averaging(0.0, DT)
    with pytest.raises(InputError):
        ChangingNoise({"gyro_w": TRUE})
