"""The smoother against Rauch-Tung-Striebel in dense NumPy, and the law of a bridged gap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twins import NOISE, draw_twin, navigation_errors, perfect

from schuler import earth
from schuler.data import GnssRecording, ImuRecording
from schuler.kernels.navigation.smoother import Adjoint, Smoothed, smooth_nodes
from schuler.navigation.aiding.schedule import POSITION, VELOCITY, AidingSchedule
from schuler.navigation.engine import FilterRun, InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_error_model import SensorErrorModel, sensor_error_model
from schuler.navigation.error_models.sensor_states import no_sensor_states
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.smoother import smooth_run
from schuler.noise import Autoregressive, RateRamp, Sinusoid
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import rotation_vector_from_dcm
from schuler.simulation import car_urban, static

# states of two as well, a ramp and an oscillation, and of three, autoregressive noise
AR3 = Autoregressive(tuple(np.poly([0.98, 0.6, -0.3])[1:].tolist()), 1e-10, 0.02)
MIXED = NoiseModel(
    processes=dict(NOISE.processes)
    | {
        "gyro_y": NOISE.process("gyro_y") + Sinusoid(1e-4, 0.05, phase=0.4),
        "accel_x": NOISE.process("accel_x") + RateRamp(1e-4),
        "gyro_x": NOISE.process("gyro_x") + AR3,
    },
    source="twin",
)


def a_drive_with_an_outage() -> tuple[RunSetup, ImuRecording, GnssRecording]:
    profile = car_urban(90.0, 8, standstill=10.0)
    ideal = perfect(profile, 50.0)
    twin = draw_twin(profile, ideal, 3, first_fix=1.0037)
    model = sensor_error_model(MIXED, turn_on_accel=0.02, turn_on_gyro=1e-3, interval=0.02)
    # the textbook form divides by the covariance: nothing may be known exactly at the start
    initial = model.initial_covariance
    exact = np.diag(np.diag(initial) == 0.0)
    model = replace(model, initial_covariance=np.where(exact, 1e-4, initial))
    since = twin.gnss.time
    gnss = twin.gnss.select((since < 40.0) | (since > 60.0))
    return replace(twin.setup, model=model), twin.imu, gnss


def a_run_with_an_outage() -> tuple[FilterRun, SensorErrorModel, ImuRecording]:
    setup, imu, gnss = a_drive_with_an_outage()
    run = run_engine(
        imu,
        setup.initial_state(imu, gnss),
        setup.model,
        setup.schedule(imu, gnss),
        gate=gate_thresholds(0.0),
    )
    return run, setup.model, imu


def rauch_tung_striebel(run: FilterRun, model: SensorErrorModel) -> tuple[np.ndarray, np.ndarray]:
    """Smoothed error left after the update of each node (k, s), and its covariance (k, s, s)."""
    nodes, aiding = run.nodes, run.aiding
    count, size = nodes.covariance.shape[:2]
    error = np.zeros((count, size))
    covariance = nodes.covariance.copy()
    for k in range(count - 2, -1, -1):
        transition = np.zeros((size, size))
        transition[:9] = nodes.top[k + 1]
        for j, (first, count) in enumerate(model.layout().block):
            row = nodes.transition[k + 1, j, :count]
            transition[9 + j, 9 + first : 9 + first + count] = row
        # before the updates of node k + 1: P- = P+ + sum of s K K'
        before = nodes.covariance[k + 1].copy()
        for u in range(*nodes.aid[k + 1]):
            for i in range(3):
                gain = aiding.gain[u, i]
                before += aiding.scalar[u, i, 1] * np.outer(gain, gain)
        after = nodes.covariance[k]
        sd = np.sqrt(np.diag(before))
        back = np.linalg.solve(before / np.outer(sd, sd), (transition @ after) / sd[:, None]).T / sd
        error[k] = back @ (error[k + 1] + nodes.error[k + 1])
        covariance[k] = after + back @ (covariance[k + 1] - before) @ back.T
    return error, covariance


def test_the_smoother_is_rauch_tung_striebel() -> None:
    run, model, _ = a_run_with_an_outage()
    nodes, aiding = run.nodes, run.aiding
    assert (model.partner >= 0).sum() == 4
    assert [b.size for b in model.blocks] == [3]
    wanted_error, wanted_covariance = rauch_tung_striebel(run, model)
    smoothed = Smoothed.zeros(nodes.size, 9 + model.size)
    block, adjoint = model.layout().block, Adjoint.zero(9 + model.size)
    smooth_nodes(0, nodes.size, nodes, aiding, block, adjoint, smoothed)
    error, position, variance = smoothed.error, smoothed.position, smoothed.variance
    wanted_variance = np.diagonal(wanted_covariance, axis1=1, axis2=2)
    np.testing.assert_allclose(variance, wanted_variance, rtol=1e-6)
    size = np.abs(wanted_error).max(axis=0)
    np.testing.assert_allclose(error / size, wanted_error / size, atol=1e-6)
    smallest = float(wanted_variance[:, :3].min())
    np.testing.assert_allclose(position, wanted_covariance[:, :3, :3], atol=1e-6 * smallest)
    # smoothing matters here: twenty seconds without GNSS
    inside = (nodes.time > 45.0) & (nodes.time < 60.0)
    filtered = nodes.covariance[inside][:, 0, 0]
    assert np.all(wanted_variance[inside, 0] < 0.5 * filtered)


def test_smoothed_samples_take_the_error_of_the_nodes_with_the_right_signs() -> None:
    run, model, imu = a_run_with_an_outage()
    error, covariance = rauch_tung_striebel(run, model)
    back = smooth_run(run, model, imu.time)
    sample = np.flatnonzero(np.isin(np.round(imu.time, 6), np.round(run.nodes.time, 6)))
    node = np.searchsorted(run.nodes.time, imu.time[sample] - 1e-6)
    assert sample.size > 100
    old, new = run.samples, back.samples
    north, east = earth.metres_per_radian(old.position[sample])
    moved = (old.position[sample] - new.position[sample]) * np.stack(
        [north, east, -np.ones(sample.size)], axis=-1
    )
    np.testing.assert_allclose(moved, error[node, :3], atol=1e-6)
    np.testing.assert_allclose(
        old.velocity[sample] - new.velocity[sample], error[node, 3:6], atol=1e-8
    )
    psi = -rotation_vector_from_dcm(old.rotation[sample] @ new.rotation[sample].transpose(0, 2, 1))
    np.testing.assert_allclose(psi, error[node, 6:9], atol=1e-9)
    np.testing.assert_allclose(back.sensor_state - run.nodes.sensor_state, error[:, 9:], atol=1e-9)
    np.testing.assert_allclose(
        new.velocity_sd[sample], np.sqrt(covariance[node][:, [3, 4, 5], [3, 4, 5]]), rtol=1e-5
    )


@pytest.mark.parametrize("allowed", [4e5, 1e3])
def test_nodes_computed_once_more_change_nothing(allowed: float) -> None:
    # as few checkpoints as the memory allows, or the least memory that is possible
    setup, imu, gnss = a_drive_with_an_outage()
    how = {"gate": gate_thresholds(0.0)}
    start, schedule = setup.initial_state(imu, gnss), setup.schedule(imu, gnss)
    whole = run_engine(imu, start, setup.model, schedule, **how)
    less = run_engine(imu, start, setup.model, schedule, smoother_memory=allowed, **how)
    assert whole.checkpoints is None
    assert less.checkpoints is not None
    assert len(less.checkpoints.memories) > 3
    assert less.nodes.covariance.size == 0
    assert less.smoother_bytes < 0.15 * whole.smoother_bytes
    assert less.log_likelihood == whole.log_likelihood
    wanted, found = (smooth_run(r, setup.model, imu.time) for r in (whole, less))
    for field in ("position", "velocity", "rotation", "position_covariance", "attitude_sd"):
        np.testing.assert_array_equal(getattr(found.samples, field), getattr(wanted.samples, field))
    np.testing.assert_array_equal(found.sensor_state, wanted.sensor_state)
    np.testing.assert_array_equal(found.sensor_sd, wanted.sensor_sd)


@pytest.mark.parametrize("gap", [10.0, 40.0])
def test_at_mid_gap_the_smoothed_error_is_an_eighth_of_the_free_end_error(gap: float) -> None:
    # spec 7.8 with white acceleration, position and velocity pinned at both ends
    density, rate = 0.02, 20.0
    profile = static(gap + 3.0, yaw=0.4)
    ideal = perfect(profile, rate)
    rng = np.random.default_rng(11)
    truth = profile.trajectory(ideal.time)
    ends = np.array([1.0, 1.0 + gap])
    rows = np.repeat(ends, 2)
    kind = np.array([POSITION, VELOCITY] * 2, dtype=np.int64)
    value = np.where((kind == POSITION)[:, None], truth.position[0], 0.0)
    schedule = AidingSchedule(rows, kind, value, np.full((4, 3), 1e-10), np.zeros((4, 3)))
    middle, last = (int(np.searchsorted(ideal.time, t)) for t in (1.0 + gap / 2, 1.0 + gap - 1e-6))
    model = no_sensor_states(np.repeat([density, 0.0], 3))
    start = InitialState(
        truth.position[0], np.zeros(3), truth.rotation[0], np.empty(0), np.zeros((9, 9))
    )
    squares = []
    for _ in range(60):
        accel = ideal.accel + density * np.sqrt(rate) * rng.standard_normal((ideal.size, 3))
        imu = replace(ideal, accel=accel)
        run = run_engine(imu, start, model, schedule, gate=gate_thresholds(0.0))
        back = smooth_run(run, model, imu.time).samples
        e = navigation_errors(profile, imu.time, back.position, back.velocity, back.rotation)
        squares.append(e[middle, :2] ** 2)
    free_end = density * gap**1.5 / np.sqrt(3.0)
    claimed = np.sqrt(np.diag(back.position_covariance[middle]))
    np.testing.assert_allclose(claimed[:2], free_end / 8.0, rtol=0.02)
    filtered = np.sqrt(run.samples.position_covariance[last - 1, 0, 0])
    assert filtered == pytest.approx(free_end, rel=0.02 + 3.0 / (gap * rate))
    # 120 squares: four standard errors of their mean
    assert np.mean(squares) == pytest.approx((free_end / 8.0) ** 2, rel=4.0 * np.sqrt(2.0 / 120.0))
