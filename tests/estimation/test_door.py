"""One door: every method answers in the same words, rightly, or says why it cannot."""

from __future__ import annotations

import functools
import json
import math

import numpy as np
import pytest

from schuler.errors import EstimationError, InputError
from schuler.estimation.comparison.curves import correlation_points
from schuler.estimation.comparison.methods import MethodComparison, compare_methods
from schuler.estimation.comparison.parameters import combined_difference
from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.estimation.identification import Identification
from schuler.estimation.identify import METHODS, identify
from schuler.estimation.residuals.diagnostics import diagnose_residuals, process_residuals
from schuler.estimation.result import MethodIdentification, MethodResult
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    ProcessSum,
    Quantization,
    RandomWalk,
    WhiteNoise,
)
from schuler.noise.arma import ARMA
from schuler.noise.autoregressive import Autoregressive
from schuler.noise.expected_correlation import expected_autocovariance

RATE = 50.0
N, SIGMA, TIME = 2e-3, 3e-3, 1.5
TRUTH = WhiteNoise(N) + GaussMarkov(SIGMA, TIME)
FIT_A_SUM = ("allan", "psd", "autocorrelation", "gmwm", "gmwm-robust", "ml")


@functools.cache
def record() -> np.ndarray:
    return TRUTH.simulate(30_000, 1.0 / RATE, np.random.default_rng(7)) + 0.3


@functools.cache
def answer(method: str) -> Identification | MethodIdentification:
    return identify(record(), RATE, method=method)


@pytest.mark.parametrize("method", METHODS)
def test_every_result_answers_the_same_questions(method: str) -> None:
    found = answer(method)
    assert isinstance(found, MethodResult)
    assert found.method == method
    assert found.parameters
    assert set(found.standard_errors) <= set(found.parameters)
    assert all(math.isfinite(v) for v in found.parameters.values())
    assert json.loads(json.dumps(found.to_dict(), allow_nan=False))["parameters"]


@pytest.mark.parametrize("method", FIT_A_SUM)
def test_methods_that_fit_sums_find_the_truth_within_their_errors(method: str) -> None:
    found = answer(method)
    truth = {
        "white_noise.density": N,
        "gauss_markov.sigma": SIGMA,
        "gauss_markov.correlation_time": TIME,
    }
    assert set(found.parameters) == set(truth)
    for key, value in truth.items():
        error = found.standard_errors[key]
        assert abs(found.parameters[key] - value) < 4.0 * error, key
        # an error that is too large would excuse everything: 600 s hold 400 correlation times
        assert error < (0.03 if key == "white_noise.density" else 0.3) * value, key


@pytest.mark.parametrize("method", [*FIT_A_SUM, "ar", "ar-covariance", "arma", "fos"])
def test_the_process_of_every_method_has_the_allan_deviation_of_the_truth(method: str) -> None:
    process = answer(method).process
    assert process is not None
    # predictors of 10 lags (FOS) describe clusters of up to 5 samples, known to 0.7 %
    tau = np.array([1, 2, 5]) / RATE
    ratio = np.sqrt(process.allan_variance(tau) / TRUTH.allan_variance(tau))
    assert np.abs(ratio - 1.0).max() < 0.03


@pytest.mark.parametrize("method", [*FIT_A_SUM[1:], "arma"])
def test_what_a_right_model_leaves_is_white_and_as_large_as_it_says(method: str) -> None:
    left = answer(method).diagnostics
    assert left.white
    # the innovation variance of 30 000 samples is known to 0.8 %
    assert left.variance == pytest.approx(TRUTH.innovation_variance(1.0 / RATE), rel=0.03)
    assert left.variance == pytest.approx(left.expected_variance, rel=0.03)
    assert left.constant_variance
    assert left.gaussian
    assert "white" in left.verdict


