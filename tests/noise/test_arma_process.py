"""ARMA processes against closed forms, and their exact change to Gauss-Markov sums (spec 5.1)."""

from __future__ import annotations

import math

import numpy as np
import pytest

from schuler.curves.allan import allan_deviation
from schuler.errors import ModelError
from schuler.noise import GaussMarkov, Process, RandomWalk, WhiteNoise
from schuler.noise.arma import ARMA
from schuler.noise.arma_exchange import arma_to_gauss_markov_sum, gauss_markov_sum_to_arma
from schuler.noise.innovation import kolmogorov_szego

DT = 0.01
TABLE_1 = ARMA((1.666, -0.671), (-1.086, 0.160), 1.0, DT)
EXAMPLES = [
    TABLE_1,
    ARMA((0.7,), (), 2.0, DT),
    ARMA((), (0.6, -0.2), 0.5, DT),
    ARMA((1.2, -0.8), (0.4, 0.3, 0.2), 1.5, DT),
    ARMA((0.3, 0.2, 0.1, -0.2), (0.5,), 1.0, DT),
    ARMA((), (), 3.0, DT),
]


def impulse_response(process: ARMA, count: int) -> np.ndarray:
    """Weights of the present and past innovations, by the definition."""
    psi = np.zeros(count)
    for k in range(count):
        psi[k] = 1.0 if k == 0 else 0.0
        if 1 <= k <= len(process.theta):
            psi[k] += process.theta[k - 1]
        for i, phi in enumerate(process.phi, 1):
            if k >= i:
                psi[k] += phi * psi[k - i]
    return psi


def test_table_1_of_waegli2010_is_white_noise_and_two_gauss_markovs() -> None:
    white, slow, fast = arma_to_gauss_markov_sum(TABLE_1).parts
    assert isinstance(white, WhiteNoise)
    assert isinstance(slow, GaussMarkov)
    assert isinstance(fast, GaussMarkov)
    # half a unit of the last printed digit
    assert white.density**2 / DT == pytest.approx(0.238, abs=5e-4)
    assert slow.sigma**2 == pytest.approx(1.69, abs=5e-3)
    assert fast.sigma**2 == pytest.approx(1.06, abs=5e-3)
    assert slow.correlation_time == pytest.approx(0.63, abs=5e-3)
    assert fast.correlation_time == pytest.approx(0.026, abs=5e-4)
    np.testing.assert_allclose(TABLE_1.poles.real, [0.98429, 0.68171], atol=5e-6)
    np.testing.assert_allclose(TABLE_1.zeros.real, [0.910, 0.176], atol=5e-4)


def test_rounded_coefficients_of_the_text_are_a_random_walk_and_refused() -> None:
    # E-000-10: 1.67 and -0.67 sum up to one
    with pytest.raises(ModelError, match="pole of modulus 1"):
        ARMA((1.67, -0.67), (-1.09, 0.16), 1.0, DT)


