"""Zero velocities are used where a vehicle stands, not where it creeps so that nobody feels it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from schuler.data import ImuRecording
from schuler.navigation.aiding.schedule import ZERO_VELOCITY
from schuler.navigation.aiding.standstill import StandingJudgement, Standstill
from schuler.navigation.aiding.vehicle import VehicleConstraint
from schuler.navigation.causal import ConstraintStream
from schuler.navigation.preparation.standing import judge_standing

RATE = 50
PART = 20.0
SD = 0.05


@dataclass
class Known:
    """What a smoothed run knows of a drive."""

    trajectory: Any
    velocity_sd: np.ndarray


@dataclass
class Path:
    time: np.ndarray
    velocity: np.ndarray


def jam(speeds: list[float], shakes: list[float], seed: int) -> tuple[ImuRecording, Known]:
    """Parts at a steady speed each, with a jolt between two."""
    rng = np.random.default_rng(seed)
    n = int(PART * RATE)
    time = np.arange(n * len(speeds)) / RATE
    shake = np.repeat(shakes, n)[:, None]
    since = (np.arange(time.size) % n / RATE)[:, None]
    jolt = np.where(since < 3.0, since, 0.0) * np.array([1.0, 0.0, 0.0])
    gyro = 0.01 * shake * rng.standard_normal((time.size, 3))
    accel = np.array([0.0, 0.0, -9.8]) + shake * rng.standard_normal((time.size, 3)) + jolt
    velocity = np.zeros((time.size, 3))
    velocity[:, 0] = np.repeat(speeds, n)
    noise = np.repeat(rng.standard_normal((len(speeds), 3)), n, axis=0)
    known = Known(Path(time, velocity + SD * noise), np.full((time.size, 3), SD))
    return ImuRecording(time, gyro, accel), known


def moments(imu: ImuRecording, judgement: StandingJudgement | None) -> np.ndarray:
    rows = Standstill(imu, np.full(3, 1e-4), judgement).rows()
    return np.asarray(rows.time[rows.kind == ZERO_VELOCITY])


SPEEDS = [0.0, 0.3, 0.0, 0.2, 0.0, 0.4, 0.0, 0.3, 0.0, 0.0, 0.3, 0.0]


def test_shaking_tells_standing_from_creeping() -> None:
    imu, known = jam(SPEEDS, [0.05 if v else 0.01 for v in SPEEDS], 1)
    judgement, finding = judge_standing(imu, known)  # type: ignore[arg-type]
    assert judgement is not None
    assert finding is not None
    assert finding.severity == "info"
    part = ((moments(imu, judgement) - 0.5) / PART).astype(int)
    assert set(part) == {k for k, v in enumerate(SPEEDS) if v == 0.0}
    assert set(((moments(imu, None) - 0.5) / PART).astype(int)) == set(range(len(SPEEDS)))
    # at the rate at which noise is tuned they are the same moments
    slow = ImuRecording(imu.time[::2], imu.gyro[::2], imu.accel[::2])
    assert set(((moments(slow, judgement) - 0.5) / PART).astype(int)) == set(part)


def test_creeping_that_shakes_like_standing_switches_zero_velocities_off() -> None:
    imu, known = jam(SPEEDS, [0.02] * len(SPEEDS), 2)
    judgement, finding = judge_standing(imu, known)  # type: ignore[arg-type]
    assert judgement is not None
    assert finding is not None
    assert finding.severity == "warning"
    assert "switched off" in finding.message
    assert moments(imu, judgement).size == 0


@pytest.mark.parametrize("seed", range(5))
def test_a_drive_that_only_stands_keeps_all_its_zero_velocities(seed: int) -> None:
    imu, known = jam([0.0] * 12, [0.02] * 12, 10 + seed)
    assert judge_standing(imu, known) == (None, None)  # type: ignore[arg-type]


def test_a_stream_leaves_out_the_same_moments() -> None:
    imu, known = jam(SPEEDS, [0.05 if v else 0.01 for v in SPEEDS], 3)
    judgement, _ = judge_standing(imu, known)  # type: ignore[arg-type]
    vehicle = VehicleConstraint(("zupt",), np.eye(3), -1, standing=judgement)
    stream = ConstraintStream(vehicle, np.full(3, 1e-4), float(RATE))
    seen = [
        row[0]
        for time, gyro, accel in zip(imu.time, imu.gyro, imu.accel, strict=True)
        for row in stream.rows(float(time), gyro, accel)
        if row[1] == ZERO_VELOCITY
    ]
    np.testing.assert_allclose(seen, moments(imu, judgement))
