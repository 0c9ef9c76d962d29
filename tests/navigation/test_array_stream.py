"""An array in real time: as good as the batch filter, faults out from their onset."""

from __future__ import annotations

import time as clock
from dataclasses import replace

import numpy as np
import pytest
from test_array_faults import BEGIN, DEGREE, TOLD, heading_and_position, hurt, noise, prepared, ride

from schuler.data import GnssRecording, ImuArray
from schuler.errors import InputError
from schuler.navigation.mechanizations.array_faults import ArrayFaults
from schuler.navigation.mechanizations.array_preparation import prepare_array
from schuler.navigation.mechanizations.array_stream import ArrayFilter
from schuler.navigation.mechanizations.navigate_array import run_mechanization
from schuler.navigation.mechanizations.sensor_table import Absence
from schuler.rotations import rotation_vector_from_dcm


def streamed(
    array: ImuArray, gnss: GnssRecording, *, faults: bool = True
) -> tuple[ArrayFilter, np.ndarray]:
    """Feed a ride; the filter, and its attitude at every sample (n, 3, 3)."""
    healthy, _, _ = ride()
    ready = prepare_array(healthy.between(0.0, 40.0), gnss, noise(), TOLD)
    live, turned, fix = ArrayFilter(ready, gnss, faults=faults), [], 0
    for k in range(array.size):
        while fix < gnss.size and gnss.time[fix] <= array.time[k]:
            sd = (gnss.position_sd, gnss.velocity_sd)
            assert sd[0] is not None and sd[1] is not None and gnss.velocity is not None
            live.add_gnss(
                gnss.time[fix], gnss.position[fix], sd[0][fix], gnss.velocity[fix], sd[1][fix]
            )
            fix += 1
        live.add_array(array.time[k], array.gyro[k], array.accel[k])
        turned.append(live.filter._stepper.state.rotation.copy())
    return live, np.array(turned)


def heading_rms(turned: np.ndarray) -> float:
    array, _, truth = ride()
    off = rotation_vector_from_dcm(turned @ truth.rotation.transpose(0, 2, 1))
    return float(np.sqrt(np.mean(off[array.time >= BEGIN, 2] ** 2)))


def test_a_faulty_gyro_is_out_from_its_onset_in_a_stream() -> None:
    array, gnss, truth = ride()
    live, turned = streamed(hurt(array), gnss)
    (absence,) = live.absences
    assert absence.record.name == "imu 4 x" and absence.record.sensor == "gyro"
    assert BEGIN - 0.6 < absence.onset <= BEGIN < absence.record.start < BEGIN + 0.5
    assert live.out[1, 9] and live.out.sum() == 1
    oracle = run_mechanization(prepared(False), gnss, "extended").solution
    assert heading_rms(turned) < 1.2 * heading_and_position(oracle, truth)[0] + 0.05 * DEGREE
    blind = heading_rms(streamed(hurt(array), gnss, faults=False)[1])
    assert blind > 3.0 * DEGREE


def test_a_healthy_stream_is_the_batch_filter_and_a_fault_that_ends_is_forgiven() -> None:
    array, gnss, _ = ride()
    live, turned = streamed(array, gnss)
    assert not live.absences
    batch = run_mechanization(prepare_array(array, gnss, noise(), TOLD), gnss, "extended").solution
    off = rotation_vector_from_dcm(turned @ batch.trajectory.rotation.transpose(0, 2, 1))
    # the start was prepared from a part of the ride
    assert np.abs(off[array.time > 30.0]).max() < 0.1 * DEGREE
    live, _ = streamed(hurt(array, stop=BEGIN + 3.0), gnss)
    assert not live.out.any()
    assert live.absences[0].record.stop is not None


def test_silent_imus_and_bad_samples() -> None:
    array, gnss, _ = ride()
    ready = prepare_array(array.between(0.0, 40.0), gnss, noise(), TOLD)
    live = ArrayFilter(ready, gnss)
    for k in range(300):
        gyro = array.gyro[k].copy()
        if 100 <= k < 200:
            gyro[2] = np.nan
        live.add_array(array.time[k], gyro, array.accel[k])
        assert live.out[:, 6:9].all() == (100 <= k < 200)
    with pytest.raises(InputError, match="no IMU has a whole sample"):
        live.add_array(array.time[300], np.full((4, 3), np.nan), array.accel[300])
    with pytest.raises(InputError, match="a sample of shape"):
        live.add_array(array.time[300], array.gyro[300, :3], array.accel[300])
    live.add_array(array.time[300], array.gyro[300], array.accel[300])
    begin = clock.perf_counter()
    for k in range(301, 1301):
        live.add_array(array.time[k], array.gyro[k], array.accel[k])
    assert clock.perf_counter() - begin < 2.0


def test_a_second_unit_fails_after_the_first_is_forgiven_and_one_was_silent_in_between() -> None:
    array, gnss, truth = ride()
    gyro, accel = hurt(array, stop=BEGIN + 3.0).gyro.copy(), array.accel.copy()
    second = BEGIN + 25.0
    gyro[array.time >= second, 1] -= 2.0 * DEGREE
    # silent just before the second onset: going back must not take its zeros for values
    quiet = (array.time >= second - 0.6) & (array.time < second - 0.2)
    gyro[quiet, 2], accel[quiet, 2] = np.nan, np.nan
    broken = replace(array, gyro=gyro, accel=accel)
    live, turned = streamed(broken, gnss)
    first, unit = live.absences
    assert first.record.name == "imu 4 x" and first.record.stop is not None
    assert BEGIN + 3.0 < first.record.stop < second + 15.0
    assert unit.record.name == "imu 2" and unit.record.stop is None
    assert second - 0.6 < unit.onset <= second < unit.record.start < second + 0.5
    assert live.out[1, 3:6].all() and not live.out[0].any()
    absences = (Absence(1, (9,), -np.inf, np.inf), Absence(1, (3, 4, 5), -np.inf, np.inf))
    oracle = prepare_array(array, gnss, noise(), TOLD, faults=ArrayFaults(absences=absences))
    never = run_mechanization(oracle, gnss, "extended").solution
    assert heading_rms(turned) < 1.2 * heading_and_position(never, truth)[0] + 0.05 * DEGREE


def test_a_unit_that_stays_silent_costs_what_it_would_have_brought_and_comes_back() -> None:
    array, gnss, _ = ride()
    gyro, accel = array.gyro.copy(), array.accel.copy()
    gone = (array.time >= 40.0) & (array.time < 60.0)
    gyro[gone, 0], accel[gone, 0] = np.nan, np.nan
    live, turned = streamed(replace(array, gyro=gyro, accel=accel), gnss)
    assert not live.absences and not live.out.any()
    _, whole = streamed(array, gnss)
    off = rotation_vector_from_dcm(turned @ whole.transpose(0, 2, 1))
    assert np.abs(off[array.time < 40.0]).max() == 0.0
    assert 1e-6 < np.abs(off).max() < 0.3 * DEGREE
