"""Inputs that cannot be used end in one clear line; single bad fixes end at the gate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twins import HEADING_SD, NOISE, draw_twin, navigation_errors, perfect, with_noise

from schuler import earth
from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError, SchulerError
from schuler.navigation.navigate import navigate, withhold
from schuler.navigation.run import run
from schuler.rotations import dcm_from_rotation_vector
from schuler.simulation import Profile, car_urban, simulate_gnss, static


def recordings(duration: float = 60.0) -> tuple[ImuRecording, GnssRecording]:
    rng = np.random.default_rng(1)
    profile = static(duration, yaw=0.3)
    imu, _ = with_noise(perfect(profile, 50.0), NOISE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.5, velocity_sd=0.05, rng=rng)
    return imu, gnss


def message(error: pytest.ExceptionInfo[SchulerError]) -> str:
    text = str(error.value)
    assert "\n" not in text
    assert "nan" not in text.lower()
    return text


def test_no_overlap_in_time() -> None:
    imu, gnss = recordings()
    with pytest.raises(SchulerError) as error:
        navigate(imu, replace(gnss, time=gnss.time + 1e6), NOISE)
    assert "overlap" in message(error)
    assert "1000000.000" in message(error)
    assert "time scale" in message(error)


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_an_imu_without_one_channel(sensor: str) -> None:
    imu, gnss = recordings()
    values = np.array(getattr(imu, sensor))
    values[:, 1] = np.nan
    with pytest.raises(SchulerError) as error:
        navigate(replace(imu, **{sensor: values}), gnss, NOISE)
    text = message(error)
    assert "three gyros and three accelerometers" in text
    assert f"{sensor}_y" not in text
    assert f"{sensor}_x" in text


@pytest.mark.parametrize("sensor", ["gyro", "accel"])
def test_an_axis_that_is_zero_throughout(sensor: str) -> None:
    imu, gnss = recordings()
    values = np.array(getattr(imu, sensor))
    values[:, 2] = 0.0
    with pytest.raises(SchulerError) as error:
        navigate(replace(imu, **{sensor: values}), gnss, NOISE)
    text = message(error)
    assert f"{sensor}_z" in text
    assert "zero" in text
    assert "column" in text


@pytest.mark.parametrize("what", ["position", "velocity"])
def test_standard_deviations_that_are_not_known(what: str) -> None:
    imu, gnss = recordings()
    bare = replace(gnss, **{f"{what}_sd": None})
    with pytest.raises(InputError) as error:
        navigate(imu, bare, NOISE, heading=0.3, time_offset=0.0)
    text = message(error)
    assert "standard deviation" in text
    assert f"--gnss-{what}-sd" in text


def test_no_motion_and_no_heading() -> None:
    imu, gnss = recordings()
    with pytest.raises(SchulerError) as error:
        navigate(imu, gnss, NOISE, time_offset=0.0)
    text = message(error)
    assert "heading" in text
    assert "--heading" in text


def test_too_few_fixes_to_tune_with() -> None:
    imu, gnss = recordings()
    few = gnss.select(np.arange(12))
    with pytest.raises(SchulerError) as error:
        navigate(imu, few, heading=0.3, time_offset=0.0)
    text = message(error)
    assert "12" in text
    assert "20" in text
    # with a noise model and given offsets nothing has to be found: twelve are enough
    assert navigate(imu, few, NOISE, heading=0.3, time_offset=0.0).trajectory.size == imu.size


def test_a_heading_without_rest_at_the_start() -> None:
    profile = car_urban(120.0, 3, standstill=10.0)
    imu, _ = with_noise(perfect(profile, 50.0), NOISE, np.random.default_rng(1))
    gnss = simulate_gnss(
        profile, 1.0, position_sd=0.5, velocity_sd=0.05, rng=np.random.default_rng(2)
    )
    with pytest.raises(SchulerError) as error:
        navigate(
            imu.between(30.0, 100.0),
            gnss.select(gnss.time > 30.5),
            NOISE,
            heading=0.1,
            time_offset=0.0,
        )
    assert "rest" in message(error)


@pytest.mark.parametrize("window", [(-5.0, 10.0), (10.0, 0.0), (10.0, -3.0)])
def test_outages_that_are_none(window: tuple[float, float]) -> None:
    imu, gnss = recordings()
    with pytest.raises(SchulerError) as error:
        navigate(imu, gnss, NOISE, heading=0.3, outages=[window])
    assert "START >= 0" in message(error)


def test_outages_that_leave_nothing() -> None:
    _, gnss = recordings()
    with pytest.raises(SchulerError) as error:
        withhold(gnss, [(0.0, 1000.0)])
    assert "no GNSS at all" in message(error)


@pytest.mark.parametrize("arm", [(1.0, 2.0), (np.nan, 0.0, 0.0)])
def test_a_lever_arm_that_is_none(arm: tuple[float, ...]) -> None:
    imu, gnss = recordings()
    with pytest.raises(SchulerError) as error:
        navigate(imu, gnss, NOISE, heading=0.3, time_offset=0.0, lever_arm=arm)
    text = str(error.value)
    assert "lever arm" in text
    assert "\n" not in text


def a_drive() -> tuple[Profile, ImuRecording]:
    profile = car_urban(150.0, 3, standstill=10.0)
    return profile, perfect(profile)


def test_the_gate_keeps_out_a_fix_ten_kilometres_off() -> None:
    profile, ideal = a_drive()
    twin = draw_twin(profile, ideal, 5)
    honest = run(twin.imu, twin.gnss, twin.setup).causal
    position = np.array(twin.gnss.position)
    at = int(np.searchsorted(twin.gnss.time, 80.0))
    position[at, 0] += 10_000.0 / float(earth.metres_per_radian(position[at])[0])
    wrong = run(twin.imu, replace(twin.gnss, position=position), twin.setup).causal
    i = wrong.innovations
    refused = np.flatnonzero(~i.accepted)
    assert i.time[refused].tolist() == [80.0]
    assert [i.kind[k] for k in refused] == ["GNSS position"]
    assert wrong.settings["updates_refused"] == 1
    assert abs(i.value[refused[0], 0]) == pytest.approx(1e4, rel=1e-3)
    path, other = wrong.trajectory, honest.trajectory
    moved = np.abs(path.position - other.position).max(axis=0) * [6.4e6, 6.4e6, 1.0]
    # one fix less among a hundred: decimetres
    assert np.all(moved < 0.5)


def test_a_filter_that_is_wrong_gives_in_to_fixes_that_agree() -> None:
    # half a kilometre beside all fixes after a minute, and sure of it: a gate alone would
    # refuse them for ever
    profile, ideal = a_drive()
    twin = draw_twin(profile, ideal, 6)
    position = np.array(twin.gnss.position)
    early = twin.gnss.time < 60.0
    position[early, 0] += 500.0 / float(earth.metres_per_radian(position[0])[0])
    done = run(twin.imu, replace(twin.gnss, position=position), twin.setup).causal
    i = done.innovations
    accepted = i.of_kind("GNSS position").accepted
    # never more than four in a row are refused, and velocity, which was right, never is
    runs = np.diff(np.flatnonzero(np.concatenate([[True], accepted, [True]]))) - 1
    assert runs.max() == 4
    assert i.of_kind("GNSS velocity").accepted.all()
    path = done.trajectory
    k = np.searchsorted(path.time, [59.0, 70.0, 145.0])
    e = navigation_errors(
        profile, path.time[k], path.position[k], path.velocity[k], path.rotation[k]
    )
    off = np.linalg.norm(e[:, :2], axis=1)
    assert off[0] == pytest.approx(500.0, abs=2.0)
    # what was wrong is put right at once, and nothing else is touched
    assert off[1] < 5.0
    assert off[2] < 5.0
    assert np.abs(e[1:, 8]).max() < np.radians(1.5)


def test_a_heading_twenty_sigma_off_is_found_again() -> None:
    profile, ideal = a_drive()
    twin = draw_twin(profile, ideal, 6)
    turned = dcm_from_rotation_vector([0.0, 0.0, -20.0 * HEADING_SD])
    alignment = replace(twin.setup.alignment, rotation=turned @ twin.setup.alignment.rotation)
    path = run(twin.imu, twin.gnss, replace(twin.setup, alignment=alignment)).causal.trajectory
    k = np.searchsorted(path.time, [5.0, 149.0])
    e = navigation_errors(
        profile, path.time[k], path.position[k], path.velocity[k], path.rotation[k]
    )
    assert np.degrees(e[0, 8]) == pytest.approx(20.0, abs=2.0)
    assert abs(np.degrees(e[1, 8])) < 2.0
