"""Constraints are believed as far as the fixes after self-made outages allow."""

from __future__ import annotations

import numpy as np
import pytest
from twins import NOISE, navigation_errors, perfect, with_noise

from schuler import navigate
from schuler.data import NavigationSolution
from schuler.rotations import euler_from_dcm
from schuler.simulation import Profile, car_urban, fit_profile, simulate_gnss

OUTAGES = tuple((float(start), 30.0) for start in range(100, 390, 70))
DURATION = 440.0


def sliding(seed: int, slip: float) -> Profile:
    """A car whose nose wanders off its course for seconds, by `slip` rad."""
    car = car_urban(DURATION, seed, standstill=20.0)
    time = np.arange(car.start, car.stop + 0.05, 0.1)
    time = time[time <= car.stop]
    path, rng = car.trajectory(time), np.random.default_rng(seed)
    wander = np.zeros(time.size)
    for k in range(1, time.size):
        wander[k] = (1.0 - 0.0125) * wander[k - 1] + 0.158 * rng.standard_normal()
    soft = np.convolve(np.pad(wander, 20, mode="edge"), np.full(41, 1.0 / 41.0), "valid")
    euler = np.unwrap(np.stack(euler_from_dcm(path.rotation), axis=-1), axis=0)
    euler[:, 2] += slip * soft
    return fit_profile(time, path.position, euler)


def judged(seed: int, slip: float) -> tuple[list[str], float, float]:
    """What is said, and the mean of the largest errors in outages: constrained and plain."""
    profile, rng = sliding(seed, slip), np.random.default_rng(seed)
    imu, _ = with_noise(perfect(profile, 50.0), NOISE, rng)
    gnss = simulate_gnss(profile, 2.0, position_sd=0.5, velocity_sd=0.05, rng=rng)

    def worst(solution: NavigationSolution) -> float:
        path = solution.trajectory
        off = navigation_errors(profile, path.time, path.position, path.velocity, path.rotation)
        since = path.time - gnss.time[0]
        parts = [off[(since >= a) & (since < a + s), :2] for a, s in OUTAGES]
        return float(np.mean([np.hypot(*p.T).max() for p in parts]))

    known = {"time_offset": 0.0, "tune_noise": False, "outages": OUTAGES}
    aided = navigate(imu, gnss, NOISE, aiding=("nhc", "zupt"), **known)  # type: ignore[arg-type]
    plain = navigate(imu, gnss, NOISE, **known)  # type: ignore[arg-type]
    said = [f["message"] for f in aided.settings["findings"] if f["kind"] == "constraints"]
    return said, worst(aided), worst(plain)


def test_constraints_that_lose_are_widened_or_switched_off_and_it_is_said() -> None:
    said, aided, plain = judged(1, np.radians(3.0))
    assert said
    assert "outages" in said[0]
    assert aided < 1.1 * plain


@pytest.mark.parametrize("seed", [1, 2])
def test_constraints_that_win_are_kept_without_a_word(seed: int) -> None:
    said, aided, plain = judged(seed, 0.0)
    assert said == []
    assert aided < 0.6 * plain
