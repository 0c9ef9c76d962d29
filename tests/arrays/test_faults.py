"""Faults found on line: power, isolation, time to detect, the log, and what is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from riding_twins import ACCEL, DEGREE, GYRO, ride

from schuler.arrays.detection.fault_log import FaultRecord, Kind, told_records
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.faults import detect_faults
from schuler.arrays.detection.thresholds import likelihood_threshold
from schuler.arrays.geometry import tetrahedron
from schuler.arrays.synthesis.synthetic import synthesize
from schuler.arrays.tracking import OnlineSettings
from schuler.data import ImuArray, Mounting
from schuler.errors import InputError


@pytest.fixture(scope="module")
def healthy() -> tuple[ImuArray, np.ndarray]:
    return ride(240.0, 3)


def with_gyro(array: ImuArray, unit: int, axis: int, added: np.ndarray) -> ImuArray:
    gyro = array.gyro.copy()
    gyro[:, unit, axis] += added
    return replace(array, gyro=gyro)


def test_a_healthy_ride_keeps_all_its_sensors_and_alarms_as_often_as_it_should(healthy) -> None:
    array, _ = healthy
    detection = detect_faults(array)
    assert detection.healthy and detection.records == () and detection.limits == ()
    for sensor in detection.sensors:
        # 24 000 samples, noise that changes: 0.05 +- 0.0014
        assert sensor.exceedance(0.05) == pytest.approx(0.05, abs=0.006)
        assert sensor.exceedance(0.01) < 0.014
        assert min(sensor.used_share.values()) == 1.0


def test_a_step_of_one_sample_is_found_and_put_on_its_axis(healthy) -> None:
    array, deviation = healthy
    rng = np.random.default_rng(4)
    threshold = likelihood_threshold(tetrahedron(), 0.05)
    found, right, false = [], [], []
    for _ in range(6):
        # few enough not to be noise themselves
        rows = np.flatnonzero(rng.random(array.size) < 0.015)
        rows = rows[rows > 1500]
        axis = rng.integers(0, 12, rows.size)
        gyro = array.gyro.reshape(-1, 12).copy()
        gyro[rows, axis] += 5.0 * deviation.reshape(-1, 12)[rows, axis]
        followed = detect_faults(replace(array, gyro=gyro.reshape(-1, 4, 3))).gyro.followed  # type: ignore[union-attr]
        alarm = followed.axis_statistic > threshold
        clean = np.ones(array.size, bool)
        clean[:1500] = clean[rows] = False
        false.append(np.mean(alarm[clean]))
        found += alarm[rows].tolist()
        right += (followed.axis_suspect[rows] == axis)[alarm[rows]].tolist()
    # theory with known noise: 0.937 and 0.985; here 2000 steps: +- 0.006 and 0.003
    assert np.mean(false) == pytest.approx(0.05, abs=0.006)
    assert np.mean(found) > 0.93 - 0.006
    assert np.mean(right) > 0.98 - 0.003


@pytest.mark.parametrize(("slope", "within"), [(0.02, 6.0), (0.5, 1.0)])
def test_ramps_are_found_in_time_and_taken_out(healthy, slope: float, within: float) -> None:
    array, _ = healthy
    start = 120.0
    for unit, axis in ((0, 2), (3, 0)):
        ramp = slope * DEGREE * np.maximum(array.time - start, 0.0)
        detection = detect_faults(with_gyro(array, unit, axis, ramp))
        first = detection.records[0]
        assert first.name == f"imu {unit + 1} {'xyz'[axis]}" and first.kind == "axis"
        assert start < first.start < start + within
        assert first.stop is None and first.size is not None and first.size > 0.0
        assert len(detection.records) == 1


def test_the_fused_sensor_does_without_what_is_taken_out(healthy) -> None:
    array, _ = healthy
    broken = with_gyro(array, 1, 0, np.where(array.time > 100.0, 1.0 * DEGREE, 0.0))
    clean = synthesize(array, faults=FaultSettings())
    mended = synthesize(broken, faults=FaultSettings())
    blind = synthesize(broken, "equal")
    late = array.time > 105.0
    whole = clean.imu.gyro[late]
    assert np.abs((mended.imu.gyro[late] - whole).mean(axis=0)).max() < 0.01 * DEGREE
    # a quarter of the fault along its axis otherwise, so does the gap in weights
    assert np.linalg.norm((blind.imu.gyro[late] - whole).mean(axis=0)) > 0.2 * DEGREE
    # three axes instead of four say less, and the filter is told so
    variance = np.einsum("nii->n", mended.covariance("gyro")[late])
    before = np.einsum("nii->n", clean.covariance("gyro")[late])
    assert np.mean(variance / before) == pytest.approx(10 / 9, abs=0.02)


def test_faults_in_turn_are_told_apart_and_let_back_in(healthy) -> None:
    array, _ = healthy
    time = array.time
    gyro, accel = array.gyro.copy(), array.accel.copy()
    between = (time > 60.0) & (time < 100.0)
    gyro[between, 2] += np.array([0.5, -0.5, 0.4]) * DEGREE
    gyro[time > 80.0, 0, 1] -= 0.4 * DEGREE
    accel[time > 150.0, 3, 2] += 0.3
    detection = detect_faults(replace(array, gyro=gyro, accel=accel))
    kinds = [(r.sensor, r.kind, r.name) for r in detection.records]
    assert kinds == [
        ("gyro", "unit", "imu 3"),
        ("gyro", "axis", "imu 1 y"),
        ("accel", "axis", "imu 4 z"),
    ]
    first, second, third = detection.records
    assert first.start < 61.0 and second.start < 81.0 and third.start < 151.0
    # hysteresis: back after it has behaved for 10 s, its longest memory gone
    assert first.stop is not None and 110.0 < first.stop < 150.0
    assert second.stop is None and second.size is not None and second.size < 0.0
    assert "gyros of imu 3 taken out" in first.text and "deg/s" in first.text
    assert "accel imu 4 z taken out" in third.text and "m/s" in third.text
    assert detection.to_dict()["log"][1]["stop_s"] is None
    assert detection.gyro is not None and detection.gyro.used_share["imu 1 y"] < 0.7


def test_noise_that_bursts_and_single_spikes_are_no_lasting_fault(healthy) -> None:
    array, deviation = healthy
    rng = np.random.default_rng(5)
    gyro = array.gyro.copy()
    burst = (array.time > 90.0) & (array.time < 110.0)
    gyro[burst, 1] += 15.0 * deviation[burst, 1] * rng.standard_normal((burst.sum(), 3))
    rows = np.arange(13_000, 20_000, 500)
    gyro[rows, 2, 0] += 40.0 * deviation[rows, 2, 0]
    detection = detect_faults(replace(array, gyro=gyro))
    assert detection.healthy
    assert detection.gyro is not None
    assert detection.gyro.spikes["imu 3 x"] == rows.size
    # the bursting IMU is weighed down instead
    weight = detection.gyro.followed.weight[1000].reshape(4, 3)
    assert weight[1].max() < 0.01
    # and a sample that spikes is not used: its error in the fused rate is that of the others
    clean = detect_faults(array).gyro
    assert clean is not None
    change = detection.gyro.followed.fused[rows] - clean.followed.fused[rows]
    assert np.abs(change).max() < 2.0 * deviation[rows].mean()


def test_two_aligned_units_are_told_to_disagree_and_neither_is_blamed() -> None:
    rng = np.random.default_rng(6)
    n = 6000
    gyro = GYRO * rng.standard_normal((n, 2, 3))
    gyro[3000:, 1, 0] += 0.5 * DEGREE
    accel = ACCEL * rng.standard_normal((n, 2, 3)) + [0.0, 0.0, -9.81]
    array = ImuArray(np.arange(n) / 100.0, gyro, accel, Mounting.aligned(2))
    detection = detect_faults(array)
    assert any("not isolated" in line for line in detection.limits)
    (record,) = detection.records
    assert record.kind == "inconsistent" and {record.name, record.other} == {"imu 1 x", "imu 2 x"}
    assert "could be to blame" in record.text and record.start < 31.0
    assert min(detection.gyro.used_share.values()) == 1.0  # type: ignore[union-attr]


def test_when_most_sensors_are_faulty_at_once_none_is_believed_to_be_the_culprit(healthy) -> None:
    array, _ = healthy
    rng = np.random.default_rng(7)
    gyro = array.gyro.copy()
    gyro[array.time > 100.0] += 2.0 * DEGREE * rng.standard_normal((4, 3))
    detection = detect_faults(replace(array, gyro=gyro))
    assert any(r.kind == "inconsistent" for r in detection.records)
    used = detection.gyro.followed.usage[1100:] == 0  # type: ignore[union-attr]
    # two thirds of the redundancy at least is kept
    assert used.sum(axis=1).min() >= 8


def test_an_error_that_all_share_leaves_no_trace(healthy) -> None:
    array, _ = healthy
    common = np.einsum("kij,i->kj", array.mounting.rotation, [2.0 * DEGREE, 0.0, 1.0 * DEGREE])
    gyro = array.gyro + np.where(array.time > 100.0, 1.0, 0.0)[:, None, None] * common
    assert detect_faults(replace(array, gyro=gyro)).healthy


def test_a_sensor_that_dies_is_logged_and_done_without(healthy) -> None:
    array, _ = healthy
    gyro = array.gyro.copy()
    gyro[12_000:, 3] = np.nan
    gyro[5000:5010, 0, 1] = np.nan
    detection = detect_faults(replace(array, gyro=gyro))
    assert detection.healthy
    (record,) = detection.records
    assert record.kind == "missing" and record.name == "imu 4" and record.stop is None
    assert record.start == pytest.approx(array.time[12_000])
    assert detection.gyro is not None and detection.gyro.followed.freedom[-1] == 6
    assert detection.gyro.exceedance(0.05) == pytest.approx(0.05, abs=0.008)


def test_scale_errors_in_motion_are_allowed_for_when_said(healthy) -> None:
    array, _ = healthy
    scale = 1.0 + 0.004 * np.random.default_rng(8).standard_normal((4, 3))
    array = replace(array, gyro=array.gyro * scale)
    assert not detect_faults(array).healthy
    told = FaultSettings(scale_uncertainty=0.006)
    assert detect_faults(array, told).healthy
    # a fault that motion cannot explain is found all the same
    broken = with_gyro(array, 2, 2, np.where(array.time > 120.0, 5.0 * DEGREE, 0.0))
    records = detect_faults(broken, told).records
    assert records[0].name == "imu 3 z" and records[0].start < 122.0


def test_the_future_does_not_change_what_was_decided(healthy) -> None:
    array, _ = healthy
    broken = with_gyro(array, 1, 0, np.where(array.time > 60.0, 0.5 * DEGREE, 0.0))
    other = with_gyro(broken, 2, 1, np.where(array.time > 100.0, 9.0 * DEGREE, 0.0))
    first, second = detect_faults(broken).gyro, detect_faults(other).gyro
    assert first is not None and second is not None
    row = int(np.searchsorted(array.time, 100.0))
    np.testing.assert_array_equal(
        first.followed.statistic[: row - 10], second.followed.statistic[: row - 10]
    )
    assert first.records[0].start == second.records[0].start


def test_settings_that_make_no_sense_are_refused(healthy) -> None:
    with pytest.raises(InputError, match="between 0 and 1"):
        FaultSettings(false_alarm_rate=0.0)
    with pytest.raises(InputError, match="above zero"):
        FaultSettings(time_constants=())
    with pytest.raises(InputError, match="above zero"):
        OnlineSettings(time_constant=0.0)
    with pytest.raises(InputError, match="one IMU"):
        detect_faults(healthy[0].select([0]))
    with pytest.raises(InputError, match="together with faults"):
        synthesize(healthy[0], "equal", faults=FaultSettings())


def test_a_sensor_that_is_often_missing_has_one_line_after_the_faults() -> None:
    def record(kind: Kind, name: str, start: float, stop: float | None) -> FaultRecord:
        return FaultRecord("gyro", kind, name, start, stop, 0.1, 40.0, 30.0, 0.5, "")

    both = [(name, k) for k in range(5) for name in ("imu 1", "imu 3")]
    records = [record("missing", name, float(k), k + 0.5) for name, k in both]
    records += [record("axis", "imu 2 x", 7.0, None), record("missing", "imu 2", 8.0, 9.0)]
    said = told_records(records)
    assert [severity for severity, _ in said] == ["warning", "info", "info"]
    assert said[1][1] == "0.00 s to 4.50 s: gyro imu 1, imu 3 missing, 5 times, 2.5 s in all"
    assert said[2][1] == "8.00 s to 9.00 s: gyro imu 2 missing"
