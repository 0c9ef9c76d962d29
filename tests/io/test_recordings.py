"""The real recordings are readable by their names alone, and agree with their descriptions."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from schuler.io import read_gnss, read_imu, read_imus

DEG = math.pi / 180.0


@pytest.mark.parametrize(
    ("run", "force"), [(1, 9.965), (2, 9.983), (3, 9.996), (4, 9.972), (5, 9.980), (6, 9.973)]
)
def test_adis16405(data_folder: Path, run: int, force: float) -> None:
    imu = read_imu(data_folder / "adis16405-static" / f"imu{run}.parquet")
    assert imu.size == 1_000_000
    assert imu.rate == pytest.approx(100.0)
    assert np.linalg.norm(imu.accel.mean(axis=0)) == pytest.approx(force, abs=6e-4)
    assert imu.gyro.mean(axis=0) / DEG == pytest.approx([0.39, -0.43, -0.28], abs=0.05)
    assert imu.gyro.std(axis=0) / DEG == pytest.approx([0.350, 0.370, 0.430], rel=0.05)
    assert any("README.md: 100 Hz" in line for line in imu.history)


def test_mtig_has_one_channel(data_folder: Path) -> None:
    imu = read_imu(data_folder / "mtig-gyro-static")
    assert imu.channels == ("gyro_x",)
    assert imu.size == 500_000
    assert imu.rate == pytest.approx(100.0)
    assert imu.gyro[:, 0].std() == pytest.approx(0.00563, abs=5e-6)


def test_rtk_drive(data_folder: Path) -> None:
    imu, gnss = (read(data_folder / "rtk-drive") for read in (read_imu, read_gnss))
    assert imu.size == 54_860
    assert (imu.size - 1) / imu.duration == pytest.approx(99.999, abs=1e-3)
    assert imu.time[0] == pytest.approx(243261.9925)
    assert gnss.size == 2197
    assert np.sum(gnss.quality == 1) == 2189
    assert gnss.position_sd[0] == pytest.approx([0.0098995, 0.0098995, 0.01])
    assert gnss.velocity_sd[0] == pytest.approx([0.0586899] * 3)
    assert np.linalg.norm(gnss.velocity, axis=1).max() == pytest.approx(16.3, abs=0.1)
    step = np.diff(gnss.position[:, :2], axis=0) * [6367500.0, 6389000.0 * math.cos(0.69982)]
    assert np.linalg.norm(step, axis=1).sum() == pytest.approx(4051.7, rel=2e-3)


def test_rtk_walk(data_folder: Path) -> None:
    imu, gnss = (read(data_folder / "rtk-walk") for read in (read_imu, read_gnss))
    assert imu.duration == pytest.approx(134.25, abs=0.02)
    assert (np.sum(gnss.quality == 1), np.sum(gnss.quality == 2)) == (349, 187)


def test_thor_flight(data_folder: Path) -> None:
    imu, gnss = (read(data_folder / "thor-flight") for read in (read_imu, read_gnss))
    assert imu.rate == pytest.approx(50.0, abs=1e-3)
    start = imu.between(26.0, 60.0)
    assert start.accel.mean(axis=0) == pytest.approx([1.92, -0.72, -9.69], abs=0.02)
    assert start.gyro.mean(axis=0) / DEG == pytest.approx([-1.18, -0.03, 0.01], abs=0.02)
    assert gnss.size == 674
    assert np.isnan(gnss.position_sd).all()


def test_phone_has_no_velocity_down(data_folder: Path) -> None:
    imu, gnss = (read(data_folder / "phone-highway") for read in (read_imu, read_gnss))
    assert (imu.size - 1) / imu.duration == pytest.approx(104.26, abs=0.01)
    assert imu.accel[:, 2].mean() == pytest.approx(-9.66, abs=0.005)
    assert np.isinf(gnss.velocity_sd[:, 2]).all()
    assert not gnss.velocity[:, 2].any()
    reference = read_gnss(data_folder / "phone-highway" / "reference.parquet")
    assert np.linalg.norm(reference.velocity, axis=1).max() == pytest.approx(20.0, abs=0.1)


def test_eight_imus_side_by_side(data_folder: Path) -> None:
    imus = read_imus(data_folder / "mimu8-array" / "run1.parquet")
    assert len(imus) == 8
    biases = [1.5, 0.2, 2.5, 2.7, 0.8, 2.0, 2.2, 1.2]  # deg/s
    for imu, bias in zip(imus, biases, strict=True):
        assert imu.size == 37_439
        assert imu.duration == pytest.approx(599.0, abs=0.1)
        middle = np.median(imu.gyro, axis=0)
        quiet = np.linalg.norm(imu.gyro - middle, axis=1) < 0.05
        found = np.linalg.norm(np.median(imu.gyro[quiet], axis=0))
        assert found / DEG == pytest.approx(bias, abs=0.07)
        assert np.linalg.norm(imu.accel[quiet], axis=1).mean() == pytest.approx(9.83, abs=0.1)
    second = read_imu(data_folder / "mimu8-array" / "run1.parquet", imu=2)
    assert np.array_equal(second.gyro, imus[1].gyro)


@pytest.mark.parametrize(
    ("path", "rows", "force"),
    [
        (2, 5281, (10.69, 11.20, 10.55, 10.26)),
        (3, 5917, (10.71, 11.23, 10.52, 10.27)),
        (9, 6481, (10.41, 10.94, 10.21, 9.95)),
        (11, 6613, (10.47, 11.00, 10.28, 10.03)),
        (13, 6217, (10.68, 11.21, 10.50, 10.24)),
    ],
)
def test_four_imus_below_each_other(
    data_folder: Path, path: int, rows: int, force: tuple[float, ...]
) -> None:
    """Paths 3, 9, 11 and 13 hold repeated time stamps that the other IMUs correct."""
    file = data_folder / "quad-4imu" / f"path{path:02d}_imu.parquet"
    for imu, mean in zip(read_imus(file), force, strict=True):
        assert imu.size == rows
        assert np.linalg.norm(imu.accel.mean(axis=0)) == pytest.approx(mean, abs=0.006)
    assert read_imu(file).rate == pytest.approx(120.005, abs=1e-3)


def test_local_truth_without_an_origin_says_where_it_was_put(data_folder: Path) -> None:
    file = data_folder / "quad-4imu" / "path02_truth.parquet"
    placed = read_gnss(file)
    assert any("without an origin" in line for line in placed.history)
    assert placed.position[0, :2] == pytest.approx([np.pi / 4.0, 0.0], abs=1e-6)
    truth = read_gnss(file, origin=(0.57, 0.61, 100.0))
    assert truth.position[0] == pytest.approx([0.57, 0.61, 100.0])
