"""Speed from wheel vibration in the filter: as good as it claims, and silent without wheels."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from twins import navigation_errors
from vehicle_twins import Ride, VehicleTwin, draw_vehicle, ride

from schuler.data import ImuRecording, NavigationSolution
from schuler.errors import SchulerError
from schuler.navigation.aiding.schedule import VEHICLE_VELOCITY
from schuler.navigation.aiding.wheel import WheelSpeeds, find_wheel_speeds
from schuler.navigation.engine import gate_thresholds
from schuler.navigation.navigate import navigate, withhold
from schuler.navigation.run import run
from schuler.navigation.segments import RunSegment
from schuler.simulation import Vibration, add_vibration, engine_turning_rate, wheel_turning_rate

SEEDS = 4
# the car drives in all of them, and has driven for two minutes before
WINDOWS = ((150.0, 30.0), (210.0, 30.0), (270.0, 30.0))
WHEEL = tuple(
    Vibration(accel=np.full(3, 0.02), gyro=np.full(3, 0.005), order=k, bandwidth=0.05)
    for k in (1.0, 2.0, 3.0, 4.0)
)
ENGINE = tuple(
    Vibration(accel=np.full(3, 0.05), gyro=np.full(3, 0.01), order=k) for k in (0.5, 1.0, 2.0)
)


def speed_of(ideal: ImuRecording, car: Ride) -> np.ndarray:
    return np.linalg.norm(car.profile.trajectory(ideal.time).velocity, axis=1)


@dataclass(frozen=True, eq=False)
class Drive:
    """The same motion, silent and with what shakes it."""

    silent: Ride
    car: Ride
    engine_only: Ride


@pytest.fixture(scope="module")
def drives() -> Drive:
    plain = ride(330.0, 5)
    rng = np.random.default_rng(6)
    speed = speed_of(plain.ideal, plain)
    engine = add_vibration(plain.ideal, ENGINE, rng, turning_rate=engine_turning_rate(speed))
    # an unbalanced wheel pushes with the square of its turning rate; at rest it does nothing
    turns, push = wheel_turning_rate(speed), np.minimum((speed / 10.0) ** 2, 1.5)
    both = add_vibration(engine, WHEEL, rng, turning_rate=turns, strength=push)
    return Drive(plain, replace(plain, ideal=both), replace(plain, ideal=engine))


def heard(draw: VehicleTwin) -> WheelSpeeds:
    setup, imu = draw.aided.setup, draw.aided.imu
    gnss = withhold(draw.aided.gnss, WINDOWS)
    assert setup.vehicle is not None
    whole = RunSegment(imu, setup.initial_state(imu, gnss), setup.schedule(imu, gnss), None)
    states = setup.vehicle.states
    return find_wheel_speeds(whole, setup.model, states, gate=gate_thresholds(1e-6))


def solved(draw: VehicleTwin, constraints: tuple[str, ...]) -> NavigationSolution:
    setup = draw.aided.setup
    assert setup.vehicle is not None
    known = replace(setup, vehicle=replace(setup.vehicle, constraints=constraints))
    return run(draw.aided.imu, withhold(draw.aided.gnss, WINDOWS), known).causal


def errors_in_windows(car: Ride, draw: VehicleTwin, found: NavigationSolution) -> np.ndarray:
    """(windows, seconds, 2): along and across the way, m."""
    first = draw.aided.gnss.time[0]
    path = found.trajectory
    time = first + np.array([[a + t for t in np.arange(1.0, s)] for a, s in WINDOWS])
    k = np.searchsorted(path.time, time.ravel() - 1e-6)
    moved = (path.position[k], path.velocity[k], path.rotation[k])
    error = navigation_errors(car.profile, path.time[k], *moved)[:, :2]
    velocity = car.profile.trajectory(path.time[k]).velocity[:, :2]
    ahead = velocity / np.maximum(np.linalg.norm(velocity, axis=1, keepdims=True), 1e-3)
    along = np.einsum("ki,ki->k", error, ahead)
    across = error[:, 1] * ahead[:, 0] - error[:, 0] * ahead[:, 1]
    return np.stack([along, across], axis=-1).reshape(len(WINDOWS), -1, 2)


@pytest.fixture(scope="module")
def draws(drives: Drive) -> list[VehicleTwin]:
    return [draw_vehicle(drives.car, s, ("nhc", "zupt", "wheel")) for s in range(SEEDS)]


def test_speeds_are_as_good_as_they_claim(drives: Drive, draws: list[VehicleTwin]) -> None:
    ratios, errors = [], []
    for draw in draws:
        found = heard(draw)
        assert found.order == pytest.approx(1.0 / 1.95, rel=5e-3)
        truth = np.interp(found.time, drives.car.ideal.time, speed_of(drives.car.ideal, drives.car))
        ratios.append((found.speed - truth) / found.sd)
        errors.append(found.speed - truth)
        since = found.time - draw.aided.gnss.time[0]
        blind = [(since > a) & (since < a + s) for a, s in WINDOWS]
        assert np.any(blind, axis=0).sum() > 10
    ratio, error = np.concatenate(ratios), np.concatenate(errors)
    # the claims are somewhat wide: mixtures with blocks that say nothing, and tyres that this car
    # does not have
    assert 0.3 < np.mean(ratio**2) < 1.2
    assert np.mean(np.abs(ratio) < 2.0) > 0.93
    assert np.abs(ratio).max() < 5.0
    assert np.median(np.abs(error)) < 0.1


def test_an_outage_loses_less_way_and_stays_honest(drives: Drive, draws: list[VehicleTwin]) -> None:
    with_wheel, without = [], []
    inside = []
    for draw in draws:
        found = solved(draw, ("nhc", "zupt", "wheel"))
        error = errors_in_windows(drives.car, draw, found)
        with_wheel.append(np.abs(error).max(axis=1))
        without.append(
            np.abs(errors_in_windows(drives.car, draw, solved(draw, ("nhc", "zupt")))).max(axis=1)
        )
        first = draw.aided.gnss.time[0]
        time = first + np.array([[a + t for t in np.arange(1.0, s)] for a, s in WINDOWS]).ravel()
        k = np.searchsorted(found.trajectory.time, time - 1e-6)
        sd = np.sqrt(found.position_covariance[k][:, [0, 1], [0, 1]].sum(axis=1))
        inside.append(np.linalg.norm(error.reshape(-1, 2), axis=1) < 2.5 * sd)
        assert found.innovations.of_kind("speed from wheel vibration").accepted.mean() > 0.95
    along = np.mean(with_wheel, axis=(0, 1))[0], np.mean(without, axis=(0, 1))[0]
    assert along[0] < 0.5 * along[1]
    assert np.mean(inside) > 0.9


def test_without_wheels_nothing_is_heard_and_nothing_changes(drives: Drive) -> None:
    for car in (drives.silent, drives.engine_only):
        draw = draw_vehicle(car, 3, ("nhc", "zupt", "wheel"))
        found = heard(draw)
        assert found.order is None
        assert found.time.size == 0
        with_wheel = solved(draw, ("nhc", "zupt", "wheel")).trajectory.position
        without = solved(draw, ("nhc", "zupt")).trajectory.position
        np.testing.assert_array_equal(with_wheel, without)


def test_speeds_know_no_future(drives: Drive) -> None:
    draw = draw_vehicle(drives.car, 0, ("nhc", "zupt", "wheel"))
    whole = heard(draw)
    imu = draw.aided.imu
    early = replace(draw, aided=replace(draw.aided, imu=imu.between(0.0, imu.time[0] + 240.0)))
    part = heard(early)
    count = part.time.size
    assert count > 10
    np.testing.assert_array_equal(part.time, whole.time[:count])
    np.testing.assert_array_equal(part.speed, whole.speed[:count])


def test_rows_measure_forward_only_and_wheel_needs_nhc(drives: Drive) -> None:
    draw = draw_vehicle(drives.silent, 1, ("nhc", "wheel"))
    model = draw.aided.setup.model
    place = model.names.index("wheel speed error")
    speeds = WheelSpeeds(np.array([1.0]), np.array([9.0]), np.array([0.1]), place, 0.5)
    rows = speeds.rows()
    assert rows.kind.tolist() == [VEHICLE_VELOCITY]
    np.testing.assert_array_equal(rows.variance, [[0.1**2, np.inf, np.inf]])
    assert rows.offset_state[0].tolist() == [place, -1, -1]
    with pytest.raises(SchulerError, match="without 'nhc'"):
        navigate(draw.aided.imu, draw.aided.gnss, aiding=("wheel",))
