"""The linear error model against the nonlinear strapdown step, and P against F P F' + Q."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from schuler import earth
from schuler.data import CHANNELS
from schuler.kernels.navigation.covariance import navigation_rows, propagate_covariance
from schuler.kernels.navigation.filter_data import FilterState, Work
from schuler.kernels.navigation.strapdown import strapdown_step
from schuler.kernels.navigation.transition import (
    accumulate_transition,
    reset_transition,
    sensor_transition,
)
from schuler.navigation.error_models.sensor_error_model import (
    FILTER_CHANNELS,
    SensorErrorModel,
    sensor_error_model,
)
from schuler.navigation.error_models.sensor_states import no_sensor_states
from schuler.noise import GaussMarkov, RandomWalk, RateRamp, Sinusoid, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import (
    dcm_from_euler,
    dcm_from_rotation_vector,
    quaternion_from_dcm,
    rotation_vector_from_dcm,
)

Array = NDArray[np.float64]
DT = 0.01
PLACES = 264


def dense_blocks(rows: Array, block: NDArray[np.int64]) -> Array:
    """Matrix of the (m, w) layout of kernels/navigation/transition.py."""
    matrix = np.zeros((len(block), len(block)))
    for j, (first, size) in enumerate(block):
        matrix[j, first : first + size] = rows[j, :size]
    return matrix


@dataclass(frozen=True, eq=False)
class Start:
    position: Array
    velocity: Array
    rotation: Array
    force: Array
    rate: Array


def vehicle(velocity: Array, rotation: Array) -> Start:
    """A vehicle that accelerates, turns and climbs at 50 degrees north."""
    return Start(
        position=np.array([0.87, -1.9, 320.0]),
        velocity=velocity,
        rotation=rotation,
        force=np.array([2.5, -3.0, -9.3]),
        rate=np.array([0.15, -0.3, 0.4]),
    )


SLOW = vehicle(np.array([0.4, -0.3, 0.1]), dcm_from_euler(0.3, -0.4, 2.1))
FAST = vehicle(np.array([28.0, -17.0, 2.0]), dcm_from_euler(0.3, -0.4, 2.1))


@dataclass(frozen=True)
class Stepped:
    position: Array
    velocity: Array
    rotation: Array
    earth: Array
    transport: Array


def step(
    start: Start,
    dt: float = DT,
    error: Array | None = None,
    sensor: Array | None = None,
) -> Stepped:
    """One strapdown step from an erroneous state with erroneous sensors, all in SI and spec 0."""
    e = np.zeros(9) if error is None else error
    y = np.zeros(6) if sensor is None else sensor
    north, east = earth.metres_per_radian(start.position)
    position = start.position + np.array([e[0] / north, e[1] / east, -e[2]])
    velocity = start.velocity + e[3:6]
    rotation = dcm_from_rotation_vector(-e[6:9]) @ start.rotation
    quaternion = np.array(quaternion_from_dcm(rotation))
    angle, thrust = (start.rate + y[3:]) * dt, (start.force + y[:3]) * dt
    out, matrix = np.zeros(10), np.array(rotation)
    none = np.zeros(3)  # nothing changes during the step
    strapdown_step(dt, angle, thrust, none, none, position, velocity, quaternion, matrix, out)
    meridian, transverse = (float(r) for r in earth.radii(position[0]))
    transport = np.array(
        [
            1.0 / (transverse + position[2]),
            -1.0 / (meridian + position[2]),
            -np.tan(position[0]) / (transverse + position[2]),
        ]
    )
    return Stepped(position, velocity, matrix, out, transport)


def difference(found: Stepped, truth: Stepped) -> Array:
    """Navigation error, computed - true, with C_hat = (I - [psi x]) C."""
    north, east = earth.metres_per_radian(truth.position)
    offset = (found.position - truth.position) * np.array([north, east, -1.0])
    psi = -rotation_vector_from_dcm(found.rotation @ truth.rotation.T)
    return np.concatenate([offset, found.velocity - truth.velocity, psi])


def numerical_transition(start: Start, dt: float = DT) -> Array:
    """(9, 15): error after a step by error before it and by the six sensor errors."""
    truth = step(start, dt)
    sizes = np.repeat([100.0, 1.0, 1e-3, 1e-1, 1e-2], 3)
    columns = []
    for j, size in enumerate(sizes):
        x = np.zeros(15)
        x[j] = size
        up = difference(step(start, dt, x[:9], x[9:]), truth)
        down = difference(step(start, dt, -x[:9], -x[9:]), truth)
        columns.append((up - down) / (2.0 * size))
    return np.column_stack(columns)


def linear_transition(stepped: Stepped, dt: float = DT) -> Array:
    """(9, 15) of the kernel: its rows applied to the identity."""
    rows, errors, result = (np.zeros((k, PLACES)) for k in (9, 6, 9))
    rows[:, :9] = np.eye(9)
    errors[:, 9:15] = np.eye(6)
    navigation_rows(
        rows.ravel(),
        errors.ravel(),
        flat := result.ravel(),
        15,
        dt,
        stepped.rotation,
        stepped.earth,
        stepped.transport,
    )
    return flat.reshape(9, PLACES)[:, :15]


def block(matrix: Array, row: str, column: str) -> Array:
    places = {"r": 0, "v": 3, "psi": 6, "f": 9, "w": 12}
    i, j = places[row], places[column]
    return matrix[i : i + 3, j : j + 3]


# block, largest deviation relative to the largest entry: half a turn of the body during the step
# (2.5e-3) where the kernel takes the attitude at its end, 1e-3 elsewhere
BLOCKS = [
    ("v", "psi", 1e-3),
    ("v", "f", 4e-3),
    ("psi", "w", 4e-3),
    ("r", "v", 1e-3),
    ("r", "f", 1e-2),
    ("r", "psi", 1e-2),
    ("v", "w", 1e-2),
    ("psi", "psi", 1e-6),
    ("v", "v", 2e-6),
    ("r", "r", 1e-6),
]


@pytest.mark.parametrize("start", [SLOW, FAST], ids=["slow", "fast"])
@pytest.mark.parametrize(("row", "column", "tolerance"), BLOCKS)
def test_transition_is_the_jacobian_of_the_strapdown_step(
    start: Start, row: str, column: str, tolerance: float
) -> None:
    wanted = block(numerical_transition(start), row, column)
    found = block(linear_transition(step(start)), row, column)
    # position within a step: terms of third order in dt are left out
    scale = np.abs(wanted).max()
    third_order = 0.4 if (row, column) in {("v", "w"), ("r", "psi"), ("r", "f")} else 0.0
    assert scale > 0.0
    assert np.abs(found - wanted).max() < (tolerance + third_order * DT) * scale


def test_small_terms_of_the_earth_have_the_right_size_and_sign() -> None:
    # at low speed nothing hides them: Coriolis, rate of the n frame, transport, gravity gradient
    wanted, found = numerical_transition(SLOW), linear_transition(step(SLOW))
    identity = np.eye(3)
    for row, tolerance in (("v", 1e-2), ("psi", 1e-3)):
        small = block(wanted, row, row) - identity
        assert np.abs(small).max() > 5e-7  # 7.3e-5 rad/s times 0.01 s
        np.testing.assert_allclose(
            block(found, row, row) - identity, small, atol=tolerance * np.abs(small).max()
        )
    transport = block(wanted, "psi", "v")
    np.testing.assert_allclose(
        block(found, "psi", "v"), transport, atol=2e-2 * np.abs(transport).max()
    )
    # a height error of 100 m: gravity changes by 3.1e-4 m/s², and down grows with down
    assert wanted[5, 2] == pytest.approx(3.08e-6 * DT, rel=0.02)
    assert found[5, 2] == pytest.approx(wanted[5, 2], rel=0.02)


WALK = RandomWalk(3e-4, initial_sd=0.02)
ACCEL = WhiteNoise(2e-3) + GaussMarkov(5e-3, 7.0) + WALK
GYRO = WhiteNoise(4e-4) + GaussMarkov(2e-4, 0.5) + RateRamp(1e-6) + Sinusoid(3e-4, 3.0)
NOISE = NoiseModel(
    processes={
        c: (GYRO if c.startswith("gyro") else ACCEL) + WhiteNoise(1e-3 * (1 + k))
        for k, c in enumerate(CHANNELS)
    },
    source="test",
)


def dense_sensor_model(dt: float) -> tuple[Array, Array, Array]:
    """Transition, noise and output (6, m) of all channels from the processes' own closed forms."""
    from scipy.linalg import block_diag

    transition, noise, output = [], [], []
    for name in FILTER_CHANNELS:
        parts = [p.state_space(dt) for p in NOISE.process(name).components]
        parts = [p for p in parts if p.size]
        if name.startswith("gyro"):
            from schuler.noise import TurnOnBias

            parts.append(TurnOnBias(0.01).state_space(dt))
        transition += [p.transition for p in parts]
        noise += [p.noise_covariance for p in parts]
        output.append(np.concatenate([p.output for p in parts])[None, :])
    return block_diag(*transition), block_diag(*noise), block_diag(*output)


