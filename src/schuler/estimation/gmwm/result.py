"""What the generalised method of wavelet moments found, and what a reader should know of it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.curves.wavelet_variance import WaveletVarianceCurve
from schuler.estimation.curve_fit import limits_of
from schuler.estimation.gmwm.moments import MomentFit
from schuler.estimation.gmwm.scatter import pooled_points, pooled_scatter
from schuler.estimation.identification import FitDiagnostics, Identification
from schuler.estimation.parts import estimates_of
from schuler.estimation.record import judge_record
from schuler.estimation.slopes import slope_method
from schuler.noise import GaussMarkov, ProcessSum

_HEAVY_TAILS = 1.3


@dataclass(frozen=True, slots=True, eq=False)
class GmwmIdentification(Identification):
    """What the generalised method of wavelet moments found.

    Parameters
    ----------
    wavelet : WaveletVarianceCurve
        The curve that was fitted (the longest record's where several were pooled).
    p_value : float
        Of the J test: probability of a larger misfit if the model is true.
    wvic : float
        Wavelet variance information criterion; smaller is better among models of one curve.
    flags : tuple of str
        What a reader should know, in plain words; empty when all is well.

    Notes
    -----
    All else as in `Identification`.
    """

    wavelet: WaveletVarianceCurve
    p_value: float
    wvic: float
    flags: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        more: dict[str, Any] = {"method": "gmwm", "wavelet_variance": self.wavelet.to_dict()}
        more |= {"p_value": self.p_value, "wvic": self.wvic, "flags": list(self.flags)}
        return Identification.to_dict(self) | more | {"converged": self.diagnostics.converged}


def describe_fit(
    fit: MomentFit,
    curves: Sequence[WaveletVarianceCurve],
    granted: float,
    candidates: Mapping[str, float],
    tails: float,
) -> GmwmIdentification:
    """Turn a fit into a result with errors, intervals, limits and flags."""
    from scipy.special import chdtrc

    process = fit.process
    found = estimates_of(fit.parts, fit.names, fit.log_covariance)
    points = pooled_points(curves)
    absent = limits_of(fit, points, pooled_scatter(process, curves, points))
    longest = max(curves, key=lambda c: c.samples)
    shown = longest.allan
    p_value = float(chdtrc(max(fit.degrees_of_freedom, 1), fit.cost))
    model = 0.5 * points.of(process)
    return GmwmIdentification(
        process=process,
        standard_errors=found.errors,
        intervals=found.intervals,
        limits={**absent, **found.limits},
        curve=shown,
        diagnostics=FitDiagnostics(
            chi_square=fit.cost,
            degrees_of_freedom=fit.degrees_of_freedom,
            discrepancy=0.5 * granted,
            tau=points.tau,
            residuals=0.5 * np.log(0.5 * points.variance / model),
            candidates=candidates,
            converged=fit.converged,
        ),
        slopes=slope_method(shown),
        verdict=judge_record(process, found.errors, math.fsum(c.duration for c in curves)),
        wavelet=longest,
        p_value=p_value,
        wvic=fit.wvic,
        flags=_flags(fit, process, longest, granted, tails),
    )


def _flags(
    fit: MomentFit,
    process: ProcessSum,
    curve: WaveletVarianceCurve,
    granted: float,
    tails: float,
) -> tuple[str, ...]:
    flags = []
    if not fit.converged:
        flags.append("the fit did not converge")
    if granted > 0.0:
        flags.append(
            f"no sum of these processes fits better than {50.0 * granted:.1f} % in deviation: "
            "errors were widened to match"
        )
    if tails > _HEAVY_TAILS:
        flags.append(
            f"heavy tails or outliers: the finest scale holds {tails:.3g} times its robust "
            "variance; robust=True holds them back"
        )
    times = [p.correlation_time for p in process.parts if isinstance(p, GaussMarkov)]
    flags += [
        f"a correlation time of {t:.3g} s cannot be told from a random walk in "
        f"{curve.duration:.3g} s"
        for t in times
        if t > 0.5 * curve.duration
    ]
    flags += [
        f"a correlation time of {t:.3g} s stands at the shortest scale: it may be shorter"
        for t in times
        if t <= 1.001 * curve.scale[0]
    ]
    if curve.robust == "samples" and curve.outliers > 0.1:
        flags.append(f"{100.0 * curve.outliers:.0f} % of the samples were held back as outliers")
    return tuple(flags)
