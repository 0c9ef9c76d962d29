"""Faults and changing noise of an array's sensors inside the filter, by one table of variances."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from schuler import earth
from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import CHANNELS, GnssRecording, ImuArray, NavigationSolution, Trajectory
from schuler.navigation.aiding.parity import Parity
from schuler.navigation.mechanizations.array_faults import ArrayFaults
from schuler.navigation.mechanizations.array_model import extended_model, white_variances
from schuler.navigation.mechanizations.array_preparation import PreparedArray, prepare_array
from schuler.navigation.mechanizations.array_weights import followed_variances
from schuler.navigation.mechanizations.navigate_array import (
    Mechanization,
    navigate_array,
    run_mechanization,
)
from schuler.navigation.mechanizations.sensor_table import Absence, sensor_table
from schuler.navigation.settings import NavigationSettings
from schuler.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
from schuler.rotations import rotation_vector_from_dcm
from schuler.simulation import motorcycle, simulate_array, simulate_gnss

DEGREE = np.pi / 180.0
RATE, DURATION, BEGIN = 50.0, 90.0, 50.0
TOLD = NavigationSettings(time_offset=0.0, tune_noise=False)


def noise() -> NoiseModel:
    accel = WhiteNoise(3e-3) + GaussMarkov(0.02, 60.0) + RandomWalk(1e-4, 0.03)
    gyro = WhiteNoise(1e-3) + GaussMarkov(5e-4, 60.0) + RandomWalk(2e-6, 2e-3)
    return NoiseModel({c: gyro if c.startswith("gyro") else accel for c in CHANNELS})


@cache
def ride(seed: int = 11) -> tuple[ImuArray, GnssRecording, Trajectory]:
    rng = np.random.default_rng(seed)
    profile = motorcycle(DURATION, seed, standstill=15.0)
    mount = tetrahedron_mounting(0.05)
    parts = simulate_array(profile, mount.rotation, mount.position, noise(), RATE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.05, velocity_sd=0.05, rng=rng)
    array = ImuArray.from_recordings(parts, mount)
    return array, gnss, profile.trajectory(array.time)


def hurt(array: ImuArray, size: float = 2.0 * DEGREE, stop: float = np.inf) -> ImuArray:
    """The x gyro of the fourth IMU is off from the middle on."""
    gyro = array.gyro.copy()
    gyro[(array.time >= BEGIN) & (array.time < stop), 3, 0] += size
    return replace(array, gyro=gyro)


@cache
def prepared(found: bool = True) -> PreparedArray:
    """A ride with a faulty gyro; by an oracle that never used it otherwise."""
    array, gnss, _ = ride()
    never = ArrayFaults(absences=(Absence(1, (9,), -np.inf, np.inf),), judged=True)
    return prepare_array(hurt(array), gnss, noise(), TOLD, faults=found or never)


def heading_and_position(solution: NavigationSolution, truth: Trajectory) -> tuple[float, float]:
    own = solution.trajectory
    first = int(np.searchsorted(truth.time, own.time[0] - 1e-6))
    t = np.s_[first : first + own.size]
    north, east = earth.metres_per_radian(truth.position[t])
    off = own.position - truth.position[t]
    metres = np.stack([off[:, 0] * north, off[:, 1] * east, off[:, 2]], axis=1)
    turned = rotation_vector_from_dcm(own.rotation @ truth.rotation[t].transpose(0, 2, 1))
    late = own.time >= BEGIN
    heading = float(np.sqrt(np.mean(turned[late, 2] ** 2)))
    return heading, float(np.linalg.norm(metres[late], axis=1).max())


@pytest.mark.parametrize(
    ("mechanization", "smooth"),
    [("extended", False), ("extended", True), ("synthetic", False), ("constrained", False),
     ("system", False)],
)  # fmt: skip
def test_a_faulty_gyro_costs_no_more_than_never_having_had_it(
    mechanization: Mechanization, smooth: bool
) -> None:
    _, gnss, truth = ride()
    found, oracle = (
        run_mechanization(prepared(known), gnss, mechanization, smooth=smooth).solution
        for known in (True, False)
    )
    ours, best = heading_and_position(found, truth), heading_and_position(oracle, truth)
    assert ours[0] < 1.2 * best[0] + 0.05 * DEGREE and ours[1] < 1.2 * best[1]
    assert 0.8 < found.innovations.gnss.mean_nis < 1.2
    (fault,) = found.settings["sensor_faults"]["taken_out"]
    assert (fault["sensor"], fault["name"]) == ("gyro", "imu 4 x")
    assert BEGIN - 0.5 < fault["onset_s"] <= BEGIN < fault["start_s"] < BEGIN + 0.5
    told = [f for f in found.settings["findings"] if f["kind"] == "sensor fault"]
    assert len(told) == 1 and "gyro imu 4 x" in told[0]["message"]


def test_without_looking_for_faults_the_same_gyro_ruins_the_heading() -> None:
    array, gnss, truth = ride()
    told = {"time_offset": 0.0, "tune_noise": False}
    blind = navigate_array(hurt(array), gnss, noise(), faults=False, **told)
    assert heading_and_position(blind.solution, truth)[0] > 3.0 * DEGREE
    assert not blind.solution.settings["sensor_faults"]["judged"]


def test_a_gyro_that_recovers_is_used_again_and_a_healthy_array_is_left_alone() -> None:
    array, gnss, _ = ride()
    ready = prepare_array(hurt(array, stop=BEGIN + 5.0), gnss, noise(), TOLD)
    assert ready.table.rows == 3 and not ready.table.out[2].any()
    (absence,) = ready.faults.taken_out
    assert absence.record.stop is not None and BEGIN + 5.0 < absence.record.stop < DURATION
    healthy = prepare_array(array, gnss, noise(), TOLD)
    assert healthy.table.constant and healthy.faults.taken_out == ()


@pytest.mark.parametrize(("second", "sign"), [(0.0, -1.0), (0.0, 1.0), (20.0, 1.0)])
def test_two_units_of_four_are_named_at_once_and_in_turn(second: float, sign: float) -> None:
    array, gnss, _ = ride()
    gyro = array.gyro.copy()
    gyro[array.time >= BEGIN, 3] += 2.0 * DEGREE
    gyro[array.time >= BEGIN + second, 2] += sign * 2.0 * DEGREE
    found = prepare_array(replace(array, gyro=gyro), gnss, noise(), TOLD).faults
    starts = {a.record.name: a.record.start for a in found.taken_out}
    assert starts.keys() == {"imu 3", "imu 4"} and not found.contradictions
    assert BEGIN < starts["imu 4"] < BEGIN + 0.5
    assert BEGIN + second < starts["imu 3"] < BEGIN + second + 0.5


def test_a_large_step_of_one_gyro_is_no_turn_of_its_unit() -> None:
    array, gnss, _ = ride()
    found = prepare_array(hurt(array, 10.0 * DEGREE), gnss, noise(), TOLD).faults
    (absence,) = found.taken_out
    assert absence.record.name == "imu 4 x" and found.notes == ()


def test_two_imus_contradict_each_other_and_neither_is_taken_out() -> None:
    array, gnss, _ = ride()
    gyro = array.gyro.copy()
    gyro[array.time >= BEGIN, 1] += 2.0 * DEGREE
    two = replace(array, gyro=gyro).select([0, 1])
    done = navigate_array(two, gnss, noise(), time_offset=0.0, tune_noise=False)
    told = done.solution.settings["sensor_faults"]
    assert told["taken_out"] == [] and len(told["contradictions"]) == 1
    assert any("contradict" in f["message"] for f in done.solution.settings["findings"])


def test_a_silent_imu_is_out_and_in_again_and_moves_nothing() -> None:
    array, gnss, truth = ride()
    gyro, accel = array.gyro.copy(), array.accel.copy()
    rows = (array.time >= BEGIN) & (array.time < BEGIN + 10.0)
    gyro[rows, 3], accel[rows, 3] = np.nan, np.nan
    done = navigate_array(
        replace(array, gyro=gyro, accel=accel), gnss, noise(), time_offset=0.0, tune_noise=False
    )
    whole = navigate_array(array, gnss, noise(), time_offset=0.0, tune_noise=False)
    ours, best = (heading_and_position(d.solution, truth) for d in (done, whole))
    assert ours[0] < 1.5 * best[0] + 0.05 * DEGREE and ours[1] < 1.3 * best[1]
    ((name, start, stop),) = done.prepared.faults.silent
    assert name == "imu 4" and start == BEGIN and stop == pytest.approx(BEGIN + 10.0)
    out = done.prepared.table.out[done.prepared.table.row_at(np.array([BEGIN + 5.0]))[0]]
    assert out[:, 9:].all() and not out[:, :9].any()


def test_rows_that_repeat_the_first_change_no_bit_of_the_smoothed_solution() -> None:
    _, gnss, _ = ride()
    one = prepared(False)
    plain = replace(one, table=sensor_table(one.array.time, one.array.mounting, one.models))
    same = np.repeat(white_variances(one.models)[None], 3, axis=0)
    rows = sensor_table(
        one.array.time, one.array.mounting, one.models, noise=(np.array([0.0, 20.0, 47.0]), same)
    )
    # memory for a few nodes only: they are computed once more, each in its stretch
    little = replace(one.setup.settings, smoother_memory=2e6)
    split = replace(one, table=rows, setup=replace(one.setup, settings=little))
    solutions = [
        run_mechanization(p, gnss, "extended", smooth=True).solution for p in (plain, split)
    ]
    assert rows.rows == 3
    np.testing.assert_allclose(
        solutions[0].trajectory.position, solutions[1].trajectory.position, rtol=0, atol=1e-13
    )
    np.testing.assert_allclose(solutions[0].attitude_sd, solutions[1].attitude_sd, rtol=1e-9)


def test_parity_is_blind_to_motion_and_knows_only_axes_in_use() -> None:
    ready = prepared()
    models, table = ready.models, ready.table
    model = extended_model(models, ready.fusion, ready.array.names)
    rows = Parity(ready.array, table, models, model.size).rows()
    before, after = (rows.matrices[rows.matrix[rows.time < BEGIN - 2.0]][:, :, 12:],
                     rows.matrices[rows.matrix[rows.time > BEGIN + 2.0]][:, :, 12:])  # fmt: skip
    of_axis = [j for j, name in enumerate(model.names) if name.startswith("imu 4 gyro_x")]
    assert np.abs(before[..., of_axis]).max() > 0.1 and not after[..., of_axis].any()
    # biases that are one rate of the body show in no parity
    common = np.zeros(model.size)
    for j, (name, channel) in enumerate(zip(model.names, model.channel, strict=True)):
        if (channel >= 3 and "constant" in name) or (channel >= 3 and "walk" in name):
            imu = next(i for i, n in enumerate(ready.array.names) if name.startswith(n))
            common[j] = ready.fusion.axes[3 * imu + channel - 3] @ [0.3, -0.2, 0.1]
    assert np.abs(rows.matrices[..., 12:] @ common).max() < 1e-9


def test_fused_noise_is_that_of_the_sensors_in_use() -> None:
    ready = prepared()
    stretches = ready.table.stretches(ready.models, ready.setup.factors)
    white = 1e-6
    for row, count in zip(range(2), (12, 11), strict=True):
        axes = ready.fusion.axes[:count] if count == 12 else np.delete(ready.fusion.axes, 9, 0)
        expected = white * np.linalg.inv(axes.T @ axes)
        np.testing.assert_allclose(stretches.white[row, 1], expected, atol=1e-15)


def test_a_unit_that_becomes_noisy_counts_less_and_the_claims_stay_honest() -> None:
    array, gnss, truth = ride()
    rng = np.random.default_rng(4)
    gyro = array.gyro.copy()
    gyro[:, 3] += 9.9e-3 * np.sqrt(RATE) * rng.standard_normal(gyro[:, 3].shape)
    loud = replace(array, gyro=gyro)
    options = {"time_offset": 0.0, "tune_noise": False}
    followed, constant = (
        navigate_array(loud, gnss, noise(), weights=w, **options).solution
        for w in ("auto", "constant")
    )
    ours, theirs = (heading_and_position(s, truth)[0] for s in (followed, constant))
    assert ours < 0.7 * theirs
    assert 0.85 < followed.innovations.gnss.mean_nis < 1.15


def test_noise_that_begins_counts_from_its_first_row_on() -> None:
    array, _, _ = ride()
    loud = (
        np.random.default_rng(5).standard_normal(array.gyro.shape)
        * (array.time >= BEGIN)[:, None, None]
    )
    changed = replace(array, gyro=array.gyro + np.sqrt(24.0 * RATE) * 1e-3 * loud)
    models = prepared(False).models
    time, variance = followed_variances(changed, models, "ewma", relative=False)
    factor = (variance / white_variances(models))[:, 1].mean(axis=1)
    begin = int(np.searchsorted(time, BEGIN - 1e-9))
    assert factor[begin - 1] < 1.5
    # 25 in the end; what was known at the beginning of the row would make it 1
    assert factor[begin] > 10.0
    assert np.all(np.abs(factor[begin + 2 :] / 25.0 - 1.0) < 0.3)


def test_parity_of_unequal_sensors_claims_the_noise_that_it_has() -> None:
    ready = prepared(False)
    time, rng = ready.array.time, np.random.default_rng(8)
    density = white_variances(ready.models) * np.geomspace(0.1, 10.0, 12)
    noise_of_all = (time[:1], density[None])
    table = sensor_table(time, ready.array.mounting, ready.models, (), noise_of_all)
    drawn = np.sqrt(density[1]) * rng.standard_normal((20_000, 12))
    found = Parity(ready.array, table, ready.models, 3).measured(1, 0, drawn, np.zeros((12, 3)))
    assert found is not None
    seen, claimed = np.cov(found[0].T), found[2]
    whiten = np.linalg.inv(np.linalg.cholesky(claimed))
    np.testing.assert_allclose(whiten @ seen @ whiten.T, np.eye(9), atol=0.06)