def test_white_noise_alone_does_not_explain_a_correlated_signal() -> None:
    left = diagnose_residuals(process_residuals(record(), WhiteNoise(N), RATE))
    assert left is not None
    assert not left.white
    # variances N²/dt and sigma² are known: the correlation at one sample is their share
    share = SIGMA**2 / (SIGMA**2 + N**2 * RATE)
    lag, value = left.largest_correlation
    assert lag < 30
    # the largest of many neighbours of one size, each known to 0.01, the share itself to 7 %
    assert value == pytest.approx(share * math.exp(-lag / RATE / TIME), abs=0.04)
    assert value > 0.0
    assert "correlated" in left.verdict


def test_residuals_tell_clusters_of_variance_and_tails() -> None:
    rng = np.random.default_rng(4)
    calm = np.where((np.arange(20_000) // 500) % 2 == 0, 1.0, 3.0)
    left = diagnose_residuals(calm * rng.standard_normal(20_000))
    assert left is not None
    assert left.white
    assert not left.constant_variance
    # half at 1, half at 9: kurtosis 3 (1 + 81)/2 / 25
    assert left.kurtosis == pytest.approx(4.92, rel=0.1)
    assert "variance changes" in left.verdict
    assert "heavy tails" in left.verdict


def test_slopes_read_the_line_of_white_noise_and_their_process_is_what_they_read() -> None:
    rng = np.random.default_rng(3)
    found = identify(WhiteNoise(N).simulate(30_000, 0.02, rng), RATE, method="slope")
    assert found.parameters["white_noise.density"] == pytest.approx(N, rel=0.05)
    assert found.process is not None
    assert (
        found.process.parameters["white_noise.density"] == (found.parameters["white_noise.density"])
    )


def test_garch_is_found_where_it_is_and_not_where_it_is_not() -> None:
    calm = answer("garch")
    assert calm.parameters["persistence"] < 0.5
    rng = np.random.default_rng(9)
    e, s, out = rng.standard_normal(30_000), 1.0, np.empty(30_000)
    for k in range(out.size):
        out[k] = math.sqrt(s) * e[k]
        s = 0.05 + 0.10 * out[k] ** 2 + 0.85 * s
    found = identify(out * 1e-4, RATE, method="garch")
    assert isinstance(found, MethodIdentification)
    assert found.converged
    assert found.parameters["alpha_1"] == pytest.approx(0.10, abs=0.03)
    assert found.parameters["persistence"] == pytest.approx(0.95, abs=0.03)
    assert found.diagnostics is not None
    assert found.diagnostics.constant_variance


def test_orders_and_models_are_obeyed() -> None:
    values = record()
    assert "a_3" in identify(values, RATE, method="ar", order=3).parameters
    assert "a_4" not in identify(values, RATE, method="ar", order=3).parameters
    arma = identify(values, RATE, method="arma", order=(1, 1))
    assert {"phi_1", "theta_1"} <= set(arma.parameters)
    assert arma.parameters["phi_1"] == pytest.approx(math.exp(-1.0 / RATE / TIME), abs=0.01)
    like = identify(values, RATE, Autoregressive((0.1, 0.1), 1.0, 0.02), "ar-covariance")
    assert {"a_2"} <= set(like.parameters)
    assert "a_3" not in like.parameters
    both = identify(values, RATE, ARMA((0.5,), (), 1.0, 0.02), "arma")
    assert "theta_1" not in both.parameters
    for method in ("allan", "psd", "gmwm", "ml"):
        only = identify(values, RATE, WhiteNoise(1.0) + RandomWalk(1.0), method)
        assert set(only.parameters) == {"white_noise.density", "random_walk.density"}


def test_products_of_samples_have_no_process_and_say_so() -> None:
    rng = np.random.default_rng(2)
    out = np.zeros(6000)
    noise = rng.standard_normal(out.size)
    for k in range(2, out.size):
        out[k] = 0.4 * out[k - 1] + 0.3 * math.tanh(out[k - 1] * out[k - 2]) + noise[k]
    found = identify(out, RATE, method="fos", order=(3, 2))
    assert isinstance(found, MethodIdentification)
    assert found.process is None
    assert "products" in found.no_process


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"method": "magic"}, "allan, slope, psd, autocorrelation, gmwm"),
        ({"method": "gmwm", "order": 3}, "order"),
        ({"method": "ar", "order": (1, 2)}, "one number"),
        ({"method": "arma", "order": 2}, "two numbers"),
        ({"method": "ar", "model": WhiteNoise(1.0)}, "Autoregressive"),
        ({"method": "slope", "model": "classical"}, "'auto'"),
        ({"method": "psd", "shortest": -1.0}, "above zero"),
        ({"model": "fancy"}, "'auto', 'classical'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        identify(record()[:2000], RATE, **arguments)  # type: ignore[call-overload]
    assert "\n" not in str(caught.value)


BAD = {
    "constant": (np.full(500, 3.0), EstimationError, "does not vary"),
    "too short": (np.random.default_rng(0).standard_normal(60), EstimationError, "60 samples"),
    "NaN": (np.where(np.arange(500) == 7, np.nan, 1.0), InputError, "row 7"),
    "infinite": (np.where(np.arange(500) == 9, -np.inf, 1.0), InputError, "row 9"),
    "table": (np.ones((50, 3)), InputError, "shape"),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", BAD)
def test_bad_signals_are_refused_by_every_method(method: str, case: str) -> None:
    signal, kind, words = BAD[case]
    with pytest.raises(kind, match=words) as caught:
        identify(signal, RATE, method=method)
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="rate"):
        identify(record()[:500], math.nan, method=method)


@pytest.mark.parametrize("method", METHODS)
def test_the_unit_does_not_matter(method: str) -> None:
    part = (record() - 0.3)[:3000] / SIGMA
    small, large = (identify(part * s, RATE, method=method) for s in (1e-12, 1e12))
    assert set(small.parameters) == set(large.parameters)
    for key, value in small.parameters.items():
        # dimension 0, 1 or 2 in the unit of the signal
        power = math.log10(abs(large.parameters[key] / value)) / 24.0 if value else 0.0
        assert power == pytest.approx(round(power), abs=1e-6), key
        if "density" in key or "sigma" in key:
            assert round(power) == 1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", ["ramp", "outlier", "near unit roots"])
def test_wild_signals_give_a_flag_or_an_error_and_never_a_silent_nan(
    method: str, case: str
) -> None:
    rng = np.random.default_rng(5)
    signal = rng.standard_normal(1500)
    if case == "ramp":
        signal = np.arange(1500.0)
    elif case == "outlier":
        signal[700] = 1e4
    else:
        for k in range(2, signal.size):
            signal[k] += 2.0 * 0.9999 * math.cos(0.3) * signal[k - 1] - 0.9998 * signal[k - 2]
    try:
        found = identify(signal, RATE, method=method)
    except EstimationError as error:
        assert "\n" not in str(error)
        return
    numbers = [*found.parameters.values(), *found.standard_errors.values()]
    assert all(math.isfinite(v) for v in numbers)
    json.dumps(found.to_dict(), allow_nan=False)
    if case == "outlier" and method != "gmwm-robust":
        assert any("outlier" in f or "sample" in f for f in found.flags)
    if case == "outlier" and method == "gmwm-robust":
        # one sample in 1500 moves a robust estimate by nothing that counts
        assert found.parameters["white_noise.density"] == pytest.approx(RATE**-0.5, rel=0.1)
    if case == "ramp" and isinstance(found, MethodIdentification) and found.converged:
        ramp = found.process is not None and "rate_ramp" in {
            p.kind for p in found.process.components
        }
        assert ramp or found.flags


def mean_autocovariance(process: Process, n: int, dt: float, lags: list[int]) -> np.ndarray:
    total = np.zeros(len(lags))
    rng = np.random.default_rng(1)
    for _ in range(1500):
        x = process.simulate(n, dt, rng)
        x = x - x.mean()
        total += [x[k:] @ x[: n - k] / n for k in lags]
    return total / 1500


def test_expected_autocovariance_is_the_mean_over_records() -> None:
    process = ProcessSum(
        (WhiteNoise(1.0), GaussMarkov(1.0, 3.0), RandomWalk(0.1), Quantization(0.02))
    )
    lags = [0, 1, 5, 50, 150]
    found = expected_autocovariance(process, 300, 0.1, lags)
    simulated = mean_autocovariance(process, 300, 0.1, lags)
    # about 1500 records; the standard error of each mean is below 0.03 (lag 0: 0.04)
    assert found == pytest.approx(simulated, abs=0.12)
    # by hand, with everything at every lag, for the two sums of a tiny record
    pair = expected_autocovariance(WhiteNoise(1.0), 2, 1.0, [0, 1])
    assert pair == pytest.approx([0.5, -0.25])


def test_averaged_correlations_are_those_of_the_process() -> None:
    points = correlation_points(record(), RATE)
    total = SIGMA**2 + N**2 * RATE
    expected = SIGMA**2 / total * np.exp(-points.lag / TIME)
    assert (np.abs(points.correlation - expected) < 0.03).all()
    assert points.first[0] == 1
    assert (points.first[1:] == points.last[:-1] + 1).all()
    # the band of a mean of m lags shrinks by the root of m
    m = points.last - points.first + 1
    wide = points.band * np.sqrt(m * 30_000)
    assert wide == pytest.approx(np.full(m.size, 1.96), rel=0.1)


@functools.cache
def compared() -> MethodComparison:
    return compare_methods(
        record(), RATE, ("slope", "ml", "allan", "psd", "gmwm", "arma", "garch"), name="gyro_x"
    )


def test_methods_on_one_signal_agree_and_say_so() -> None:
    found = compared()
    assert tuple(found.results) == ("allan", "slope", "psd", "gmwm", "ml", "arma", "garch")
    assert not found.failures
    assert found.agree
    white = next(p for p in found.parameters if p.parameter == "white_noise.density")
    assert set(white.values) == {"allan", "slope", "psd", "gmwm", "ml"}
    assert white.worst_pair
    assert "slope" not in white.worst_pair
    first, second = white.worst_pair
    by_hand = abs(math.log(white.values[first] / white.values[second])) / math.hypot(
        *(white.standard_errors[m] / white.values[m] for m in white.worst_pair)
    )
    assert white.worst == pytest.approx(by_hand)
    assert any("agree within their errors" in f for f in found.findings)
    assert any("ARMA(1, 1) is exactly white noise" in f for f in found.findings)
    json.dumps(found.to_dict(), allow_nan=False)


def test_theory_lies_on_the_measured_curves() -> None:
    found = compared()
    for method in ("allan", "psd", "gmwm", "ml", "arma"):
        theory = found.theory[method]
        assert theory.allan is not None
        assert theory.density is not None
        assert theory.correlation is not None
        short = found.allan.tau < 10.0
        ratio = (theory.allan / found.allan.deviation)[short]
        assert np.abs(ratio - 1.0).max() < 0.15, method
        sure = found.spectrum.degrees_of_freedom > 100
        level = (theory.density / found.spectrum.two_sided)[sure]
        assert np.abs(np.log(level)).max() < 0.5, method
        assert abs(float(np.mean(np.log(level)))) < 0.05, method
        assert np.abs(theory.correlation - found.correlation.correlation).max() < 0.04, method
    assert found.floor == pytest.approx(TRUTH.innovation_variance(1.0 / RATE), rel=0.05)
    assert found.volatility is not None
    root = math.sqrt(TRUTH.innovation_variance(1.0 / RATE))
    assert float(np.mean(found.volatility.measured)) == pytest.approx(root, rel=0.03)
    assert float(np.mean(found.volatility.model)) == pytest.approx(root, rel=0.03)


def test_the_crossing_of_white_noise_and_walk_is_not_a_bias_instability() -> None:
    rng = np.random.default_rng(8)
    n, k = 1e-3, 2e-4
    signal = (WhiteNoise(n) + RandomWalk(k)).simulate(200_000, 0.1, rng)
    found = compare_methods(signal, 10.0, ("allan", "slope"))
    read = found.results["slope"].parameters.get("bias_instability.level")
    assert read is not None
    # the minimum of the sum is 2 N K/sqrt(3), which reads as 1.62 sqrt(N K)
    assert read == pytest.approx(math.sqrt(2.0 * n * k / math.sqrt(3.0)) / 0.66428, rel=0.15)
    crossing = [f for f in found.findings if "where N and K cross" in f]
    assert crossing
    assert crossing[0].endswith(f"not {read:.3g}")


def test_outliers_set_robust_and_plain_apart() -> None:
    rng = np.random.default_rng(6)
    signal = rng.standard_normal(20_000)
    wild = rng.random(signal.size) < 0.05
    signal[wild] *= 8.0
    found = compare_methods(signal, 10.0, ("gmwm", "gmwm-robust"), model=WhiteNoise(1.0))
    plain, robust = (found.results[m].parameters["white_noise.density"] for m in found.results)
    # 5 % of the samples with 64 times the variance: 1 + 0.05 * 63 = 4.15
    assert plain == pytest.approx(math.sqrt(4.15 / 10.0), rel=0.1)
    assert robust == pytest.approx(math.sqrt(1.0 / 10.0), rel=0.15)
    assert any("outliers decide the plain estimate" in f for f in found.findings)
    assert found.agree is None  # the robust one asks for something else


def test_a_line_of_vibration_is_told_with_its_frequency() -> None:
    rng = np.random.default_rng(6)
    time = np.arange(40_000) / 50.0
    signal = rng.standard_normal(time.size)
    quiet = compare_methods(signal, 50.0, ("psd",))
    assert not any("lines stand above" in f for f in quiet.findings)
    loud = compare_methods(signal + 0.5 * np.sin(2 * np.pi * 4.0 * time), 50.0, ("psd",))
    told = [f for f in loud.findings if "lines stand above" in f]
    assert len(told) == 1
    frequency = float(told[0].split(" at ")[1].split(" Hz")[0])
    # the points are an eighth of an octave wide
    assert frequency == pytest.approx(4.0, rel=0.06)


def test_structure_is_shared_unless_each_shall_choose() -> None:
    rng = np.random.default_rng(12)
    signal = (WhiteNoise(1.0) + BiasInstability(0.3, 0.2, 2000.0)).simulate(30_000, 0.1, rng)
    shared = compare_methods(signal, 10.0, ("allan", "gmwm"))
    kinds = [
        sorted(p.kind for p in r.process.components)
        for r in shared.results.values()
        if r.process is not None
    ]
    assert kinds[0] == kinds[1]
    assert "allan" in shared.structure
    with pytest.raises(InputError, match="all, allan"):
        compare_methods(signal, 10.0, ("alan",))


def test_methods_without_an_answer_are_named_and_the_others_go_on() -> None:
    rng = np.random.default_rng(1)
    found = compare_methods(rng.standard_normal(3000), 10.0, ("allan", "autocorrelation"))
    assert "no correlation" in found.failures["autocorrelation"]
    assert set(found.results) == {"allan"}
    with pytest.raises(EstimationError, match="no method has an answer"):
        compare_methods(rng.standard_normal(3000), 10.0, ("autocorrelation",))


def test_differences_are_of_logarithms_in_combined_errors() -> None:
    assert combined_difference((1.0, 0.03), (math.e**0.5, math.e**0.5 * 0.04)) == pytest.approx(
        10.0
    )
    assert combined_difference((2.0, 0.1), (1.0, 0.0)) < 0.0


def test_a_constant_variance_is_not_called_clustered() -> None:
    white = np.random.default_rng(71).standard_normal(20_000)
    steady = compare_methods(white, 100.0, ("allan", "garch"))
    text = " ".join(steady.findings)
    assert "variance clusters" not in text
    assert "no sign that the variance changes" in text
    shocks, _ = simulate_garch(20_000, 0.02, [0.10], [0.88], np.random.default_rng(72))
    lively = " ".join(compare_methods(shocks, 100.0, ("allan", "garch")).findings)
    assert "variance clusters" in lively
