"""Closed forms against each other, against their integrals and against simulation."""

from __future__ import annotations

import math
from decimal import Decimal, getcontext

import numpy as np
import pytest

from schuler.curves.allan import allan_deviation
from schuler.errors import ModelError
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    Quantization,
    RandomWalk,
    RateRamp,
    Sinusoid,
    TurnOnBias,
    WhiteNoise,
)
from schuler.noise.gauss_markov import (
    ALLAN_PEAK_HEIGHT,
    ALLAN_PEAK_POSITION,
    gauss_markov_allan_shape,
)

NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)


def allan_from_psd(process: Process, tau: float) -> float:
    """Spec (14): 4 int_0^inf S(f) sin^4(pi f T)/(pi f T)^2 df, two-sided S, by panels in f T."""
    low = np.concatenate([np.geomspace(1e-9, 0.25, 120), np.arange(0.5, 4000.0, 0.25)])
    half = 0.5 * np.diff(low)
    x = (low[:-1] + half)[:, None] + half[:, None] * NODES
    shape = np.sin(np.pi * x) ** 4 / (np.pi * x) ** 2
    density = process.psd(x / tau, onesided=False)
    return float(4.0 / tau * np.sum(half[:, None] * WEIGHTS * density * shape))


@pytest.mark.parametrize(
    ("process", "tail"),
    [
        # beyond f T = 4000 the integrand of white noise is 3/(8 pi² x²): 1e-4 of the whole
        (WhiteNoise(0.7), 2e-4),
        (GaussMarkov(0.3, 7.0), 2e-4),
        (RandomWalk(0.02), 1e-6),
        (BiasInstability(0.4, 0.1, 1000.0, 2), 2e-4),
    ],
)
@pytest.mark.parametrize("tau", [0.5, 13.0, 400.0])
def test_allan_variance_is_the_integral_of_the_spectrum(
    process: Process, tail: float, tau: float
) -> None:
    assert allan_from_psd(process, tau) == pytest.approx(
        float(process.allan_variance(tau)), rel=tail
    )


def test_gauss_markov_shape_has_full_precision_where_its_bracket_cancels() -> None:
    getcontext().prec = 60
    for x in (1e-9, 1e-4, 0.03, 0.0999, 0.1, 0.2, 1.5, 30.0, 1e7):
        d = Decimal(x)
        exact = 2 / d * (1 - (3 - 4 * (-d).exp() + (-2 * d).exp()) / (2 * d))
        assert float(gauss_markov_allan_shape(x)) == pytest.approx(float(exact), rel=1e-12)


def test_gauss_markov_peak_is_where_the_constants_say() -> None:
    x = np.linspace(1.85, 1.95, 100_001)
    shape = gauss_markov_allan_shape(x)
    assert x[np.argmax(shape)] == pytest.approx(ALLAN_PEAK_POSITION, abs=2e-6)
    assert math.sqrt(shape.max()) == pytest.approx(ALLAN_PEAK_HEIGHT, rel=1e-6)
    assert pytest.approx(1.89262, abs=5e-6) == ALLAN_PEAK_POSITION


def test_one_gauss_markov_through_a_plateau_peaks_at_its_level() -> None:
    level, centre = 2.5e-3, 40.0
    process = GaussMarkov.through_plateau(level, centre)
    tau = np.linspace(20.0, 80.0, 6001)
    deviation = np.sqrt(process.allan_variance(tau))
    assert deviation.max() == pytest.approx(0.66428 * level, rel=1e-4)
    assert tau[np.argmax(deviation)] == pytest.approx(centre, abs=0.05)


@pytest.mark.parametrize(("per_decade", "low", "high"), [(1, 0.9896, 1.0097), (2, 0.9962, 0.9999)])
def test_flicker_is_flat_within_the_bounds_of_the_specification(
    per_decade: int, low: float, high: float
) -> None:
    process = BiasInstability(1.0, 1e-2, 1e5, per_decade)
    ratio = np.sqrt(process.allan_variance(np.geomspace(1.0, 1e3, 400))) / 0.6642825
    # printed to four digits
    assert ratio.min() == pytest.approx(low, abs=1.5e-4)
    assert ratio.max() == pytest.approx(high, abs=1.5e-4)


