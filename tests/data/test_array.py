"""Mountings and arrays of IMUs: frames, gaps, clocks, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.data import ImuArray, ImuRecording, Mounting
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler

RATE = np.array([0.3, -0.2, 0.5])
FORCE = np.array([0.1, 0.4, -9.8])


def turned(k: int = 3) -> Mounting:
    rng = np.random.default_rng(3)
    return Mounting(dcm_from_euler(*rng.uniform(-1.5, 1.5, (3, k))), rng.normal(size=(k, 3)))


def recording(i: int, time: np.ndarray, mounting: Mounting) -> ImuRecording:
    c_sb = mounting.rotation[i].T
    growing = 1.0 + time[:, None]
    return ImuRecording(time, growing * (c_sb @ RATE), growing * (c_sb @ FORCE), name=f"unit {i}")


def array(n: int = 50, k: int = 3) -> ImuArray:
    mounting, time = turned(k), np.arange(n) / 100.0
    return ImuArray.from_recordings([recording(i, time, mounting) for i in range(k)], mounting)


def test_a_mounting_takes_sensor_axes_to_body_axes() -> None:
    body = array().in_body()
    growing = 1.0 + body.time[:, None, None]
    np.testing.assert_allclose(body.gyro, growing * np.tile(RATE, (3, 1)), atol=1e-14)
    np.testing.assert_allclose(body.accel, growing * np.tile(FORCE, (3, 1)), atol=1e-13)
    # turned once and for all: a second time changes nothing
    np.testing.assert_array_equal(body.in_body().gyro, body.gyro)
    np.testing.assert_array_equal(body.mounting.position, array().mounting.position)


def test_rows_that_one_recording_lacks_are_missing_in_it_alone_and_come_back_whole() -> None:
    mounting, time = turned(), np.arange(50) / 100.0
    parts = [recording(i, time, mounting) for i in range(3)]
    kept = np.delete(np.arange(50), [7, 8, 30])
    parts[1] = recording(1, time[kept] + 1e-6, mounting)
    joined = ImuArray.from_recordings(parts, mounting)
    assert joined.size == 50
    lost = np.isnan(joined.gyro).all(axis=2)
    np.testing.assert_array_equal(np.argwhere(lost), [[7, 1], [8, 1], [30, 1]])
    np.testing.assert_allclose(joined.missing[:, 0], [0.0, 3 / 50, 0.0])
    again = joined.imu(1)
    np.testing.assert_allclose(again.gyro, parts[1].gyro)
    np.testing.assert_allclose(again.accel, parts[1].accel)
    assert again.name == "unit 1" and "3 rows missing" in again.history[-1]
    for back, part in zip(joined.recordings(), parts, strict=True):
        np.testing.assert_array_equal(back.accel, part.accel)


def test_select_keeps_each_imu_with_its_own_mounting() -> None:
    whole = array()
    part = whole.select([2, 0])
    assert part.names == ("unit 2", "unit 0")
    np.testing.assert_array_equal(part.mounting.rotation[0], whole.mounting.rotation[2])
    np.testing.assert_allclose(part.in_body().gyro[:, 0], whole.in_body().gyro[:, 2])
    masked = whole.select(np.array([True, False, True]))
    assert masked.names == ("unit 0", "unit 2")
    assert whole.between(0.1, 0.2).size == 10


def test_channels_that_an_imu_never_recorded_stay_out_of_its_recording() -> None:
    whole = array()
    accel = whole.accel.copy()
    accel[:, 1] = np.nan
    gyros_only = replace(whole, accel=accel).imu(1)
    assert gyros_only.channels == ("gyro_x", "gyro_y", "gyro_z")
    assert gyros_only.size == whole.size


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (np.diag([1.0, 1.0, -1.0]), "IMU 2 is left-handed"),
        (np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, 1]]), "IMU 2 is left-handed"),
        (np.diag([1.0, 1.0, 1.001]), "IMU 2 is no rotation"),
        (np.full((3, 3), np.nan), "not finite"),
    ],
)
def test_mountings_that_are_no_rotations_are_refused(change: np.ndarray, words: str) -> None:
    rotation = np.tile(np.eye(3), (3, 1, 1))
    rotation[1] = change
    with pytest.raises(InputError, match=words):
        Mounting(rotation, np.zeros((3, 3)))


def test_clocks_that_run_apart_are_refused_and_not_interleaved() -> None:
    mounting, time = turned(2), np.arange(500) / 100.0
    first, second = recording(0, time, mounting), recording(1, 1.0001 * time + 0.003, mounting)
    with pytest.raises(InputError, match="bring the clocks together"):
        ImuArray.from_recordings([first, second], mounting)


def test_what_cannot_be_an_array_is_refused() -> None:
    whole = array()
    gyro = whole.gyro.copy()
    gyro[4, 2, 1] = np.inf
    with pytest.raises(InputError, match="gyro_y of unit 2 is infinite at row 4"):
        replace(whole, gyro=gyro)
    with pytest.raises(InputError, match="a different name"):
        replace(whole, names=("a", "b", "a"))
    silent = np.where(np.arange(3)[:, None] == 1, np.nan, whole.gyro)
    with pytest.raises(InputError, match="unit 1 has no value"):
        replace(whole, gyro=silent, accel=silent)
    with pytest.raises(InputError, match="goes backwards"):
        replace(whole, time=whole.time[::-1])
    with pytest.raises(InputError, match="mountings of 2 IMUs"):
        ImuArray.from_recordings(whole.recordings(), turned(2))
    with pytest.raises(InputError, match="numbers from 0 to 2"):
        whole.select([3])
    with pytest.raises(InputError, match="shape"):
        replace(whole, gyro=whole.gyro[:, :2])
