"""Processes from spectra: truth recovered, errors as claimed, PSD and Allan in agreement."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from schuler.curves.spectrum import power_spectral_density
from schuler.errors import EstimationError, InputError, ModelError, SchulerError
from schuler.estimation.comparison.pairs import compare_parameters
from schuler.estimation.identify import identify
from schuler.estimation.spectrum.fit import fit_spectrum, identify_spectrum
from schuler.estimation.spectrum.slopes import spectrum_slopes
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    ProcessSum,
    Quantization,
    RandomWalk,
    RateRamp,
    WhiteNoise,
)
from schuler.units import parse

TRUTH = WhiteNoise(1.0) + GaussMarkov(0.5, 5.0) + RandomWalk(0.02)


def test_errors_are_claimed_as_they_are() -> None:
    rng = np.random.default_rng(1)
    errors, claimed, covered = [], [], []
    for _ in range(30):
        fit = identify_spectrum(TRUTH.simulate(100_000, 0.1, rng), 10.0, TRUTH)
        assert fit.converged
        keys = list(fit.parameters)
        values = TRUTH.parameters
        errors.append([fit.parameters[k] / values[k] - 1.0 for k in keys])
        claimed.append([fit.standard_errors[k] / values[k] for k in keys])
        covered += [fit.intervals[k][0] <= values[k] <= fit.intervals[k][1] for k in keys]
    spread = np.std(errors, axis=0) / np.median(claimed, axis=0)
    # a standard deviation out of 30 is known to 13 %
    assert (spread > 0.55).all()
    assert (spread < 1.55).all()
    assert np.mean(covered) > 0.88
    assert (np.abs(np.mean(errors, axis=0)) < 4.0 * np.median(claimed, axis=0) / 5.5).all()
    white = keys.index("white_noise.density")
    assert np.std(np.array(errors)[:, white]) < 0.005


def test_the_structure_is_found() -> None:
    rng = np.random.default_rng(2)
    found = [
        "+".join(identify_spectrum(TRUTH.simulate(72_000, 0.1, rng), 10.0).process.names)
        for _ in range(10)
    ]
    assert found.count("white_noise+gauss_markov+random_walk") >= 8
    white = identify_spectrum(3.0 * rng.standard_normal(50_000), 100.0)
    assert white.process.names == ("white_noise",)
    assert white.parameters["white_noise.density"] == pytest.approx(0.3, rel=0.01)
    assert white.flags == ()
    steps = Quantization(2.0) + WhiteNoise(1.0)
    fit = identify_spectrum(steps.simulate(50_000, 0.1, rng), 10.0)
    assert fit.process.names == ("white_noise", "quantization")
    assert fit.parameters["quantization.step_density"] == pytest.approx(2.0, rel=0.03)


# Table 4 of S004 with the bias instability that its own curves bear (spec 2.4 b)
S004: dict[str, tuple[ProcessSum, float]] = {
    "accel_x": (
        WhiteNoise(parse("0.045 m/s/sqrt(h)", "accel white noise"))
        + BiasInstability(parse("2.65 m/s/h", "accel bias instability"), 0.02, 1e5)
        + RandomWalk(parse("166.3 m/s/h^1.5", "accel random walk")),
        0.20,
    ),
    "accel_y": (
        WhiteNoise(parse("0.045 m/s/sqrt(h)", "accel white noise"))
        + BiasInstability(parse("4.22 m/s/h", "accel bias instability"), 0.02, 1e5)
        + RandomWalk(parse("24.95 m/s/h^1.5", "accel random walk")),
        0.20,
    ),
}


@pytest.mark.parametrize("axis", sorted(S004))
def test_table_3_against_table_4(axis: str) -> None:
    truth, band = S004[axis]
    signal = truth.simulate(2_520_000, 0.01, np.random.default_rng(3))
    spectrum = identify_spectrum(signal, 100.0, "classical")
    values = truth.parameters
    found = spectrum.parameters
    assert found["white_noise.density"] == pytest.approx(values["white_noise.density"], rel=0.02)
    assert found["bias_instability.level"] == pytest.approx(
        values["bias_instability.level"], rel=band
    )
    assert found["random_walk.density"] == pytest.approx(values["random_walk.density"], rel=band)
    allan = identify(signal, 100.0, "classical")
    table = compare_parameters(spectrum, allan)
    rows = {row.parameter: row for row in table.rows}
    assert len(rows) == 3
    assert abs(rows["bias_instability.level"].difference) < 2.0
    assert abs(rows["random_walk.density"].difference) < 2.0
    # the Allan form of the fastest Gauss-Markov noise knows no aliases: 0.15 % in N
    assert abs(rows["white_noise.density"].relative) < 0.003
    # what the slope method reads is right where one process rules
    slopes = spectrum.slopes
    assert slopes.white_noise is not None
    assert slopes.white_noise.value == pytest.approx(values["white_noise.density"], rel=0.05)
    if axis == "accel_x":
        # N and K cross: read as bias instability by the Allan plateau, twice the truth
        assert allan.slopes.bias_instability is not None
        assert allan.slopes.bias_instability.value > 1.8 * values["bias_instability.level"]
        assert slopes.bias_instability is not None
        assert slopes.bias_instability.value > 1.5 * values["bias_instability.level"]
        assert slopes.random_walk is not None
        assert slopes.random_walk.value == pytest.approx(values["random_walk.density"], rel=0.3)
    else:
        assert slopes.bias_instability is not None
        assert slopes.bias_instability.value == pytest.approx(
            values["bias_instability.level"], rel=0.3
        )


def test_slopes_are_read_two_sided_from_either_convention() -> None:
    rng = np.random.default_rng(4)
    walk = RandomWalk(0.3).simulate(200_000, 0.1, rng)
    steps = Quantization(2.0).simulate(200_000, 0.1, rng)
    flicker = BiasInstability(1.5, 0.1, 1e5, 2).simulate(400_000, 0.1, rng)
    white = 2.0 * rng.standard_normal(200_000)
    for onesided in (True, False):
        readings = [
            spectrum_slopes(power_spectral_density(s, 10.0, onesided=onesided))
            for s in (walk, flicker, white)
        ]
        assert readings[0].random_walk is not None
        assert readings[1].bias_instability is not None
        assert readings[2].white_noise is not None
        # K = 2 pi sqrt(S(1 Hz)), B = sqrt(2 pi f S), N = sqrt(S)
        assert readings[0].random_walk.value == pytest.approx(0.3, rel=0.1)
        assert readings[1].bias_instability.value == pytest.approx(1.5, rel=0.1)
        assert readings[2].white_noise.value == pytest.approx(2.0 / np.sqrt(10.0), rel=0.01)
        assert readings[2].random_walk is None
        assert readings[2].white_noise.relative_error < 0.01
    # the +2 line bends down towards the Nyquist frequency: sin² instead of the square
    quantised = spectrum_slopes(power_spectral_density(steps, 10.0, onesided=False)).quantization
    assert quantised is not None
    assert quantised.value == pytest.approx(2.0, rel=0.15)


def test_a_misfit_is_told_and_widens_the_errors() -> None:
    rng = np.random.default_rng(5)
    signal = (WhiteNoise(1.0) + GaussMarkov(2.0, 3.0)).simulate(50_000, 0.1, rng)
    wrong = identify_spectrum(signal, 10.0, WhiteNoise(1.0) + RandomWalk(1.0))
    right = identify_spectrum(signal, 10.0, WhiteNoise(1.0) + GaussMarkov(1.0, 1.0))
    assert "misfit" in wrong.flags
    assert wrong.discrepancy > 0.1
    assert right.flags == ()
    assert right.discrepancy == 0.0
    assert right.dispersion < 1.5
    assert wrong.standard_errors["white_noise.density"] > (
        1.5 * right.standard_errors["white_noise.density"]
    )


def test_a_term_that_is_not_there_gets_a_limit() -> None:
    rng = np.random.default_rng(10)
    true = WhiteNoise(1.0) + GaussMarkov(0.5, 5.0)
    model = true + RandomWalk(1.0)
    limits = []
    for _ in range(12):
        fit = identify_spectrum(true.simulate(50_000, 0.1, rng), 10.0, model)
        value = fit.parameters["random_walk.density"]
        error = fit.standard_errors["random_walk.density"]
        limits.append(fit.intervals["random_walk.density"][1])
        # nothing is claimed that the record does not show
        assert value < 2.5 * error
        assert error > 1e-3
    # a walk above the limits is seen: K² adds to the spectrum at the lowest frequencies
    seen = 4.0 * float(np.median(limits))
    walking = true + RandomWalk(seen)
    found = identify_spectrum(walking.simulate(50_000, 0.1, rng), 10.0, model)
    assert found.parameters["random_walk.density"] == pytest.approx(seen, rel=0.5)
    assert found.intervals["random_walk.density"][0] > 0.0


def test_a_sensors_own_filter_is_kept_out() -> None:
    rng = np.random.default_rng(6)
    fast = rng.standard_normal(400_002)
    smooth = (fast[:-2] + fast[1:-1] + fast[2:]) / 3.0
    whole = identify_spectrum(smooth, 100.0, WhiteNoise(1.0))
    inside = identify_spectrum(smooth, 100.0, WhiteNoise(1.0), band=(0.0, 3.0))
    beyond = identify_spectrum(smooth, 100.0, WhiteNoise(1.0), band=(0.0, 50.0))
    assert whole.flags == ("fast part left out",)
    assert whole.frequency.max() <= 5.0
    assert inside.flags == ()
    assert "misfit" in beyond.flags
    for fit in (whole, inside):
        assert fit.parameters["white_noise.density"] == pytest.approx(0.1, rel=0.02)


@dataclass(frozen=True)
class Given:
    parameters: dict[str, float]
    standard_errors: dict[str, float]


def test_comparison_counts_in_combined_errors() -> None:
    # Acc Y, Table 3 against Table 4 of S004 with the printed sigma
    psd = Given({"N": 0.044, "B": 4.67, "Q": 1.0}, {"N": 0.0, "B": 0.0, "Q": 1.0})
    allan = Given({"N": 0.045, "B": 4.5507, "K": 24.95}, {"N": 0.00022, "B": 0.0506, "K": 2.8})
    table = compare_parameters(psd, allan)
    assert [r.parameter for r in table.rows] == ["N", "B"]
    assert table.rows[0].difference == pytest.approx(-4.5, abs=0.06)
    assert table.rows[1].difference == pytest.approx(2.4, abs=0.06)
    assert table.rows[0].relative == pytest.approx(-0.0222, abs=1e-4)
    assert table.outside() == ("N", "B")
    assert table.outside(3.0) == ("N",)
    assert table.only_first == ("Q",)
    assert table.only_second == ("K",)
    assert any("less than Allan, 4.5" in text for text in table.findings())
    json.dumps(table.to_dict(), allow_nan=False)
    both = Given({"N": 3.0}, {"N": 3.0})
    assert compare_parameters(both, Given({"N": 0.0}, {"N": 4.0})).rows[0].difference == 0.6
    with pytest.raises(InputError, match="common"):
        compare_parameters(psd, Given({}, {}))


# Tables 3 (PSD) and 4 (Allan variance, with its printed sigma) of S004, in the paper's units
PRINTED = {
    "acc X": {
        "N": (0.045, 0.045, 0.00023),
        "B": (4.6447, 5.1581, 0.0370),
        "K": (168.6, 166.3, 4.6398),
    },
    "acc Y": {
        "N": (0.044, 0.045, 0.00022),
        "B": (4.67, 4.5507, 0.0506),
        "K": (26.66, 24.95, 2.8368),
    },
    "acc Z": {
        "N": (0.047, 0.047, 0.0005),
        "B": (1.7733, 1.8336, 0.0524),
        "K": (14.6, 13.53, 1.8685),
    },
    "gyro X": {"N": (2.297, 2.42, 0.0974), "B": (43.438, 44.533, 5.14)},
    "gyro Y": {"N": (1.937, 1.988, 0.0565), "B": (39.614, 38.81, 2.51)},
    "gyro Z": {"N": (2.058, 2.164, 0.0599), "B": (30.705, 31.717, 2.29)},
}


def test_most_within_the_interval_is_nine_of_fifteen() -> None:
    # E-004-16: the paper's "most" of its own tables
    outside = {}
    total = 0
    for axis, rows in PRINTED.items():
        psd = Given({k: v[0] for k, v in rows.items()}, dict.fromkeys(rows, 0.0))
        allan = Given({k: v[1] for k, v in rows.items()}, {k: v[2] for k, v in rows.items()})
        table = compare_parameters(psd, allan)
        total += len(table.rows)
        for row in table.rows:
            if row.parameter in table.outside(1.0):
                outside[f"{axis} {row.parameter}"] = round(row.difference, 1)
    assert total == 15
    assert outside == {
        "acc X B": -13.9,
        "acc Y N": -4.5,
        "acc Y B": 2.4,
        "acc Z B": -1.2,
        "gyro X N": -1.3,
        "gyro Z N": -1.8,
    }


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_scale_does_not_matter(scale: float) -> None:
    signal = TRUTH.simulate(20_000, 0.1, np.random.default_rng(7))
    unit, scaled = (identify_spectrum(s * signal, 10.0) for s in (1.0, scale))
    assert scaled.process.names == unit.process.names
    for key, value in unit.parameters.items():
        factor = 1.0 if key.endswith("correlation_time") else scale
        assert scaled.parameters[key] == pytest.approx(factor * value, rel=1e-3)


def test_results_are_json() -> None:
    fit = identify_spectrum(np.random.default_rng(8).standard_normal(5000), 10.0)
    back = json.loads(json.dumps(fit.to_dict(), allow_nan=False))
    assert back["parameters"]["white_noise.density"]["value"] == fit.process.parts[0].density


@pytest.mark.parametrize(
    ("signal", "model", "error", "words"),
    [
        (np.full(500, 1.0), "auto", EstimationError, "does not vary"),
        (np.arange(40.0) % 7, "auto", EstimationError, "points"),
        (np.arange(500.0) % 7, "perfect", InputError, "perfect"),
        (np.arange(500.0) % 7, RateRamp(1.0) + WhiteNoise(1.0), ModelError, "rate_ramp"),
        (np.append(np.zeros(500), np.nan), "auto", InputError, "not finite"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    signal: Any, model: Any, error: type[SchulerError], words: str
) -> None:
    with pytest.raises(error, match=words) as caught:
        identify_spectrum(signal, 10.0, model)
    assert "\n" not in str(caught.value)


def test_ramps_and_outliers_are_not_passed_off_as_good_fits() -> None:
    rng = np.random.default_rng(9)
    noise = rng.standard_normal(20_000)
    ramp = identify_spectrum(noise + 1e-2 * np.arange(20_000), 10.0)
    assert "trend" in ramp.flags
    struck = noise.copy()
    struck[7000] = 1e4
    hit = identify_spectrum(struck, 10.0)
    # one blow is white: its variance is reported, not hidden
    assert hit.parameters["white_noise.density"] > 5.0
    single = power_spectral_density(noise, 10.0, onesided=False, bins_per_octave=None)
    with pytest.raises(InputError, match="single bins"):
        fit_spectrum(single)
