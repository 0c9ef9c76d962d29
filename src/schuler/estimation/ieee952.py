"""The five coefficients of IEEE Std 952 out of a fitted sum of processes.

N angle or velocity random walk, B bias instability, K rate random walk, Q quantisation, R ramp:
fitted values where the term is in the chosen model, 95 % upper limits where it was looked for and
not found. What one would read off the curve by hand stands beside B, under its own name.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from schuler.curves.allan_curve import AllanCurve
from schuler.estimation.slopes import SlopeReadings
from schuler.noise import GaussMarkov, Process
from schuler.noise.gauss_markov import FLICKER_LEVEL

KEYS = {
    "N": "white_noise.density",
    "B": "bias_instability.level",
    "K": "random_walk.density",
    "Q": "quantization.step_density",
    "R": "rate_ramp.slope",
}
"""Parameter behind every coefficient."""
WORDS = {
    "N": "N, random walk of the integral",
    "B": "B, bias instability",
    "K": "K, rate random walk",
    "Q": "Q, quantisation",
    "R": "R, ramp",
}
PLATEAU = "plateau of the sum of Gauss-Markov noises: its highest Allan deviation over 0.664"


@dataclass(frozen=True, slots=True)
class Coefficient:
    """One coefficient, SI."""

    value: float | None = None  # fitted; None where the term is not in the model.
    standard_error: float | None = None  # of it
    upper_limit: float | None = None  # 95 %, where the term was looked for and not found
    note: str = ""  # how it came about, where that is not plain


def ieee952_of(
    process: Process | None, errors: Mapping[str, float], limits: Mapping[str, float]
) -> dict[str, Coefficient]:
    """Coefficients of a process, by letter."""
    values = {} if process is None else process_parameters(process)
    found = {}
    for letter, key in KEYS.items():
        limit = limits.get(key)
        if key in values:
            # a term that has shrunk to nothing is only bounded
            gone = limit is not None and errors.get(key, 0.0) > values[key]
            kept = Coefficient(values[key], errors.get(key))
            found[letter] = Coefficient(upper_limit=limit) if gone else kept
        else:
            found[letter] = Coefficient(upper_limit=limit)
    if process is not None and found["B"].value is None:
        found["B"] = _of_gauss_markovs(process, errors) or found["B"]
    return found


def process_parameters(process: Process) -> dict[str, float]:
    """Parameters by key, for a single process as for a sum."""
    if len(process.components) == 1:
        (part,) = process.components
        return {f"{part.kind}.{name}": value for name, value in part.parameters.items()}
    return process.parameters


def _of_gauss_markovs(process: Process, errors: Mapping[str, float]) -> Coefficient | None:
    """The level that two or more Gauss-Markov noises hold together, as flicker would."""
    noises = [p for p in process.components if isinstance(p, GaussMarkov)]
    if len(noises) < 2:
        return None
    times = np.array([p.correlation_time for p in noises])
    tau = np.geomspace(times.min(), 3.0 * times.max(), 200)
    variances = np.array([p.allan_variance(tau) for p in noises])
    top = int(np.argmax(variances.sum(axis=0)))
    level = math.sqrt(float(variances[:, top].sum())) / FLICKER_LEVEL
    relative = 0.0
    for k, part in enumerate(noises):
        error = errors.get(f"gauss_markov_{k + 1}.sigma", 0.0) / max(part.sigma, 1e-300)
        relative += (error * float(variances[k, top] / variances[:, top].sum())) ** 2
    return Coefficient(level, level * math.sqrt(relative), None, PLATEAU)


@dataclass(frozen=True, slots=True)
class ClassicalReading:
    """Bias instability as it is read off a curve by hand, SI; each is biased where others reach in.

    Parameters
    ----------
    flat_run : float or None
        Longest flat run over 0.664.
    minimum : float
        Lowest point over 0.664, an upper bound of B even where there is no flicker at all.
    minimum_at : float
        Its cluster time in s.
    flicker_share : float
        Share of the variance at that point that the model gives to flicker or Gauss-Markov noise.
    """

    flat_run: float | None  # longest flat run over 0.664
    # lowest point over 0.664, an upper bound of B even where there is no flicker at all
    minimum: float
    minimum_at: float  # its cluster time in s
    # share of the variance at that point that the model gives to flicker or Gauss-Markov noise
    flicker_share: float


def classical_reading(
    curve: AllanCurve, slopes: SlopeReadings, process: Process
) -> ClassicalReading:
    """What one would read off the curve."""
    lowest = int(np.argmin(curve.deviation))
    clusters = curve.factors[lowest : lowest + 1]
    shares = [
        (p.kind, float(p.sampled_allan_variance(clusters, 1.0 / curve.rate)[0]))
        for p in process.components
    ]
    total = math.fsum(v for _, v in shares)
    held = math.fsum(v for kind, v in shares if kind in ("bias_instability", "gauss_markov"))
    run = slopes.bias_instability
    return ClassicalReading(
        None if run is None else run.value,
        float(curve.deviation[lowest]) / FLICKER_LEVEL,
        float(curve.tau[lowest]),
        held / total if total > 0.0 else 0.0,
    )


def ieee952_to_dict(
    coefficients: Mapping[str, Coefficient], reading: ClassicalReading | None = None
) -> dict[str, Any]:
    """Return plain Python for JSON, SI."""
    out: dict[str, Any] = {}
    for letter, c in coefficients.items():
        out[letter] = {
            "value": c.value,
            "standard_error": c.standard_error,
            "upper_limit": c.upper_limit,
            **({"note": c.note} if c.note else {}),
        }
    if reading is not None:
        out["B"]["classical_reading"] = asdict(reading)
    return out
