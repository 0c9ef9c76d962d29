"""Signals nobody would send: an error of one line or finite numbers, never a silent NaN."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from schuler.curves.allan_family import KINDS, family_deviation
from schuler.curves.autocorrelation import autocorrelation
from schuler.denoising import denoise
from schuler.errors import SchulerError
from schuler.estimation.gauss_markov_correlation import fit_gauss_markov
from schuler.estimation.spectrum.fit import identify_spectrum


def odd_signals(n: int) -> dict[str, np.ndarray]:
    white = np.random.default_rng(n).standard_normal(n)
    row = np.arange(n)
    return {
        "ramp": 1.0 * row,
        "ramp and noise": 0.1 * row + white,
        "walk of a walk": np.cumsum(np.cumsum(white)),
        "sine": np.sin(0.1 * row),
        "alternating": (-1.0) ** row,
        "one outlier": np.where(row == n // 2, 1e12, white),
        "one value": 1.0 * (row == 2),
        "step": 1.0 * (row > n // 2),
        "rounded": np.round(white),
        "tiny": 1e-12 * white,
        "huge": 1e12 * white,
        "subnormal": 1e-310 * white,
        "small on a large offset": 1e6 + 1e-9 * white,
        "integers": np.round(10 * white).astype(np.int16),
        "constant": np.full(n, 9.81),
    }


ANSWERS: dict[str, Callable[[np.ndarray], Any]] = {
    "autocorrelation": lambda x: autocorrelation(x, 10.0).to_dict(),
    "gauss-markov": lambda x: fit_gauss_markov(autocorrelation(x, 10.0)).to_dict(),
    "spectrum": lambda x: identify_spectrum(x, 10.0).to_dict(),
    "classical": lambda x: identify_spectrum(x, 10.0, "classical").to_dict(),
    "sure": lambda x: [d := denoise(x), d.signal.tolist(), d.to_dict()][1:],
    "universal": lambda x: denoise(x, threshold="universal", scale="sln").signal.tolist(),
    "unit": lambda x: denoise(x, scale="one").signal.tolist(),
    "family": lambda x: [family_deviation(x, 10.0, kind=k).upper.tolist() for k in KINDS],
}


@pytest.mark.parametrize("samples", [5, 64, 333])
@pytest.mark.parametrize("name", sorted(ANSWERS))
def test_an_error_or_finite_numbers(name: str, samples: int) -> None:
    answered = 0
    for kind, signal in odd_signals(samples).items():
        try:
            answer = ANSWERS[name](signal)
        except SchulerError as error:
            assert "\n" not in str(error), kind
            continue
        json.dumps(answer, allow_nan=False)
        answered += 1
    # records of 333 samples are enough for most
    assert answered >= (8 if samples == 333 and name != "gauss-markov" else 0)


def test_false_claims_are_flagged() -> None:
    signals = odd_signals(3000)
    for kind in ("ramp", "ramp and noise", "walk of a walk"):
        assert "trend" in identify_spectrum(signals[kind], 10.0).flags, kind
    fit = identify_spectrum(signals["sine"], 10.0)
    assert "misfit" in fit.flags
    for kind in ("ramp", "sine", "step"):
        correlation = fit_gauss_markov(autocorrelation(signals[kind], 10.0))
        assert {"not exponential", "record too short"} & set(correlation.flags), kind
    assert math.isfinite(fit.discrepancy)
