"""Wavelet moments find known noise with true errors, from one record or from several."""

from __future__ import annotations

import json
import math
import time
from functools import lru_cache

import numpy as np
import pytest

from schuler.curves.wavelet_variance import wavelet_variance
from schuler.errors import EstimationError, InputError, ModelError
from schuler.estimation.gmwm.fit import GmwmIdentification, fit_gmwm
from schuler.estimation.gmwm.moments import fit_moments
from schuler.estimation.gmwm.replicates import fit_gmwm_replicates
from schuler.estimation.gmwm.scatter import misfit, relative_covariance
from schuler.estimation.identification import Identification
from schuler.estimation.identify import identify
from schuler.noise import (
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
GYRO = WhiteNoise(6.1e-4) + GaussMarkov(1.98e-4, 600.0)
TRUTH = {"accel": ACCEL, "gyro": GYRO}
SEEDS = 30


def truth_of(process: ProcessSum) -> dict[str, float]:
    return {k: v for k, v in process.parameters.items() if not k.endswith("initial_sd")}


@lru_cache(maxsize=4)
def ensemble(name: str, robust: bool = False) -> tuple[GmwmIdentification, ...]:
    """Records of 7 h at 10 Hz, where all but N is as certain as at 100 Hz."""
    return tuple(
        fit_gmwm(
            TRUTH[name].simulate(252_000, 0.1, np.random.default_rng([7, seed])),
            10.0,
            robust=robust,
        )
        for seed in range(15 if robust else SEEDS)
    )


@pytest.mark.parametrize("name", ["accel", "gyro"])
def test_structure_is_found_and_nothing_invented(name: str) -> None:
    wanted = set(truth_of(TRUTH[name]))
    assert sum(set(r.parameters) == wanted for r in ensemble(name)) >= SEEDS - 2
    assert sum(r.diagnostics.converged for r in ensemble(name)) >= SEEDS - 1


@pytest.mark.parametrize("name", ["accel", "gyro"])
def test_intervals_cover_and_errors_are_true(name: str) -> None:
    for key, value in truth_of(TRUTH[name]).items():
        found = [r for r in ensemble(name) if key in r.parameters]
        hits = sum(r.intervals[key][0] <= value <= r.intervals[key][1] for r in found)
        assert hits / SEEDS >= 0.83, key  # 95 % of 30 less 3 sd
        logs = np.array([math.log(r.parameters[key] / value) for r in found])
        claimed = float(np.median([r.standard_errors[key] / r.parameters[key] for r in found]))
        assert 0.6 < logs.std(ddof=1) / claimed < 1.45, key
        assert abs(logs.mean()) < 4.0 * claimed / math.sqrt(len(logs)), key


@pytest.mark.parametrize("name", ["accel", "gyro"])
def test_goodness_of_fit_is_calibrated(name: str) -> None:
    p_values = np.array([r.p_value for r in ensemble(name)])
    # uniform: mean 0.5 with sd 0.289/sqrt(30) = 0.053
    assert 0.29 < p_values.mean() < 0.71
    assert np.count_nonzero(p_values < 0.01) <= 2
    assert not any(r.diagnostics.discrepancy > 0.0 for r in ensemble(name))


@pytest.mark.parametrize("process", [ACCEL, GYRO], ids=["accel", "gyro"])
def test_seven_hours_at_full_rate(process: ProcessSum) -> None:
    signal = process.simulate(2_520_000, 0.01, np.random.default_rng(42))
    fit_gmwm(signal[:5000], 100.0)
    start = time.process_time()
    result = fit_gmwm(signal, 100.0)
    assert time.process_time() - start < 1.0  # 0.15 on a quiet machine
    truth = truth_of(process)
    assert set(result.parameters) == set(truth)
    assert result.parameters["white_noise.density"] == pytest.approx(
        truth["white_noise.density"], rel=0.002
    )
    for key, value in truth.items():
        spread = result.standard_errors[key] / result.parameters[key]
        assert abs(math.log(result.parameters[key] / value)) < 3.5 * spread, key
    assert result.flags == ()


@pytest.mark.parametrize(
    "truth",
    [
        WhiteNoise(0.3),
        WhiteNoise(0.01) + Quantization(0.01),
        WhiteNoise(0.1) + RandomWalk(0.02),
        WhiteNoise(0.1) + GaussMarkov(0.2, 0.5) + GaussMarkov(0.1, 50.0),
        WhiteNoise(0.1) + RateRamp(2e-4),
    ],
    ids=["white", "quantization", "walk", "two times", "ramp"],
)
def test_other_structures_are_found(truth: Process) -> None:
    n, dt = 400_000, 0.02
    result = fit_gmwm(truth.simulate(n, dt, np.random.default_rng(12)), 1 / dt)
    wanted = truth_of(truth if isinstance(truth, ProcessSum) else ProcessSum((truth,)))
    assert set(result.parameters) == {k for k in wanted if not k.endswith("interval")}
    for key, value in result.parameters.items():
        error = max(4.0 * result.standard_errors[key], 0.01 * value)
        assert abs(value - wanted[key]) < error, key


def test_agrees_with_the_joint_fit_of_the_allan_curve() -> None:
    signal = ACCEL.simulate(252_000, 0.1, np.random.default_rng(5))
    ours, joint = fit_gmwm(signal, 10.0), identify(signal, 10.0)
    assert isinstance(ours, Identification)
    for key, value in joint.parameters.items():
        # the same data: apart by less than their errors
        assert abs(ours.parameters[key] - value) < joint.standard_errors[key], key
        ratio = ours.standard_errors[key] / joint.standard_errors[key]
        assert ratio == pytest.approx(1.0, abs=0.25), key


def test_given_structure_is_kept_from_any_start() -> None:
    signal = ACCEL.simulate(252_000, 0.1, np.random.default_rng(5))
    free = fit_gmwm(signal, 10.0)
    model = RandomWalk(1.0) + WhiteNoise(1.0) + GaussMarkov(1.0, 1000.0) + TurnOnBias(3.0)
    given = fit_gmwm(signal, 10.0, model)
    assert [p.kind for p in given.process.parts] == [p.kind for p in model.parts]
    for key, value in free.parameters.items():
        assert given.parameters[key] == pytest.approx(value, rel=2e-3)
    # a structure that cannot fit says so
    alone = fit_gmwm(signal, 10.0, WhiteNoise(1.0))
    assert alone.diagnostics.discrepancy > 0.1
    assert any("no sum of these processes" in flag for flag in alone.flags)


def test_information_criterion_and_efficient_weights() -> None:
    signal = ACCEL.simulate(252_000, 0.1, np.random.default_rng(6))
    curve = wavelet_variance(signal, 10.0)
    right = fit_moments(ACCEL.parts, [curve])
    # with efficient weights the optimism is twice the number of parameters
    assert right.wvic - right.cost == pytest.approx(2.0 * 4, rel=0.05)
    poor = fit_moments((ACCEL.parts[0], ACCEL.parts[2]), [curve])
    assert poor.wvic > right.wvic + 20.0
    relative = relative_covariance(right.process, curve)
    model = curve.of(right.process)
    assert misfit(curve.variance, model, relative) == pytest.approx(right.cost, rel=0.01)


def test_covariance_of_wavelet_variances_is_that_of_simulation() -> None:
    process = WhiteNoise(1.0) + GaussMarkov(1.5, 20.0)
    curves = [
        wavelet_variance(process.simulate(4096, 1.0, np.random.default_rng([1, k])), 1.0)
        for k in range(300)
    ]
    ratio = np.array([c.variance for c in curves]) / process.wavelet_variance(curves[0].scale)
    # sd of a variance of 300 is 8 % at the normal, twice that at the two longest scales
    short = slice(None, -2)
    found = np.cov(ratio.T)[short, short]
    claimed = relative_covariance(process, curves[0])[short, short]
    np.testing.assert_allclose(np.diag(found) / np.diag(claimed), 1.0, atol=0.35)
    scale = np.sqrt(np.outer(np.diag(claimed), np.diag(claimed)))
    np.testing.assert_allclose(found / scale, claimed / scale, atol=0.25)


def test_robust_from_end_to_end() -> None:
    rng = np.random.default_rng(9)
    clean = ACCEL.simulate(1_000_000, 0.01, rng)
    dirty = clean + (rng.random(clean.size) < 0.1) * rng.standard_normal(clean.size) * 0.06
    plain, robust = fit_gmwm(dirty, 100.0), fit_gmwm(dirty, 100.0, robust=True)
    assert any("robust=True" in flag for flag in plain.flags)
    assert plain.parameters["white_noise.density"] > 2.0 * 7.5e-4
    assert robust.wavelet.robust == "samples"
    truth = truth_of(ACCEL)
    assert set(robust.parameters) == set(truth)
    # what is left of outliers hidden among the good samples: a few per cent of N
    assert robust.parameters["white_noise.density"] == pytest.approx(7.5e-4, rel=0.05)
    for key in ("gauss_markov.sigma", "gauss_markov.correlation_time", "random_walk.density"):
        low, high = robust.intervals[key]
        assert low / 1.1 < truth[key] < high * 1.1, key


def test_robust_costs_little_on_clean_records() -> None:
    for key, value in truth_of(ACCEL).items():
        plain = [r.standard_errors[key] / value for r in ensemble("accel")]
        found = [fit for fit in ensemble("accel", True) if key in fit.parameters]
        robust = [r.standard_errors[key] / value for r in found]
        hits = sum(r.intervals[key][0] <= value <= r.intervals[key][1] for r in found)
        assert hits >= 12, key  # 95 % of 15 less 3 sd
        limit = 2.5 if key.startswith("white") else 1.15
        assert 0.95 < np.median(robust) / np.median(plain) < limit, key


def test_replicates_of_one_model_are_pooled() -> None:
    p_values, gain = [], []
    for trial in range(12):
        signals = [
            ACCEL.simulate(n, 0.1, np.random.default_rng([2, trial, n]))
            for n in (72_000, 50_000, 90_000)
        ]
        result = fit_gmwm_replicates(signals, 10.0, ACCEL)
        p_values.append(result.p_value)
        gain.append(
            result.pooled.standard_errors["gauss_markov.sigma"]
            / result.runs[0].standard_errors["gauss_markov.sigma"]
        )
        for key, value in truth_of(ACCEL).items():
            error = result.pooled.standard_errors[key] / result.pooled.parameters[key]
            assert abs(math.log(result.pooled.parameters[key] / value)) < 4.0 * error, key
    assert result.degrees_of_freedom == 8
    # uniform: mean 0.5, sd 0.083
    assert 0.25 < np.mean(p_values) < 0.75
    # three records of 212 000 samples against one of 72 000
    assert np.median(gain) == pytest.approx(math.sqrt(72 / 212), rel=0.1)


def test_replicates_that_differ_are_told() -> None:
    other = WhiteNoise(7.5e-4) + GaussMarkov(2.0e-3, 7.0) + RandomWalk(1.157e-4)
    signals = [
        process.simulate(100_000, 0.1, np.random.default_rng([3, k]))
        for k, process in enumerate((ACCEL, ACCEL, other))
    ]
    result = fit_gmwm_replicates(signals, 10.0, ACCEL)
    assert not result.shared
    assert result.p_value < 1e-4
    by_name = {a.parameter: a for a in result.agreements}
    assert not by_name["gauss_markov.sigma"].shared
    assert by_name["white_noise.density"].shared
    assert any("do not share" in flag for flag in result.pooled.flags)
    json.dumps(result.to_dict(), allow_nan=False)


def test_units_scale_through() -> None:
    signal = ACCEL.simulate(100_000, 0.1, np.random.default_rng(3))
    one = fit_gmwm(signal, 10.0)
    for scale in (1e-12, 1e12):
        other = fit_gmwm(scale * signal, 10.0)
        for key, value in one.parameters.items():
            factor = 1.0 if key.endswith("time") else scale
            assert other.parameters[key] == pytest.approx(factor * value, rel=1e-4)


def test_result_is_plain_enough_for_json() -> None:
    result = fit_gmwm(ACCEL.simulate(50_000, 0.1, np.random.default_rng(1)), 10.0)
    back = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    density = back["parameters"]["white_noise.density"]
    assert density["interval_95"][0] < density["value"] < density["interval_95"][1]
    assert 0.0 <= back["p_value"] <= 1.0
    assert back["converged"] is True


@pytest.mark.parametrize(
    ("signal", "error"),
    [
        (np.full(1000, 9.8), EstimationError),
        (np.arange(50.0), EstimationError),
        (np.zeros((1000, 2)), InputError),
        (np.where(np.arange(1000) == 5, np.inf, 1.0), InputError),
    ],
)
def test_signals_without_noise_are_refused(signal: np.ndarray, error: type[Exception]) -> None:
    with pytest.raises(error) as caught:
        fit_gmwm(signal, 100.0)
    assert "\n" not in str(caught.value)


def test_hard_signals_are_flagged_not_trusted() -> None:
    rng = np.random.default_rng(0)
    white = rng.standard_normal(20_000)
    struck = white.copy()
    struck[777] = 1e6
    assert any("outliers" in flag for flag in fit_gmwm(struck, 1.0).flags)
    assert fit_gmwm(struck, 1.0, robust=True).parameters["white_noise.density"] == pytest.approx(
        1.0, rel=0.03
    )
    from scipy.signal import lfilter

    # a resonance is no sum of these processes
    resonant = lfilter([1.0], [1.0, -1.99, 0.995], white)
    assert any("no sum of these" in flag for flag in fit_gmwm(resonant, 1.0).flags)
    ramp = fit_gmwm(white + 0.01 * np.arange(white.size), 1.0)
    assert ramp.parameters["rate_ramp.slope"] == pytest.approx(0.01, rel=0.1)


def test_wrong_wishes_are_refused() -> None:
    signal = np.random.default_rng(0).standard_normal(1000)
    with pytest.raises(InputError, match="model"):
        fit_gmwm(signal, 1.0, "flicker")  # type: ignore[arg-type]
    with pytest.raises(ModelError, match="no parameter"):
        fit_gmwm(signal, 1.0, TurnOnBias(1.0))
    with pytest.raises(EstimationError, match="at least two"):
        fit_gmwm_replicates([signal], 1.0)
    with pytest.raises(InputError, match="record 1"):
        fit_gmwm_replicates([signal, np.full(1000, np.nan)], 1.0)


@pytest.mark.parametrize("column", ["gyro_y_rad_s", "gyro_z_rad_s"])
def test_two_runs_of_a_real_gyro(data_folder: object, column: str) -> None:
    import polars as pl

    signals = [
        pl.read_parquet(f"{data_folder}/adis16405-static/imu{k}.parquet", columns=[column])[
            column
        ].to_numpy()
        for k in (1, 2)
    ]
    result = fit_gmwm_replicates(signals, 100.0)
    joint = [identify(signal, 100.0).parameters["white_noise.density"] for signal in signals]
    density = result.pooled.parameters["white_noise.density"]
    # data sheet and Allan deviation at 1 s: 0.04 deg/s/sqrt(Hz)
    assert density == pytest.approx(math.radians(0.04), rel=0.12)
    assert density == pytest.approx(float(np.mean(joint)), rel=0.03)
    assert result.pooled.diagnostics.discrepancy < 0.02
    assert result.degrees_of_freedom == len(result.pooled.parameters)
    # two runs differ by parts of a hundred in N, which a million samples can tell
    runs = [r.parameters["white_noise.density"] for r in result.runs]
    assert runs[0] == pytest.approx(runs[1], rel=0.03)


def test_contaminated_real_gyro(data_folder: object) -> None:
    import polars as pl

    table = pl.read_parquet(f"{data_folder}/mtig-gyro-static/gyro_x.parquet")
    signal = table["gyro_x_rad_s"].to_numpy()
    plain, robust = fit_gmwm(signal, 100.0), fit_gmwm(signal, 100.0, robust=True)
    assert any("outliers" in flag for flag in plain.flags)
    assert plain.parameters["white_noise.density"] == pytest.approx(5.6e-4, rel=0.02)
    assert robust.parameters["white_noise.density"] < 2.0e-4
    for result in (plain, robust):
        assert result.diagnostics.converged
        assert result.diagnostics.discrepancy == 0.0
