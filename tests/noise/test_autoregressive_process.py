"""Autoregressive noise: every answer about it is the same process."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from schuler.curves.allan import allan_deviation
from schuler.errors import ModelError
from schuler.noise import ARMA, GaussMarkov, WhiteNoise
from schuler.noise.autoregressive import Autoregressive
from schuler.noise.innovation import kolmogorov_szego
from schuler.noise.lattice import levinson, step_down, step_up

DT = 0.02
PROCESSES = {
    "one": Autoregressive((-0.9,), 0.3, DT),
    "slow": Autoregressive(tuple(np.poly([0.995, 0.98, 0.6])[1:].tolist()), 2.0, DT),
    "resonant": Autoregressive(
        tuple(np.poly([0.97 * np.exp(0.7j), 0.97 * np.exp(-0.7j), -0.5])[1:].real.tolist()), 1.5, DT
    ),
}


@pytest.fixture(params=list(PROCESSES))
def process(request: pytest.FixtureRequest) -> Autoregressive:
    return PROCESSES[request.param]


@pytest.mark.parametrize("multiple", [1, 3])
def test_states_are_stationary_and_carry_the_autocovariance(
    process: Autoregressive, multiple: int
) -> None:
    space = process.state_space(multiple * DT)
    stationary = solve_discrete_lyapunov(space.transition, space.noise_covariance)
    np.testing.assert_allclose(stationary, space.initial_covariance, rtol=1e-7)
    for k in (0, 1, 7):
        power = np.linalg.matrix_power(space.transition, k)
        found = float(space.output @ power @ space.initial_covariance @ space.output)
        assert found == pytest.approx(float(process.autocovariance(k * multiple * DT)), rel=1e-9)


def test_companion_is_the_recursion_with_the_newest_sample_as_output() -> None:
    process = PROCESSES["resonant"]
    space = process.state_space(DT)
    past = np.array([0.3, -1.0, 2.0])
    a = np.array(process.coefficients)
    after = space.transition @ past
    np.testing.assert_allclose(after[:2], past[1:])
    assert after[2] == pytest.approx(-(a[0] * 2.0 + a[1] * -1.0 + a[2] * 0.3))
    assert float(space.output @ after) == after[2]
    noise = np.zeros((3, 3))
    noise[2, 2] = process.driving_variance
    np.testing.assert_array_equal(space.noise_covariance, noise)
    assert space.drift is None
    assert space.blocks == (slice(0, 3),)


def test_first_order_is_sampled_gauss_markov_noise() -> None:
    twin = GaussMarkov(0.7, 3.0)
    phi = math.exp(-DT / 3.0)
    process = Autoregressive((-phi,), 0.49 * -math.expm1(-2.0 * DT / 3.0), DT)
    lags = DT * np.arange(50)
    np.testing.assert_allclose(process.autocovariance(lags), twin.autocovariance(lags), rtol=1e-10)
    cycles = np.linspace(0.0, 0.5, 9)
    for multiple in (1, 4):
        np.testing.assert_allclose(
            process.sampled_psd(cycles, multiple * DT),
            twin.sampled_psd(cycles, multiple * DT),
            rtol=1e-9,
        )
        assert process.innovation_variance(multiple * DT) == pytest.approx(
            twin.innovation_variance(multiple * DT), rel=1e-10
        )


def test_allan_variance_is_that_of_sums_of_samples(process: Autoregressive) -> None:
    for m in (1, 2, 17, 300):
        weights = np.concatenate([-np.ones(m), np.ones(m)])
        lags = np.abs(np.subtract.outer(np.arange(2 * m), np.arange(2 * m)))
        covariance = process.autocovariance(DT * np.arange(2 * m))[lags]
        exact = float(weights @ covariance @ weights) / (2.0 * m**2)
        assert float(process.allan_variance(m * DT)) == pytest.approx(exact, rel=1e-9)


def test_long_allan_variances_go_on_where_short_ones_end(process: Autoregressive) -> None:
    # at 8192 samples the sum of lags gives way to powers of the companion
    tau = DT * np.array([4090.0, 4096.0, 4100.0, 8190.0, 8200.0])
    curve = process.allan_variance(tau) * tau
    assert np.abs(np.diff(curve) / np.diff(tau)).max() < 2e-3 * curve.max()
    far = float(process.allan_variance(1e5)) * 1e5
    # white at long times, with the density at zero frequency
    assert far == pytest.approx(float(process.psd(0.0, onesided=False)), rel=2e-3)


def test_allan_variance_of_a_simulation(process: Autoregressive) -> None:
    curve = allan_deviation(
        process.simulate(200_000, DT, np.random.default_rng(3)), 1.0 / DT, taus=[DT, 10 * DT, 1.0]
    )
    model = np.sqrt(process.allan_variance(curve.tau))
    width = curve.upper - curve.lower
    assert (np.abs(curve.deviation - model) < 1.5 * width).all()


def test_spectrum_of_a_simulation_is_the_closed_form() -> None:
    # S003 (1)-(5): the mean of many periodogram ordinates over the density, to 1 %
    process = Autoregressive((-1.2, 0.6), 2.0, DT)
    signal = process.simulate(2**18, DT, np.random.default_rng(4))
    f = np.fft.rfftfreq(signal.size, DT)[1:-1]
    ratio = (
        np.abs(np.fft.rfft(signal)[1:-1]) ** 2 * DT / signal.size / process.psd(f, onesided=False)
    )
    parts = [p.mean() for p in np.array_split(ratio, 4)]
    np.testing.assert_allclose(parts, 1.0, atol=5.0 / math.sqrt(ratio.size / 4))
    assert ratio.mean() == pytest.approx(1.0, abs=0.01)


def test_spectrum_integrates_to_the_variance(process: Autoregressive) -> None:
    f = (np.arange(20_000) + 0.5) / 20_000 * 0.5 / DT
    total = float(process.psd(f, onesided=True).mean()) * 0.5 / DT
    assert total == pytest.approx(float(process.autocovariance(0.0)), rel=1e-6)


def test_innovation_floor_is_the_driving_variance(process: Autoregressive) -> None:
    assert process.innovation_variance(DT) == process.driving_variance
    f = (np.arange(200_000) + 0.5) / 400_000
    floor = math.exp(float(np.log(process.sampled_psd(f, DT)).mean()))
    assert floor == pytest.approx(process.driving_variance, rel=1e-6)
    assert process.innovation_variance(5 * DT) > process.driving_variance


def test_innovation_variance_at_a_multiple_is_the_spectral_floor() -> None:
    process = PROCESSES["slow"]
    found = process.innovation_variance(5 * DT)
    assert found == pytest.approx(kolmogorov_szego(process.sampled_psd, 5 * DT), rel=1e-8)


def test_simulation_starts_stationary_and_decimates() -> None:
    process, runs = PROCESSES["slow"], 3000
    rng = np.random.default_rng(5)
    draws = np.array([process.simulate(6, 2 * DT, rng) for _ in range(runs)])
    r = process.autocovariance(2 * DT * np.arange(6))
    band = 4.0 * math.sqrt(2.0 / runs)
    np.testing.assert_allclose(draws.var(axis=0) / r[0], 1.0, atol=band)
    # differences see the short times, where a wrong start or step would show
    steps = np.diff(draws, axis=1).var(axis=0) / (2.0 * (r[0] - r[1]))
    np.testing.assert_allclose(steps, 1.0, atol=band)


def test_same_seed_gives_the_recursion() -> None:
    process = PROCESSES["resonant"]
    signal = process.simulate(500, DT, np.random.default_rng(6))
    driven = signal[3:].copy()
    for k, a in enumerate(process.coefficients, 1):
        driven += a * signal[3 - k : signal.size - k]
    np.testing.assert_allclose(
        driven, math.sqrt(1.5) * np.random.default_rng(6).standard_normal(500)[3:], atol=1e-12
    )


def test_sum_with_white_noise() -> None:
    total = WhiteNoise(0.3) + PROCESSES["one"]
    space = total.state_space(DT)
    assert space.size == 1
    assert space.white_density == 0.3
    assert float(total.allan_variance(DT)) == pytest.approx(
        0.09 / DT + float(PROCESSES["one"].allan_variance(DT))
    )


@pytest.mark.parametrize("dt", [0.03, 0.01, 0.9999 * DT])
def test_another_step_is_refused(process: Autoregressive, dt: float) -> None:
    with pytest.raises(ModelError, match="fit the process again"):
        process.state_space(dt)
    with pytest.raises(ModelError, match="fit the process again"):
        process.simulate(3, dt, np.random.default_rng(0))


def test_unstable_coefficients_are_refused() -> None:
    # S004 Table 2, accelerometer X as printed (E-004-10): a pole at 1.044
    with pytest.raises(ModelError, match=r"pole of modulus 1\.04"):
        Autoregressive((-2.582, 2.166, -0.585), 4.973e-13, 0.01)
    with pytest.raises(ModelError, match="inside the unit circle"):
        Autoregressive((-1.0,), 1.0, 0.01)
    with pytest.raises(ModelError, match="order zero"):
        Autoregressive((), 1.0, 0.01)


def test_step_down_undoes_step_up_and_levinson_undoes_the_autocovariance() -> None:
    gamma = np.array([-0.99, 0.7, -0.3, 0.95, 0.1])
    np.testing.assert_allclose(step_down(step_up(gamma)[-1]), gamma, rtol=1e-9)
    process = Autoregressive(tuple(step_up(gamma)[-1].tolist()), 0.4, 1.0)
    again, error = levinson(process.autocovariance(np.arange(6.0)))
    np.testing.assert_allclose(again, gamma, rtol=1e-8)
    assert error[-1] == pytest.approx(0.4, rel=1e-8)


def test_autocovariance_dies_away_as_its_slowest_pole_does_and_not_before() -> None:
    both = (
        Autoregressive(tuple(np.poly([0.99, 0.3])[1:].tolist()), 2.0, DT),
        ARMA((0.99 + 0.3, -0.99 * 0.3), (0.4, 0.2, 0.1), 1.0, DT),
    )
    for process in both:
        covariance = process.autocovariance(np.arange(200_000) * DT)
        lag = np.arange(100, 6500)
        fading = covariance[100] * 0.99 ** (lag - 100.0)
        assert covariance[lag] == pytest.approx(fading, rel=1e-9, abs=0.0)
        # no numbers near the smallest there are, which every sum would pay for
        rest = np.abs(covariance[covariance != 0.0])
        assert rest.min() > 1e-40
