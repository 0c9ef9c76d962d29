"""A real drive whose IMU is on a car: outages with the vehicle's constraints."""

from __future__ import annotations

from pathlib import Path

import pytest

from schuler.evaluation.outages import evaluate_outages
from schuler.io import read_gnss, read_imu


def test_rtk_drive_with_the_vehicle(data_folder: Path) -> None:
    imu = read_imu(data_folder / "rtk-drive" / "imu.parquet")
    gnss = read_gnss(data_folder / "rtk-drive" / "gnss.parquet")
    windows = [(float(s), 30.0) for s in (120, 180, 240, 300, 360, 420, 480)]
    found = evaluate_outages(imu, gnss, windows=windows, aiding=("nhc", "zupt", "wheel"))
    causal, smoothed = found.causal, found.smoothed
    # measured: 1.73 m and 0.23 m, 99 % and all inside 2 sigma; without the wheels 2.9 m and 0.28 m,
    # without the vehicle 15.3 m and 0.84 m. The standard deviations of the constraints come from
    # the likelihood of what is outside the windows; the constants of aiding/wheel.py were
    # set with the whole recording in sight.
    assert causal.mean_of_max_m < 2.4
    assert smoothed.mean_of_max_m < 0.4
    assert causal.within_2_sigma >= 0.9
    assert smoothed.within_2_sigma >= 0.9
    run = found.runs[0]
    # wheels of 0.6 m
    assert run["wheel_turns_per_metre"] == pytest.approx(0.531, rel=5e-3)
    assert run["wheel_speeds"] > 20
    assert 0.02 < run["constraint_sd_right_m_s"] < 0.15
    assert 0.05 < run["constraint_sd_down_m_s"] < 0.4
    solution = found.solutions[0][0]
    last = dict(zip(solution.sensor_error_names, solution.sensor_errors[-1], strict=True))
    # what the recording's authors give: 6.8 deg of pitch and 5.4 deg of yaw beside the axes
    assert found.runs[0]["mounting_deg"][1] == pytest.approx(6.8, abs=1.5)
    # springs: nose up when it speeds up, a third of a degree for a m/s²
    assert last["spring pitch"] == pytest.approx(-0.0054, abs=0.003)
    sway = solution.innovations.of_kind("velocity across the vehicle")
    assert sway.accepted.mean() > 0.99
