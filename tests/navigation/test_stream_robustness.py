"""What a stream is given that cannot be true leaves it as it was, quickly, and says why."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from twins import Twin, draw_twin, perfect

from schuler.errors import InputError, NavigationError, SchulerError
from schuler.navigation.aiding.schedule import POSITION, schedule_rows
from schuler.navigation.stream.navigation_filter import NavigationFilter
from schuler.navigation.stream.state import FilterState
from schuler.simulation import car_urban

RATE = 50.0
DRIVE = car_urban(60.0, 8, standstill=6.0)
BEFORE = 1000
GYRO, ACCEL = np.zeros(3), np.array([0.0, 0.0, -9.8])
WORST = 1e-3
"""Seconds in which bad input is told."""


@pytest.fixture(scope="module")
def twin() -> Twin:
    return draw_twin(DRIVE, perfect(DRIVE, RATE), 3)


def stream(twin: Twin, begun: bool = True) -> NavigationFilter:
    """A stream in the middle of a drive."""
    filter_ = NavigationFilter.from_setup(twin.setup, twin.imu, twin.gnss)
    assert twin.gnss.position_sd is not None
    waiting = 0
    for k in range(BEFORE if begun else 0):
        filter_.add_imu(float(twin.imu.time[k]), twin.imu.gyro[k], twin.imu.accel[k])
        while twin.gnss.time[waiting] < twin.imu.time[k]:
            filter_.add_gnss(
                float(twin.gnss.time[waiting]),
                twin.gnss.position[waiting],
                twin.gnss.position_sd[waiting],
            )
            waiting += 1
    return filter_


def same(a: FilterState, b: FilterState) -> None:
    for name in ("time", "position", "velocity", "rotation", "sensor_state", "covariance"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def sample(gap: float = 0.02, gyro: Any = GYRO, accel: Any = ACCEL, scale: Any = None):  # type: ignore[no-untyped-def]
    return lambda f: f.add_imu(f.time + gap, gyro, accel, scale)


def fix(ahead: float, position: Any = None, sd: Any = 1.0, velocity: Any = None, other: Any = 1.0):  # type: ignore[no-untyped-def]
    def add(f: NavigationFilter) -> bool:
        place = f.state().position if isinstance(position, str) else position
        return f.add_gnss(f.time + ahead, place, sd, velocity, other)

    return add


def rows(value: float, variance: float, ahead: float = 0.1) -> Callable[[NavigationFilter], bool]:
    return lambda f: f.add(
        schedule_rows(np.array([f.time + ahead]), POSITION, np.full((1, 3), value), variance)
    )


HERE = "here"
BAD: dict[str, tuple[Callable[[NavigationFilter], Any], str]] = {
    "clock jumps to Unix time": (sample(1.7e9), "clock jumped by 1.7e"),
    "clock jumps a day": (sample(1e5), "clock jumped by 100000 s"),
    "clock stands": (sample(0.0), "time that increases"),
    "clock goes back": (sample(-3.0), "time that increases"),
    "time is infinite": (sample(np.inf), "finite time"),
    "time is no number": (sample(np.nan), "finite time"),
    "gyro NaN": (sample(gyro=[0.0, np.nan, 0.0]), "the gyros show"),
    "accel infinite": (sample(accel=[0.0, 0.0, -np.inf]), "the accelerometers show"),
    "gyro 1e30": (sample(gyro=[1e30, 0.0, 0.0]), "the gyros show"),
    "gyro is one number": (sample(gyro=0.1), "3 numbers"),
    "accel is one number in an array": (sample(accel=[9.8]), "3 numbers"),
    "gyro is nothing": (sample(gyro=None), "3 numbers"),
    "gyro is text": (sample(gyro="abc"), "3 numbers"),
    "scale of wrong shape": (sample(scale=[1.0, 2.0]), "6 numbers"),
    "scale NaN": (sample(scale=np.full(6, np.nan)), "white_scale"),
    "fix NaN": (fix(-0.5, np.full(3, np.nan)), "finite numbers"),
    "fix in degrees": (fix(-0.5, [48.1, 11.5, 500.0]), "numpy.radians"),
    "fix in the sky": (fix(-0.5, [0.8, 0.1, 1e12]), "metres above"),
    "fix of two numbers": (fix(-0.5, [0.8, 0.1]), "3 numbers"),
    "fix years away": (fix(5e7, HERE), "ahead of the IMU"),
    "fix at no time": (fix(np.nan, HERE), "finite time"),
    "sd negative": (fix(-0.5, HERE, -1.0), "infinite where not measured"),
    "sd zero": (fix(-0.5, HERE, 0.0), "infinite where not measured"),
    "sd of 1e-200": (fix(-0.5, HERE, 1e-200), "infinite where not measured"),
    "sd of 1e-9": (fix(-0.5, HERE, 1e-9), "infinite where not measured"),
    "sd NaN": (fix(-0.5, HERE, [1.0, np.nan, 1.0]), "infinite where not measured"),
    "nothing measured": (fix(-0.5, HERE, np.inf), "infinite where not measured"),
    "good position, bad velocity": (
        fix(-0.5, HERE, 1.0, [np.inf, 0.0, 0.0]),
        "the velocity is",
    ),
    "row NaN": (rows(np.nan, 1.0, -0.5), "finite numbers"),
    "row without variance": (rows(0.0, 0.0, -0.5), "positive"),
    "row years ahead": (rows(0.0, 1.0, 1e9), "ahead of the IMU"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_told_at_once_and_changes_nothing(twin: Twin, case: str) -> None:
    act, words = BAD[case]
    filter_, clean = stream(twin), stream(twin)
    spent = []
    for _ in range(5):
        begin = time.thread_time()
        with pytest.raises(InputError, match=words):
            act(filter_)
        spent.append(time.thread_time() - begin)
    assert min(spent) < WORST
    same(filter_.state(), clean.state())
    for f in (filter_, clean):
        for k in range(BEFORE, BEFORE + 100):
            f.add_imu(float(twin.imu.time[k]), twin.imu.gyro[k], twin.imu.accel[k])
        assert f.add_gnss(f.time - 0.3, f.state().position, 0.5)
    same(filter_.state(), clean.state())


def test_a_fix_of_years_ago_is_counted_and_not_used(twin: Twin) -> None:
    filter_ = stream(twin)
    before = filter_.state()
    assert not filter_.add_gnss(filter_.time - 1e8, before.position, 1.0)
    assert filter_.late_fixes_refused == 1
    same(filter_.state(), before)


@pytest.mark.parametrize("away", [-1e8, 1e8])
def test_a_fix_of_another_time_does_not_wait_for_the_first_sample(twin: Twin, away: float) -> None:
    filter_, clean = stream(twin, begun=False), stream(twin, begun=False)
    wrong = twin.gnss.position[0] + np.array([1e-5, 0.0, 0.0])
    filter_.add_gnss(float(twin.imu.time[0]) + away, wrong, 0.01)
    for f in (filter_, clean):
        assert f.add_gnss(float(twin.gnss.time[0]), twin.gnss.position[0], 1.0)
        for k in range(200):
            f.add_imu(float(twin.imu.time[k]), twin.imu.gyro[k], twin.imu.accel[k])
    assert filter_.late_fixes_refused == 1
    same(filter_.state(), clean.state())


def test_a_component_that_is_not_measured_may_be_anything(twin: Twin) -> None:
    filter_, clean = stream(twin), stream(twin)
    place = filter_.state().position
    sd = np.array([1.0, 1.0, np.inf])
    assert filter_.add_gnss(filter_.time - 0.2, [place[0], place[1], np.nan], sd)
    assert clean.add_gnss(clean.time - 0.2, place, sd)
    same(filter_.state(), clean.state())


def test_a_model_that_fails_leaves_the_state_where_the_samples_are(twin: Twin) -> None:
    filter_ = stream(twin)
    before = filter_.state()

    class Broken:
        name, time = "broken", np.array([filter_.time - 0.5])

        def linearise(self, *_: Any) -> Any:
            raise ValueError("a model of one's own")

    from schuler.navigation.aiding.general import placed_source

    _, known = placed_source(Broken()).placed(twin.setup.model)
    with pytest.raises((ValueError, SchulerError), match="one's own"):
        filter_.add(known.rows())
    same(filter_.state(), before)


def test_a_state_that_stops_being_finite_is_taken_back(twin: Twin) -> None:
    filter_ = stream(twin)
    # within what sensors may show, but not for so long
    with pytest.raises(NavigationError, match="the filter is back at"):
        for _ in range(20_000):
            filter_.add_imu(filter_.time + 9.0, GYRO, np.full(3, 9e4))
    state = filter_.state()
    assert np.isfinite(state.position).all()
    assert np.isfinite(state.covariance).all()
    assert state.time == filter_.time
    filter_.add_imu(filter_.time + 0.02, GYRO, ACCEL)
    assert np.isfinite(filter_.state().position).all()