@pytest.mark.parametrize("seed", range(8))
def test_change_to_gauss_markovs_and_back_to_1e_10(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = 1 + seed % 4
    times = 0.02 * 4.0 ** np.arange(count) * rng.uniform(0.8, 1.2, count)
    process: Process = WhiteNoise(rng.uniform(0.01, 0.1)) if seed < 4 else WhiteNoise(0.0)
    for time in times:
        process = process + GaussMarkov(rng.uniform(0.5, 2.0), time)
    arma = gauss_markov_sum_to_arma(process, DT)
    assert (len(arma.phi), len(arma.theta)) == (count, count if seed < 4 else count - 1)
    assert np.all(np.abs(arma.zeros) < 1.0)
    again = gauss_markov_sum_to_arma(arma_to_gauss_markov_sum(arma), DT)
    np.testing.assert_allclose(again.phi, arma.phi, rtol=1e-10)
    np.testing.assert_allclose(again.theta, arma.theta, rtol=1e-10, atol=1e-12)
    assert again.driving_variance == pytest.approx(arma.driving_variance, rel=1e-10)
    # the same samples: autocovariance, spectrum and prediction floor
    markovs = [p for p in process.components if isinstance(p, GaussMarkov)]
    lags = np.arange(1, 60) * DT
    expected = sum(g.autocovariance(lags) for g in markovs)
    # what the rounding of the coefficients allows: the gain at zero frequency is 1/prod(1 - pole)
    digits = 1e-10 + 1e-16 / float(np.prod(1.0 - arma.poles.real)) ** 2
    np.testing.assert_allclose(arma.autocovariance(lags), expected, rtol=digits)
    density = process.components[0].parameters["density"] if seed < 4 else 0.0
    variance = sum(g.sigma**2 for g in markovs) + density**2 / DT
    assert arma.autocovariance(0.0) == pytest.approx(variance, rel=digits)
    assert arma.innovation_variance(DT) == pytest.approx(process.innovation_variance(DT), rel=1e-8)


def test_table_1_survives_the_round_trip() -> None:
    again = gauss_markov_sum_to_arma(arma_to_gauss_markov_sum(TABLE_1), DT)
    np.testing.assert_allclose(again.phi, TABLE_1.phi, rtol=1e-10)
    np.testing.assert_allclose(again.theta, TABLE_1.theta, rtol=1e-10)
    assert again.driving_variance == pytest.approx(1.0, rel=1e-10)


def test_slow_gyro_bias_under_white_noise_keeps_its_parts() -> None:
    # correlation time of 60 000 samples, 1 % of the white variance
    process = WhiteNoise(1e-3) + GaussMarkov(1e-3, 600.0)
    back = arma_to_gauss_markov_sum(gauss_markov_sum_to_arma(process, DT))
    white, slow = back.parts
    assert white.parameters["density"] == pytest.approx(1e-3, rel=1e-8)
    assert slow.parameters["sigma"] == pytest.approx(1e-3, rel=1e-6)
    assert slow.parameters["correlation_time"] == pytest.approx(600.0, rel=1e-6)


@pytest.mark.parametrize(
    ("arma", "words"),
    [
        (ARMA((1.5, -0.8), (), 1.0, DT), "complex poles 0.75"),
        (ARMA((-0.5,), (0.1,), 1.0, DT), "pole -0.5"),
        (ARMA((0.5,), (0.3,), 1.0, DT), "white part"),
        (ARMA((0.9, -0.18), (0.5,), 1.0, DT), "pole 0.3 would have the variance -"),
        (ARMA((0.5,), (0.3, 0.1), 1.0, DT), r"ARMA\(1, 2\)"),
        (ARMA((1.0, -0.25), (), 1.0, DT), "(double|complex) pole"),
    ],
)
def test_no_gauss_markov_sum_names_the_offender(arma: ARMA, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        arma_to_gauss_markov_sum(arma)


def test_random_walk_has_no_arma_form() -> None:
    with pytest.raises(ModelError, match="random_walk"):
        gauss_markov_sum_to_arma(WhiteNoise(1.0) + RandomWalk(1.0), DT)
    with pytest.raises(ModelError, match="variance zero"):
        gauss_markov_sum_to_arma(WhiteNoise(0.0), DT)


@pytest.mark.parametrize("arma", EXAMPLES, ids=lambda a: f"{len(a.phi)},{len(a.theta)}")
def test_second_moments_follow_from_the_impulse_response(arma: ARMA) -> None:
    psi = impulse_response(arma, 4000)
    lags = np.arange(30)
    expected = arma.driving_variance * np.array([psi[k:] @ psi[: psi.size - k] for k in lags])
    found = arma.autocovariance(lags * DT)
    np.testing.assert_allclose(found, expected, atol=1e-10 * expected[0])
    # Allan variance: mean square of (second mean - first mean)/sqrt 2 as a quadratic form
    for m in (1, 2, 7, 15):
        weights = np.concatenate([-np.ones(m), np.ones(m)]) / m
        toeplitz = arma.autocovariance(np.abs(np.subtract.outer(range(2 * m), range(2 * m))) * DT)
        assert arma.allan_variance(m * DT) == pytest.approx(
            0.5 * weights @ toeplitz @ weights, rel=1e-9
        )
    # spectrum: its integral is the variance, its transform the autocovariance
    cycles = (np.arange(4096) + 0.5) / 4096
    density = arma.sampled_psd(np.minimum(cycles, 1.0 - cycles), DT)
    for k in (0, 1, 5):
        moment = float(np.mean(density * np.cos(2.0 * np.pi * k * cycles)))
        assert moment == pytest.approx(expected[k], abs=1e-9 * expected[0])
    onesided = arma.psd(np.array([10.0]), onesided=True)
    np.testing.assert_allclose(onesided, 2.0 * DT * arma.sampled_psd(0.1, DT))


@pytest.mark.parametrize("arma", EXAMPLES, ids=lambda a: f"{len(a.phi)},{len(a.theta)}")
def test_state_space_is_stationary_and_is_the_same_process(arma: ARMA) -> None:
    space = arma.state_space(DT)
    after = space.transition @ space.initial_covariance @ space.transition.T
    np.testing.assert_allclose(
        after + space.noise_covariance, space.initial_covariance, atol=1e-9 * after.max() + 1e-12
    )
    propagated = space.initial_covariance @ space.output
    for k in range(12):
        lag = float(arma.autocovariance(k * DT))
        assert space.output @ propagated == pytest.approx(lag, abs=1e-9 * (1.0 + abs(lag)))
        propagated = space.transition @ propagated
    assert space.white_density == 0.0


def test_long_clusters_see_white_noise_and_the_sum_sees_the_same() -> None:
    tau = 1000.0
    # far beyond all memory: N² = S(0) dt at zero frequency
    level = float(TABLE_1.sampled_psd(0.0, DT)) * DT
    assert TABLE_1.allan_variance(tau) == pytest.approx(level / tau, rel=2e-3)


def test_prediction_floor() -> None:
    assert kolmogorov_szego(TABLE_1.sampled_psd, DT) == pytest.approx(1.0, rel=1e-8)
    # a zero outside the circle is worth its mirror: variance times its square
    outside = ARMA((0.5,), (-2.0,), 1.0, DT)
    assert outside.innovation_variance(DT) == pytest.approx(4.0)
    assert kolmogorov_szego(outside.sampled_psd, DT) == pytest.approx(4.0, rel=1e-8)


def test_simulation_is_stationary_from_the_first_sample() -> None:
    rng = np.random.default_rng(11)
    count = 4000
    draws = np.array([TABLE_1.simulate(6, DT, rng) for _ in range(count)])
    expected = TABLE_1.autocovariance(np.arange(6) * DT)
    for k in range(6):
        product = draws[:, 0] * draws[:, k]
        spread = math.sqrt((expected[0] ** 2 + expected[k] ** 2) / count)
        assert abs(product.mean() - expected[k]) < 4.0 * spread
        assert abs((draws[:, k] ** 2).mean() - expected[0]) < 4.0 * expected[0] * math.sqrt(
            2.0 / count
        )


def test_long_simulation_has_the_allan_deviation_of_the_model() -> None:
    signal = TABLE_1.simulate(200_000, DT, np.random.default_rng(3))
    tau = np.array([1, 4, 20, 100, 500]) * DT
    curve = allan_deviation(signal, 1.0 / DT, tau)
    expected = np.sqrt(TABLE_1.allan_variance(tau))
    # 99.99 % of the chi-square spread of the independent clusters there are
    clusters = 200_000 / (tau / DT) / 2.0
    assert np.all(np.abs(curve.deviation / expected - 1.0) < 4.0 / np.sqrt(2.0 * clusters))


def test_driven_from_rest_by_a_unit_pulse_gives_the_impulse_response() -> None:
    pulse = np.zeros(50)
    pulse[0] = 1.0
    for arma in EXAMPLES:
        np.testing.assert_allclose(arma.respond_to(pulse), impulse_response(arma, 50), atol=1e-12)


def test_another_sample_interval_is_refused() -> None:
    for ask in (
        lambda: TABLE_1.state_space(0.02),
        lambda: TABLE_1.simulate(10, 0.005, np.random.default_rng(0)),
        lambda: TABLE_1.innovation_variance(0.02),
        lambda: TABLE_1.sampled_psd(0.1, 1.0),
        lambda: TABLE_1.allan_variance(0.015),
        lambda: TABLE_1.autocovariance(0.001),
    ):
        with pytest.raises(ModelError, match="interval"):
            ask()


def test_impossible_parameters() -> None:
    with pytest.raises(ModelError, match="modulus"):
        ARMA((1.01,), (), 1.0, DT)
    with pytest.raises(ModelError, match="innovation variance"):
        ARMA((0.5,), (), -1.0, DT)
    with pytest.raises(ModelError, match="phi"):
        ARMA((math.nan,), (), 1.0, DT)
    with pytest.raises(ModelError, match="interval"):
        ARMA((0.5,), (), 1.0, 0.0)


def test_sum_with_other_processes() -> None:
    total = TABLE_1 + WhiteNoise(0.1)
    assert total.state_space(DT).size == 3
    tau = np.array([0.05, 0.5])
    np.testing.assert_allclose(
        total.allan_variance(tau), TABLE_1.allan_variance(tau) + 0.01 / tau, rtol=1e-12
    )
    assert total.parameters["arma.phi_1"] == 1.666
