"""What an identification is: a process with errors, misfit and a verdict on the record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from schuler.curves.allan_curve import AllanCurve
from schuler.data.exportable import Exportable
from schuler.data.to_dict import plain
from schuler.estimation.disturbances.lines import Line
from schuler.estimation.ieee952 import (
    Coefficient,
    classical_reading,
    ieee952_of,
    ieee952_to_dict,
)
from schuler.estimation.record import RecordVerdict
from schuler.estimation.result import fitted_to_dict
from schuler.estimation.slopes import SlopeReadings
from schuler.noise import ProcessSum
from schuler.noise.effects import Effect
from schuler.types import FloatArray

CLOSE = 6.0
"""Difference of the criterion within which two structures cannot be told apart."""


@dataclass(frozen=True, slots=True, eq=False)
class FitDiagnostics:
    """How well the model describes the curve."""

    chi_square: float  # misfit, points being correlated as the model says
    degrees_of_freedom: int  # points less parameters
    # relative standard deviation (of the Allan deviation) that had to be granted to every point
    # because no sum of these processes fits better; 0 when the misfit is pure chance.
    discrepancy: float
    tau: FloatArray  # (t,): cluster times of the fit in s
    residuals: FloatArray  # (t,): ln(measured/model) of the deviation
    # criterion (smaller is better) of the structures that were compared
    candidates: Mapping[str, float]
    converged: bool  # the fit ended by itself


@dataclass(frozen=True, slots=True, eq=False)
class Identification(Exportable):
    """The processes a signal is made of.

    Parameters
    ----------
    process : ProcessSum
        In the unit of the signal.
    standard_errors : dict of str to float
        By parameter, e.g. "gauss_markov.sigma".
    intervals : dict of str to (float, float)
        95 % intervals, symmetric in the logarithm.
    limits : dict of str to float
        95 % upper limits of terms that were not found.
    curve : AllanCurve
        The curve that was fitted.
    diagnostics : FitDiagnostics
        Misfit.
    slopes : SlopeReadings
        What the slope method reads off the same curve, for comparison.
    verdict : RecordVerdict
        Record length against need.
    flags : tuple of str
        What to know before use, in plain words; empty if nothing.
    lines : tuple of Line
        Lines of vibration that were taken out first.
    effects : tuple of Effect
        What follows a column beside the signal, taken out first.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import WhiteNoise, identify
    >>> signal = WhiteNoise(1e-3).simulate(60_000, 0.01, np.random.default_rng(1))
    >>> [part.kind for part in identify(signal, 100.0).process.parts]
    ['white_noise']
    """

    JSON = "upper_limits_95=limits slope_method=slopes record=verdict"

    process: ProcessSum
    standard_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    limits: dict[str, float]
    curve: AllanCurve
    diagnostics: FitDiagnostics
    slopes: SlopeReadings
    verdict: RecordVerdict
    flags: tuple[str, ...] = field(default=(), kw_only=True)
    lines: tuple[Line, ...] = field(default=(), kw_only=True)
    effects: tuple[Effect, ...] = field(default=(), kw_only=True)

    @property
    def method(self) -> str:
        """Name of the method, as `identify` takes it."""
        return "allan"

    @property
    def parameters(self) -> dict[str, float]:
        """Fitted values by parameter, SI."""
        values = self.process.parameters
        return {key: values[key] for key in self.standard_errors}

    @property
    def ieee952(self) -> dict[str, Coefficient]:
        """N, B, K, Q, R of IEEE Std 952, SI."""
        return ieee952_of(self.process, self.standard_errors, self.limits)

    @property
    def rivals(self) -> dict[str, float]:
        """Structures nearly as good as the chosen one, and by how much they are worse."""
        tried = self.diagnostics.candidates
        best = min(tried.values(), default=0.0)
        # lines were taken out before structures were compared
        compared = [p.kind for p in self.process.parts if not (self.lines and p.kind == "sinusoid")]
        own = " + ".join(compared)
        return {s: c - best for s, c in tried.items() if c - best < CLOSE and s != own}

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        d = self.diagnostics
        misfit = {
            "chi_square": d.chi_square,
            "degrees_of_freedom": d.degrees_of_freedom,
            "discrepancy": d.discrepancy,
            "candidates": d.candidates,
        }
        named = fitted_to_dict(self.process, self.parameters, self.standard_errors, self.intervals)
        more = {"flags": self.flags, "lines": self.lines, "effects": self.effects}
        reading = classical_reading(self.curve, self.slopes, self.process)
        named |= {"ieee952": ieee952_to_dict(self.ieee952, reading)}
        told = {"misfit": misfit} | {key: value for key, value in more.items() if value}
        return Exportable.to_dict(self) | named | {key: plain(value) for key, value in told.items()}
