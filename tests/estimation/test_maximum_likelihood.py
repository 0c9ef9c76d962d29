"""The likelihood is that of the dense covariance; its maximum is the best estimate there is."""

from __future__ import annotations

import json
import math
from functools import lru_cache

import numpy as np
import pytest

from schuler.errors import EstimationError, InputError, ModelError
from schuler.estimation.gmwm.fit import fit_gmwm
from schuler.estimation.identification import Identification
from schuler.estimation.identify import identify
from schuler.estimation.maximum_likelihood import (
    LikelihoodIdentification,
    _evaluate,
    fit_maximum_likelihood,
)
from schuler.estimation.parts import free_parameters, with_logs
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    ProcessSum,
    Quantization,
    RandomWalk,
    RateRamp,
    TurnOnBias,
    WhiteNoise,
)

ACCEL = WhiteNoise(7.5e-4) + GaussMarkov(1.376e-3, 7.0) + RandomWalk(1.157e-4)
GYRO = WhiteNoise(6.1e-4) + GaussMarkov(1.98e-4, 60.0)
TRUTH = {"accel": ACCEL, "gyro": GYRO}
SEEDS, MORE = 20, 60
Estimates = dict[str, list[Identification]]


def truth_of(process: ProcessSum) -> dict[str, float]:
    return {k: v for k, v in process.parameters.items() if not k.endswith("initial_sd")}


def sample_covariance(parts: tuple[Process, ...], n: int, dt: float) -> np.ndarray:
    time = np.arange(n) * dt
    total = np.zeros((n, n))
    for part in parts:
        if isinstance(part, WhiteNoise):
            total += np.eye(n) * part.density**2 / dt
        elif isinstance(part, RandomWalk):
            total += part.density**2 * np.minimum.outer(time, time)
        else:
            total += part.autocovariance(time[:, None] - time)
    return total


def dense_log_likelihood(
    parts: tuple[Process, ...], values: np.ndarray, dt: float, block: int
) -> float:
    """Likelihood of the differences of block means, from the whole covariance matrix."""
    count = values.size // block
    average = np.kron(np.eye(count), np.full(block, 1.0 / block))
    contrast = np.diff(np.eye(count), axis=0) @ average
    covariance = contrast @ sample_covariance(parts, values.size, dt) @ contrast.T
    seen = contrast @ values
    return -0.5 * float(
        np.linalg.slogdet(covariance)[1]
        + seen @ np.linalg.solve(covariance, seen)
        + seen.size * math.log(2.0 * math.pi)
    )


PROCESSES = [
    WhiteNoise(1.0) + GaussMarkov(1.5, 0.7) + GaussMarkov(0.8, 5.0) + RandomWalk(0.3),
    WhiteNoise(1.0) + GaussMarkov(1.5, 0.7),
    ProcessSum((WhiteNoise(1.0),)),
    WhiteNoise(0.4) + BiasInstability(1.0, 0.5, 50.0),
]


@pytest.mark.parametrize("block", [1, 4, 5])
@pytest.mark.parametrize("process", PROCESSES, ids=["walk", "one", "white", "flicker"])
def test_likelihood_and_score_equal_the_dense_ones(process: ProcessSum, block: int) -> None:
    values = process.simulate(160, 0.1, np.random.default_rng(3))
    names = free_parameters(process.parts)
    logs = np.log([getattr(process.parts[k], name) for k, name in names])
    means = values.reshape(-1, block).mean(axis=1)
    total, _, score, information = _evaluate(process.parts, names, logs, means, 0.1, block)

    def dense(moved: np.ndarray) -> float:
        return dense_log_likelihood(with_logs(process.parts, names, moved), values, 0.1, block)

    assert total == pytest.approx(dense(logs), rel=1e-10)
    units = 1e-5 * np.eye(logs.size)
    expected = [(dense(logs + u) - dense(logs - u)) / 2e-5 for u in units]
    np.testing.assert_allclose(score, expected, rtol=1e-3, atol=1e-3)
    assert np.linalg.eigvalsh(information)[0] > -1e-6


