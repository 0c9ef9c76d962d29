"""A start that later motion contradicts is taken back, and one that it does not is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import schuler
from schuler.earth import metres_per_radian
from schuler.rotations import dcm_from_euler
from schuler.simulation import car_urban, drone, ideal_imu, simulate_imu
from schuler.simulation.receivers import RTK_FIXED, simulate_receiver

NOISE = schuler.NoiseModel(
    {
        f"{sensor}_{axis}": schuler.WhiteNoise(white)
        for sensor, white in (("gyro", 1e-4), ("accel", 1.5e-3))
        for axis in "xyz"
    },
    rate=20.0,
)


def test_first_fixes_that_show_another_motion_do_not_turn_the_whole_drive() -> None:
    rng = np.random.default_rng(8)
    profile = car_urban(200.0, 8, standstill=20.0)
    imu = simulate_imu(ideal_imu(profile, 20.0), NOISE, rng)
    gnss = simulate_receiver(profile, RTK_FIXED, 1.0, rng=rng)
    assert gnss.velocity is not None
    turn = dcm_from_euler(0.0, 0.0, np.radians(80.0))
    unit = np.stack([*metres_per_radian(gnss.position), np.ones(gnss.size)], axis=1)
    turned = gnss.position[0] + ((gnss.position - gnss.position[0]) * unit @ turn.T) / unit
    for until, begin in ((55.0, 55.0), (0.0, 0.0)):
        early = (gnss.time < until)[:, None]
        wrong = replace(
            gnss,
            position=np.where(early, turned, gnss.position),
            velocity=np.where(early, gnss.velocity @ turn.T, gnss.velocity),
        )
        found = schuler.navigate(imu, wrong, NOISE, time_offset=0.0)
        path = found.trajectory
        true = profile.trajectory(path.time[-200:])
        off = path.rotation[-200:] @ true.rotation.transpose(0, 2, 1)
        heading = np.arctan2(off[:, 1, 0], off[:, 0, 0])
        assert np.all(np.abs(heading) < 4.0 * found.attitude_sd[-200:, 2])
        told = [f["message"] for f in found.settings["findings"] if f["kind"] == "start"]
        assert (path.time[0] > begin) and (path.time[0] < begin + 30.0)
        assert len(told) == (1 if until else 0)
        assert all("contradicts the heading" in text for text in told)


def test_a_heading_that_too_little_motion_told_is_turned_by_what_the_drive_tells() -> None:
    """A drone that hovers, a fix every 5 s: the heading was 60 deg off and claimed to 5."""
    profile = drone(300.0, 65005, standstill=20.0)
    rng = np.random.default_rng([11, 65005])
    imu = simulate_imu(ideal_imu(profile, 50.0), NOISE, rng)
    gnss = simulate_receiver(profile, RTK_FIXED, 0.2, rng=rng)
    solution = schuler.navigate(imu, gnss, NOISE)
    assert any("first motion" in f["message"] for f in solution.settings["findings"])
    path = solution.trajectory
    late = path.time > 150.0
    true = profile.trajectory(path.time[late])
    north, east = metres_per_radian(true.position)
    off = (path.position[late] - true.position)[:, :2] * np.stack([north, east], axis=1)
    square = (off / solution.position_sd[late, :2]) ** 2
    assert square.mean() < 3.0
    assert np.abs(off).max() < 1.0
