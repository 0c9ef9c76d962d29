"""Calibration between IMUs: truth within its standard errors, and what real arrays reach."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from schuler.arrays.calibration.calibrate import calibrate_array
from schuler.arrays.calibration.judging import (
    disagreement_after,
    mean_slope,
    track_phases,
    with_biases_at_rest,
)
from schuler.arrays.calibration.poses import fit_poses
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import Rests, mask_saturated
from schuler.arrays.calibration.turns import fit_turns
from schuler.arrays.read import read_array
from schuler.data import ImuArray, Mounting
from schuler.errors import EstimationError, InputError
from schuler.rotations import dcm_from_rotation_vector

GRAVITY = 9.80665
RATE = 100.0
POSES, POSE, TURNING = 16, 3.0, 40.0
TURN, BETWEEN = 0.4, np.array([0.3, -0.5, 0.4])
GYRO_NOISE, ACCEL_NOISE = 2e-3, 0.02


class Truth:
    """Sensors of a simulated array."""

    def __init__(self, count: int, rng: np.random.Generator) -> None:
        self.nominal = dcm_from_rotation_vector(rng.normal(0.0, 1.0, (count, 3)))
        # what all sensors have in common is not seen, but for what gravity says of the
        # accelerometers' scale and shape: let there be none of it
        gyro, accel = rng.normal(0.0, 0.01, (2, count, 3, 3))
        common = accel.mean(axis=0)
        back = np.swapaxes(self.nominal, 1, 2)
        self.gyro = back @ (np.eye(3) + gyro - gyro.mean(axis=0))
        self.accel = back @ (np.eye(3) + accel - 0.5 * (common - common.T))
        self.gyro_bias = rng.normal(0.0, 0.02, (count, 3))
        self.accel_bias = rng.normal(0.0, 0.2, (count, 3))
        self.position = rng.uniform(-0.05, 0.05, (count, 3))


def motion(time: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Poses, then turning about all axes: rate, its derivative, and force, at instants (n, k)."""
    frequency, phase = rng.uniform(0.3, 2.0, (6, 3)), rng.uniform(0.0, 6.28, (6, 3))
    start = POSES * POSE
    on = np.clip(time - start, 0.0, 1.0)[..., None, None]
    ramp = on * on * (3.0 - 2.0 * on)
    slope_ramp = np.where((on > 0.0) & (on < 1.0), 6.0 * on * (1.0 - on), 0.0)
    angle = 2.0 * np.pi * frequency * time[..., None, None] + phase
    rate = np.sum(ramp * np.sin(angle), axis=-2)
    slope = np.sum(
        2.0 * np.pi * frequency * ramp * np.cos(angle) + slope_ramp * np.sin(angle), axis=-2
    )
    # what tells the poses apart: the array is turned between them
    share = np.clip((time % POSE) / TURN, 0.0, 1.0)[..., None] * (time < start)[..., None]
    rate = rate + np.sin(np.pi * share) ** 2 * BETWEEN
    slope = slope + np.pi / TURN * np.sin(2.0 * np.pi * share) * BETWEEN
    directions = rng.normal(size=(POSES + 1, 3))
    directions *= GRAVITY / np.linalg.norm(directions, axis=1, keepdims=True)
    pose = np.clip((time // POSE).astype(int), 0, POSES)
    shake = np.sum(ramp * np.cos(angle * 0.7 + 1.0), axis=-2)
    return rate, slope, directions[pose] + 4.0 * shake


def array_of(truth: Truth, seed: int, ages: np.ndarray | None = None) -> ImuArray:
    rng = np.random.default_rng(seed)
    count = truth.position.shape[0]
    time = np.arange(int((POSES * POSE + TURNING) * RATE)) / RATE
    instants = np.broadcast_to(time[:, None], (time.size, count))
    rate, slope, force = motion(instants if ages is None else instants - ages, rng)
    arm = np.cross(slope, truth.position) + np.cross(rate, np.cross(rate, truth.position))
    gyro = np.einsum("kij,nkj->nki", truth.gyro, rate) + truth.gyro_bias
    accel = np.einsum("kij,nkj->nki", truth.accel, force + arm) + truth.accel_bias
    noise = np.random.default_rng(1000 + seed)
    return ImuArray(
        time,
        gyro + GYRO_NOISE * noise.standard_normal(gyro.shape),
        accel + ACCEL_NOISE * noise.standard_normal(accel.shape),
        Mounting(truth.nominal, np.zeros((count, 3))),
    )


def test_parameters_are_found_within_their_standard_errors() -> None:
    scores: dict[str, list[np.ndarray]] = {}
    for seed in range(5):
        truth = Truth(4, np.random.default_rng(seed))
        found = calibrate_array(array_of(truth, seed), timing="constant")
        arm = truth.position - truth.position.mean(axis=0)
        gyro, accel = (truth.nominal @ s - np.eye(3) for s in (truth.gyro, truth.accel))
        pairs = {
            "gyro": (found.gyro_deviation - gyro, found.gyro_deviation_sd),
            "accel": (found.accel_deviation - accel, found.accel_deviation_sd),
            "accel bias": (found.accel_bias - truth.accel_bias, found.accel_bias_sd),
            "gyro bias": (found.gyro_bias - truth.gyro_bias, found.gyro_bias_sd),
            "position": (found.position - arm, found.position_sd),
            "delay": (found.delay, found.delay_sd),
        }
        for name, (error, sd) in pairs.items():
            scores.setdefault(name, []).append((error / sd).ravel())
        assert found.gyro_deviation_sd.max() < 1e-3 and found.position_sd.max() < 2e-3
    for name, values in scores.items():
        flat = np.concatenate(values)
        # errors of differences sum to zero over the IMUs, those of what gravity tells are the same
        # for all: far fewer than 60 of these count, and the seeds carry most of the scatter
        assert 0.35 < np.mean(flat**2) < 1.7, name
        assert np.mean(np.abs(flat) < 2.0) > 0.88, name


def test_gravity_gives_scale_and_bias_of_the_mean_accelerometer() -> None:
    truth = Truth(3, np.random.default_rng(8))
    array = array_of(truth, 8)
    found = calibrate_array(array, timing="none")
    assert found.rests == POSES and found.gravity_fit is not None
    assert found.gravity_fit[1] < 0.005 < found.gravity_fit[0]
    body = found.apply(array)
    still = array.time % POSE > 1.0
    still &= array.time < POSES * POSE
    lengths = np.linalg.norm(body.accel[still].mean(axis=1), axis=1)
    assert lengths.mean() == pytest.approx(GRAVITY, abs=2e-3)
    rng = np.random.default_rng(3)
    matrix = np.eye(3) + 0.01 * (lambda m: m + m.T)(rng.normal(size=(3, 3)))
    force = rng.normal(size=(20, 3))
    force *= GRAVITY / np.linalg.norm(force, axis=1, keepdims=True)
    fit = fit_poses(np.linalg.solve(matrix, force.T).T + np.array([0.1, -0.2, 0.05]))
    assert fit is not None
    np.testing.assert_allclose(fit.matrix, matrix, atol=1e-9)
    np.testing.assert_allclose(fit.bias, [0.1, -0.2, 0.05], atol=1e-8)
    # upright poses only do not determine nine numbers
    flat = force * [1.0, 1.0, 0.0]
    assert fit_poses(flat / np.linalg.norm(flat, axis=1, keepdims=True) * GRAVITY) is None


def test_turning_from_pose_to_pose_tells_the_mean_gyro() -> None:
    """A body that rests, turns, rests: what its gyros show of the turns, against gravity."""
    rng = np.random.default_rng(9)
    fine, pace = 20, 0.01
    gyro = np.eye(3) + 0.02 * rng.normal(size=(3, 3))
    rates, poses, directions = [], [], []
    up = np.array([0.0, 0.0, 1.0])
    for p in range(15):
        rates.append(np.zeros((200, 3)))
        poses.append(np.full(200, p))
        directions.append(up)
        t = (np.arange(200 * fine) + 0.5) / (200 * fine)
        turn = np.sin(np.pi * t)[:, None] ** 2 * rng.normal(0.0, 1.2, 3)
        turn += np.sin(2 * np.pi * t)[:, None] * rng.normal(0.0, 0.8, 3)
        for step in dcm_from_rotation_vector(-turn * pace / fine):
            up = step @ up
        # samples at the ends of the steps, from the fine ones around
        edges = np.vstack([np.zeros(3), 0.5 * (turn[1:] + turn[:-1]), np.zeros(3)])
        rates.append(edges[fine::fine][:200])
        poses.append(np.full(200, -1))
    rate, pose = np.concatenate(rates), np.concatenate(poses)
    noisy = rate @ gyro.T + 5e-4 * rng.standard_normal(rate.shape)
    force = GRAVITY * np.array(directions) + 1e-3 * rng.standard_normal((15, 3))
    found = fit_turns(np.arange(rate.shape[0]) * pace, noisy, Rests(pose >= 0, pose), force)
    assert found is not None and found.turns == 14
    error = (found.matrix - np.linalg.inv(gyro)) / found.matrix_sd
    # nine scores with 19 degrees of freedom in their scale
    assert np.mean(error**2) < 3.0 and found.matrix_sd.max() < 1e-3
    assert found.deviation < 0.1 * found.before


def test_polled_chips_are_seen_and_their_phases_tracked() -> None:
    count, period = 5, 2e-3
    rng = np.random.default_rng(2)
    truth = Truth(count, rng)
    time = np.arange(int((POSES * POSE + TURNING) * RATE)) / RATE
    beat = np.array([-2.3, 1.1, 0.4, -0.7, 1.9])
    cycles = beat * time[:, None] + rng.uniform(0.0, 1.0, count)
    ages = period * np.mod(cycles, 1.0)
    array = array_of(truth, 21, ages)
    found = calibrate_array(array)
    assert found.period == pytest.approx(period, rel=0.03)
    np.testing.assert_allclose(found.beat, beat, atol=0.01)
    track = track_phases(found, array)
    assert track is not None
    lively = time > POSES * POSE + 1.0
    apart = np.mod(track.delay(time) / period - cycles + 0.5, 1.0) - 0.5
    # where the motion is, phases are known to some hundredths of a cycle
    assert np.sqrt(np.mean(apart[lively] ** 2)) < 0.04
    plain = disagreement_after(found, array, None)
    tracked = disagreement_after(found, array, track)
    moving = [next(d.robust for d in ds if d.quantity == "gyro" and d.limit > 0.0)
              for ds in (plain, tracked)]  # fmt: skip
    expected = GYRO_NOISE * np.sqrt(1.0 - 1.0 / count)
    assert moving[0] > 1.5 * expected and moving[1] < 1.1 * expected
    assert calibrate_array(array_of(truth, 21)).period is None


def test_one_axis_a_dead_sensor_a_copy_and_mirrored_axes() -> None:
    truth = Truth(3, np.random.default_rng(4))
    array = array_of(truth, 4)
    body = np.einsum("kij,nkj->nki", truth.nominal, array.gyro)
    single = body * np.array([0.0, 0.0, 1.0]) + GYRO_NOISE * np.random.default_rng(
        5
    ).standard_normal(body.shape)
    single = np.einsum("kji,nkj->nki", truth.nominal, single)
    found = calibrate_array(replace(array, gyro=single), timing="none")
    assert sum("no rotation about" in f for f in found.findings) == 2
    assert found.gyro_deviation_sd[:, :, 2].max() < 2e-3
    assert found.gyro_deviation_sd[:, :, 0].min() > 0.05
    dead = np.array(array.gyro)
    dead[: array.size // 3, 1] = np.nan
    half = calibrate_array(replace(array, gyro=dead), timing="none")
    assert any("lacks 33 % of the rows" in f for f in half.findings)
    error = half.gyro_deviation - (truth.nominal @ truth.gyro - np.eye(3))
    assert np.abs(error / half.gyro_deviation_sd).max() < 5.0
    stuck = np.array(array.gyro)
    stuck[: array.size // 3, 1] = stuck[0, 1]
    frozen = calibrate_array(replace(array, gyro=stuck), timing="none")
    assert any("it was dead there" in f for f in frozen.findings)
    np.testing.assert_allclose(frozen.gyro_deviation, half.gyro_deviation, atol=1e-12)
    nothing = np.array(array.gyro)
    nothing[:, 2] = np.nan
    with pytest.raises(InputError, match="imu 3 has no gyros"):
        calibrate_array(replace(array, gyro=nothing))
    rates = calibrate_array(replace(array, accel=np.full(array.accel.shape, np.nan)))
    assert any("lever arms were not sought" in f for f in rates.findings)
    swapped = array.accel * np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    with pytest.raises(InputError, match="accel_sensor of imu 2 is singular or left-handed"):
        calibrate_array(replace(array, accel=swapped))
    copied = np.array(array.gyro)
    copied[:, 2] = copied[:, 0]
    with pytest.raises(InputError, match="imu 3 is a copy of imu 1"):
        calibrate_array(replace(array, gyro=copied))
    mirrored = np.array(array.gyro)
    mirrored[:, 1, 0] *= -1.0
    with pytest.raises(InputError, match="left-handed"):
        calibrate_array(replace(array, gyro=mirrored))
    with pytest.raises(EstimationError, match="nothing to compare"):
        calibrate_array(array.select([0]))
    with pytest.raises(EstimationError, match="turn"):
        calibrate_array(array.between(0.0, 2.0))


def test_saturated_samples_go_with_a_margin() -> None:
    array = array_of(Truth(2, np.random.default_rng(6)), 6)
    gyro = np.array(array.gyro)
    top = np.percentile(gyro[:, 0, 1], 99.0)
    gyro[:, 0, 1] = np.minimum(gyro[:, 0, 1], top)
    masked, counts = mask_saturated(replace(array, gyro=gyro), margin=2)
    clipped = gyro[:, 0, 1] == top
    near = np.convolve(clipped, np.ones(5), mode="same") > 0.5
    gone = np.isnan(masked.gyro[:, 0]).all(axis=1)
    assert gone[near].all() and counts[0, 0] == gone.sum() < 1.3 * near.sum() and counts[1, 0] == 0


def test_it_keeps_in_a_file_and_files_are_checked(tmp_path: Path) -> None:
    array = array_of(Truth(2, np.random.default_rng(7)), 7)
    found = calibrate_array(array)
    found.save(tmp_path / "array.yaml")
    back = ArrayCalibration.load(tmp_path / "array.yaml")
    np.testing.assert_array_equal(back.apply(array).gyro, found.apply(array).gyro)
    assert (back.after, back.findings, back.period) == (found.after, found.findings, found.period)
    text = (tmp_path / "array.yaml").read_text()
    for wrong, words in (
        ("kind: other\n", "no calibration"),
        ("a: [", "not YAML"),
        (text.replace("position:", "place:", 1), "'position' is missing"),
        (text.replace("version: 1", "version: 9"), "version 9"),
        (text.replace("noise: ", "noise: x"), "cannot be read"),
    ):
        (tmp_path / "bad.yaml").write_text(wrong)
        with pytest.raises(InputError, match=words):
            ArrayCalibration.load(tmp_path / "bad.yaml")
    with pytest.raises(InputError, match="2 IMUs and an array of 1"):
        found.apply(array.select([0]))


def test_the_board_of_eight_agrees_after_calibration_on_another_run(data_folder: Path) -> None:
    """Issue 5's figures for mimu8-array; fitted on run 1, judged on run 4."""
    folder = data_folder / "mimu8-array"
    calibration = calibrate_array(read_array(folder / "run1.parquet"))
    array = read_array(folder / "run4.parquet")
    used = with_biases_at_rest(calibration, array)
    masked, _ = mask_saturated(array)
    slope = mean_slope(array, used.gyro_correction, used.gyro_bias)
    found = disagreement_after(used, masked, track_phases(used, array), slope=slope)
    reached = {(d.quantity, d.condition): d for d in found}
    for key, rms, robust in (
        (("gyro", "below 500 deg/s"), 2.0, 0.42),
        (("gyro", "below 1500 deg/s"), 3.5, 0.80),
    ):
        assert np.degrees(reached[key].rms) < rms and np.degrees(reached[key].robust) < robust
    assert reached["accel", "at rest"].rms < 0.053
    assert reached["accel", "below 500 deg/s"].rms < 1.1
    # the board's drawing: corners of a square of 18.9 mm, 2 mm thick; chips are a few tenths off
    drawn = np.array([[-9.45, 9.45], [-9.45, -9.45], [9.45, 9.45], [9.45, -9.45]]).repeat(2, axis=0)
    drawn = np.column_stack([drawn, np.tile([1.0, -1.0], 4)]) * 1e-3
    assert np.abs(calibration.position - drawn).max() < 1e-3
    # what the README of the data found: beats in run 1
    np.testing.assert_allclose(
        calibration.beat, [-2.55, -2.25, -0.33, -2.45, 0.83, -0.04, 1.12, -0.65], atol=0.02
    )


def test_four_on_a_quadrotor_agree_and_sit_where_they_sat_before(data_folder: Path) -> None:
    from schuler.arrays.clocks.resampling import low_pass

    found = []
    for path in ("path02", "path09"):
        array = read_array(data_folder / "quad-4imu" / f"{path}_imu.parquet")
        one = calibrate_array(array, gyro_model="rotation", accel_model="rotation", bandwidth=8.0)
        body = one.apply(array).gyro.reshape(array.size, -1)
        smooth = low_pass(array.time, body, 8.0).reshape(array.size, 4, 3)[60:-60]
        apart = smooth - smooth.mean(axis=1, keepdims=True)
        assert np.degrees(np.sqrt(np.nanmean((apart - np.nanmean(apart, axis=0)) ** 2))) < 0.17
        found.append(one)
    # nobody published the lever arms: two flights have to agree on them
    assert np.abs(found[0].position - found[1].position).max() < 5e-3
    assert np.abs(found[0].accel_bias - found[1].accel_bias).max() < 0.1
    assert any("only the differences" in f for f in found[0].findings)