def test_information_is_the_scatter_of_the_score() -> None:
    process = PROCESSES[1]
    names = free_parameters(process.parts)
    logs = np.log([getattr(process.parts[k], name) for k, name in names])
    scores, informations = [], []
    for seed in range(400):
        values = process.simulate(400, 0.1, np.random.default_rng([4, seed]))
        _, _, score, information = _evaluate(process.parts, names, logs, values, 0.1, 1)
        scores.append(score)
        informations.append(information)
    expected, found = np.mean(informations, axis=0), np.cov(np.array(scores).T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # sd of a variance of 400 is 7 %
    np.testing.assert_allclose(found / scale, expected / scale, atol=0.25)
    assert np.all(np.abs(np.mean(scores, axis=0)) < 4.0 * np.sqrt(np.diag(expected) / 400))


def test_sampled_wavelet_variance_is_that_of_the_covariance() -> None:
    process = WhiteNoise(0.3) + GaussMarkov(1.5, 0.15) + RandomWalk(0.8)
    factors = np.array([1, 2, 8])
    found = 0.5 * process.sampled_allan_variance(factors, 0.1)
    covariance = sample_covariance(process.parts, 16, 0.1)
    for m, value in zip(factors, found, strict=True):
        taps = np.concatenate([np.full(m, -0.5 / m), np.full(m, 0.5 / m)])
        size = taps.size
        assert value == pytest.approx(taps @ covariance[:size, :size] @ taps, rel=1e-10)


@lru_cache(maxsize=2)
def ensemble(name: str) -> Estimates:
    """Records of 67 minutes at 10 Hz, every method with the true structure."""
    process, found = TRUTH[name], {}
    for seed in range(SEEDS):
        signal = process.simulate(40_000, 0.1, np.random.default_rng([8, seed]))
        results: dict[str, Identification] = {
            "likelihood": fit_maximum_likelihood(signal, 10.0, process),
            "moments": fit_gmwm(signal, 10.0, process),
            "allan": identify(signal, 10.0, process),
        }
        for method, result in results.items():
            found.setdefault(method, []).append(result)
    return found


@lru_cache(maxsize=2)
def of_means(name: str) -> list[Identification]:
    """More records of 67 minutes, by the likelihood of means of four samples."""
    process = TRUTH[name]
    return [
        fit_maximum_likelihood(
            process.simulate(40_000, 0.1, np.random.default_rng([8, seed])), 10.0, process, block=4
        )
        for seed in range(MORE)
    ]


def logs_of(results: list[Identification], key: str, truth: float) -> np.ndarray:
    return np.array([math.log(r.parameters[key] / truth) for r in results])


@pytest.mark.parametrize("name", ["accel", "gyro"])
def test_maximum_likelihood_is_efficient_and_all_methods_agree(name: str) -> None:
    for key, value in truth_of(TRUTH[name]).items():
        logs = {m: logs_of(r, key, value) for m, r in ensemble(name).items()}
        spread = {m: float(x.std(ddof=1)) for m, x in logs.items()}
        # never worse than moments beyond the noise of 20 paired trials
        assert spread["likelihood"] < 1.15 * spread["moments"], key
        assert spread["likelihood"] < 1.15 * spread["allan"], key
        for method, found in logs.items():
            assert abs(found.mean()) < 4.0 * spread[method] / math.sqrt(SEEDS) + 1e-3, (method, key)
            apart = found - logs["likelihood"]
            assert abs(np.median(apart)) < 0.5 * spread[method], (method, key)


@pytest.mark.parametrize("name", ["accel", "gyro"])
def test_errors_are_true(name: str) -> None:
    results = of_means(name)
    for key, value in truth_of(TRUTH[name]).items():
        hits = sum(r.intervals[key][0] <= value <= r.intervals[key][1] for r in results)
        assert hits / MORE >= 0.85, key  # 95 % of 60 less 3.5 sd
        spread = logs_of(results, key, value).std(ddof=1)
        claimed = np.median([r.standard_errors[key] / r.parameters[key] for r in results])
        # sd of an sd of 60 is 9 %
        assert 0.7 < spread / claimed < 1.35, key
    assert all(r.diagnostics.converged for r in results)


def test_means_lose_knowledge_of_white_noise_only() -> None:
    full, means = ensemble("accel")["likelihood"], of_means("accel")[:SEEDS]
    for key in truth_of(ACCEL):
        ratio = np.median(
            [
                b.standard_errors[key] / a.standard_errors[key]
                for a, b in zip(full, means, strict=True)
            ]
        )
        if key.startswith("white"):
            # N is known from a fourth of the values, and told from faster noise less well
            assert 1.9 < ratio < 2.7
        else:
            assert ratio == pytest.approx(1.0, rel=0.05), key


def test_automatic_block_and_structure() -> None:
    signal = ACCEL.simulate(500_000, 0.01, np.random.default_rng(2))
    result = fit_maximum_likelihood(signal, 100.0, block="auto")
    assert result.block >= 4
    assert set(result.parameters) == set(truth_of(ACCEL))
    for key, value in truth_of(ACCEL).items():
        spread = result.standard_errors[key] / result.parameters[key]
        assert abs(math.log(result.parameters[key] / value)) < 3.5 * spread, key
    assert result.flags == ()
    freedom = result.diagnostics.degrees_of_freedom
    assert result.diagnostics.chi_square < freedom + 4.0 * math.sqrt(2.0 * freedom)
    back = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert back["aic"] == pytest.approx(8.0 - 2.0 * back["log_likelihood"])


def test_innovation_variance_is_the_floor_of_prediction() -> None:
    process = WhiteNoise(0.1) + GaussMarkov(0.6, 5.0) + RandomWalk(0.05)
    signal = process.simulate(40_000, 0.1, np.random.default_rng(5))
    result = fit_maximum_likelihood(signal, 10.0, process)
    # Kolmogorov and Szegö, spec 3
    floor = process.innovation_variance(0.1)
    assert result.innovation_variance == pytest.approx(floor, rel=4.0 * math.sqrt(2.0 / 40_000))


def test_a_term_that_is_not_there_vanishes() -> None:
    signal = WhiteNoise(1.0).simulate(20_000, 1.0, np.random.default_rng(6))
    with_walk = fit_maximum_likelihood(signal, 1.0, WhiteNoise(1.0) + RandomWalk(0.1))
    alone = fit_maximum_likelihood(signal, 1.0, WhiteNoise(1.0))
    assert with_walk.diagnostics.converged
    assert with_walk.log_likelihood >= alone.log_likelihood - 0.1
    assert with_walk.log_likelihood - alone.log_likelihood < 6.0
    assert with_walk.parameters["random_walk.density"] < 2e-3
    # the mean square about the mean is the maximum for white noise alone
    assert alone.parameters["white_noise.density"] == pytest.approx(
        float(np.std(signal, ddof=1)), rel=2e-5
    )
    truncated = fit_maximum_likelihood(
        np.cumsum(signal), 1.0, ProcessSum((WhiteNoise(1.0), RandomWalk(1.0)))
    )
    assert truncated.parameters["random_walk.density"] == pytest.approx(1.0, rel=0.03)


def test_a_ramp_is_taken_off_first() -> None:
    noise = WhiteNoise(1.0) + GaussMarkov(2.0, 30.0)
    signal = noise.simulate(20_000, 1.0, np.random.default_rng(7)) + 0.02 * np.arange(20_000)
    result = fit_maximum_likelihood(signal, 1.0, noise + RateRamp(1.0))
    assert any("line" in flag for flag in result.flags)
    ramp = next(p for p in result.process.parts if isinstance(p, RateRamp))
    assert ramp.slope == pytest.approx(0.02, rel=0.01)
    for key, value in truth_of(noise).items():
        assert result.parameters[key] == pytest.approx(value, abs=4.0 * result.standard_errors[key])


def test_scales_with_the_unit_and_flags_outliers() -> None:
    signal = ACCEL.simulate(20_000, 0.1, np.random.default_rng(8))
    one = fit_maximum_likelihood(signal, 10.0, ACCEL)
    for scale in (1e-12, 1e6):
        other = fit_maximum_likelihood(scale * signal, 10.0, ACCEL)
        for key, value in one.parameters.items():
            factor = 1.0 if key.endswith("time") else scale
            assert other.parameters[key] == pytest.approx(factor * value, rel=0.01)
    signal[99] += 1e3
    assert any("outliers" in f for f in fit_maximum_likelihood(signal, 10.0, ACCEL).flags)


def test_bad_input_is_refused() -> None:
    signal = np.random.default_rng(0).standard_normal(1000)
    for wrong, error in (
        (np.zeros((10, 100)), InputError),
        (np.full(1000, 9.8), EstimationError),
        (signal[:50], EstimationError),
        (np.where(np.arange(1000) == 7, np.nan, signal), InputError),
    ):
        with pytest.raises(error) as caught:
            fit_maximum_likelihood(wrong, 1.0)
        assert "\n" not in str(caught.value)
    with pytest.raises(ModelError, match="quantization"):
        fit_maximum_likelihood(signal, 1.0, WhiteNoise(1.0) + Quantization(1.0))
    with pytest.raises(InputError, match="block"):
        fit_maximum_likelihood(signal, 1.0, block=0)
    with pytest.raises(EstimationError, match="shorter block"):
        fit_maximum_likelihood(signal, 1.0, block=50)
    with pytest.raises(ModelError, match="no parameter"):
        fit_maximum_likelihood(signal, 1.0, TurnOnBias(1.0))


def test_real_gyro_agrees_with_moments(data_folder: object) -> None:
    import polars as pl

    column = "gyro_y_rad_s"
    table = pl.read_parquet(f"{data_folder}/adis16405-static/imu1.parquet", columns=[column])
    signal = table[column].to_numpy()
    # beyond the sensor's own low-pass filter
    means = signal[: signal.size // 50 * 50].reshape(-1, 50).mean(axis=1)
    moments = fit_gmwm(means, 2.0)
    likelihood = fit_maximum_likelihood(means, 2.0, moments.process)
    assert isinstance(likelihood, LikelihoodIdentification)
    for key, value in likelihood.parameters.items():
        apart = math.log(moments.parameters[key] / value)
        error = moments.standard_errors[key] / moments.parameters[key]
        assert abs(apart) < 2.0 * error, key


def test_the_unit_of_the_signal_decides_nothing() -> None:
    truth = WhiteNoise(1e-3) + GaussMarkov(5e-3, 3.0)
    x = truth.simulate(20_000, 0.01, np.random.default_rng(3))
    one, other = (fit_maximum_likelihood(s * x, 100.0) for s in (1.0, 1e12))
    scaled = {k: v if "time" in k else v * 1e12 for k, v in one.parameters.items()}
    assert other.parameters == pytest.approx(scaled, rel=1e-6)
    # a density in another unit: the first value has none, its level being unknown
    shift = (x.size - 1) * math.log(1e12)
    assert other.log_likelihood == pytest.approx(one.log_likelihood - shift, abs=1e-5)


def test_errors_carry_the_misfit() -> None:
    # white noise alone is wrong, and says so
    truth = WhiteNoise(1e-3) + GaussMarkov(5e-3, 3.0)
    x = truth.simulate(20_000, 0.01, np.random.default_rng(4))
    alone = fit_maximum_likelihood(x, 100.0, WhiteNoise(1.0))
    known = alone.parameters["white_noise.density"] / math.sqrt(2.0 * x.size)
    assert alone.standard_errors["white_noise.density"] > 3.0 * known
    assert any("errors were widened" in flag for flag in alone.flags)