def test_flicker_spectrum_inside_its_band() -> None:
    level, f = 0.3, np.geomspace(1e-3, 0.1, 50)
    density = BiasInstability(level, 1e-2, 1e6, 2).psd(f, onesided=False)
    np.testing.assert_allclose(density, level**2 / (2 * np.pi * f), rtol=0.02)


def test_autocovariance_is_the_transform_of_the_spectrum() -> None:
    process = GaussMarkov(0.5, 2.0) + BiasInstability(0.2, 0.5, 50.0)
    f = np.linspace(0.0, 500.0, 2_000_001)
    density = process.psd(f, onesided=True)
    for lag in (0.0, 1.0, 10.0):
        integral = np.trapezoid(density * np.cos(2 * np.pi * f * lag), f)
        # what lies beyond 500 Hz: about 2 sigma² /(pi² Tc 500)
        assert float(process.autocovariance(lag)) == pytest.approx(integral, abs=3e-4)


@pytest.mark.parametrize(
    "process", [WhiteNoise(1.0), GaussMarkov(1.0, 3.0), RandomWalk(1.0), Quantization(1.0, 0.01)]
)
def test_one_sided_spectrum_is_twice_the_two_sided(process: Process) -> None:
    f = np.array([0.01, 1.0, 20.0])
    np.testing.assert_allclose(
        process.psd(f, onesided=True), 2.0 * process.psd(f, onesided=False), rtol=1e-15
    )


@pytest.mark.parametrize(
    "process",
    [WhiteNoise(2.0), GaussMarkov(1.0, 0.3), RandomWalk(0.5), BiasInstability(1.0, 1.0, 100.0)],
)
def test_sampled_spectrum_tends_to_the_continuous_one_at_low_frequency(process: Process) -> None:
    dt = 1e-3
    f = np.geomspace(0.02, 2.0, 9)
    np.testing.assert_allclose(
        process.sampled_psd(f * dt, dt) * dt, process.psd(f, onesided=False), rtol=1e-4
    )


def test_wavelet_variance_is_half_the_allan_variance() -> None:
    process = WhiteNoise(2.0) + RandomWalk(0.1)
    assert float(process.wavelet_variance(3.0)) == 0.5 * float(process.allan_variance(3.0))


SIMULATED = [
    WhiteNoise(0.3),
    Quantization(0.05),
    GaussMarkov(0.4, 5.0),
    GaussMarkov(0.4, 300.0),
    RandomWalk(0.05, initial_sd=3.0),
    BiasInstability(0.5, 2.0, 200.0),
    WhiteNoise(0.3) + GaussMarkov(0.4, 20.0) + RandomWalk(0.02) + TurnOnBias(4.0),
]


@pytest.mark.parametrize("process", SIMULATED, ids=lambda p: p.kind)
def test_simulation_has_the_allan_variance_of_the_closed_form(process: Process) -> None:
    dt, n, runs = 0.1, 6000, 80
    factors = np.array([20, 60, 200, 600])
    rng = np.random.default_rng(20)
    signals = np.column_stack([process.simulate(n, dt, rng) for _ in range(runs)])
    found = allan_deviation(signals, 1.0 / dt, factors * dt).deviation ** 2
    expected = process.allan_variance(factors * dt)
    # samples are points in time, the closed form is of means over dt: a part 1/(2 n²)
    slack = 1.0 + 0.5 / factors**2
    error = found.std(axis=1, ddof=1) / math.sqrt(runs)
    assert (np.abs(found.mean(axis=1) / slack - expected) < 4.0 * error).all()
    # the band itself is tight enough to see a factor
    assert (error < 0.12 * expected).all()


