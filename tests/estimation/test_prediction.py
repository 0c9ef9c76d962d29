"""Predictors on held-out data: exact errors, and the floor that nobody may beat."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from scipy.signal import lfilter

from schuler.errors import EstimationError, InputError
from schuler.estimation.autoregressive.fit import fit_ar
from schuler.estimation.orthogonal_search.search import fast_orthogonal_search
from schuler.estimation.predictors.comparison import compare_predictors, multi_step_ar
from schuler.estimation.predictors.innovation_floor import (
    check_prediction_floor,
    innovation_variance,
    innovation_variance_of_signal,
)
from schuler.kernels.noise.prediction import kalman_states
from schuler.noise import GaussMarkov, Process, RandomWalk, WhiteNoise
from schuler.noise.autoregressive import Autoregressive

RATE = 50.0
MODEL = WhiteNoise(0.05) + GaussMarkov(1.0, 0.5)


@pytest.mark.parametrize("onesided", [True, False])
@pytest.mark.parametrize(
    "process",
    [
        MODEL,
        WhiteNoise(0.2),
        Autoregressive(
            tuple(np.poly([0.9 * np.exp(0.8j), 0.9 * np.exp(-0.8j)])[1:].real.tolist()),
            3.0,
            1 / RATE,
        ),
    ],
    ids=["white and Gauss-Markov", "white", "autoregressive"],
)
def test_floor_of_a_spectrum_is_that_of_the_process(process: Process, onesided: bool) -> None:
    # the spectrum of the samples: what lies beyond the Nyquist frequency is folded in
    f = np.linspace(0.0, RATE / 2, 20_001)
    density = process.sampled_psd(f / RATE, 1.0 / RATE) / RATE * (2.0 if onesided else 1.0)
    found = innovation_variance(f, density, RATE, onesided=onesided)
    assert found == pytest.approx(process.innovation_variance(1.0 / RATE), rel=1e-5)


def test_chi_square_bias_of_the_logarithm_is_taken_off() -> None:
    rng = np.random.default_rng(1)
    f = np.linspace(0.0, 0.5, 4001)
    for freedom in (2.0, 8.0):
        density = 3.0 * rng.chisquare(freedom, f.size) / freedom
        found = innovation_variance(f, density, 1.0, onesided=False, degrees_of_freedom=freedom)
        # variance of the logarithm: trigamma(1) = 1.64 for two degrees of freedom
        assert found == pytest.approx(3.0, rel=5.0 * math.sqrt(1.65 / f.size))
        plain = innovation_variance(f, density, 1.0, onesided=False)
        assert plain < 0.9 * 3.0


@pytest.mark.parametrize("n", [5000, 60_000])
def test_floor_of_a_record_scatters_about_that_of_its_process(n: int) -> None:
    runs = 20
    ratios = np.array(
        [
            innovation_variance_of_signal(MODEL.simulate(n, 1 / RATE, np.random.default_rng(s)))
            for s in range(runs)
        ]
    ) / MODEL.innovation_variance(1 / RATE)
    error = math.sqrt(3.0 / n)
    assert abs(ratios.mean() - 1.0) < 4.0 * error / math.sqrt(runs) + 0.015
    assert ratios.std() < 1.7 * error


def test_an_impossible_error_is_refused() -> None:
    # spec 8.3: 3e-14 claimed on data whose innovation variance is 5.9e-5
    with pytest.raises(EstimationError, match=r"orthogonal search claims .* held-out raw data"):
        check_prediction_floor(3e-14, 5.9e-5, what="orthogonal search")
    with pytest.raises(EstimationError, match=r"0\.899 of the innovation variance"):
        check_prediction_floor(0.899, 1.0, samples=100_000)
    assert check_prediction_floor(0.91, 1.0) == 0.91
    # 200 samples: one standard error is 10 %
    assert check_prediction_floor(0.7, 1.0, samples=200) == 0.7
    with pytest.raises(EstimationError):
        check_prediction_floor(math.nan, 1.0)
    with pytest.raises(InputError, match="above zero"):
        check_prediction_floor(1.0, 0.0)


def test_bad_spectra() -> None:
    f = np.linspace(0.0, 0.5, 5)
    for frequency, density, words in (
        (f, np.ones(4), "shape"),
        (f[::-1], np.ones(5), "increasing"),
        (2.0 * f, np.ones(5), "0 to 0.5 Hz"),
        (f, np.array([1.0, 0.0, 1.0, 1.0, 1.0]), "above zero"),
        (f, np.array([1.0, np.nan, 1.0, 1.0, 1.0]), "above zero"),
    ):
        with pytest.raises(InputError, match=words):
            innovation_variance(frequency, density, 1.0, onesided=False)
    with pytest.raises(InputError, match="at least 1024"):
        innovation_variance_of_signal(np.arange(100.0))


def test_kalman_filter_is_the_conditional_mean() -> None:
    rng = np.random.default_rng(2)
    dt, n = 1 / RATE, 14
    space = (MODEL + RandomWalk(0.3, initial_sd=0.4)).state_space(dt)
    white = space.white_density**2 / dt
    y = rng.standard_normal(n)
    states = np.zeros((n, space.size))
    kalman_states(
        y, space.transition, space.noise_covariance, space.output, white,
        space.initial_covariance, states,
    )  # fmt: skip
    # joint covariance of all states by running the model, then plain Gaussian conditioning
    covariance = [[space.initial_covariance]]
    for k in range(1, n):
        covariance.append([space.transition @ c for c in covariance[-1]])
        before = covariance[k - 1][k - 1]
        covariance[k].append(
            space.transition @ before @ space.transition.T + space.noise_covariance
        )
    outputs = np.array(
        [
            [space.output @ covariance[max(i, j)][min(i, j)] @ space.output for j in range(n)]
            for i in range(n)
        ]
    )
    cross = np.array([covariance[n - 1][j] @ space.output for j in range(n)]).T
    expected = cross @ np.linalg.solve(outputs + white * np.eye(n), y)
    np.testing.assert_allclose(states[-1], expected, rtol=1e-9)


def test_many_steps_of_an_autoregressive_model() -> None:
    y = lfilter([1.0], [1.0, -1.2, 0.6], np.random.default_rng(3).standard_normal(500)) + 4.0
    fit = fit_ar(y, 2)
    path = list(y[:301] - fit.mean)
    for _ in range(20):
        path.append(float(-fit.coefficients @ path[:-3:-1]))
    found = multi_step_ar(fit, y, (1, 5, 20), [300])[0]
    expected = np.array([path[301], path[305], path[320]]) + fit.mean
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_baselines_have_the_errors_that_theory_gives_them() -> None:
    dt = 1.0 / RATE
    rng = np.random.default_rng(4)
    y = MODEL.simulate(160_000, dt, rng) + 9.8
    train, unseen = y[:80_000], y[80_000:]
    search = fast_orthogonal_search(train, 10, 2)
    found = compare_predictors(
        train, unseen, rate=RATE, process=MODEL, models={"FOS": search}, horizons=(1, 10, 100)
    )
    floor = MODEL.innovation_variance(dt)
    assert found.floor_from == "process"
    assert found.innovation_variance == floor
    slow = GaussMarkov(1.0, 0.5)
    white = 0.05**2 / dt
    # 80 000 samples hold 1600 correlation times
    for column, h in enumerate((1, 10, 100)):
        r = float(slow.autocovariance(h * dt))
        assert found["zero"].mean_square_error[column] == pytest.approx(1.0 + white, rel=0.2)
        expected = 2.0 * (1.0 - r) + 2.0 * white
        assert found["last value"].mean_square_error[column] == pytest.approx(expected, rel=0.2)
        # P is the steady covariance of the filtered state: from the one-step error
        phi2 = math.exp(-2.0 * dt / 0.5)
        posterior = (floor - white - (1.0 - phi2)) / phi2
        optimal = 1.0 + white - phi2**h * (1.0 - posterior)
        band = 0.03 if h == 1 else 0.2
        assert found["Kalman"].mean_square_error[column] == pytest.approx(optimal, rel=band)
    assert found["Kalman"].normalised[0] == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / 72_000))
    for name in ("AR by BIC", "FOS"):
        # the same task with a finite past: never clearly better, and close behind
        ratio = found[name].mean_square_error / found["Kalman"].mean_square_error
        assert 0.995 < ratio[0] < 1.03
        assert (ratio > 0.97).all()
    assert found["last value"].normalised[0] > 1.2
    json.dumps(found.to_dict(), allow_nan=False)
    with pytest.raises(InputError, match="'AR by BIC'"):
        _ = found["oracle"]


def test_a_model_that_has_seen_the_future_is_refused() -> None:
    rng = np.random.default_rng(5)
    y = rng.standard_normal(20_000)
    # held-out data that is smoothed is other data: the floor of the raw process refuses it
    smooth = np.convolve(y, np.ones(8) / 8.0, "valid")
    with pytest.raises(EstimationError, match="of the innovation variance"):
        compare_predictors(
            smooth[:9000], smooth[9000:], rate=1.0, process=WhiteNoise(1.0), horizons=(1,)
        )


def test_too_little_held_out_data() -> None:
    y = np.random.default_rng(6).standard_normal(3000)
    with pytest.raises(InputError, match="ask for fewer steps"):
        compare_predictors(y[:2500], y[2500:], rate=1.0)
    with pytest.raises(InputError, match="horizons"):
        compare_predictors(y, y, rate=1.0, horizons=(0,))
