"""Faults do what they say, at the times they say, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import simulation as simulate
from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError

N, RATE = 2000, 100.0


@pytest.fixture
def imu() -> ImuRecording:
    rng = np.random.default_rng(1)
    return ImuRecording(
        np.arange(1, N + 1) / RATE, rng.standard_normal((N, 3)), rng.standard_normal((N, 3))
    )


def change(imu: ImuRecording, fault) -> np.ndarray:
    faulty, _ = simulate.inject_faults(imu, [fault])
    np.testing.assert_array_equal(faulty.time, imu.time)
    return faulty.signals() - imu.signals()


def only(imu: ImuRecording, channel: str, start: float, stop: float) -> np.ndarray:
    mask = np.zeros((N, 6), dtype=bool)
    inside = (imu.time >= start) & (imu.time < stop)
    mask[inside, CHANNELS.index(channel)] = True
    return mask


def test_step(imu) -> None:
    fault = simulate.StepFault(start=5.0, duration=3.0, channels=("gyro_y",), size=-0.4)
    expected = np.where(only(imu, "gyro_y", 5.0, 8.0), -0.4, 0.0)
    np.testing.assert_allclose(change(imu, fault), expected, atol=1e-15)
    assert np.count_nonzero(expected) == 300


def test_ramp_grows_from_its_start_until_the_end(imu) -> None:
    fault = simulate.RampFault(start=10.0, channels=("accel_x",), slope=0.02)
    time = imu.time[:, None]
    expected = np.where(only(imu, "accel_x", 10.0, np.inf), 0.02 * (time - 10.0), 0.0)
    np.testing.assert_allclose(change(imu, fault), expected, atol=1e-14)
    assert expected.max() == pytest.approx(0.2)


def test_stuck_shows_the_last_value_or_a_given_one(imu) -> None:
    last = simulate.StuckFault(start=5.0, duration=1.0, channels=("accel_z", "gyro_x"))
    faulty, (entry,) = simulate.inject_faults(imu, [last])
    first, stop = entry.rows
    assert stop - first == 100
    np.testing.assert_array_equal(faulty.accel[first:stop, 2], imu.accel[first - 1, 2])
    np.testing.assert_array_equal(faulty.gyro[first:stop, 0], imu.gyro[first - 1, 0])
    np.testing.assert_array_equal(faulty.accel[stop:], imu.accel[stop:])
    np.testing.assert_array_equal(faulty.accel[:, :2], imu.accel[:, :2])
    zero = simulate.StuckFault(start=5.0, duration=1.0, channels=("accel_z",), value=0.0)
    faulty, _ = simulate.inject_faults(imu, [zero])
    np.testing.assert_array_equal(faulty.accel[first:stop, 2], 0.0)


def test_noise_burst_has_its_deviation_in_its_interval(imu) -> None:
    fault = simulate.NoiseBurst(start=2.0, duration=15.0, channels=("gyro_z",), deviation=3.0)
    added = change(imu, fault)
    mask = only(imu, "gyro_z", 2.0, 17.0)
    assert np.all(added[~mask] == 0.0)
    assert added[mask].std() == pytest.approx(3.0, rel=0.06)  # 1500 samples: 0.018
    assert abs(added[mask].mean()) < 4 * 3.0 / np.sqrt(1500)
    np.testing.assert_array_equal(added, change(imu, fault))
    other = simulate.NoiseBurst(
        start=2.0, duration=15.0, channels=("gyro_z",), deviation=3.0, seed=1
    )
    assert np.abs(added - change(imu, other)).max() > 1.0


def test_slip_delays_one_channel(imu) -> None:
    fault = simulate.SampleSlip(start=5.0, duration=2.0, channels=("accel_y",), samples=3)
    faulty, (entry,) = simulate.inject_faults(imu, [fault])
    first, stop = entry.rows
    np.testing.assert_array_equal(faulty.accel[first:stop, 1], imu.accel[first - 3 : stop - 3, 1])
    np.testing.assert_array_equal(faulty.accel[stop:, 1], imu.accel[stop:, 1])
    np.testing.assert_array_equal(faulty.gyro, imu.gyro)


def test_drop_out_takes_rows_away_or_holds_them(imu) -> None:
    gone, (entry,) = simulate.inject_faults(imu, [simulate.DropOut(start=5.0, duration=1.0)])
    assert entry.removed == 100
    assert gone.size == N - 100
    assert not np.any((gone.time >= 5.0) & (gone.time < 6.0))
    outside = (imu.time < 5.0) | (imu.time >= 6.0)
    np.testing.assert_array_equal(gone.accel, imu.accel[outside])
    held, (entry,) = simulate.inject_faults(
        imu, [simulate.DropOut(start=5.0, duration=1.0, hold=True)]
    )
    assert entry.removed == 0
    first, stop = entry.rows
    np.testing.assert_array_equal(held.signals()[first:stop], imu.signals()[[first - 1] * 100])
    np.testing.assert_array_equal(held.time, imu.time)


def test_time_jumps_forward_back_and_for_a_while(imu) -> None:
    ahead, (entry,) = simulate.inject_faults(imu, [simulate.TimeJump(start=5.0, jump=0.7)])
    first = entry.rows[0]
    np.testing.assert_array_equal(ahead.time[:first], imu.time[:first])
    np.testing.assert_allclose(ahead.time[first:] - imu.time[first:], 0.7, atol=1e-12)
    assert entry.removed == 0
    # back by 0.7 s: the rows that would come before the last good stamp are lost
    back, (entry,) = simulate.inject_faults(imu, [simulate.TimeJump(start=5.0, jump=-0.705)])
    assert entry.removed == 70
    assert np.diff(back.time).min() > 0.0
    assert back.time[-1] == pytest.approx(imu.time[-1] - 0.705)
    np.testing.assert_array_equal(back.gyro[-1], imu.gyro[-1])
    # for a second only: ahead, then rows are lost until the old clock has caught up
    while_, (entry,) = simulate.inject_faults(
        imu, [simulate.TimeJump(start=5.0, duration=1.0, jump=0.205)]
    )
    assert entry.removed == 20
    assert while_.time[-1] == imu.time[-1]


def test_several_faults_and_their_log(imu) -> None:
    faults = [
        simulate.StepFault(start=5.0, channels=("gyro_x",), size=1.0),
        simulate.DropOut(start=7.0, duration=0.5),
        simulate.StepFault(start=6.0, duration=2.0, channels=("gyro_x",), size=1.0),
        simulate.RampFault(start=100.0, channels=("gyro_x",), slope=1.0),
    ]
    faulty, log = simulate.inject_faults(imu, faults)
    assert [e.fault for e in log] == faults
    added = np.interp(faulty.time, imu.time, np.arange(N))  # rows as they were
    rows = np.round(added).astype(int)
    difference = faulty.gyro[:, 0] - imu.gyro[rows, 0]
    for at, expected in ((4.5, 0.0), (5.5, 1.0), (6.5, 2.0), (9.0, 1.0)):
        assert difference[np.searchsorted(faulty.time, at)] == pytest.approx(expected)
    assert log[0].start == pytest.approx(5.0) and log[0].stop == pytest.approx(20.0)
    assert log[2].stop == pytest.approx(7.99)
    assert log[3].rows[0] == log[3].rows[1] and "nothing done" in log[3].text
    assert len(faulty.history) == 4 and "50 rows removed" in faulty.history[1]
    assert np.isfinite(faulty.signals()).all()


def test_faults_that_cannot_be_are_refused(imu) -> None:
    with pytest.raises(InputError, match="a fault on gyro_w"):
        simulate.StepFault(start=1.0, channels=("gyro_w",), size=1.0)
    with pytest.raises(InputError, match="no channel"):
        simulate.StuckFault(start=1.0, channels=())
    with pytest.raises(InputError, match="fewer than two rows"):
        simulate.inject_faults(imu, [simulate.DropOut(start=0.0)])
    gyros = ImuRecording(imu.time, imu.gyro, np.full((N, 3), np.nan))
    with pytest.raises(InputError, match="does not have"):
        simulate.inject_faults(
            gyros, [simulate.StepFault(start=1.0, channels=("accel_x",), size=1.0)]
        )
