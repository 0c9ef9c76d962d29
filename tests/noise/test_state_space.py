"""State spaces are the same processes: exact steps, stationary starts, prediction floor."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from scipy.linalg import expm, solve_discrete_are

from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    ProcessSum,
    Quantization,
    RandomWalk,
    RateRamp,
    Sinusoid,
    TurnOnBias,
    WhiteNoise,
)
from schuler.noise.innovation import kolmogorov_szego

DT = 0.07
CONTINUOUS = [
    GaussMarkov(0.3, 2.0),
    RandomWalk(0.2, initial_sd=0.5),
    BiasInstability(0.4, 0.5, 60.0),
    RateRamp(0.1),
    Sinusoid(0.7, 1.3),
    TurnOnBias(0.2),
    WhiteNoise(0.1) + GaussMarkov(0.3, 2.0) + RateRamp(0.1) + Sinusoid(0.2, 0.4) + RandomWalk(1.0),
]


@pytest.mark.parametrize("process", CONTINUOUS, ids=lambda p: p.kind)
def test_step_is_the_exact_solution_of_the_drift(process: Process) -> None:
    space = process.state_space(DT)
    assert space.drift is not None
    assert space.diffusion is not None
    n = space.size
    np.testing.assert_allclose(space.transition, expm(space.drift * DT), atol=1e-14)
    # van Loan: the noise over a step from one matrix exponential
    big = np.zeros((2 * n, 2 * n))
    big[:n, :n], big[:n, n:], big[n:, n:] = -space.drift, space.diffusion, space.drift.T
    lump = expm(big * DT)
    noise = lump[n:, n:].T @ lump[:n, n:]
    np.testing.assert_allclose(space.noise_covariance, noise, rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize(
    "process",
    [GaussMarkov(0.3, 2.0), BiasInstability(0.4, 0.5, 60.0), Sinusoid(0.7, 1.3), TurnOnBias(0.2)],
    ids=lambda p: p.kind,
)
def test_stationary_start_stays_and_gives_the_autocovariance(process: Process) -> None:
    space = process.state_space(DT)
    after = space.transition @ space.initial_covariance @ space.transition.T
    np.testing.assert_allclose(after + space.noise_covariance, space.initial_covariance, atol=1e-15)
    for k in (0, 1, 13):
        power = np.linalg.matrix_power(space.transition, k)
        covariance = space.output @ power @ space.initial_covariance @ space.output
        assert covariance == pytest.approx(float(process.autocovariance(k * DT)), rel=1e-10)


def test_quantization_states_give_its_autocovariance() -> None:
    process = Quantization(0.3, interval=DT)
    space = process.state_space(DT)
    covariance = space.initial_covariance
    for k, expected in enumerate((2.0, -1.0, 0.0)):
        power = np.linalg.matrix_power(space.transition, k)
        found = float(space.output @ power @ covariance @ space.output)
        assert found == pytest.approx(expected * (0.3 / DT) ** 2, abs=1e-10)
        assert float(process.autocovariance(k * DT)) == pytest.approx(found, abs=1e-10)


def test_sum_stacks_blocks_and_adds_white_densities_in_squares() -> None:
    process = WhiteNoise(3.0) + RateRamp(1.0) + GaussMarkov(1.0, 5.0) + WhiteNoise(4.0)
    space = process.state_space(0.1)
    assert space.white_density == pytest.approx(5.0)
    assert space.names == ("ramp", "ramp slope", "Gauss-Markov")
    assert space.blocks == (slice(0, 2), slice(2, 3))
    np.testing.assert_allclose(space.output, [1.0, 0.0, 1.0])


def test_sum_is_flat_and_names_its_parts() -> None:
    total = (WhiteNoise(1.0) + GaussMarkov(1.0, 2.0)) + ProcessSum((GaussMarkov(3.0, 4.0),))
    assert total.names == ("white_noise", "gauss_markov_1", "gauss_markov_2")
    assert total.parameters["gauss_markov_2.correlation_time"] == 4.0
    assert pickle.loads(pickle.dumps(total)) == total


@pytest.mark.parametrize(
    "process",
    [
        WhiteNoise(7.5e-4) + GaussMarkov(1.4e-3, 4.6),
        WhiteNoise(7.5e-4) + GaussMarkov(1.4e-3, 4.6) + RandomWalk(7.7e-4),
        WhiteNoise(1.0) + BiasInstability(2.0, 0.1, 100.0),
        WhiteNoise(0.3) + RandomWalk(5.0),
    ],
)
def test_innovation_variance_is_that_of_the_steady_kalman_filter(process: Process) -> None:
    space = process.state_space(0.01)
    white = space.white_density**2 / 0.01
    covariance = solve_discrete_are(
        space.transition.T, space.output[:, None], space.noise_covariance, np.array([[white]])
    )
    steady = float(space.output @ covariance @ space.output) + white
    assert process.innovation_variance(0.01) == pytest.approx(steady, rel=1e-9)


@pytest.mark.parametrize(
    "process",
    [
        WhiteNoise(2.0),
        GaussMarkov(1.0, 1e5),
        GaussMarkov(1.0, 0.02),
        RandomWalk(3.0),
        Quantization(0.2),
    ],
    ids=lambda p: p.kind,
)
def test_closed_innovation_variances_agree_with_the_spectral_floor(process: Process) -> None:
    floor = kolmogorov_szego(process.sampled_psd, 0.01)
    assert process.innovation_variance(0.01) == pytest.approx(floor, rel=1e-9)


def test_lines_add_nothing_to_the_innovation() -> None:
    alone = WhiteNoise(0.2) + GaussMarkov(1.0, 3.0)
    more = alone + TurnOnBias(9.0) + Sinusoid(4.0, 0.3) + RateRamp(2.0)
    assert more.innovation_variance(0.1) == alone.innovation_variance(0.1)
    assert TurnOnBias(3.0).innovation_variance(0.1) == 0.0
    assert (TurnOnBias(3.0) + RateRamp(1.0)).innovation_variance(0.1) == 0.0


def test_simulation_starts_and_stays_stationary() -> None:
    process, runs = GaussMarkov(0.8, 50.0), 3000
    rng = np.random.default_rng(5)
    draws = np.array([process.simulate(40, 1.0, rng)[[0, 39]] for _ in range(runs)])
    band = 4.0 * math.sqrt(2.0 / runs)
    np.testing.assert_allclose(draws.var(axis=0) / 0.64, 1.0, atol=band)
    correlation = np.mean(draws[:, 0] * draws[:, 1]) / 0.64
    assert correlation == pytest.approx(math.exp(-39 / 50), abs=4.0 * math.sqrt(2.0 / runs))


def test_random_walk_grows_as_its_density_says() -> None:
    process, runs, dt = RandomWalk(0.3, initial_sd=2.0), 3000, 0.25
    rng = np.random.default_rng(6)
    draws = np.array([process.simulate(101, dt, rng)[[0, 100]] for _ in range(runs)])
    band = 4.0 * math.sqrt(2.0 / runs)
    expected = np.array([4.0, 4.0 + 0.09 * 100 * dt])
    np.testing.assert_allclose(draws.var(axis=0) / expected, 1.0, atol=band)


def test_white_noise_samples_have_density_squared_over_dt() -> None:
    draws = WhiteNoise(0.3).simulate(100_000, 0.01, np.random.default_rng(7))
    assert draws.var() == pytest.approx(0.09 / 0.01, rel=4.0 * math.sqrt(2.0 / 1e5))


def test_parts_of_a_sum_are_drawn_independently_of_each_other() -> None:
    one = WhiteNoise(1.0) + GaussMarkov(1.0, 5.0)
    two = WhiteNoise(1.0) + GaussMarkov(0.0, 5.0)
    a = one.simulate(50, 0.1, np.random.default_rng(8))
    b = two.simulate(50, 0.1, np.random.default_rng(8))
    white = WhiteNoise(1.0).simulate(50, 0.1, np.random.default_rng(8).spawn(2)[0])
    np.testing.assert_array_equal(b, white)
    assert np.abs(a - b).max() > 0.1
