"""White noise that follows vibration: its measure, its place in the filter, its exponent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twins import LEVER, perfect

from schuler.data import ImuRecording
from schuler.navigation.aiding.options import MeasurementOptions
from schuler.navigation.aiding.schedule import AidingSchedule
from schuler.navigation.engine import InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_states import no_sensor_states
from schuler.navigation.navigate import navigate
from schuler.navigation.tuning.vibration import VibrationResponse, vibration_level
from schuler.simulation import car_urban, simulate_gnss, static


def shaken(imu: ImuRecording, sd: np.ndarray, rng: np.random.Generator) -> ImuRecording:
    """White noise whose deviation changes from sample to sample; gyros a tenth of it."""
    return replace(
        imu,
        accel=imu.accel + sd[:, None] * rng.standard_normal((imu.size, 3)),
        gyro=imu.gyro + 0.1 * sd[:, None] * rng.standard_normal((imu.size, 3)),
    )


def test_level_is_the_logarithm_of_the_power_and_knows_no_future() -> None:
    rng = np.random.default_rng(4)
    ideal = perfect(static(100.0), 100.0)
    loud = (ideal.time > 60.0) & (ideal.time < 80.0)
    level = vibration_level(shaken(ideal, np.where(loud, 0.3, 0.1), rng))
    before, during = level[2000:6000].mean(axis=0), level[6150:7950].mean(axis=0)
    # three times the deviation is nine times the power; a second of differences knows its
    # logarithm to 0.18, 18 seconds to 0.04 (three of them here)
    np.testing.assert_allclose(during - before, np.log(9.0), atol=0.13)
    # nothing rises before the noise does, all of it has risen a second later
    assert np.abs(level[5900:6000] - before).max() < 1.0
    assert np.all(level[6110:6150].mean(axis=0) > before + 1.5)


def test_scaled_noise_grows_the_claim_from_the_sample_on() -> None:
    profile = static(21.0)
    ideal = perfect(profile, 50.0)
    density = 0.01
    model = no_sensor_states(np.repeat([density, 0.0], 3))
    nothing = AidingSchedule(
        np.empty(0),
        np.empty(0, dtype=np.int64),
        np.empty((0, 3)),
        np.empty((0, 3)),
        np.empty((0, 3)),
    )
    truth = profile.trajectory(ideal.time[:1])
    start = InitialState(
        truth.position[0], np.zeros(3), truth.rotation[0], np.empty(0), np.zeros((9, 9))
    )
    # accelerometers first: y nine times the power in the second half, gyros untouched
    scale = np.ones((ideal.size, 6))
    half = ideal.time > ideal.time[0] + 10.0
    scale[half, 1] = 9.0
    scale[:, 3:] = 1e6
    run = run_engine(ideal, start, model, nothing, gate=gate_thresholds(0.0), white_scale=scale)
    at = [int(np.searchsorted(ideal.time, ideal.time[0] + t - 1e-6)) for t in (10.0, 20.0)]
    sd = run.samples.velocity_sd[at]
    np.testing.assert_allclose(sd[0], density * np.sqrt(10.0), rtol=1e-3)
    np.testing.assert_allclose(sd[1, [0, 2]], density * np.sqrt(20.0), rtol=1e-3)
    assert sd[1, 1] == pytest.approx(density * np.sqrt(10.0 + 90.0), rel=2e-3)


def test_exponents_scale_accelerometers_and_gyros_apart() -> None:
    level = np.log(np.array([[4.0] * 6, [1.0] * 6]))
    scale = VibrationResponse(accel=1.0, gyro=0.5).white_scale(level)
    np.testing.assert_allclose(scale, [[4.0] * 3 + [2.0] * 3, [1.0] * 6])
    assert not VibrationResponse().active


@pytest.mark.parametrize("changing", [True, False])
def test_the_drive_decides_whether_noise_follows_vibration(changing: bool) -> None:
    rng = np.random.default_rng(6)
    profile = car_urban(300.0, 3, standstill=20.0)
    ideal = perfect(profile, 50.0)
    sd = np.full(ideal.size, 0.15)
    if changing:
        # quiet and loud by turns of seven seconds, four times the deviation
        sd = np.where(np.floor(ideal.time / 7.0) % 2 == 0, 0.1, 0.4)
    gnss = simulate_gnss(profile, 2.0, position_sd=0.05, velocity_sd=0.02, lever_arm=LEVER, rng=rng)
    found = navigate(
        shaken(ideal, sd, rng),
        gnss,
        lever_arm=LEVER,
        time_offset=0.0,
        tune_noise=True,
        measurements=MeasurementOptions(correlated=None),  # as the receiver of the twin is
    ).settings
    exponent = found["vibration_exponent_accel"]
    if changing:
        assert exponent == pytest.approx(1.0, abs=0.3)
        # the strength is known a second after it changed, so some innovations are too large
        assert found["nis_over_degrees"] == pytest.approx(1.0, abs=0.3)
    else:
        # constant noise has no strength to follow: the exponent rests on chance and does nothing
        density = found["white_noise_density"]["accel_x"]
        assert density == pytest.approx(0.15 / np.sqrt(50.0), rel=0.25)
