"""Arrays whose axes are not what the mounting says are refused, and the mounting is found."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from schuler.arrays.common_axes import check_axes, require_common_axes
from schuler.arrays.detection.faults import detect_faults
from schuler.arrays.geometry import orthogonal_mounting, tetrahedron_mounting
from schuler.arrays.read import read_array
from schuler.arrays.synthesis.synthetic import synthesize
from schuler.cli.options.simulation import MotionOptions, SensorOptions
from schuler.cli.verbs.simulate import simulate
from schuler.data import ImuArray, Mounting
from schuler.data.mounting import MOUNTING_FILE, mounting_yaml
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler
from schuler.simulation import receivers
from schuler.simulation.grades import grade_noise
from schuler.simulation.scenario import Scenario, simulate_drive

GRAVITY = 9.81

STILL = MotionOptions(motion="static", duration=30.0)


@lru_cache
def twin(geometry: str, motion: str, seed: int = 4) -> ImuArray:
    mounting = tetrahedron_mounting(0.05) if geometry == "tetrahedron" else orthogonal_mounting(4)
    scenario = Scenario(
        motion,
        grade_noise("consumer"),
        receivers.RTK_FIXED,
        duration=120.0,
        array_rotations=mounting.rotation,
        array_positions=mounting.position,
    )
    return ImuArray.from_recordings(simulate_drive(scenario, seed).imus, mounting)


def remounted(array: ImuArray, imu: int, degrees: tuple[float, float, float]) -> ImuArray:
    rotation = array.mounting.rotation.copy()
    rotation[imu] = rotation[imu] @ dcm_from_euler(*np.radians(degrees))
    return replace(array, mounting=Mounting(rotation, array.mounting.position))


@pytest.mark.parametrize("motion", ["static", "motorcycle"])
@pytest.mark.parametrize("geometry", ["tetrahedron", "aligned"])
def test_every_geometry_is_right_with_its_mounting_and_refused_without(
    geometry: str, motion: str
) -> None:
    array = twin(geometry, motion)
    require_common_axes(array)
    start = array.between(0.0, 10.0)
    fused = synthesize(start, "equal").imu.accel.mean(axis=0)
    # four turn-on biases of 0.03 g in each axis, averaged
    assert abs(np.linalg.norm(fused) - GRAVITY) < 0.3
    without = replace(array, mounting=Mounting.aligned(4))
    if geometry == "aligned":
        require_common_axes(without)
        return
    for verb in (synthesize, detect_faults):
        with pytest.raises(InputError, match="not turned as the mounting says"):
            verb(without)


@pytest.mark.parametrize("degrees", [5.0, 90.0, 180.0])
def test_a_turn_about_gravity_is_seen_in_the_rates_and_its_size_is_told(degrees: float) -> None:
    array = remounted(twin("aligned", "motorcycle"), 2, (0.0, 0.0, degrees))
    with pytest.raises(InputError, match=r"rates of imu 3 by") as caught:
        require_common_axes(array)
    told = float(str(caught.value).split("imu 3 by ")[1].split()[0])
    assert told == pytest.approx(degrees, abs=0.5)
    found = check_axes(array)
    assert found.turned.tolist() == [False, False, True, False]
    turn = found.turn[2] @ array.mounting.rotation[2]
    assert np.degrees(np.arccos((np.trace(turn) - 1.0) / 2.0)) < 0.5


def test_what_the_message_prints_as_mounting_is_the_mounting() -> None:
    array = replace(twin("tetrahedron", "motorcycle"), mounting=Mounting.aligned(4))
    with pytest.raises(InputError) as caught:
        require_common_axes(array)
    words = [w.removeprefix("--mount=") for w in str(caught.value).split() if "--mount=" in w]
    found = np.array([dcm_from_euler(*np.radians([float(a) for a in w.split(",")])) for w in words])
    truth = tetrahedron_mounting().rotation
    relative = np.swapaxes(truth[:1], 1, 2) @ truth
    np.testing.assert_allclose(found, relative, atol=np.radians(0.5))


def test_one_that_stands_alone_is_turned_where_its_gravity_is_as_long_as_that_of_others() -> None:
    array = remounted(twin("aligned", "static"), 1, (90.0, 0.0, 0.0))
    with pytest.raises(InputError, match=r"gravity in imu 2 by (89|90|91) deg"):
        require_common_axes(array, broken_may_pass=True)


def test_a_broken_accelerometer_is_for_fault_detection_and_nobody_else() -> None:
    array = twin("aligned", "motorcycle")
    accel = array.accel.copy()
    accel[:, 3] = 0.01
    dead = replace(array, accel=accel)
    require_common_axes(dead, broken_may_pass=True)
    with pytest.raises(InputError, match="accelerometers contradict"):
        synthesize(dead)
    with pytest.raises(InputError, match="accelerometers contradict"):
        require_common_axes(dead.select([0, 3]), broken_may_pass=True)


@pytest.mark.parametrize("fault", ["step", "stuck", "noise", "silent"])
def test_faults_of_gyros_are_not_taken_for_turns(fault: str) -> None:
    array = twin("tetrahedron", "motorcycle")
    gyro = array.gyro.copy()
    late = array.time > 40.0
    if fault == "step":
        gyro[late, 1, 0] += np.radians(10.0)
    elif fault == "stuck":
        gyro[late, 1, 0] = gyro[np.flatnonzero(late)[0], 1, 0]
    elif fault == "noise":
        gyro[late, 1] += np.radians(3.0) * np.random.default_rng(1).standard_normal(
            gyro[late, 1].shape
        )
    else:
        gyro[late, 1] = np.nan
    require_common_axes(replace(array, gyro=gyro))


@pytest.mark.parametrize("array", ["tetrahedron", "tetrahedron:0.1", "2", "4"])
def test_simulate_writes_the_mounting_that_reading_finds(array: str, tmp_path: Path) -> None:
    out = tmp_path / "twin"
    simulate(out, moved=STILL, sensor=SensorOptions(array=array))
    read = read_array(out)
    truth = (
        tetrahedron_mounting(float(array.partition(":")[2] or 0.0))
        if array.startswith("tetra")
        else orthogonal_mounting(int(array))
    )
    np.testing.assert_allclose(read.mounting.rotation, truth.rotation, atol=1e-15)
    np.testing.assert_allclose(read.mounting.position, truth.position, atol=1e-15)
    # some of the files, in another order
    some = read_array([out / "imu2.parquet", out / "imu1.parquet"])
    np.testing.assert_allclose(some.mounting.rotation, truth.rotation[[1, 0]], atol=1e-15)


def test_a_mounting_file_that_does_not_fit_is_named(tmp_path: Path) -> None:
    out = tmp_path / "twin"
    simulate(out, moved=STILL, sensor=SensorOptions(array="3"))
    place = out / MOUNTING_FILE
    place.write_text(mounting_yaml(Mounting.aligned(2), ["imu1", "imu2"]))
    with pytest.raises(InputError, match="says nothing of imu3"):
        read_array(out)
    place.write_text(
        "kind: schuler mounting\nimus:\n"
        + "".join(f"- {{name: imu{i}, roll_pitch_yaw_deg: [0, 0, {90 * i}]}}\n" for i in (1, 2, 3))
    )
    by_hand = read_array(out).mounting
    np.testing.assert_allclose(by_hand.rotation[1], np.diag([-1.0, -1.0, 1.0]), atol=1e-15)
    for bad in ("kind: other", "kind: schuler mounting\nimus: 3", "{"):
        place.write_text(bad)
        with pytest.raises(InputError, match=MOUNTING_FILE):
            read_array(out)


def test_recordings_of_different_rides_are_no_array() -> None:
    one, other = twin("aligned", "motorcycle"), twin("aligned", "drone")
    n = min(len(one.time), len(other.time))

    def with_others(*strangers: int, from_row: int = 0, until_row: int | None = None) -> ImuArray:
        gyro, accel = one.gyro[:n].copy(), one.accel[:n].copy()
        for i in strangers:
            gyro[:, i], accel[:, i] = other.gyro[:n, i], other.accel[:n, i]
            gyro[:from_row, i] = np.nan
        if until_row is not None:
            gyro[until_row:, [i for i in range(4) if i not in strangers]] = np.nan
        return replace(one, time=one.time[:n], gyro=gyro, accel=accel)

    with pytest.raises(InputError, match="do not move as"):
        synthesize(with_others(2, 3))
    # one that differs may be a fault, which is looked for
    require_common_axes(with_others(3), broken_may_pass=True)
    with pytest.raises(InputError, match="no moment in common"):
        synthesize(with_others(2, 3, from_row=n // 2, until_row=n // 2))


def test_noise_of_one_place_is_no_motion() -> None:
    rng, n = np.random.default_rng(3), 5_000
    loud = np.exp(np.sin(np.arange(n)[:, None] / 400.0 + np.arange(4)))[..., None]
    gyro = np.radians(30.0) * loud * rng.standard_normal((n, 4, 3))
    accel = np.array([0.0, 0.0, -9.81]) + 0.01 * rng.standard_normal((n, 4, 3))
    array = ImuArray(np.arange(n) / 100.0, gyro, accel, Mounting.aligned(4), tuple("abcd"))
    require_common_axes(array)
    silent = gyro.copy()
    silent[:, 3] = np.nan
    require_common_axes(replace(array, gyro=silent))
