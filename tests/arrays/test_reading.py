"""Array recordings in: one file, several files, a folder; missing samples; own clocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from schuler import simulation as simulate
from schuler.arrays.read import read_array
from schuler.data import Mounting
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler


def test_long_and_wide_forms_of_real_arrays(data_folder: Path) -> None:
    long = read_array(data_folder / "quad-4imu" / "path07_imu.parquet")
    assert (long.count, long.size) == (4, 5521) and not np.isnan(long.gyro).any()
    assert np.linalg.norm(long.accel.mean(axis=0), axis=1) == pytest.approx(
        [10.70, 11.22, 10.54, 10.27], abs=0.02
    )  # from the README of the data
    wide = read_array(data_folder / "mimu8-array" / "run1.parquet")
    assert (wide.count, wide.size) == (8, 37439)
    assert wide.rate == pytest.approx(62.5, abs=0.01)


def test_a_sample_that_one_imu_lost_is_missing_there_alone(data_folder: Path) -> None:
    array = read_array(data_folder / "quad-4imu" / "path03_imu.parquet")
    rows, imus = np.nonzero(np.isnan(array.gyro[:, :, 0]))
    assert (1973, 3) in zip(rows, imus, strict=True)
    assert any("wrong time stamp" in line for line in array.history)


def write(path: Path, columns: dict[str, np.ndarray]) -> None:
    rows = zip(*columns.values(), strict=True)
    lines = [",".join("" if np.isnan(v) else f"{v:.9f}" for v in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")


def columns(imu, prefix: str = "") -> dict[str, np.ndarray]:
    return {
        f"{prefix}{s}_{a}_{u}": values[:, k]
        for s, values, u in (("gyro", imu.gyro, "rad_s"), ("accel", imu.accel, "m_s2"))
        for k, a in enumerate("xyz")
    }


@pytest.fixture(scope="module")
def recordings():
    ride = simulate.motorcycle(80.0, 3, standstill=5.0)
    rotations = dcm_from_euler(*np.random.default_rng(1).uniform(-1.0, 1.0, (3, 2)))
    rng = np.random.default_rng(2)
    return simulate.simulate_array(ride, rotations, np.zeros((2, 3)), None, 50.0, rng)


def test_values_that_one_imu_lacks_in_a_wide_file(tmp_path: Path, recordings) -> None:
    a, b = recordings
    table = {"time_s": a.time} | columns(a, "imu1_") | columns(b, "imu2_")
    table["imu2_gyro_y_rad_s"] = table["imu2_gyro_y_rad_s"].copy()
    table["imu2_gyro_y_rad_s"][100:130] = np.nan
    write(tmp_path / "both.csv", table)
    array = read_array(tmp_path / "both.csv", mounting=Mounting.aligned(2))
    assert np.isnan(array.gyro[100:130, 1]).all() and np.isfinite(array.gyro[:, 0]).all()
    assert np.isnan(array.gyro).any(axis=(1, 2)).sum() == 30
    assert any("30 rows" in line for line in array.history)


def test_a_folder_of_files_with_clocks_of_their_own(tmp_path: Path, recordings) -> None:
    a, b = recordings
    late = simulate.restamp(
        b, simulate.StampErrors(offset=5.003, rate_error=1e-4), np.random.default_rng(3)
    )
    for k, imu in ((10, late), (2, a)):
        write(tmp_path / f"imu{k}.csv", {"time_s": imu.time} | columns(imu))
    (tmp_path / "notes.csv").write_text("nothing\n")
    array = read_array(tmp_path)
    assert array.names == ("imu2", "imu10") and array.size == a.size
    assert any("ppm" in line for line in array.history)
    inner = slice(20, -20)
    # noise-free: what is left is the interpolation and some microseconds of clock
    assert np.nanmax(np.abs(array.gyro[inner, 1] - b.gyro[inner])) < 2e-3


def test_what_is_no_array_is_refused(tmp_path: Path, recordings) -> None:
    a, _ = recordings
    write(tmp_path / "one.csv", {"time_s": a.time} | columns(a))
    with pytest.raises(InputError, match=r"1 IMU in one\.csv"):
        read_array(tmp_path / "one.csv")
    with pytest.raises(InputError, match="named twice"):
        read_array([tmp_path / "one.csv", tmp_path / "one.csv"])
    with pytest.raises(InputError, match="no file with 'imu'"):
        read_array(tmp_path)
