"""Every kind of sensor state inside the running filter: blocks, scale factors, hidden states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2
from twins import GYRO, draw_twin, navigation_errors, perfect

from schuler.data import CHANNELS, ImuRecording
from schuler.navigation.aiding.schedule import (
    POSITION,
    AidingSchedule,
    linear_measurements,
    merge_schedules,
)
from schuler.navigation.engine import FilterRun, InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_error_model import (
    SensorErrorModel,
    sensor_error_model,
    with_misalignments,
    with_scale_factors,
)
from schuler.navigation.error_models.sensor_states import no_sensor_states
from schuler.noise import Autoregressive, RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.simulation import car_urban

RATE = 50.0
# two slow poles and a fast one; standard deviation 4e-3 m/s² and 2e-4 rad/s
AR_ACCEL = Autoregressive(tuple(np.poly([0.995, 0.98, 0.3])[1:].tolist()), 1.0e-11, 1.0 / RATE)
AR_GYRO = Autoregressive(tuple(np.poly([0.998, 0.97, 0.5])[1:].tolist()), 4.0e-15, 1.0 / RATE)


def scaled(process: Autoregressive, sd: float) -> Autoregressive:
    """The same correlation with another standard deviation."""
    factor = sd**2 / float(process.autocovariance(0.0))
    return replace(process, driving_variance=process.driving_variance * factor)


NOISE = NoiseModel(
    processes={
        c: WhiteNoise(2e-4) + scaled(AR_GYRO, 2e-4) + RandomWalk(2e-6, initial_sd=2e-3)
        if c.startswith("gyro")
        else WhiteNoise(2e-3) + scaled(AR_ACCEL, 4e-3) + RandomWalk(1e-4, initial_sd=0.05)
        for c in CHANNELS
    },
    source="twin",
)
DRIVE = car_urban(120.0, 3, standstill=10.0)
IDEAL = perfect(DRIVE, RATE)


def start_at_truth(model: SensorErrorModel, sd: float = 1.0) -> InitialState:
    truth = DRIVE.trajectory(IDEAL.time[:1])
    covariance = np.zeros((9 + model.size, 9 + model.size))
    covariance[:9, :9] = np.diag(np.repeat([0.1, 0.05, 1e-3], 3) ** 2) * sd**2
    covariance[9:, 9:] = model.initial_covariance
    return InitialState(
        truth.position[0],
        truth.velocity[0],
        truth.rotation[0],
        np.zeros(model.size),
        covariance,
    )


def filtered(
    imu: ImuRecording, model: SensorErrorModel, schedule: AidingSchedule, **how: float
) -> FilterRun:
    return run_engine(imu, start_at_truth(model), model, schedule, gate=gate_thresholds(0.0), **how)


def positions(every: float, sd: float, first: float = 1.0) -> AidingSchedule:
    """True positions, to be used with a standard deviation."""
    time = np.arange(first, DRIVE.duration - 1.0, every)
    truth = DRIVE.trajectory(time)
    return AidingSchedule(
        time,
        np.full(time.size, POSITION, dtype=np.int64),
        truth.position,
        np.full((time.size, 3), sd**2),
        np.zeros((time.size, 3)),
    )


def test_autoregressive_states_are_as_uncertain_as_claimed() -> None:
    # 27AR and a walk: 24 sensor states; fixes split samples. Bands of the chi-square law.
    model = sensor_error_model(NOISE, turn_on_accel=0.0, turn_on_gyro=0.0, interval=1.0 / RATE)
    assert model.size == 24
    shows = np.flatnonzero(np.isnan(model.direction[:, 0]))
    assert shows.size == 12
    times = np.array([15.0, 40.0, 80.0, 115.0])
    nis, nees = [], []
    for seed in range(30):
        twin = draw_twin(DRIVE, IDEAL, seed, first_fix=1.0037, noise=NOISE, interval=1.0 / RATE)
        run = run_engine(
            twin.imu,
            twin.setup.initial_state(twin.imu, twin.gnss),
            model,
            twin.setup.schedule(twin.imu, twin.gnss),
            gate=gate_thresholds(0.0),
            node_interval=1.0 / RATE,
        )
        nis.append(run.aiding.nis[2:].sum())
        k = np.searchsorted(twin.imu.time, times - 1e-6)
        node = np.searchsorted(run.nodes.time, times - 1e-6)
        s = run.samples
        errors = navigation_errors(
            DRIVE, twin.imu.time[k], s.position[k], s.velocity[k], s.rotation[k]
        )
        # the state at the end of a sample is the error of the next one
        sensor = twin.sensor_truth[k + 1] - run.nodes.sensor_state[node][:, shows]
        x = np.hstack([errors, sensor])
        keep = np.concatenate([np.arange(9), 9 + shows])
        p = run.nodes.covariance[node][:, keep][:, :, keep]
        nees.append(np.einsum("ki,ki->k", x, np.linalg.solve(p, x[..., None])[..., 0]))
    degrees = 30 * 6 * (twin.gnss.size - 1)
    assert np.sum(nis) / degrees == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / degrees))
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], 30 * 21) / (30 * 21)
    means = np.mean(nees, axis=0) / 21
    assert np.all((means > low) & (means < high)), means


def test_fixes_that_split_samples_change_nothing_of_a_block() -> None:
    model = sensor_error_model(NOISE, turn_on_accel=0.0, turn_on_gyro=0.0, interval=1.0 / RATE)
    blind = positions(0.1, np.inf, first=1.0037)
    whole = filtered(IDEAL, model, positions(40.0, np.inf))
    split = filtered(IDEAL, model, blind)
    states = np.concatenate([np.arange(b.first, b.first + b.size) for b in model.blocks])
    a, b = (r.nodes.sensor_sd[-1, states] for r in (whole, split))
    np.testing.assert_allclose(b, a, rtol=1e-10)
    # two thousand steps: the stationary deviation, which only exact steps keep
    np.testing.assert_allclose(a[2], 4e-3, rtol=1e-6)
    np.testing.assert_allclose(
        split.samples.velocity_sd[-1], whole.samples.velocity_sd[-1], rtol=1e-5
    )


def test_scale_factors_and_misalignments_are_found() -> None:
    # truth = (1 - S) measured: forward acceleration, yaw rate, and roll that leaks into yaw
    noise = NoiseModel(
        processes={c: GYRO if c.startswith("gyro") else WhiteNoise(2e-3) for c in CHANNELS},
        source="twin",
    )
    plain = sensor_error_model(noise, turn_on_accel=0.0, turn_on_gyro=0.0)
    model = with_misalignments(
        with_scale_factors(plain, accel_sd=0.01, gyro_sd=0.01), gyro_sd=0.005
    )
    assert model.size == plain.size + 6 + 6
    matrix_f, matrix_w = np.eye(3), np.eye(3)
    matrix_f[0, 0] -= 0.01
    matrix_w[2, 2] += 0.015
    matrix_w[2, 0] -= 0.004
    imu = replace(
        IDEAL,
        accel=IDEAL.accel @ np.linalg.inv(matrix_f).T,
        gyro=IDEAL.gyro @ np.linalg.inv(matrix_w).T,
    )
    run = filtered(imu, model, positions(1.0, 0.02))
    found = dict(zip(model.names, run.nodes.sensor_state[-1], strict=True))
    claimed = dict(zip(model.names, run.nodes.sensor_sd[-1], strict=True))
    for name, truth in (
        ("accel_x scale factor", 0.01),
        ("gyro_z scale factor", -0.015),
        ("gyro_z misalignment to gyro_x", 0.004),
        ("gyro_x misalignment to gyro_z", 0.0),
    ):
        assert found[name] == pytest.approx(truth, abs=3.0 * claimed[name]), name
    assert claimed["accel_x scale factor"] < 0.003
    assert claimed["gyro_z scale factor"] < 0.004
    # not told of them, the filter has to make up for what it sees in every turn
    blind = filtered(imu, plain, positions(1.0, 0.02))
    assert blind.aiding.nis.mean() > 5.0 * run.aiding.nis.mean()


def test_states_without_a_channel_or_noise_cost_no_accuracy() -> None:
    plain = no_sensor_states(np.repeat([2e-3, 2e-4], 3))
    more = plain.with_states(["north", "east", "down"], 2.0, correlation_time=50.0)
    fixes = positions(1.0, 0.5)
    alone, beside = (filtered(IDEAL, model, fixes) for model in (plain, more))
    np.testing.assert_allclose(beside.samples.position, alone.samples.position, rtol=1e-14)
    np.testing.assert_allclose(beside.nodes.sensor_sd[-1], 2.0, rtol=1e-9)


def test_slow_errors_of_fixes_are_told_from_motion() -> None:
    # GNSS 2 m off by a Gauss-Markov error of 50 s: told of it, the filter claims what it knows
    rng = np.random.default_rng(8)
    step = 1.0
    fixes = positions(step, 0.05)
    decay = np.exp(-step / 50.0)
    squares, claims = [], []
    model = no_sensor_states(np.repeat([2e-3, 2e-4], 3)).with_states(
        ["north", "east", "down"], 2.0, correlation_time=50.0
    )
    told = replace(fixes, offset_state=np.tile([0, 1, 2], (fixes.size, 1)))
    for _ in range(20):
        slow = np.empty((fixes.size, 3))
        slow[0] = 2.0 * rng.standard_normal(3)
        for k in range(1, fixes.size):
            slow[k] = decay * slow[k - 1] + 2.0 * np.sqrt(1.0 - decay**2) * rng.standard_normal(3)
        off = slow + 0.05 * rng.standard_normal(slow.shape)
        north, east = metres(fixes.value)
        value = fixes.value + off / np.column_stack([north, east, -np.ones(fixes.size)])
        white = np.repeat([2e-3, 2e-4], 3) * np.sqrt(RATE) * rng.standard_normal((IDEAL.size, 6))
        imu = replace(IDEAL, accel=IDEAL.accel + white[:, :3], gyro=IDEAL.gyro + white[:, 3:])
        start = start_at_truth(model)
        e = rng.standard_normal(9) * np.sqrt(np.diag(start.covariance)[:9])
        start = displaced(start, e)
        run = run_engine(imu, start, model, replace(told, value=value), gate=gate_thresholds(0.0))
        squares.append(run.aiding.nis.sum())
        node = np.searchsorted(run.nodes.time, fixes.time[-1] - 1e-6)
        claims.append((run.nodes.sensor_state[node] - slow[-1]) / run.nodes.sensor_sd[node])
    degrees = 20 * 3 * fixes.size
    assert np.sum(squares) / degrees == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / degrees))
    assert np.mean(np.square(claims)) == pytest.approx(1.0, abs=3.5 * np.sqrt(2.0 / 60.0))


def metres(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    from schuler import earth

    return earth.metres_per_radian(position)


def displaced(start: InitialState, error: np.ndarray) -> InitialState:
    """The start with an error, computed minus true."""
    from schuler.rotations import dcm_from_rotation_vector

    north, east = metres(start.position)
    return replace(
        start,
        position=start.position + error[:3] / np.array([north, east, -1.0]),
        velocity=start.velocity + error[3:6],
        rotation=dcm_from_rotation_vector(-error[6:9]) @ start.rotation,
    )


def test_linear_measurements_are_one_joint_update() -> None:
    # seven correlated rows at one time, in three parts: spec 7.5
    rng = np.random.default_rng(5)
    model = sensor_error_model(NOISE, turn_on_accel=0.0, turn_on_gyro=0.0, interval=1.0 / RATE)
    matrix = rng.standard_normal((7, model.size))
    root = rng.standard_normal((7, 7)) * 1e-3
    noise = root @ root.T + 1e-8 * np.eye(7)
    value = rng.standard_normal((1, 7)) * 0.05
    before = filtered(IDEAL, model, positions(200.0, np.inf), node_interval=1.0 / RATE)
    at = int(np.searchsorted(before.nodes.time, 3.0 - 1e-6))
    p, x = before.nodes.covariance[at], before.nodes.sensor_state[at]
    rows = linear_measurements([before.nodes.time[at]], value, matrix, noise)
    assert rows.size == 3
    merged = merge_schedules([positions(200.0, 1.0), rows, rows], 0.0, 100.0)
    np.testing.assert_array_equal(merged.matrix[-6:], [0, 1, 2, 3, 4, 5])
    after = filtered(IDEAL, model, rows, node_interval=1.0 / RATE)
    h = np.zeros((7, 9 + model.size))
    h[:, 9:] = -matrix
    s = h @ p @ h.T + noise
    innovation = matrix @ x - value[0]
    gain = np.linalg.solve(s, h @ p).T
    np.testing.assert_allclose(
        after.nodes.sensor_state[at], x + (gain @ innovation)[9:], rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(
        np.diag(after.nodes.covariance[at]), np.diag(p - gain @ h @ p), rtol=1e-6
    )
    joint = innovation @ np.linalg.solve(s, innovation)
    assert after.aiding.nis.sum() == pytest.approx(joint, rel=1e-6)
    assert after.aiding.degrees.sum() == 7
