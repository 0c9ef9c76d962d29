"""Lasting faults in motion: offsets of windows, their covariance, alarms and blame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from schuler.arrays.calibration.calibrate import calibrate_array
from schuler.arrays.calibration.rows import mask_saturated
from schuler.arrays.detection.healthy_motion import LastingFaultSettings, learn_healthy_motion
from schuler.arrays.detection.lasting_faults import detect_lasting_faults
from schuler.arrays.detection.window_offsets import CalibratedRates, window_offsets
from schuler.arrays.read import read_array
from schuler.data import ImuArray
from schuler.errors import InputError

NOISE, JERK = 0.01, 300.0
"""rad/s, and rad/s²: angular acceleration that no derivative of the mean shows."""


def rates_with(fault: np.ndarray, seed: int, unknown: float, seconds: int = 80) -> CalibratedRates:
    """Sensors whose ages saw through a millisecond each at its own pace, shaken."""
    rng = np.random.default_rng(seed)
    n, k = 100 * seconds, fault.shape[0]
    time = np.arange(n) / 100.0
    age = 1e-3 * np.mod(rng.uniform(0.5, 3.0, k) * time[:, None] + rng.uniform(size=k), 1.0)
    age -= age.mean(axis=1, keepdims=True)
    shaken = JERK * rng.standard_normal((n, 3))
    noise = NOISE * rng.standard_normal((n, k, 3))
    residual = fault + noise - age[..., None] * shaken[:, None]
    residual -= residual.mean(axis=1, keepdims=True)
    zero = np.zeros((n, 3))
    present = np.ones((n, k), dtype=bool)
    return CalibratedRates(time, residual, present, age, np.full(n, unknown), zero, zero)


def test_a_window_shows_the_fault_through_unknown_angular_acceleration() -> None:
    fault = np.zeros((6, 3))
    fault[2, 1] = 0.02
    truth = fault - fault.mean(axis=0)
    found = window_offsets(rates_with(fault, 1, 1.0), 1.0, 1.0)
    error = found.offset - truth
    # chi-square of 15 degrees of freedom a window, robust weights cost a few percent
    precision = np.linalg.pinv(found.sampling, hermitian=True)
    score = np.einsum("wka,wkl,wla->w", error, precision, error)
    se = np.sqrt(2.0 * 15.0 / score.size)
    # measured 15.6 with a standard error of 0.6
    assert score.mean() == pytest.approx(15.0, abs=3.0 * se + 0.8)
    assert abs(error[:, 2, 1].mean()) < 4.0 * error[:, 2, 1].std() / np.sqrt(score.size)
    # taken as known, the same acceleration drowns it
    plain = window_offsets(rates_with(fault, 1, 0.0), 1.0, 1.0).offset - truth
    assert plain.std() > 4.0 * error.std()


def test_a_sensor_that_is_away_is_neither_judged_nor_missed() -> None:
    fault = np.zeros((6, 3))
    fault[2, 1] = 0.02
    rates = rates_with(fault, 2, 1.0, seconds=20)
    present = rates.present.copy()
    present[1000:, 5] = False
    rates = replace(
        rates, present=present, residual=np.where(present[..., None], rates.residual, 0.0)
    )
    found = window_offsets(rates, 1.0, 1.0)
    assert not found.present[10:, 5].any() and found.present[:, :5].all()
    assert (found.offset[10:, 5] == 0.0).all()
    # against the mean of six, then of five
    assert found.offset[:10, 2, 1].mean() == pytest.approx(0.02 * 5 / 6, abs=0.002)
    assert found.offset[10:, 2, 1].mean() == pytest.approx(0.02 * 4 / 5, abs=0.002)
    # half of the sensors away: nothing can be said
    present[:, 3:] = False
    assert window_offsets(replace(rates, present=present), 1.0, 1.0).skipped == 20


def test_settings_that_cannot_be() -> None:
    with pytest.raises(InputError, match="windows of 0 s"):
        LastingFaultSettings(window=0.0)
    with pytest.raises(InputError, match="false alarms below"):
        LastingFaultSettings(false_alarm_rate=0.5)


def test_a_fast_board_of_eight_is_watched_by_what_another_run_taught(data_folder: Path) -> None:
    run1, run4 = (read_array(data_folder / "mimu8-array" / f"run{r}.parquet") for r in (1, 4))
    calibration = calibrate_array(run1)
    normal = learn_healthy_motion(calibration, [run1])
    healthy = detect_lasting_faults(calibration, run4, normal)
    speed = np.degrees(healthy.offsets.speed)
    slow, fast = (speed > 5.0) & (speed < 100.0), speed > 800.0
    assert slow.sum() > 80 and fast.sum() > 200
    # wanted: at most 1 % (measured 0 and 0), and 2 % for all axes together below 500 deg/s
    assert healthy.alarm[slow].mean() <= 0.01 and healthy.alarm[fast].mean() <= 0.01
    assert healthy.inconsistent[(speed > 5.0) & (speed < 500.0)].mean() <= 0.02

    rng = np.random.default_rng(3)
    start = healthy.offsets.start
    chosen: list[int] = []
    for w in rng.permutation(np.flatnonzero(slow | fast)):
        if all(abs(start[w] - start[c]) >= 4.0 for c in chosen):
            chosen.append(int(w))
    imu, axis = rng.integers(8, size=len(chosen)), rng.integers(3, size=len(chosen))
    size = np.radians(np.where(fast[chosen], 5.0, 0.5)) * rng.choice([-1, 1], len(chosen))
    faulty = with_faults(run4, calibration.gyro_sensor, healthy.offsets, chosen, imu, axis, size)
    found = detect_lasting_faults(calibration, faulty, normal)
    place = np.searchsorted(found.offsets.start, start[chosen])
    hit = found.alarm[place] & (found.offsets.start[place] == start[chosen])
    right = found.suspect[place] == 3 * imu + axis
    # wanted: power 0.95 of each; one in some sixty slips through where the sensor is saturated
    # in nearly all of the window
    assert hit.size > 30
    assert hit.mean() >= 0.95
    assert right[hit].mean() >= 0.95
    assert not found.healthy and any("off by" in r.text for r in found.records)


def with_faults(run, sensor, offsets, chosen, imu, axis, size) -> ImuArray:  # type: ignore[no-untyped-def]
    """A constant in each chosen window before anything is estimated; what is saturated stays so."""
    gyro = np.array(run.gyro)
    for w, i, a, s in zip(chosen, imu, axis, size, strict=True):
        first, last = np.searchsorted(run.time, [offsets.start[w], offsets.stop[w]])
        gyro[first : last + 1, i] += sensor[i, :, a] * s
    saturated = np.isnan(mask_saturated(run, margin=0)[0].gyro)
    gyro[saturated] = run.gyro[saturated]
    return replace(run, gyro=gyro)
