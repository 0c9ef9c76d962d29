"""What motion, temperature, vibration, filter and clock do to an IMU, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler import earth
from schuler import simulation as simulate
from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError
from schuler.navigation.preparation.alignment import dead_reckon
from schuler.noise import NoiseModel, WhiteNoise

PLACE = np.array([0.8, 0.1, 300.0])


def turning(yaw) -> simulate.Profile:
    """On the spot, level; yaw as a function of time."""
    t = np.linspace(0.0, 20.0, 201)
    euler = np.column_stack([np.zeros(201), np.zeros(201), yaw(t)])
    return simulate.fit_profile(t, np.tile(PLACE, (201, 1)), euler)


def plain(n: int, rate: float, gyro=(0.0, 0.0, 0.0), accel=(0.0, 0.0, -9.80665)) -> ImuRecording:
    return ImuRecording(np.arange(1, n + 1) / rate, np.tile(gyro, (n, 1)), np.tile(accel, (n, 1)))


def test_turning_at_1_rad_s_pulls_an_accelerometer_5_cm_off_inwards_by_0_05() -> None:
    profile = turning(lambda t: t)
    ideal = simulate.ideal_imu(profile, 100.0)
    tensor = simulate.arm_tensor(profile, ideal.time)
    moved = simulate.add_size_effect(ideal, tensor, (0.05, 0.0, 0.0))
    # 1e-5: the rate of the earth, 1e-4 of that of the turn
    np.testing.assert_allclose(moved.accel - ideal.accel, [[-0.05, 0.0, 0.0]] * 2000, atol=1e-5)
    np.testing.assert_array_equal(moved.gyro, ideal.gyro)


def test_spinning_up_pushes_an_arm_along_the_turn() -> None:
    profile = turning(lambda t: 0.15 * t**2)  # 0.3 rad/s² to the right
    ideal = simulate.ideal_imu(profile, 100.0)
    moved = simulate.add_size_effect(
        ideal, simulate.arm_tensor(profile, ideal.time), (0.2, 0.0, 0.0)
    )
    added = moved.accel - ideal.accel
    np.testing.assert_allclose(added[:, 1], 0.06, atol=2e-5)
    rate = 0.3 * (ideal.time - 0.005)
    np.testing.assert_allclose(added[:, 0], -0.2 * rate**2, atol=3e-4)


def test_an_imu_on_an_arm_navigates_to_where_the_arm_went() -> None:
    profile, arm = simulate.ski(10.0, 30.0, 3), np.array([0.12, -0.08, 0.15])
    centre = simulate.ideal_imu(profile, 400.0)
    imu = simulate.add_size_effect(centre, simulate.arm_tensor(profile, centre.time), arm)
    position, velocity = simulate.antenna_motion(profile, imu.time, arm)
    rotation = profile.trajectory(imu.time).rotation
    north, east = earth.metres_per_radian(position)
    metres = np.stack([north, east, np.ones(imu.size)], axis=-1)
    reached, _, _ = dead_reckon(imu, position[0], velocity[0], rotation[0])
    assert np.abs((reached - position) * metres).max() < 1e-3
    naive, _, _ = dead_reckon(centre, position[0], velocity[0], rotation[0])
    assert np.abs((naive - position) * metres).max() > 0.1


def test_each_accelerometer_may_have_its_own_place() -> None:
    profile = turning(lambda t: t)
    ideal = simulate.ideal_imu(profile, 50.0)
    places = np.array([[0.05, 0.0, 0.0], [0.0, 0.02, 0.0], [0.3, 0.3, 0.3]])
    added = (
        simulate.add_size_effect(ideal, simulate.arm_tensor(profile, ideal.time), places).accel
        - ideal.accel
    )
    np.testing.assert_allclose(added, [[-0.05, -0.02, 0.0]] * ideal.size, atol=5e-5)


def test_g_sensitivity_shows_force_as_rate() -> None:
    matrix = np.zeros((3, 3))
    matrix[0, 2] = 1e-3  # gyro x feels the force along z, which is -g at rest
    seen = simulate.simulate_imu(
        plain(100, 100.0), None, np.random.default_rng(1), g_sensitivity=matrix
    )
    np.testing.assert_allclose(seen.gyro, [[-9.80665e-3, 0.0, 0.0]] * 100, rtol=1e-12)
    np.testing.assert_array_equal(seen.accel, plain(100, 100.0).accel)


def test_bias_follows_temperature() -> None:
    imu = plain(3000, 1.0)
    imu = replace(imu, temperature=simulate.warm_up(imu.time, start=20.0, rise=10.0,
                                                    time_constant=500.0))  # fmt: skip
    drift = simulate.TemperatureDrift(
        22.0, gyro_linear=(1e-4, 0.0, -2e-4), accel_quadratic=(0.0, 1e-3, 0.0)
    )
    seen = simulate.simulate_imu(imu, None, np.random.default_rng(1), temperature_drift=drift)
    k = 500  # one time constant after the first sample
    above = 20.0 + 10.0 * (1.0 - np.exp(-1.0)) - 22.0
    np.testing.assert_allclose(seen.gyro[k], [1e-4 * above, 0.0, -2e-4 * above], rtol=1e-9)
    np.testing.assert_allclose(seen.accel[k], [0.0, 1e-3 * above**2, -9.80665], rtol=1e-9)
    np.testing.assert_allclose(seen.gyro[0, 0], -2e-4)
    np.testing.assert_array_equal(seen.temperature, imu.temperature)


def test_manoeuvre_noise_follows_rate_and_force_and_adds_in_variance() -> None:
    rate, n = 100.0, 40_000
    imu = plain(n, rate)
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    gyro[n // 2 :, 2] = -2.0
    accel[n // 2 :, 2] = -12.80665
    imu = replace(imu, gyro=gyro, accel=accel)
    model = NoiseModel({c: WhiteNoise(3e-4) for c in CHANNELS})
    noise = simulate.ManoeuvreNoise(
        gyro_with_rate=2e-4, accel_with_rate=1e-4, accel_with_force=2e-4
    )
    make = lambda **how: simulate.simulate_imu(imu, model, np.random.default_rng(4), **how)  # noqa: E731
    errors = make(manoeuvre_noise=noise).signals() - imu.signals()
    quiet, loud = errors[: n // 2].std(axis=0), errors[n // 2 :].std(axis=0)
    # relative sd of a standard deviation from 20 000 samples: 0.005
    np.testing.assert_allclose(quiet, 3e-4 * 10.0, rtol=0.02)
    np.testing.assert_allclose(loud[:3], np.hypot(3e-4, 4e-4) * 10.0, rtol=0.02)
    accel_density = np.sqrt(3e-4**2 + 2e-4**2 + 6e-4**2)
    np.testing.assert_allclose(loud[3:], accel_density * 10.0, rtol=0.02)
    assert np.abs(np.corrcoef(errors[n // 2 :].T) - np.eye(6)).max() < 0.035
    # what the model draws stays as it is
    np.testing.assert_array_equal(
        make().signals()[: n // 2], make(manoeuvre_noise=noise).signals()[: n // 2]
    )


def test_vibration_aliases_and_is_weakened_by_the_mean_over_the_interval() -> None:
    shaking = [simulate.Vibration(accel=(1.0, 0.0, 2.0), gyro=(0.0, 0.1, 0.0), frequency=130.0)]
    still = plain(4000, 100.0, accel=(0.0, 0.0, 0.0))
    shaken = simulate.add_vibration(still, shaking, np.random.default_rng(1))
    gain = abs(np.sin(np.pi * 1.3) / (np.pi * 1.3))
    assert shaken.accel[:, 0].std() == pytest.approx(gain, rel=1e-3)
    assert shaken.accel[:, 2].std() == pytest.approx(2.0 * gain, rel=1e-3)
    assert shaken.gyro[:, 1].std() == pytest.approx(0.1 * gain, rel=1e-3)
    assert np.ptp(shaken.gyro[:, 0]) == 0.0
    spectrum = np.abs(np.fft.rfft(shaken.accel[:, 0]))
    assert np.fft.rfftfreq(4000, 0.01)[np.argmax(spectrum)] == pytest.approx(30.0, abs=0.03)


def test_a_fast_recording_averaged_shows_the_same_vibration() -> None:
    shaking = [simulate.Vibration(accel=(1.0, 0, 0), frequency=37.0)]
    fast = simulate.add_vibration(
        plain(100_000, 5000.0, accel=(0, 0, 0)), shaking, np.random.default_rng(2)
    )
    slow = simulate.add_vibration(
        plain(2000, 100.0, accel=(0, 0, 0)), shaking, np.random.default_rng(2)
    )
    averaged = simulate.box_car(fast, 50, 50)
    np.testing.assert_allclose(averaged.time, slow.time, atol=1e-9)
    np.testing.assert_allclose(averaged.accel[:, 0], slow.accel[:, 0], atol=1e-3)


def test_vibration_follows_the_turning_rate_and_the_strength() -> None:
    n = 8000
    speed = np.where(np.arange(n) < n // 2, 5.85, 17.55)
    shaken = simulate.add_vibration(
        plain(n, 200.0, accel=(0, 0, 0)),
        [simulate.Vibration(accel=(1.0, 0, 0), order=2.0)],
        np.random.default_rng(3),
        turning_rate=simulate.wheel_turning_rate(speed),
        strength=speed / 11.7,
    )
    for part, turns, strength in ((slice(0, n // 2), 3.0, 0.5), (slice(n // 2, n), 9.0, 1.5)):
        values = shaken.accel[part, 0]
        peak = np.fft.rfftfreq(n // 2, 0.005)[np.argmax(np.abs(np.fft.rfft(values)))]
        assert peak == pytest.approx(2.0 * turns, abs=0.06)
        expected = strength * np.sinc(2.0 * turns / 200.0)
        assert values.std() == pytest.approx(expected, rel=0.01)


def test_narrow_band_vibration_has_its_width() -> None:
    n, rate, frequency, width = 200_000, 100.0, 22.0, 2.0
    shaken = simulate.add_vibration(
        plain(n, rate, accel=(0, 0, 0)),
        [simulate.Vibration(accel=(1.0, 1.0, 0), frequency=frequency, bandwidth=width)],
        np.random.default_rng(5),
    )
    x = shaken.accel[:, 0] / np.sinc(frequency / rate)
    # independent samples: about 2000 s times pi times the width
    assert x.std() == pytest.approx(1.0, rel=0.03)
    for lag in (1, 5, 9):
        found = np.mean(x[lag:] * x[:-lag]) / np.mean(x**2)
        tau = lag / rate
        expected = np.exp(-np.pi * width * tau) * np.cos(2.0 * np.pi * frequency * tau)
        assert found == pytest.approx(expected, abs=0.03)
    assert abs(np.corrcoef(shaken.accel[:, 0], shaken.accel[:, 1])[0, 1]) < 0.05


def test_engine_turns_between_idle_and_shift() -> None:
    turns = simulate.engine_turning_rate(np.linspace(0.0, 30.0, 3001))
    assert turns[0] == 13.0
    assert turns.min() >= 13.0 and turns.max() < 43.0
    assert np.count_nonzero(np.diff(turns) < -1.0) == 4  # four shifts up
    # fourth gear at 20 m/s: 0.55 m a turn
    assert simulate.engine_turning_rate([20.0])[0] == pytest.approx(20.0 / 0.55)


def test_box_car_of_s004_weakens_20_hz_by_14_16_percent() -> None:
    whole = simulate.box_car_gain(20.0, 30, 30e3) * simulate.box_car_gain(20.0, 15, 1e3)
    assert 1.0 - whole == pytest.approx(0.1416, abs=5e-5)
    t = np.arange(1, 40_001) / 1000.0
    wave = np.sin(2.0 * np.pi * 20.0 * (t - 0.0005)) * np.sinc(20.0 / 1000.0)
    fast = ImuRecording(t, np.zeros((t.size, 3)), np.tile(wave[:, None], (1, 3)))
    slow = simulate.box_car(fast, 15, 10)
    assert slow.rate == pytest.approx(100.0)
    assert slow.time[0] == pytest.approx(0.015)
    assert np.sqrt(2.0) * slow.accel[:3995, 0].std() == pytest.approx(1.0 - 0.1416, abs=1e-4)
    # the mean of 15 ms is that of its middle
    middle = np.sin(2.0 * np.pi * 20.0 * (slow.time - 0.0075))
    np.testing.assert_allclose(slow.accel[:, 1], (1.0 - 0.1416) * middle, atol=1e-4)
    assert simulate.box_car_gain([0.0, 1000.0, 1000.0 / 15], 15, 1e3) == pytest.approx([1, 1, 0])


def test_box_car_leaves_a_third_of_correlation_in_white_noise() -> None:
    model = NoiseModel({c: WhiteNoise(1e-3) for c in CHANNELS})
    fast = simulate.simulate_static(model, 300.0, 1000.0, np.random.default_rng(6))
    slow = simulate.box_car(fast, 15, 10)
    x = slow.signals() - slow.signals().mean(axis=0)
    variance = np.mean(x**2)  # 180 000 samples: relative sd 0.004
    assert variance == pytest.approx(1e-6 * 1000.0 / 15.0, rel=0.015)
    assert np.mean(x[1:] * x[:-1]) / variance == pytest.approx(1.0 / 3.0, abs=0.01)
    assert np.mean(x[2:] * x[:-2]) / variance == pytest.approx(0.0, abs=0.01)


def test_clock_offset_and_rate() -> None:
    imu = plain(1001, 100.0)
    late = simulate.restamp(
        imu, simulate.StampErrors(offset=0.3, rate_error=5e-5), np.random.default_rng(1)
    )
    assert late.time[0] - imu.time[0] == pytest.approx(0.3, abs=1e-12)
    assert late.time[-1] - imu.time[-1] == pytest.approx(0.3 + 10.0 * 5e-5, abs=1e-12)
    np.testing.assert_array_equal(late.accel, imu.accel)


def test_jitter_losses_and_repetitions_are_as_large_as_asked() -> None:
    n = 50_000
    imu = plain(n, 100.0)
    imu = replace(imu, gyro=np.tile(np.arange(n, dtype=float)[:, None], (1, 3)))
    shaken = simulate.restamp(imu, simulate.StampErrors(jitter=1e-3), np.random.default_rng(2))
    jitter = shaken.time - imu.time
    assert jitter.std() == pytest.approx(1e-3, rel=0.02)
    assert abs(jitter.mean()) < 2e-5
    wild = simulate.restamp(imu, simulate.StampErrors(jitter=1.0), np.random.default_rng(2))
    assert np.diff(wild.time).min() > 0.0
    thin = simulate.restamp(imu, simulate.StampErrors(lost=0.05, gap=4.0), np.random.default_rng(3))
    # some 600 losses of 4 +- 3.5 rows
    assert 1.0 - thin.size / n == pytest.approx(0.05, rel=0.2)
    gaps = np.diff(np.searchsorted(imu.time, thin.time)) - 1
    assert gaps[gaps > 0].mean() == pytest.approx(4.0, rel=0.2)
    held = simulate.restamp(imu, simulate.StampErrors(repeated=0.1), np.random.default_rng(4))
    repeats = np.diff(held.gyro[:, 0]) == 0.0
    assert repeats.mean() == pytest.approx(0.1, rel=0.07)
    assert np.all(held.gyro[:, 0] <= np.arange(n))
    np.testing.assert_array_equal(held.time, imu.time)
    again = simulate.restamp(imu, simulate.StampErrors(repeated=0.1), np.random.default_rng(4))
    np.testing.assert_array_equal(held.gyro, again.gyro)


def test_tactical_grade_is_that_of_the_data_sheet() -> None:
    model = simulate.tactical_grade_noise()
    gyro, accel = model.process("gyro_y"), model.process("accel_z")
    hour = 3600.0
    # angle after an hour of white noise: 0.07 degrees; 1 deg/h of flicker: 0.664 deg/h of Allan
    white, flicker = gyro.components[0], gyro.components[1]
    assert np.degrees(white.density * np.sqrt(hour)) == pytest.approx(0.07)
    plateau = np.degrees(np.sqrt(flicker.allan_variance(100.0))) * hour
    assert plateau == pytest.approx(0.664, rel=0.03)
    assert accel.components[0].density * np.sqrt(hour) == pytest.approx(0.03)
    plateau = np.sqrt(accel.components[1].allan_variance(100.0)) / 9.80665e-3
    assert plateau == pytest.approx(0.664 * 0.3, rel=0.03)
    assert model.channels == CHANNELS


def test_what_cannot_happen_to_a_sensor_is_refused() -> None:
    imu, rng = plain(100, 100.0), np.random.default_rng(1)
    with pytest.raises(InputError, match="no temperature"):
        simulate.simulate_imu(imu, None, rng, temperature_drift=simulate.TemperatureDrift())
    with pytest.raises(InputError, match="g-sensitivity"):
        simulate.simulate_imu(imu, None, rng, g_sensitivity=np.zeros(3))
    with pytest.raises(InputError, match="turning rate to follow"):
        simulate.add_vibration(imu, [simulate.Vibration(order=1.0)], rng)
    with pytest.raises(InputError, match="another length"):
        simulate.add_vibration(imu, [simulate.Vibration(order=1.0)], rng, turning_rate=[1.0])
    with pytest.raises(InputError, match="frequency or order"):
        simulate.Vibration()
    with pytest.raises(InputError, match="two means"):
        simulate.box_car(imu, 95, 10)
    with pytest.raises(InputError, match="taps"):
        simulate.box_car(imu, 0, 1)
    with pytest.raises(InputError, match="shares below"):
        simulate.StampErrors(lost=0.95)
    with pytest.raises(InputError, match="zero or more"):
        simulate.ManoeuvreNoise(gyro_with_rate=-1.0)
    with pytest.raises(InputError, match="positions of shape"):
        simulate.add_size_effect(imu, np.zeros((100, 3, 3)), (1.0, 2.0))
    with pytest.raises(InputError, match="outside the profile"):
        simulate.arm_tensor(simulate.static(1.0), [0.5, 1.5])
