"""The verb for arrays as a user calls it: alignment, missing samples, lever arms, bad input."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from array_twins import ANTENNA, mems
from twins import navigation_errors

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import GnssRecording, ImuArray, Mounting
from schuler.errors import InputError
from schuler.navigation.aiding.options import MeasurementOptions
from schuler.navigation.mechanizations.navigate_array import navigate_array
from schuler.navigation.navigate import navigate
from schuler.simulation import Profile, motorcycle, simulate_array, simulate_gnss

# the IMUs sit far from the origin of the body, so that a lever that is left out shows
MOUNTING = Mounting(
    tetrahedron_mounting().rotation, tetrahedron_mounting(0.1).position + np.array([0.4, -0.3, 0.2])
)


@cache
def ride() -> tuple[Profile, ImuArray, GnssRecording]:
    profile = motorcycle(150.0, 4, standstill=40.0)
    rng = np.random.default_rng(8)
    recordings = simulate_array(profile, MOUNTING.rotation, MOUNTING.position, mems(0.3), 50.0, rng)
    array = ImuArray.from_recordings(recordings, MOUNTING)
    gnss = simulate_gnss(
        profile, 1.0, position_sd=0.05, velocity_sd=0.03, lever_arm=ANTENNA, rng=rng
    )
    return profile, array, gnss


def errors(result, start: float = 60.0) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Root mean squares (9,) of the errors after the start of the ride."""
    path = result.solution.trajectory
    e = navigation_errors(ride()[0], path.time, path.position, path.velocity, path.rotation)
    rms: np.ndarray = np.sqrt(np.mean(e[path.time > start] ** 2, axis=0))
    return rms


@pytest.mark.parametrize("name", ["synthetic", "extended", "constrained", "system", "single"])
def test_the_origin_of_the_body_is_found_from_rest_and_motion(name: str) -> None:
    _, array, gnss = ride()
    result = navigate_array(
        array, gnss, mems(0.3), mechanization=name, lever_arm=ANTENNA, time_offset=0.0
    )
    rms = errors(result)
    # IMUs half a metre away: a lever with the wrong sign would be off by a metre
    assert rms[:3].max() < 0.06
    assert rms[3:6].max() < 0.05
    assert np.degrees(rms[6:8]).max() < (0.5 if name == "single" else 0.25)
    assert result.solution.settings["mechanization"] == name


def test_short_gaps_are_bridged_and_silent_sensors_do_not_count() -> None:
    _, array, gnss = ride()
    gyro, accel = array.gyro.copy(), array.accel.copy()
    rng = np.random.default_rng(1)
    gone = rng.random((array.size, 4)) < 0.02
    gone[gone.all(axis=1)] = False
    gyro[gone], accel[gone] = np.nan, np.nan
    full = navigate_array(array, gnss, mems(0.3), lever_arm=ANTENNA, time_offset=0.0)
    holes = navigate_array(
        replace(array, gyro=gyro, accel=accel), gnss, mems(0.3), lever_arm=ANTENNA, time_offset=0.0
    )
    assert f"{gone.sum()} missing samples" in holes.prepared.notes[0]
    np.testing.assert_allclose(errors(holes), errors(full), rtol=0.2, atol=2e-4)
    half = array.size // 2
    gyro[half:, 2] = np.nan
    result = navigate_array(
        replace(array, gyro=gyro), gnss, mems(0.3), lever_arm=ANTENNA, time_offset=0.0
    )
    assert result.prepared.table.out[-1, :, 6:9].all() and not result.prepared.table.out[0].any()
    assert "imu 3 is silent from 7" in result.prepared.notes[0]
    assert errors(result)[:3].max() < 0.06


def test_smoothing_and_outages_serve_arrays_too() -> None:
    _, array, gnss = ride()
    given = {"lever_arm": ANTENNA, "time_offset": 0.0, "outages": [(100.0, 15.0)]}
    causal = navigate_array(array, gnss, mems(0.3), **given)
    smoothed = navigate_array(array, gnss, mems(0.3), smooth=True, **given)
    inside = (causal.solution.trajectory.time > 100.0) & (causal.solution.trajectory.time < 115.0)
    ratio = smoothed.solution.position_sd[inside].max() / causal.solution.position_sd[inside].max()
    assert ratio < 0.2
    assert errors(smoothed, 100.0)[:3].max() < 0.5 * errors(causal, 100.0)[:3].max()


def test_noise_that_nobody_knows_is_tuned_on_the_fused_drive() -> None:
    _, array, gnss = ride()
    result = navigate_array(array, gnss, mechanization="synthetic", lever_arm=ANTENNA)
    # 15 m/s and an offset of a few milliseconds that is estimated
    assert errors(result)[:3].max() < 0.15
    assert abs(result.solution.settings["time_offset_position_s"]) < 0.02


def test_what_cannot_be_done_is_said() -> None:
    _, array, gnss = ride()
    with pytest.raises(InputError, match=r"one IMU .*schuler navigate --imu"):
        navigate_array(array.select([0]), gnss, mems())
    copy = replace(
        array,
        gyro=array.gyro[:, [0, 1, 2, 1]],
        accel=array.accel[:, [0, 1, 2, 1]],
    )
    with pytest.raises(InputError, match="imu 4 is a copy of imu 2"):
        navigate_array(copy, gnss, mems())
    dead = array.gyro.copy()
    dead[1:, 1:] = np.nan
    with pytest.raises(InputError, match="1 of 4 IMUs lasted"):
        navigate_array(replace(array, gyro=dead), gnss, mems())
    with pytest.raises(InputError, match="mechanization 'federated'"):
        navigate_array(array, gnss, mems(), mechanization="federated")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"smoothing .*--lag.* with the constrained"):
        navigate_array(array, gnss, mems(), mechanization="constrained", smooth=True)
    with pytest.raises(InputError, match="3 noise models for 4 IMUs"):
        navigate_array(array, gnss, [mems()] * 3)
    with pytest.raises(InputError, match="left-handed"):
        Mounting(MOUNTING.rotation * [1.0, 1.0, -1.0], MOUNTING.position)


def test_a_single_imu_is_what_navigate_makes_of_it() -> None:
    _, array, gnss = ride()
    aligned = replace(array.in_body(), mounting=Mounting.aligned(4))
    one = navigate_array(
        aligned, gnss, mems(0.3), mechanization="single", imu=2, lever_arm=ANTENNA, time_offset=0.0,
        measurements=MeasurementOptions(correlated=None),
    )  # fmt: skip
    other = navigate(
        aligned.imu(2), gnss, mems(0.3), lever_arm=ANTENNA, time_offset=0.0,
        measurements=MeasurementOptions(correlated=None),
    )  # fmt: skip
    a, b = one.solution.trajectory, other.trajectory
    # the rest says of the gyros' biases what their model allows, there what their scatter shows
    np.testing.assert_allclose(a.velocity, b.velocity, rtol=0.0, atol=0.02)
    np.testing.assert_allclose(a.rotation, b.rotation, rtol=0.0, atol=2e-3)


def test_two_imus_are_enough_for_all_but_the_vote() -> None:
    _, array, gnss = ride()
    pair = array.select([0, 3])
    for name in ("extended", "constrained", "system"):
        result = navigate_array(
            pair, gnss, mems(0.3), mechanization=name, lever_arm=ANTENNA, time_offset=0.0
        )
        assert errors(result)[:3].max() < 0.06
        if result.vote is not None:
            assert result.vote.heard.all()
