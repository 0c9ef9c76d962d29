"""Two gyros that break in turn do not make a calibrated array one that is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from test_prepared_detection import DEGREE, turning

from schuler.arrays.detection.calibrated_parts import prepare_by_parts
from schuler.arrays.detection.faults import detect_faults
from schuler.navigation.mechanizations.array_faults import find_array_faults


def test_what_is_right_in_a_lively_part_is_calibrated_throughout() -> None:
    array = turning(120.0, seed=5)
    assert prepare_by_parts(array).array is array and prepare_by_parts(array).notes == ()
    gyro = array.gyro.copy()
    gyro[4_500:, 2, 0] = gyro[4_500, 2, 0]
    gyro[8_000:, 1, 2] = gyro[8_000, 1, 2]
    broken = replace(array, gyro=gyro)
    ready = prepare_by_parts(broken)
    assert ready.array is broken and "the array is calibrated" in ready.notes[0]
    records = detect_faults(ready.array, ready.settings).records
    assert {(r.sensor, r.name) for r in records} == {("gyro", "imu 3 x"), ("gyro", "imu 2 z")}


def test_the_size_that_is_told_is_that_of_the_fault_and_not_of_the_moment_it_was_noticed() -> None:
    array = turning(120.0, seed=7)
    gyro = array.gyro.copy()
    gyro[8_000:, 1, 2] += 2.0 * DEGREE
    (step,) = find_array_faults(replace(array, gyro=gyro)).taken_out
    assert step.size is not None and abs(step.size - 2.0 * DEGREE) < 0.05 * DEGREE
    assert "off by 2" in step.text and "gyro imu 2 z was not used from 79." in step.text
    gyro = array.gyro.copy()
    gyro[8_000:, 1, 2] = gyro[8_000, 1, 2]
    (stuck,) = find_array_faults(replace(array, gyro=gyro)).taken_out
    away = array.gyro[8_000:8_800, 1, 2] - gyro[8_000, 1, 2]
    assert stuck.size is not None
    assert 0.5 * np.std(away) < abs(stuck.size) < 2.0 * np.sqrt(np.mean(away**2))


def test_an_array_out_of_scale_is_so_in_every_part() -> None:
    ready = prepare_by_parts(turning(120.0, scale=0.03, seed=6))
    assert any("calibrated in passing" in note for note in ready.notes)
