"""Zero velocity and zero rate: kept where the car stands, refused where the road is smooth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twins import perfect
from vehicle_twins import Ride, VehicleTwin, draw_vehicle, mounted, ride

from schuler.data import ImuRecording, NavigationSolution
from schuler.navigation.aiding.standstill import detect_standstill
from schuler.navigation.aiding.vehicle import VehicleConstraint
from schuler.navigation.navigate import withhold
from schuler.navigation.run import run
from schuler.simulation import Manoeuvre, drive


def solved(
    draw: VehicleTwin, *windows: tuple[float, float], zupt: bool = True
) -> NavigationSolution:
    setup = draw.plain.setup
    if zupt:
        setup = replace(setup, vehicle=VehicleConstraint(("zupt",), np.eye(3), -1))
    return run(draw.plain.imu, withhold(draw.plain.gnss, windows), setup).causal


def moved(solution: NavigationSolution, start: float, stop: float) -> float:
    """Largest horizontal distance from the place at the start, m."""
    path = solution.trajectory
    inside = (path.time >= start) & (path.time <= stop)
    place = path.position[inside] - path.position[inside][0]
    return float(np.linalg.norm(place[:, :2] * [6.37e6, 6.37e6 * np.cos(np.pi / 4)], axis=1).max())


@pytest.fixture(scope="module")
def waiting() -> Ride:
    return ride(150.0, 4, standstill=90.0)


@pytest.mark.parametrize("seed", range(4))
def test_a_car_that_stands_stays_where_it_is(waiting: Ride, seed: int) -> None:
    draw = draw_vehicle(waiting, seed)
    aided = solved(draw, (40.0, 30.0))
    assert moved(aided, 41.0, 70.9) < 0.5
    assert moved(solved(draw, (40.0, 30.0), zupt=False), 41.0, 70.9) > 1.0
    # and drives off when it drives off: nothing at all is taken for rest from then on
    zero = aided.innovations.of_kind("zero velocity")
    start = aided.trajectory.time[
        np.linalg.norm(waiting.profile.trajectory(aided.trajectory.time).velocity, axis=1) > 0.3
    ][0]
    used = zero.time[zero.accepted]
    assert np.sum(used < start) > 150
    last = waiting.profile.trajectory(used)
    assert np.linalg.norm(last.velocity, axis=1).max() < 0.15
    assert np.all(zero.nis[zero.accepted] < 30.0)


def test_zero_rate_finds_the_bias_about_the_vertical(waiting: Ride) -> None:
    draw = draw_vehicle(waiting, 7)
    names = draw.plain.setup.model.names
    gyros = [k for k, name in enumerate(names) if name.startswith("gyro")]
    states = []
    for zupt in (True, False):
        solution = solved(draw, zupt=zupt)
        k = int(np.searchsorted(solution.sensor_error_time, 85.0))
        near = int(np.searchsorted(draw.plain.imu.time, solution.sensor_error_time[k] - 1e-6))
        error = solution.sensor_errors[k] - draw.plain.sensor_truth[near]
        states.append((error[gyros], solution.sensor_errors_sd[k, gyros]))
    (error, sd), (_, plain_sd) = states
    # standing still, gravity shows the rates across the vertical, and nothing else the third
    assert sd.max() < 0.5 * plain_sd.max()
    # 85 s of white noise of 2e-3 rad/sqrt(s), at best
    assert sd.min() > 0.98 * 2e-3 / np.sqrt(85.0)
    assert sd.max() < 2.0 * 2e-3 / np.sqrt(85.0)
    assert np.abs(error / sd).max() < 3.5


@pytest.fixture(scope="module")
def smooth_road() -> Ride:
    plan = [
        Manoeuvre(20.0, 0.0),
        Manoeuvre(10.0, 10.0),
        Manoeuvre(120.0, 10.0),
        Manoeuvre(10.0, 0.0),
        Manoeuvre(5.0, 0.0),
    ]
    profile = mounted(drive(plan, heading=0.7))
    return Ride(profile, perfect(profile, 50.0))


def test_a_smooth_straight_is_not_taken_for_rest(smooth_road: Ride) -> None:
    draw = draw_vehicle(smooth_road, 5)
    found = detect_standstill(draw.plain.imu)
    straight = (found.time > 45.0) & (found.time < 145.0)
    # the IMU alone cannot tell
    assert straight.sum() > 100
    solution = solved(draw, (80.0, 30.0))
    for kind in ("zero velocity", "zero rate"):
        zero = solution.innovations.of_kind(kind)
        assert not ((zero.time > 30.0) & (zero.time < 145.0)).any()
        assert (zero.time < 20.0).sum() > 10
    speed = np.linalg.norm(solution.trajectory.velocity, axis=1)
    cruising = (solution.trajectory.time > 45.0) & (solution.trajectory.time < 145.0)
    assert np.abs(speed[cruising] - 10.0).max() < 2.0


def test_rest_is_not_looked_for_across_a_gap(smooth_road: Ride) -> None:
    imu = smooth_road.ideal
    keep = (imu.time < 8.0) | (imu.time > 13.0)
    gapped = ImuRecording(
        time=imu.time[keep], gyro=imu.gyro[keep], accel=imu.accel[keep], name="gap"
    )
    found = detect_standstill(gapped).time
    assert ((found > 5.0) & (found < 8.0)).sum() >= 4
    assert not ((found > 12.9) & (found < 14.9)).any()
