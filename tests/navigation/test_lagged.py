"""Fixed-lag smoothing: the whole-interval smoother of what was known at the horizon."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_smoother import a_drive_with_an_outage

from schuler.errors import InputError
from schuler.navigation.aiding.schedule import AidingSchedule
from schuler.navigation.engine import FilterRun, gate_thresholds, run_engine
from schuler.navigation.lagged import lag_horizons, smooth_run_with_lag
from schuler.navigation.segments import run_in_segments
from schuler.navigation.smoother import SmoothedRun, smooth_run

LAG = 4.0
SETUP, IMU, GNSS = a_drive_with_an_outage()
SCHEDULE = SETUP.schedule(IMU, GNSS)
FIELDS = ("position", "velocity", "rotation", "position_covariance", "velocity_sd", "attitude_sd")


def run(schedule: AidingSchedule = SCHEDULE, **how: float) -> FilterRun:
    start = SETUP.initial_state(IMU, GNSS)
    return run_engine(IMU, start, SETUP.model, schedule, gate=gate_thresholds(0.0), **how)


def lagged(done: FilterRun, lag: float = LAG) -> SmoothedRun:
    return smooth_run_with_lag(done, SETUP.model, IMU.time, lag)


def until(time: float) -> AidingSchedule:
    """The measurements up to a time."""
    s = SCHEDULE
    k = s.time <= time
    return AidingSchedule(s.time[k], s.kind[k], s.value[k], s.variance[k], s.lever_arm[k])


def test_a_lag_longer_than_the_run_smooths_the_whole_interval() -> None:
    done = run()
    found, wanted = lagged(done, 1e4), smooth_run(done, SETUP.model, IMU.time)
    for field in FIELDS:
        a, b = getattr(found.samples, field), getattr(wanted.samples, field)
        np.testing.assert_allclose(a, b, rtol=1e-7, atol=1e-11, err_msg=field)
    np.testing.assert_allclose(found.sensor_sd, wanted.sensor_sd, rtol=1e-7)


def test_each_node_is_the_smoother_of_the_run_that_ends_at_its_horizon() -> None:
    done = run()
    found = lagged(done)
    horizon = lag_horizons(done.nodes.time, LAG)
    for node in (20, 150, 200, 300):
        end = float(done.nodes.time[horizon[node]])
        assert LAG - 0.26 < end - done.nodes.time[node] <= LAG + 1e-9
        cut = smooth_run(run(until(end)), SETUP.model, IMU.time)
        at = int(np.searchsorted(IMU.time, done.nodes.time[node])) + 1
        for field in FIELDS:
            a, b = getattr(found.samples, field)[at], getattr(cut.samples, field)[at]
            np.testing.assert_allclose(a, b, rtol=2e-7, atol=1e-10, err_msg=field)
        np.testing.assert_allclose(found.sensor_state[node], cut.sensor_state[node], atol=1e-9)


def test_no_sample_sees_more_than_a_lag_ahead() -> None:
    # before the horizon a false fix changes nothing, behind it something
    later = SCHEDULE.time > 50.0
    value = SCHEDULE.value.copy()
    value[later] += [1e-5, 0.0, 5.0]
    value[later & (SCHEDULE.kind == 1)] = 3.0
    a, b = (lagged(run(s)).samples for s in (SCHEDULE, replace(SCHEDULE, value=value)))
    first = float(SCHEDULE.time[later][0])
    blind = IMU.time < first - LAG - 1e-6
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(a, field)[blind], getattr(b, field)[blind])
    seen = (IMU.time > first - LAG + 0.3) & (IMU.time < first)
    assert (np.abs(a.velocity - b.velocity)[seen].max(axis=1) > 1e-3).all()


def test_in_an_outage_the_lag_helps_near_its_end() -> None:
    # 20 s without GNSS from 40 s on: 2 s before its end the next fixes are within the lag
    done = run()
    found = lagged(done).samples
    sd, causal = (
        np.sqrt(np.trace(s.position_covariance[:, :2, :2], axis1=1, axis2=2))
        for s in (found, done.samples)
    )
    near, far = np.searchsorted(IMU.time, [58.0, 45.0])
    assert sd[near] < 0.35 * causal[near]
    # nothing new came within four seconds of it
    # (between nodes the covariance is interpolated)
    assert 0.9 < sd[far] / causal[far] < 1.002


def test_checkpoints_and_lag_go_together() -> None:
    less = run(smoother_memory=1e3)
    assert less.checkpoints is not None
    wanted, found = lagged(run()), lagged(less)
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(found.samples, field), getattr(wanted.samples, field))
    np.testing.assert_array_equal(found.sensor_state, wanted.sensor_state)


def test_a_restart_ends_what_a_lag_may_see() -> None:
    done, begin = run(), 45.0
    k = int(np.searchsorted(IMU.time, begin - 1e-6))
    start = SETUP.initial_state(IMU, GNSS)
    again = replace(
        start,
        position=done.samples.position[k],
        velocity=done.samples.velocity[k],
        rotation=done.samples.rotation[k],
    )
    options = {"gate": gate_thresholds(0.0)}
    pieces = run_in_segments(IMU, start, [(begin, again)], SETUP.model, SCHEDULE, **options)
    assert len(pieces.pieces) == 2
    found = lagged(pieces).samples
    first = replace(
        IMU, time=IMU.time[:k], gyro=IMU.gyro[:k], accel=IMU.accel[:k], temperature=None
    )
    alone = run_engine(first, start, SETUP.model, until(float(first.time[-1])), **options)
    wanted = smooth_run_with_lag(alone, SETUP.model, first.time, LAG).samples
    assert len(found.position) == IMU.size
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(found, field)[:k], getattr(wanted, field))
    # the second piece is smoothed too, from where fixes come again
    assert (np.abs(found.velocity - pieces.samples.velocity)[k + 800 : -300].max(axis=1) > 0).all()


def test_a_lag_has_to_be_positive() -> None:
    with pytest.raises(InputError, match="positive number of seconds"):
        lagged(run(), 0.0)
