"""Drives that suffer from something: it is said, and the filter claims no more than it knows.

Faults are put into a simulated drive whose truth is known. After each the errors must be within
what the filter claims, and what cannot be navigated must end in one clear line.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from twins import LEVER, NOISE, navigation_errors, perfect, with_noise

from schuler import earth
from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.errors import SchulerError
from schuler.navigation.navigate import navigate
from schuler.navigation.preparation.diagnosis import flipped
from schuler.navigation.preparation.drive_screening import screen_drive
from schuler.simulation import (
    DropOut,
    Fault,
    Profile,
    StuckFault,
    TimeJump,
    car_urban,
    inject_faults,
    simulate_gnss,
)

Array = np.ndarray


@cache
def a_profile() -> tuple[Profile, ImuRecording]:
    profile = car_urban(300.0, 3, standstill=20.0)
    return profile, perfect(profile)


def a_drive(seed: int) -> tuple[ImuRecording, GnssRecording]:
    profile, ideal = a_profile()
    rng = np.random.default_rng(seed)
    imu, _ = with_noise(ideal, NOISE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.5, velocity_sd=0.05, lever_arm=LEVER, rng=rng)
    return imu, gnss


def solved(imu: ImuRecording, gnss: GnssRecording, **how: object) -> NavigationSolution:
    how = {"time_offset": 0.0} | how
    return navigate(imu, gnss, NOISE, lever_arm=LEVER, **how)  # type: ignore[arg-type]


def faulty(imu: ImuRecording, *faults: Fault) -> ImuRecording:
    return inject_faults(imu, faults)[0]


def found(solution: NavigationSolution, kind: str) -> list[dict[str, object]]:
    return [f for f in solution.settings["findings"] if f["kind"] == kind]


def errors(solution: NavigationSolution, time: Array | None = None) -> tuple[Array, Array]:
    """Errors (n, 9) and claimed deviations, at all samples or at some times."""
    path = solution.trajectory
    k = np.arange(path.size) if time is None else np.searchsorted(path.time, time)
    e = navigation_errors(
        a_profile()[0], path.time[k], path.position[k], path.velocity[k], path.rotation[k]
    )
    sd = np.hstack([solution.position_sd, solution.velocity_sd, solution.attitude_sd])[k]
    return e, sd


def test_a_sound_drive_has_nothing_to_remark() -> None:
    assert solved(*a_drive(1)).settings["findings"] == []


@pytest.mark.parametrize("hold", [False, True])
def test_a_gap_of_a_second_is_bridged_and_the_covariance_opens(hold: bool) -> None:
    squares, opened = [], []
    for seed in range(8):
        imu, gnss = a_drive(seed)
        # in a corner, where interpolation misses most
        solution = solved(faulty(imu, DropOut(start=60.5, duration=1.2, hold=hold)), gnss)
        (gap,) = found(solution, "gap")
        assert gap["severity"] == "warning"
        assert gap["intervals_s"][0] == pytest.approx([60.49, 61.7], abs=0.02)
        e, sd = errors(solution, np.array([60.4, 60.99, 61.69, 65.0, 90.0]))
        squares.append((e / sd) ** 2)
        opened.append(sd)
    opened = np.mean(opened, axis=0)
    # velocity and attitude open up within the second, and close again
    assert np.all(opened[2, 3:5] > 2.0 * opened[0, 3:5])
    assert opened[2, 8] > 1.2 * opened[0, 8]
    assert np.all(opened[4, 3:5] < 1.3 * opened[0, 3:5])
    squares = np.array(squares)
    # 8 draws of 9 components at each time, of one and the same motion
    assert np.all(squares.mean(axis=(0, 2)) < 2.2)
    assert np.sqrt(squares.max()) < 5.0


def test_a_gap_of_a_minute_starts_anew_and_keeps_what_is_known_of_the_sensor() -> None:
    squares = []
    for seed in range(5):
        imu, gnss = a_drive(seed)
        whole = solved(imu, gnss)
        solution = solved(faulty(imu, DropOut(start=120.0, duration=60.0)), gnss)
        assert found(solution, "gap")
        (anew,) = found(solution, "new start")
        assert "180.000" in str(anew["message"])
        path = solution.trajectory
        assert not np.any((path.time > 120.0) & (path.time < 180.0))
        e, sd = errors(solution, np.array([119.9, 180.0, 181.0, 200.0, 290.0]))
        # nothing is left of the attitude of before, and no more is claimed
        assert sd[1, 8] > 4.0 * sd[0, 8]
        assert sd[1, 6] > 20.0 * sd[0, 6]
        squares.append((e / sd) ** 2)
        # gyro biases go on: at the restart they are known as well as before, but for their walk
        column = [k for k, n in enumerate(solution.sensor_error_names) if n == "gyro_x random walk"]
        node = np.searchsorted(solution.sensor_error_time, [119.9, 180.0])
        before, after = solution.sensor_errors_sd[node, column[0]]
        walk = 2e-6 * np.sqrt(60.0)
        assert after == pytest.approx(np.hypot(before, walk), rel=0.05)
        others = np.searchsorted(whole.sensor_error_time, 119.9)
        assert before == pytest.approx(whole.sensor_errors_sd[others, column[0]], rel=0.02)
    squares = np.array(squares)
    assert np.all(squares.mean(axis=(0, 2)) < 2.0)
    assert np.sqrt(squares.max()) < 4.5


def test_the_smoother_looks_across_a_restart_through_the_sensor_alone() -> None:
    imu, gnss = a_drive(2)
    broken = faulty(imu, DropOut(start=120.0, duration=60.0))
    causal, smoothed = solved(broken, gnss), solved(broken, gnss, smooth=True)
    e, sd = errors(smoothed, np.array([40.0, 80.0, 119.9, 180.0, 190.0, 250.0]))
    assert np.mean((e / sd) ** 2) < 1.8
    assert np.abs(e / sd).max() < 4.5
    # a bias is known better before the gap because of what came behind it
    k = causal.sensor_error_names.index("accel_z random walk")
    node = np.searchsorted(causal.sensor_error_time, 100.0)
    assert smoothed.sensor_errors_sd[node, k] < 0.8 * causal.sensor_errors_sd[node, k]
    # attitude just before the gap has nothing behind it
    at = np.searchsorted(causal.trajectory.time, 119.9)
    ratio = smoothed.attitude_sd[at] / causal.attitude_sd[at]
    assert np.all(ratio > 0.8)


@pytest.mark.parametrize("seconds", [3.0, 40.0])
def test_a_stuck_gyro_is_bridged_or_waited_for(seconds: float) -> None:
    imu, gnss = a_drive(3)
    fault = StuckFault(start=150.0, duration=seconds, channels=("gyro_z",))
    solution = solved(faulty(imu, fault), gnss)
    (stuck,) = found(solution, "stuck axis")
    assert stuck["channels"] == ["gyro_z"]
    assert bool(found(solution, "new start")) == (seconds > 10.0)
    e, sd = errors(solution)
    assert np.sqrt(np.mean((e / sd) ** 2)) < 1.3
    assert np.abs(e / sd).max() < 5.5
    assert sd.min() > 0.0


def test_a_gyro_that_is_stuck_to_the_end_ends_the_solution_there() -> None:
    imu, gnss = a_drive(3)
    solution = solved(faulty(imu, StuckFault(start=150.0, channels=("gyro_x",))), gnss)
    (stuck,) = found(solution, "stuck axis")
    assert "gyro_x" in str(stuck["message"])
    assert solution.trajectory.time[-1] == pytest.approx(150.0, abs=0.02)


def test_a_stuck_accelerometer_costs_what_it_was_worth() -> None:
    imu, gnss = a_drive(4)
    fault = StuckFault(start=150.0, duration=20.0, channels=("accel_x",))
    solution = solved(faulty(imu, fault), gnss)
    assert found(solution, "stuck axis")
    e, sd = errors(solution, np.arange(150.0, 172.0, 0.5))
    assert np.sqrt(np.mean((e[:, :6] / sd[:, :6]) ** 2)) < 1.5
    _, before = errors(solution, np.array([149.0]))
    assert sd[20, :2].max() > 1.2 * before[0, :2].max()


@pytest.mark.parametrize("jump", [0.8, 5.0])
def test_a_jump_of_the_stamps_is_no_gap_and_is_put_right(jump: float) -> None:
    imu, gnss = a_drive(5)
    solution = solved(faulty(imu, TimeJump(start=150.0, jump=jump)), gnss)
    (jumped,) = found(solution, "time jump")
    assert jumped["value"] == pytest.approx(jump, abs=1e-3)
    assert not found(solution, "gap")
    assert solution.trajectory.time[-1] == pytest.approx(300.0, abs=0.02)
    e, sd = errors(solution)
    assert np.sqrt(np.mean((e / sd) ** 2)) < 1.3


def stopped(imu: ImuRecording, gnss: GnssRecording, **how: object) -> str:
    with pytest.raises(SchulerError) as error:
        solved(imu, gnss, **how)
    text = str(error.value)
    assert "\n" not in text
    return text


def test_stamps_that_jump_back_stop_the_run() -> None:
    imu, gnss = a_drive(5)
    text = stopped(faulty(imu, TimeJump(start=150.0, jump=-0.8)), gnss)
    assert "jump" in text
    assert "-0.8 s" in text
    assert "cut both recordings" in text


def test_a_fix_ten_kilometres_off_is_left_out_even_if_it_is_the_first() -> None:
    imu, gnss = a_drive(6)
    for at in (0, 100, gnss.size - 1):
        position = np.array(gnss.position)
        position[at, 1] += 10_000.0 / float(earth.metres_per_radian(position[at])[1])
        solution = solved(imu, replace(gnss, position=position))
        (wrong,) = found(solution, "wrong fix")
        assert wrong["value"] == pytest.approx(1e4, rel=0.01)
        assert f"{gnss.time[at]:.2f}" in str(wrong["message"])
        assert solution.settings["updates_refused"] == 0
        e, sd = errors(solution)
        assert np.abs(e / sd).max() < 5.5


def test_good_fixes_are_never_taken_for_wrong_ones() -> None:
    # code positions with slow errors, and outages
    profile, _ = a_profile()
    imu, _ = a_drive(0)
    for seed in range(10):
        gnss = simulate_gnss(
            profile,
            1.0,
            position_sd=0.6,
            velocity_sd=0.1,
            correlated_sd=1.9,
            correlation_time=60.0,
            rng=np.random.default_rng(seed),
            outages=((80.0, 30.0), (200.0, 7.0)),
        )
        _, condition = screen_drive(imu, gnss)
        assert condition.wrong_fixes is None
        assert [f.kind for f in condition.findings] == ["GNSS outage"]


@pytest.mark.parametrize("late", [1.0, 2.6])
def test_gnss_that_is_stamped_late_is_found_and_corrected(late: float) -> None:
    imu, gnss = a_drive(7)
    solution = solved(imu, replace(gnss, time=gnss.time + late), time_offset="estimate")
    assert solution.settings["time_offset_position_s"] == pytest.approx(-late, abs=0.03)
    e, _ = errors(solution, np.arange(60.0, 290.0))
    assert np.sqrt(np.mean(e[:, :2] ** 2)) < 0.5


def test_a_given_time_offset_that_is_wrong_is_said() -> None:
    imu, gnss = a_drive(7)
    solution = solved(imu, replace(gnss, time=gnss.time + 1.0), time_offset=0.0)
    (clock,) = found(solution, "clock")
    assert clock["value"] == pytest.approx(-1.0, abs=0.2)
    (claims,) = found(solution, "claims")
    assert claims["cure"]


@pytest.mark.parametrize("channel", ["gyro", "accel", "gyro_x", "gyro_y", "gyro_z", "accel_y"])
def test_reversed_axes_stop_the_run_and_are_named(channel: str) -> None:
    imu, gnss = a_drive(8)
    text = stopped(flipped(imu, (channel,)), gnss)
    assert f"--flip {channel.split('_')[0]}" in text
    if channel in ("gyro_x", "gyro_y", "accel_y"):
        assert f"--flip {channel}" in text
    # and what the line says is the cure
    assert solved(flipped(flipped(imu, (channel,)), (channel,)), gnss).settings["findings"] == []


def test_exchanged_axes_and_wrong_units_stop_the_run_and_are_named() -> None:
    imu, gnss = a_drive(8)
    order = [1, 0, 2]
    text = stopped(replace(imu, gyro=imu.gyro[:, order], accel=imu.accel[:, order]), gnss)
    assert "x and y axes are exchanged" in text
    text = stopped(replace(imu, gyro=np.degrees(imu.gyro)), gnss)
    assert "--gyro-unit deg/s" in text


def test_a_mounting_upside_down_is_caught_by_gravity() -> None:
    imu, gnss = a_drive(9)
    text = stopped(imu, gnss, mounting=np.diag([1.0, -1.0, -1.0]))
    assert "deg away from down" in text
    assert "--mounting" in text
    solved(imu, gnss, mounting=np.eye(3))


def test_gnss_that_begins_in_the_middle_of_the_drive() -> None:
    squares = []
    for seed in range(4):
        imu, gnss = a_drive(seed)
        solution = solved(imu, gnss.select(gnss.time > 100.5))
        (late,) = found(solution, "late GNSS")
        assert late["value"] == pytest.approx(101.0, abs=0.1)
        assert solution.trajectory.time[0] == pytest.approx(100.0, abs=0.05)
        e, sd = errors(solution, np.array([100.5, 105.0, 130.0, 250.0]))
        squares.append((e / sd) ** 2)
    assert np.sqrt(np.max(squares)) < 4.5
    assert np.mean(squares) < 1.6


def test_no_fault_makes_a_variance_negative() -> None:
    imu, gnss = a_drive(10)
    broken = faulty(
        imu,
        DropOut(start=50.0, duration=1.0),
        StuckFault(start=90.0, duration=4.0, channels=("gyro_y", "accel_x")),
        DropOut(start=130.0, duration=30.0),
        DropOut(start=200.0, duration=2.0, hold=True),
    )
    for smooth in (False, True):
        solution = solved(broken, gnss, smooth=smooth)
        least = np.linalg.eigvalsh(solution.position_covariance).min()
        assert least > 0.0
        assert solution.velocity_sd.min() > 0.0
        assert solution.attitude_sd.min() > 0.0
        assert solution.sensor_errors_sd.min() > 0.0
        assert np.isfinite(solution.sensor_errors).all()


REAL_OFFSETS = (0.263, 0.133)


@cache
def a_real_drive(folder: Path) -> tuple[ImuRecording, GnssRecording, NavigationSolution]:
    """The recording rtk-drive, and its smoothed solution without faults."""
    from schuler.io import read_gnss, read_imu
    from schuler.navigation.error_models.sensor_error_model import generic_noise_model

    imu, gnss = read_imu(folder / "rtk-drive"), read_gnss(folder / "rtk-drive")
    whole = navigate(
        imu, gnss, generic_noise_model(), tune_noise=False, time_offset=REAL_OFFSETS, smooth=True
    )
    return imu, gnss, whole


@pytest.mark.parametrize(
    ("fault", "kinds"),
    [
        (DropOut(start=200.0, duration=2.0), {"gap"}),
        (DropOut(start=200.0, duration=60.0), {"gap", "new start"}),
        (TimeJump(start=200.0, jump=0.8), {"time jump"}),
        (StuckFault(start=200.0, duration=30.0, channels=("gyro_y",)), {"stuck axis", "new start"}),
    ],
)
def test_faults_in_a_real_drive_are_seen_and_outlived(
    data_folder: Path, fault: DropOut | TimeJump | StuckFault, kinds: set[str]
) -> None:
    from schuler.navigation.error_models.sensor_error_model import generic_noise_model

    imu, gnss, whole = a_real_drive(data_folder)
    begin = float(imu.time[0])
    broken = faulty(imu, replace(fault, start=begin + fault.start))
    solution = navigate(
        broken, gnss, generic_noise_model(), tune_noise=False, time_offset=REAL_OFFSETS
    )
    assert {str(f["kind"]) for f in solution.settings["findings"]} - {
        "refused",
        "lasting errors",
        "claims",
    } == kinds
    # against the smoothed solution of the whole recording, from the fault to a minute behind it;
    # later this drive has stretches in which the generic noise is too small, fault or no fault
    path, other = solution.trajectory, whole.trajectory
    k = np.flatnonzero((path.time > begin + 199.0) & (path.time < begin + 275.0))
    near = np.clip(np.searchsorted(other.time, path.time[k] - 1e-4), 0, other.size - 1)
    same = np.abs(other.time[near] - path.time[k]) < 2e-3
    k, near = k[same], near[same]
    north, east = earth.metres_per_radian(path.position[k])
    off = (path.position[k, :2] - other.position[near, :2]) * np.stack([north, east], axis=-1)
    claimed = np.hypot(solution.position_sd[k, :2], whole.position_sd[near, :2])
    assert k.size > 1000
    assert np.sqrt(np.mean((off / claimed) ** 2)) < 1.5
    assert np.abs(off / claimed).max() < 4.5


def test_reversed_axes_of_a_real_drive_are_named(data_folder: Path) -> None:
    from schuler.navigation.error_models.sensor_error_model import generic_noise_model

    imu, gnss, _ = a_real_drive(data_folder)
    for channel, said in (("accel", "--flip accel"), ("gyro_x", "--flip gyro_x")):
        with pytest.raises(SchulerError) as error:
            navigate(
                flipped(imu, (channel,)),
                gnss,
                generic_noise_model(),
                tune_noise=False,
                time_offset=REAL_OFFSETS,
            )
        assert said in str(error.value)


def test_every_measurement_has_its_row_though_a_break_lets_some_go() -> None:
    from schuler.navigation.engine import gate_thresholds
    from schuler.navigation.innovation_likelihood import slower_imu
    from schuler.navigation.preparation.prepare import prepare
    from schuler.navigation.segments import run_in_segments

    imu, gnss = a_drive(3)
    broken = faulty(imu, DropOut(start=120.02, duration=40.0))
    # fixes just before and inside the gap, where a slower recording has ended already
    gnss = replace(gnss, time=gnss.time + 0.015)
    cut, setup = prepare(broken, gnss, NOISE, lever_arm=LEVER, time_offset=-0.015)
    slow = slower_imu(cut)
    schedule = setup.schedule(slow, gnss)
    done = run_in_segments(
        slow,
        setup.initial_state(slow, gnss),
        setup.restarts(gnss),
        setup.model,
        schedule,
        gate=gate_thresholds(0.0),
        keep_nodes=False,
    )
    assert done.aiding.nis.size == schedule.size
    assert np.all(np.diff(schedule.time) >= 0.0)
    used = done.aiding.degrees > 0
    # all but those between the last slow sample and the break
    assert np.count_nonzero(~used) <= 2
    assert np.all(schedule.time[~used] < setup.condition.restarts[0].time)
    # and a drive with a break is tuned and its offsets are found
    found = solved(broken, gnss, time_offset="estimate")
    assert found.settings["time_offset_position_s"] == pytest.approx(-0.015, abs=0.02)
