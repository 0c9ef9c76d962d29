"""Fixes that cannot belong to the motion: held ones, detours, heights of another kind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler.data import GnssRecording
from schuler.navigation.preparation.fixes import screen_fixes

RADIUS = 6.37e6


def track(speed: float = 12.0, stop: tuple[float, float] = (np.inf, np.inf)) -> GnssRecording:
    """Drive a slow curve at 1 Hz, with a stop, seen with noise of 0.5 m and 0.1 m/s."""
    rng = np.random.default_rng(5)
    time = np.arange(400.0)
    going = np.where((time >= stop[0]) & (time < stop[1]), 0.0, speed)
    course = 0.01 * time
    velocity = np.column_stack([going * np.cos(course), going * np.sin(course), 0.0 * time])
    way = np.vstack([np.zeros(3), np.cumsum(0.5 * (velocity[1:] + velocity[:-1]), axis=0)])
    way += 0.5 * rng.standard_normal(way.shape)
    position = np.array([0.8, 0.2, 400.0]) + way * [1 / RADIUS, 1 / RADIUS / np.cos(0.8), -1.0]
    return GnssRecording(
        time,
        position,
        np.full((400, 3), 0.8),
        velocity + 0.1 * rng.standard_normal(velocity.shape),
        np.full((400, 3), 0.1),
    )


def moved(gnss: GnssRecording, begin: int, end: int, metres: float) -> GnssRecording:
    position = gnss.position.copy()
    position[begin:end, 0] += metres / RADIUS
    return replace(gnss, position=position)


@pytest.mark.parametrize("velocities", [True, False])
def test_a_sound_drive_has_nothing_wrong(velocities: bool) -> None:
    gnss = track(stop=(200.0, 230.0))
    found = screen_fixes(gnss if velocities else replace(gnss, velocity=None, velocity_sd=None))
    assert not found.wrong.any()
    assert not found.jumps
    assert not found.height_jumps


def test_a_fix_that_is_held_while_the_vehicle_drives_on_is_left_out() -> None:
    gnss = track()
    position, velocity = gnss.position.copy(), np.array(gnss.velocity)
    position[101:121], velocity[101:121] = position[100], 0.0
    found = screen_fixes(replace(gnss, position=position, velocity=velocity))
    assert np.flatnonzero(found.wrong).tolist() == list(range(101, 121))
    assert found.away.max() == pytest.approx(12.0 * 21.0, rel=0.05)
    assert not found.jumps


def test_a_fix_that_is_held_at_rest_is_good() -> None:
    gnss = track(stop=(100.0, 121.0))
    position = gnss.position.copy()
    position[101:121] = position[100]
    assert not screen_fixes(replace(gnss, position=position)).wrong.any()
    position[121:123, 0] += 1000.0 / RADIUS
    found = screen_fixes(replace(gnss, position=position))
    assert np.flatnonzero(found.wrong).tolist() == [121, 122]


@pytest.mark.parametrize("metres", [18.0, 60.0])
def test_a_detour_from_which_the_receiver_comes_back_is_left_out(metres: float) -> None:
    found = screen_fixes(moved(track(), 150, 180, metres))
    assert np.flatnonzero(found.wrong).tolist() == list(range(150, 180))
    assert found.away[160] == pytest.approx(metres, abs=3.0)
    assert not found.jumps


def test_a_jump_that_stays_is_told_and_believed() -> None:
    found = screen_fixes(moved(track(), 150, 400, 60.0))
    assert not found.wrong.any()
    assert [(t, round(size, -1)) for t, size in found.jumps] == [(150.0, 60.0)]


def test_heights_that_change_their_kind_are_told() -> None:
    gnss = track()
    position = gnss.position.copy()
    position[210:, 2] += 45.0
    found = screen_fixes(replace(gnss, position=position))
    assert not found.wrong.any()
    assert not found.jumps
    ((when, size),) = found.height_jumps
    assert when == 210.0
    assert size == pytest.approx(45.0, abs=3.0)