def test_deterministic_processes_have_their_closed_form_exactly() -> None:
    rng = np.random.default_rng(1)
    dt, n = 0.01, 20_000
    ramp = RateRamp(-0.3)
    curve = allan_deviation(ramp.simulate(n, dt, rng), 1 / dt, [0.5, 5.0, 50.0])
    np.testing.assert_allclose(curve.deviation**2, ramp.allan_variance(curve.tau), rtol=1e-9)
    wave = Sinusoid(2.0, 0.21, phase=0.4)
    curve = allan_deviation(wave.simulate(n, dt, rng), 1 / dt, [0.5, 1.7, 3.3])
    # the mean over the record of the squared sine is 1/2 up to a part of a period in 200 s
    np.testing.assert_allclose(curve.deviation**2, wave.allan_variance(curve.tau), rtol=0.02)


def test_sinusoid_keeps_its_phase_or_draws_it() -> None:
    fixed = Sinusoid(1.0, 2.0, phase=0.5)
    assert fixed.simulate(1, 0.1, np.random.default_rng(0))[0] == pytest.approx(math.sin(0.5))
    rng = np.random.default_rng(3)
    draws = np.array([Sinusoid(1.0, 2.0).simulate(1, 0.1, rng)[0] for _ in range(2000)])
    assert np.mean(draws**2) == pytest.approx(0.5, abs=4 * math.sqrt(0.125 / 2000))


@pytest.mark.parametrize(
    "make",
    [
        lambda: WhiteNoise(-1.0),
        lambda: WhiteNoise(math.nan),
        lambda: GaussMarkov(1.0, 0.0),
        lambda: GaussMarkov(math.inf, 1.0),
        lambda: RandomWalk(1.0, initial_sd=-1.0),
        lambda: BiasInstability(1.0, 10.0, 1.0),
        lambda: BiasInstability(1.0, 1.0, 10.0, 0),
        lambda: Sinusoid(1.0, -2.0),
        lambda: RateRamp(math.nan),
        lambda: WhiteNoise(1.0).allan_variance([1.0, 0.0]),
        lambda: WhiteNoise(1.0).autocovariance(0.0),
        lambda: (WhiteNoise(1.0) + RandomWalk(1.0)).autocovariance(0.0),
        lambda: Quantization(1.0).psd(1.0, onesided=True),
        lambda: WhiteNoise(1.0).simulate(-1, 0.1, np.random.default_rng(0)),
        lambda: WhiteNoise(1.0).simulate(5, 0.0, np.random.default_rng(0)),
    ],
)
def test_what_cannot_be_is_refused(make: object) -> None:
    with pytest.raises(ModelError):
        make()  # type: ignore[operator]


def test_gauss_markov_faster_than_the_samples_warns() -> None:
    with pytest.warns(UserWarning, match="white noise"):
        GaussMarkov(1.0, 0.01).simulate(10, 0.1, np.random.default_rng(0))


@pytest.mark.parametrize("process", [*SIMULATED, RateRamp(1.0), Sinusoid(1.0, 1.0)])
def test_no_samples_is_an_empty_array(process: Process) -> None:
    assert process.simulate(0, 0.1, np.random.default_rng(0)).shape == (0,)


@pytest.mark.parametrize("step", [1e-4, 0.009, 0.011, 0.3, 4.0, 600.0])
def test_sampled_gauss_markov_in_clusters_is_what_its_covariance_says(step: float) -> None:
    for m in (1, 2, 7, 60):
        lag = np.abs(np.subtract.outer(np.arange(2 * m), np.arange(2 * m)))
        sign = np.repeat([-1.0, 1.0], m) / m
        exact = 0.5 * sign @ np.exp(-step * lag) @ sign
        found = GaussMarkov(1.0, 0.01 / step).sampled_allan_variance(np.array([m]), 0.01)
        assert float(found[0]) == pytest.approx(float(exact), rel=1e-9, abs=1e-14)
