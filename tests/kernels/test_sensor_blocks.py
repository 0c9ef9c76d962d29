"""Blocks of sensor states that exist at one interval: autoregressive noise in the filter."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from schuler.data import CHANNELS
from schuler.earth import metres_per_radian
from schuler.errors import ModelError
from schuler.kernels.navigation.covariance import sensor_covariance
from schuler.kernels.navigation.filter_data import (
    AidingOutputs,
    NodeOutputs,
    SampleOutputs,
    Samples,
)
from schuler.kernels.navigation.general_aiding import general_model
from schuler.kernels.navigation.transition import move_sensor_states, raise_blocks, set_blocks
from schuler.kernels.navigation.update import add_offset_states
from schuler.navigation.aiding.schedule import linear_measurements
from schuler.navigation.error_models.sensor_error_model import SensorErrorModel, sensor_error_model
from schuler.navigation.stepping import NO_SCALE, FilterStepper, InitialState, kernel_schedule
from schuler.noise import ARMA, Autoregressive, GaussMarkov, WhiteNoise
from schuler.noise.base import Process
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import dcm_from_rotation_vector, skew

Array = NDArray[np.float64]
INTERVAL = 0.01
# S004 Table 2, gyro x, moved inside the unit circle: poles 0.995, 0.9 and 0.7
COEFFICIENTS = tuple(np.poly([0.995, 0.9, 0.7])[1:].tolist())
AR3 = Autoregressive(COEFFICIENTS, 2.7e-9, INTERVAL)


def noise_model(accel: Process, gyro: Process) -> NoiseModel:
    return NoiseModel(
        processes={c: gyro if c.startswith("gyro") else accel for c in CHANNELS}, source="test"
    )


def model_of(process: Process, interval: float | None = INTERVAL) -> SensorErrorModel:
    return sensor_error_model(
        noise_model(process, process),
        turn_on_accel=0.02,
        turn_on_gyro=1e-3,
        interval=interval,
        hold_constants=False,
    )


def raised(model: SensorErrorModel, step: float) -> tuple[Array, Array]:
    s = model.layout()
    steps = np.zeros(model.size, dtype=np.int64)
    power, noise = np.zeros_like(s.drift), np.zeros_like(s.drift)
    assert raise_blocks(step, s.drift, s.diffusion, s.block, s.interval, steps, power, noise)
    assert not raise_blocks(step, s.drift, s.diffusion, s.block, s.interval, steps, power, noise)
    return power, noise


def test_27ar_has_27_states_and_the_newest_alone_shows() -> None:
    # S004 Table 8; spec 7.3: companion, output = newest, noise into its row only
    model = model_of(AR3 + WhiteNoise(1e-3))
    assert 9 + model.size == 27
    for block in model.blocks:
        shown = model.direction[block.first : block.first + 3]
        np.testing.assert_array_equal(shown[:2], 0.0)
        assert np.isnan(shown[2]).all()
        np.testing.assert_array_equal(block.transition[:2], np.eye(3)[1:])
        np.testing.assert_allclose(block.transition[2], -np.array(COEFFICIENTS)[::-1])
        assert block.noise_covariance[2, 2] == AR3.driving_variance
        assert np.count_nonzero(block.noise_covariance) == 1
    # what is unknown at switch-on is shared by all lags
    turn_on = model.initial_covariance[:3, :3] - AR3.state_space(INTERVAL).initial_covariance
    np.testing.assert_allclose(turn_on, 0.02**2, rtol=1e-9)


def test_free_states_continue_the_filtered_noise() -> None:
    # S004 (9), (10): driven by noise, then left alone
    rng = np.random.default_rng(1)
    drive = rng.standard_normal(400)
    drive[300:] = 0.0
    wanted = lfilter([1.0], [1.0, *COEFFICIENTS], drive)
    model = model_of(AR3)
    s = model.layout()
    power, noise = raised(model, INTERVAL)
    transition, none = np.zeros_like(power), np.zeros_like(noise)
    state = np.zeros(model.size)
    state[:3] = wanted[297:300]
    for k in range(300, 400):
        set_blocks(True, s.block, s.interval, power, noise, transition, none)
        move_sensor_states(state, s.block, transition, np.empty(model.size))
        assert state[2] == pytest.approx(wanted[k], rel=1e-10)
        # the parts of a split sample share its error
        before = state.copy()
        set_blocks(False, s.block, s.interval, power, noise, transition, none)
        move_sensor_states(state, s.block, transition, np.empty(model.size))
        np.testing.assert_array_equal(state, before)
        assert not none.any()


@pytest.mark.parametrize("steps", [1, 4, 7])
def test_several_steps_are_the_powered_companion_and_the_accumulated_noise(steps: int) -> None:
    model = model_of(AR3)
    # stamps jitter: the nearest number of steps counts
    power, noise = raised(model, (steps + 0.3) * INTERVAL)
    wanted = AR3.state_space(steps * INTERVAL)
    np.testing.assert_allclose(power[:3], wanted.transition, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(noise[:3], wanted.noise_covariance, rtol=1e-12, atol=1e-24)
    # and the spread of that many recursions from one start
    rng = np.random.default_rng(2)
    draws = 20_000
    start = np.array([3e-4, 2e-4, 2e-4])
    recent = np.tile(start, (draws, 1))
    for _ in range(steps):
        new = -recent @ np.array(COEFFICIENTS)[::-1]
        new += np.sqrt(AR3.driving_variance) * rng.standard_normal(draws)
        recent = np.column_stack([recent[:, 1:], new])
    spread = np.cov(recent, rowvar=False)
    sd = np.sqrt(np.diag(noise[:3]))
    error = np.abs(spread - noise[:3])
    assert np.all(error <= 5.0 * np.sqrt(2.0 / draws) * np.outer(sd, sd) + 1e-25)
    standard = np.sqrt(np.diag(noise[:3]) / draws)
    assert np.all(np.abs(recent.mean(axis=0) - power[:3] @ start) <= 4.5 * standard + 1e-15)


def test_blocks_of_mixed_sizes_move_as_dense_matrices() -> None:
    rng = np.random.default_rng(3)
    sizes = (1, 3, 2, 1, 5, 1)
    m, widest = sum(sizes), 6
    block = np.array([[sum(sizes[:i]), n] for i, n in enumerate(sizes) for _ in range(n)])
    transition, noise = rng.standard_normal((2, m, widest))
    dense, dense_noise = np.zeros((m, m)), np.zeros((m, m))
    for first, n in {(int(f), int(n)) for f, n in block}:
        own = slice(first, first + n)
        noise[own, :n] = noise[own, :n] @ noise[own, :n].T
        dense[own, own], dense_noise[own, own] = transition[own, :n], noise[own, :n]
    root = rng.standard_normal((9 + m, 9 + m))
    covariance = root @ root.T
    wanted = dense @ covariance[9:, 9:] @ dense.T + dense_noise
    kept = covariance[:9].copy()
    sensor_covariance(covariance, block, transition, noise, np.zeros(9 * 264))
    np.testing.assert_allclose(covariance[9:, 9:], wanted, rtol=1e-11, atol=1e-11)
    np.testing.assert_array_equal(covariance, covariance.T)
    np.testing.assert_array_equal(covariance[:9], kept)


def test_another_interval_is_refused_and_a_multiple_taken() -> None:
    assert model_of(AR3, 0.0500002).blocks[0].interval == INTERVAL
    for interval in (0.005, 0.025, 0.0102, None):
        with pytest.raises(ModelError, match="only at one sample interval"):
            model_of(AR3, interval)


def test_what_is_a_sum_of_gauss_markov_noises_serves_at_any_interval() -> None:
    pole = float(np.exp(-INTERVAL / 3.0))
    first_order = Autoregressive((-pole,), 1e-6 * (1.0 - pole**2), INTERVAL)
    wanted = model_of(GaussMarkov(1e-3, 3.0))
    found = model_of(first_order, 0.004)
    assert not found.blocks
    np.testing.assert_allclose(found.drift, wanted.drift, rtol=1e-9)
    np.testing.assert_allclose(found.diffusion, wanted.diffusion, rtol=1e-9)
    # one that alternates is no such sum, and has lags that share a constant
    alternating = model_of(ARMA((0.5, 0.4), (0.3,), 1e-6, INTERVAL))
    constant = alternating.initial_covariance[:2, :2].copy()
    constant -= ARMA((0.5, 0.4), (0.3,), 1e-6, INTERVAL).state_space(INTERVAL).initial_covariance
    np.testing.assert_allclose(constant / 0.02**2, np.outer([1.0, 0.4], [1.0, 0.4]), atol=1e-9)


def test_linear_and_offset_states_have_the_derivatives_of_their_residuals() -> None:
    rng = np.random.default_rng(4)
    model = model_of(AR3)
    m = model.size
    matrix, truth, estimate = rng.standard_normal((3, m)), *rng.standard_normal((2, m))
    place = np.array([0.8, 0.1, 100.0])
    start = InitialState(place, np.zeros(3), np.eye(3), estimate, np.eye(9 + m))
    linear = linear_measurements([0.0], (matrix @ truth)[None], matrix, np.eye(3))
    stepper = FilterStepper(start, model, gate=np.full(4, np.inf))
    filter_ = stepper.filter(
        Samples(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)), NO_SCALE),
        kernel_schedule(linear, m),
        SampleOutputs.empty(0),
        AidingOutputs.empty(1, 0, 9 + m),
        NodeOutputs.empty(4, 0, 9 + m, stepper.width),
    )
    z = filter_.measurement
    z.value[:], z.lever[:] = linear.value[0], place
    general_model(filter_, 0)
    # predicted minus measured; sensor states are true minus estimated
    residual, design = z.residual.copy(), z.design.copy()
    np.testing.assert_allclose(residual, design[:, 9:] @ (truth - estimate), atol=1e-12)
    assert not design[:, :9].any()
    # errors that add to what is measured, to the first and third component here
    residual[:], design[:, :] = 0.0, 0.0
    add_offset_states(np.array([4, -1, 6]), np.array([1.0, 2.0, 0.5]), estimate, residual, design)
    measured = np.array([truth[4], 0.0, 0.5 * truth[6]])
    np.testing.assert_allclose(residual - measured, design[:, 9:] @ (truth - estimate), atol=1e-12)
    assert not residual[1]
    assert not design[1].any()


def test_a_general_measurement_follows_the_state_it_was_not_asked_at() -> None:
    rng = np.random.default_rng(6)
    place, turned = (
        np.array([0.8, 0.1, 100.0]),
        dcm_from_rotation_vector(np.array([0.3, -0.2, 1.0])),
    )
    sensor, velocity = rng.standard_normal(4), rng.standard_normal(3)
    derivatives = rng.standard_normal((3, 13))
    rows = np.hstack([turned, derivatives])
    python = getattr(general_model, "py_func", general_model)

    def residual(error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """At a state that is off by an error: computed minus true, sensors true minus estimated."""
        north, east = metres_per_radian(place)
        scale = np.array([1.0 / float(north), 1.0 / float(east), -1.0])
        psi = error[6:9]
        state = SimpleNamespace(
            position=place + error[:3] * scale,
            velocity=velocity + error[3:6],
            rotation=(np.eye(3) - skew(psi)) @ turned,
            sensor=sensor - error[9:],
        )
        z = SimpleNamespace(
            value=derivatives[:, 3:6] @ velocity + derivatives[:, 9:] @ sensor - 0.5,
            lever=place,
            residual=np.empty(3),
            design=np.empty((3, 13)),
        )
        schedule = SimpleNamespace(matrices=rows[None])
        python(SimpleNamespace(state=state, schedule=schedule, measurement=z), 0)
        return z.residual, z.design

    here, design = residual(np.zeros(13))
    np.testing.assert_allclose(here, 0.5, atol=1e-12)
    for k in range(13):
        error = np.zeros(13)
        error[k] = 1e-3
        there, _ = residual(error)
        np.testing.assert_allclose((there - here) / 1e-3, design[:, k], atol=2e-4)
