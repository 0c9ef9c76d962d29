"""A channel that becomes noisy alone is named; shaking, knocks and sound sensors are not."""

from dataclasses import replace

import numpy as np
import pytest

from schuler import NoiseModel, WhiteNoise, characterize_imu, screen, simulate_static
from schuler.simulation.faults import NoiseBurst, inject_faults

NOISE = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))


def _kinds(*faults):
    imu = simulate_static(NOISE, 120.0, 100.0, np.random.default_rng(83))
    found = screen(inject_faults(imu, faults)[0]).findings
    return [f for f in found if f.kind == "noise burst"]


def test_the_axis_and_the_time_of_a_burst_are_named():
    (found,) = _kinds(NoiseBurst(start=60.0, duration=10.0, channels=("gyro_z",), deviation=0.1))
    assert found.severity == "warning"
    assert found.channels == ("gyro_z",)
    ((start, stop),) = found.intervals
    assert abs(start - 60.0) < 1.1 and abs(stop - 70.0) < 1.1


def test_shaking_of_all_axes_is_no_burst():
    gyros, accels = ("gyro_x", "gyro_y", "gyro_z"), ("accel_x", "accel_y", "accel_z")
    times = {"start": 60.0, "duration": 10.0}
    gyro = NoiseBurst(**times, channels=gyros, deviation=0.01)
    accel = NoiseBurst(**times, channels=accels, deviation=0.14)
    assert _kinds(gyro, accel) == []


def test_a_knock_of_one_axis_and_usual_noise_are_no_burst():
    assert _kinds() == []
    assert _kinds(NoiseBurst(start=60.2, duration=1.0, channels=("gyro_z",), deviation=0.1)) == []


def test_noise_that_changes_for_good_is_told_with_the_time() -> None:
    imu = simulate_static(NOISE, 400.0, 100.0, np.random.default_rng(8))
    assert not screen(imu).of_kind("noise level")
    gyro = imu.gyro.copy()
    gyro[25_000:, :2] *= 3.0
    found = screen(replace(imu, gyro=gyro))
    (told,) = found.of_kind("noise level")
    assert told.channels == ("gyro_x", "gyro_y")
    assert told.value == pytest.approx(3.0, rel=0.1)
    assert told.intervals[0][0] == pytest.approx(250.0, abs=20.0)
    assert not found.of_kind("heavy tails")


def test_noise_below_the_steps_is_not_known_and_said() -> None:
    imu = simulate_static(NOISE, 400.0, 100.0, np.random.default_rng(9))
    step = 8.0 * float(imu.gyro.std())
    gyro = np.round((imu.gyro + 0.3 * step) / step) * step
    gyro[::997] += step  # as a rare sample does
    found = characterize_imu(replace(imu, gyro=gyro), "W")
    (text,) = [t for t in found.findings if "hidden by them" in t]
    assert text.startswith("gyro_x, gyro_y, gyro_z")
    assert "not known" in text
    assert not [t for t in found.findings if "hidden" in t and "accel" in t]
