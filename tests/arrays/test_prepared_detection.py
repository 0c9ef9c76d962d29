"""A verdict only where one is possible: healthy flights are left alone, faults are named."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from schuler.arrays.calibration.calibrate import calibrate_array
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.faults import detect_faults
from schuler.arrays.detection.motion_errors import motion_errors
from schuler.arrays.detection.preparation import prepare_detection
from schuler.arrays.read import read_array
from schuler.data import ImuArray, Mounting
from schuler.errors import InputError

DEGREE = np.pi / 180.0


def excluded(array: ImuArray, **how: object) -> list[tuple[str, str, float]]:
    ready = prepare_detection(array, **how)  # type: ignore[arg-type]
    found = detect_faults(ready.array, ready.settings)
    return [(r.sensor, r.name, r.start) for r in found.records if r.kind != "missing"]


def turning(seconds: float = 60.0, scale: float = 0.0, seed: int = 1) -> ImuArray:
    """Four aligned units that turn by waves, with errors of scale."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(100 * seconds)) / 100.0
    wave = np.sin(2.0 * np.pi * np.array([0.31, 0.23, 0.17]) * time[:, None] + [0.0, 1.0, 2.0])
    wave *= 0.5 - 0.5 * np.cos(2.0 * np.pi * time / 15.0)[:, None]
    gyro = wave[:, None] * (1.0 + scale * rng.standard_normal((4, 3)))
    gyro = gyro + 0.1 * DEGREE * rng.standard_normal(gyro.shape)
    accel = 0.02 * rng.standard_normal(gyro.shape) + [0.0, 0.0, -9.81]
    return ImuArray(time, gyro, accel, Mounting.aligned(4))


def test_what_motion_leaves_is_read_between_sensors_and_a_broken_unit_does_not_spoil_it() -> None:
    array = turning(scale=0.02)
    gyro = array.gyro.copy()
    gyro[2000:, 1] += 3.0 * DEGREE
    for one in (array, replace(array, gyro=gyro)):
        found = motion_errors(one)["gyro"]
        # 2 % of one component of the rate in three; twelve scales were drawn, pairs are few
        assert 0.4 * 0.02 / np.sqrt(3.0) < found.scale < 2.0 * 0.02 / np.sqrt(3.0)
        assert found.floor < 0.05 * DEGREE
    assert motion_errors(turning())["gyro"].scale < 2e-3


def test_an_array_in_common_axes_is_judged_as_it_is() -> None:
    array = turning()
    ready = prepare_detection(array)
    assert ready.array is array and ready.notes == ()


def test_an_array_that_motion_rules_is_calibrated_in_passing() -> None:
    array = turning(scale=0.03)
    ready = prepare_detection(array)
    assert "calibrated in passing" in ready.notes[-1]
    assert excluded(array) == []
    gyro = array.gyro.copy()
    gyro[3000:, 2, 1] += 2.0 * DEGREE
    ((sensor, name, start),) = excluded(replace(array, gyro=gyro))
    assert (sensor, name) == ("gyro", "imu 3 y") and start < 31.0


def one_axis(seed: int, scale: float, seconds: float = 120.0) -> ImuArray:
    """Four aligned units on a turntable that turns to and fro about down; one is out of scale."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(100 * seconds)) / 100.0
    rate = np.clip((time - 15.0) / 5.0, 0.0, 1.0) * np.sin(0.4 * time + 0.5 * np.sin(0.1 * time))
    gyro = 0.1 * DEGREE * rng.standard_normal((time.size, 4, 3))
    gyro[:, :, 2] += rate[:, None]
    gyro[:, 2, 2] += scale * rate
    accel = 0.02 * rng.standard_normal(gyro.shape) + [0.0, 0.0, -9.81]
    return ImuArray(time, gyro, accel, Mounting.aligned(4))


def test_one_unit_out_of_scale_in_motion_about_one_axis_is_no_fault() -> None:
    for seed in (5, 6):
        with pytest.raises(InputError, match="not calibrated"):
            excluded(one_axis(seed, 0.03))
        healthy = one_axis(seed, 0.0)
        assert excluded(healthy) == []
        gyro = healthy.gyro.copy()
        gyro[6000:, 1, 2] += 2.0 * DEGREE
        ((_, name, start),) = excluded(replace(healthy, gyro=gyro))
        assert name == "imu 2 z" and start < 61.0


def test_a_gyro_that_sticks_is_a_fault_and_no_error_of_scale() -> None:
    array = one_axis(7, 0.0)
    gyro = array.gyro.copy()
    gyro[7000:, 3, 2] = gyro[7000, 3, 2]
    ((_, name, _),) = excluded(replace(array, gyro=gyro))
    assert name == "imu 4 z"


@pytest.mark.parametrize("passing", [False, True])
def test_healthy_flights_have_no_faults_and_those_put_in_are_named(
    data_folder: Path, passing: bool
) -> None:
    flights = {
        p: read_array(data_folder / "quad-4imu" / f"path{p}_imu.parquet") for p in ("03", "10")
    }
    board = None if passing else calibrate_array(flights["10"], bandwidth=8.0)
    array = flights["03"]
    assert excluded(array, calibration=board) == []
    gyro, accel = array.gyro.copy(), array.accel.copy()
    gyro[array.time > 20.0, 1, 0] += 2.0 * DEGREE
    accel[array.time > 30.0, 3, 1] += 0.5
    named = excluded(replace(array, gyro=gyro, accel=accel), calibration=board)
    assert [n[0] for n in named] == ["gyro", "accel"]
    assert named[0][1].endswith("imu2 x") and named[0][2] < 21.0
    assert named[1][1].endswith("imu4 y") and named[1][2] < 32.0


def test_accelerometers_are_not_blamed_while_every_gyro_is_saturated() -> None:
    """Spun beyond the range: what rotation does over the lever arms is not known then."""
    rng = np.random.default_rng(8)
    time = np.arange(6000) / 100.0
    rate = np.zeros((time.size, 3))
    rate[:, 2] = 60.0 * np.clip(np.sin(2.0 * np.pi * (time - 20.0) / 20.0), 0.0, 1.0) ** 3
    arms = 0.01 * np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0]])
    slope = np.gradient(rate, time, axis=0)
    accel = np.cross(slope[:, None], arms) + np.cross(rate[:, None], np.cross(rate[:, None], arms))
    accel += [0.0, 0.0, -9.81] + 0.02 * rng.standard_normal(accel.shape)
    gyro = rate[:, None] + 0.1 * DEGREE * rng.standard_normal(accel.shape)
    gyro[rate[:, 2] > 2000.0 * DEGREE] = np.nan
    array = ImuArray(time, gyro, accel, replace(Mounting.aligned(4), position=arms))
    found = detect_faults(array, FaultSettings(arm_uncertainty=2e-4))
    assert {(r.sensor, r.kind) for r in found.records} <= {("gyro", "missing")}