def model() -> SensorErrorModel:
    return sensor_error_model(NOISE, turn_on_accel=0.1, turn_on_gyro=0.01)


def discretised(model: SensorErrorModel, dt: float) -> tuple[Array, Array]:
    states = model.layout()
    transition, noise = np.zeros_like(states.drift), np.zeros_like(states.drift)
    sensor_transition(
        dt, states.drift, states.diffusion, states.block, states.interval, transition, noise
    )
    return transition, noise


@pytest.mark.parametrize("dt", [1e-3, 0.01, 0.05, 5.0])
def test_sensor_states_are_discretised_exactly(dt: float) -> None:
    # spec 7.3: exp(-dt/Tc), sigma²(1 - exp(-2dt/Tc)), K² dt at any step, rotation of a sinusoid
    states = model()
    transition, noise = discretised(states, dt)
    wanted_transition, wanted_noise, _ = dense_sensor_model(dt)
    block = states.layout().block
    np.testing.assert_allclose(
        dense_blocks(transition, block), wanted_transition, rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose(dense_blocks(noise, block), wanted_noise, rtol=1e-11, atol=1e-25)
    gauss_markov = states.names.index("gyro_y Gauss-Markov")
    assert noise[gauss_markov, 0] == pytest.approx(2e-4**2 * (1 - np.exp(-2 * dt / 0.5)), rel=1e-11)
    walk = states.names.index("accel_z random walk")
    assert noise[walk, 0] == pytest.approx(3e-4**2 * dt, rel=1e-12)


def random_covariance(size: int, rng: np.random.Generator) -> Array:
    scale = np.concatenate([[3.0] * 3, [0.5] * 3, [0.02] * 3, np.full(size - 9, 1e-3)])
    root = scale[:, None] * rng.standard_normal((size, size))
    return root @ root.T


def propagated(covariance: Array, states: SensorErrorModel, stepped: Stepped, dt: float) -> Array:
    layout = states.layout()
    state = state_of(states, stepped, dt)
    state.covariance[:] = covariance
    propagate_covariance(state, layout, Work.of(layout), dt)
    return state.covariance


def state_of(states: SensorErrorModel, stepped: Stepped, dt: float) -> FilterState:
    """A state at a step, with the sensor states discretised for it."""
    state = FilterState.empty(states.size, 2, accumulating=True)
    state.rotation[:], state.earth[:] = stepped.rotation, stepped.earth
    state.transport[:] = stepped.transport
    state.transition[:], state.noise[:] = discretised(states, dt)
    return state


def test_covariance_step_is_f_p_f_plus_q_in_dense_numpy() -> None:
    rng = np.random.default_rng(1)
    states, stepped = model(), step(FAST)
    size = 9 + states.size
    for _ in range(3):
        before = random_covariance(size, rng)
        navigation = linear_transition(stepped)
        sensor, noise, output = dense_sensor_model(DT)
        f = np.zeros((size, size))
        f[:9, :9] = navigation[:, :9]
        f[:9, 9:] = navigation[:, 9:] @ output
        f[9:, 9:] = sensor
        q = np.zeros((size, size))
        q[9:, 9:] = noise
        white = np.array(
            [
                sum(p.density**2 for p in NOISE.process(c).components if isinstance(p, WhiteNoise))
                for c in FILTER_CHANNELS
            ]
        )
        c = stepped.rotation
        q[3:6, 3:6] = c @ np.diag(white[:3]) @ c.T * DT
        q[6:9, 6:9] = c @ np.diag(white[3:]) @ c.T * DT
        wanted = f @ before @ f.T + q
        found = propagated(before, states, stepped, DT)
        sd = np.sqrt(np.diag(wanted))
        np.testing.assert_allclose(found / np.outer(sd, sd), wanted / np.outer(sd, sd), atol=1e-11)
        np.testing.assert_array_equal(found, found.T)
        assert np.linalg.eigvalsh(found / np.outer(sd, sd)).min() > -1e-12


SKEWED = np.array(
    [
        [[1.0, 0.8, 0.0], [0.8, 1.0, -0.3], [0.0, -0.3, 1.0]],
        [[1.0, 0.0, -0.9], [0.0, 1.0, 0.2], [-0.9, 0.2, 1.0]],
    ]
)


@pytest.mark.parametrize("how", [{}, {"white_correlation": SKEWED}], ids=["plain", "skewed"])
def test_white_noise_of_a_step_is_the_spread_of_noisy_strapdown_steps(
    how: dict[str, Array],
) -> None:
    # anisotropic: mixing axes, frames, or densities with sample deviations shows at once
    rng = np.random.default_rng(2)
    density = np.array([1e-2, 4e-2, 2e-2, 1e-3, 5e-3, 2e-3])
    truth = step(FAST)
    draws = 6000
    noise = rng.standard_normal((draws, 6))
    if how:
        roots = np.linalg.cholesky(SKEWED)
        noise = np.hstack([noise[:, :3] @ roots[0].T, noise[:, 3:] @ roots[1].T])
    noise = noise * density / np.sqrt(DT)
    found = np.cov([difference(step(FAST, sensor=n), truth) for n in noise], rowvar=False)
    claimed = propagated(np.zeros((9, 9)), replace(no_sensor_states(density), **how), truth, DT)
    for part in (slice(3, 6), slice(6, 9)):
        wanted, got = claimed[part, part], found[part, part]
        sd = np.sqrt(np.diag(wanted))
        # five standard errors of a sample covariance, 1/sqrt(draws) off the diagonal
        assert np.abs((got - wanted) / np.outer(sd, sd)).max() < 5.0 * np.sqrt(2.0 / draws)


def test_accumulated_transition_is_the_product_of_the_steps() -> None:
    states = model()
    m, size = states.size, 9 + states.size
    layout = states.layout()
    block, work = layout.block, Work.of(layout)
    kept = FilterState.empty(m, 2, accumulating=True)
    total, sensor = kept.node_top, kept.node_sensor
    reset_transition(total, sensor, block)
    wanted = np.eye(size)
    _, _, output = dense_sensor_model(DT)
    for k, dt in enumerate((0.01, 0.02, 0.005, 0.01)):
        turned = vehicle(FAST.velocity, dcm_from_euler(0.3 * k, -0.4, 2.1 - k))
        stepped = step(turned, dt)
        now = state_of(states, stepped, dt)
        now.node_top[:], now.node_sensor[:] = total, sensor
        accumulate_transition(now, layout, work, dt)
        total, sensor = now.node_top, now.node_sensor
        f = np.zeros((size, size))
        f[:9, :9] = linear_transition(stepped, dt)[:, :9]
        f[:9, 9:] = linear_transition(stepped, dt)[:, 9:] @ output
        f[9:, 9:] = dense_sensor_model(dt)[0]
        wanted = f @ wanted
    np.testing.assert_allclose(
        total.reshape(9, PLACES)[:, :size], wanted[:9], rtol=1e-10, atol=1e-13
    )
    np.testing.assert_allclose(dense_blocks(sensor, block), wanted[9:, 9:], rtol=1e-11, atol=1e-12)
