"""Clocks of IMU and receiver that run at different speeds are put together, and it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler import NoiseModel, RandomWalk, Scenario, WhiteNoise, prepare, simulate_drive
from schuler.errors import NavigationError
from schuler.navigation.preparation.clock_drift import ClockDrift, find_clock_drift
from schuler.simulation import RTK_FIXED

MODEL = NoiseModel.isotropic(
    WhiteNoise(8.7e-5) + RandomWalk(3e-6), WhiteNoise(1e-3) + RandomWalk(1e-4)
)


@pytest.mark.parametrize("share", [2e-4, -2e-4])
def test_a_clock_that_drifts_is_found_and_put_right(share: float) -> None:
    drive = simulate_drive(Scenario("car_urban", MODEL, RTK_FIXED, duration=300.0), seed=4)
    imu, gnss = drive.imus[0], drive.gnss
    # the clock of the IMU loses: it shows less time than GNSS does
    slow = replace(imu, time=imu.time - share * (imu.time - 150.0))
    ready, setup = prepare(slow, gnss, MODEL)
    (said,) = [f for f in setup.condition.findings if f.kind == "clock drift"]
    assert said.value == pytest.approx(share, rel=0.1)
    assert ("slower" in said.message) == (share > 0.0)
    begin = int(np.searchsorted(slow.time, ready.time[0] - 0.1))
    left = np.polyfit(imu.time[begin:][: ready.size] - 150.0, ready.time[: imu.size - begin], 1)
    assert left[0] - 1.0 == pytest.approx(0.0, abs=0.1 * abs(share))
    assert find_clock_drift(ready, gnss, setup) is None


def test_clocks_that_agree_are_left_alone() -> None:
    drive = simulate_drive(Scenario("car_urban", MODEL, RTK_FIXED, duration=300.0), seed=5)
    ready, setup = prepare(drive.imus[0], drive.gnss, MODEL)
    assert find_clock_drift(ready, drive.gnss, setup) is None
    assert not [f for f in setup.condition.findings if f.kind == "clock drift"]
    moved = ClockDrift(1e-4, 100.0).corrected(ready)
    assert np.diff(moved.time).mean() == pytest.approx(np.diff(ready.time).mean() * 1.0001)


@pytest.mark.parametrize("jump", [0.2, -0.1])
def test_a_latency_that_changes_is_no_drift(jump: float) -> None:
    drive = simulate_drive(Scenario("car_urban", MODEL, RTK_FIXED, duration=300.0), seed=6)
    imu, gnss = drive.imus[0], drive.gnss
    kept = gnss.select((gnss.time < 140.0) | (gnss.time > 141.0))
    later = replace(kept, time=kept.time + np.where(kept.time > 140.5, jump, 0.0))
    with pytest.raises(NavigationError, match=f"by {abs(jump):.1f}. s at about 1[2-6]"):
        prepare(imu, later, MODEL)
