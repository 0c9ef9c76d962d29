"""From a signal to its processes by the usual way: lines out, outliers held back, Allan curve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.curves.allan import allan_deviation
from schuler.estimation.disturbances.covariates import without_covariates
from schuler.estimation.disturbances.lines import Line
from schuler.estimation.disturbances.prepare import prepared
from schuler.estimation.gmwm.fit import fit_gmwm
from schuler.estimation.identification import Identification
from schuler.estimation.joint_fit import fit_factors, identify_curve, usual_part
from schuler.noise import Process, ProcessSum, Quantization, Sinusoid
from schuler.types import FloatArray


def identify_signal(
    values: FloatArray,
    rate: float,
    model: str | Process = "auto",
    columns: Mapping[str, ArrayLike] | None = None,
) -> Identification:
    """Find the processes of a signal by the joint fit of its Allan curve.

    What follows a column beside it (temperature) is taken off first, its size found together with
    the noise.
    """
    values = np.asarray(values, dtype=np.float64)
    regression = without_covariates(values, rate, columns or {})
    values = regression.signal
    ready = prepared(values, rate)
    robustly = ready.robust and not isinstance(model, Process)
    if robustly:
        found: Identification = fit_gmwm(ready.values, rate, model, robust=True)
    else:
        taus = fit_factors(len(values)) / rate
        curve = allan_deviation(ready.values, rate, taus)
        found = identify_curve(curve, model)
        if model == "auto" and any(not line.steady for line in ready.lines):
            # what fills a band is not quite what was there: its edges look like quantisation
            kept = tuple(p for p in found.process.parts if not isinstance(p, Quantization))
            if len(kept) < len(found.process.parts):
                found = identify_curve(curve, ProcessSum(kept))
        if ready.lines:
            shown = usual_part(allan_deviation(values, rate, taus))
            found = replace(with_lines(found, ready.lines), curve=shown)
    followed = tuple(
        f"it follows the {e.words} by {e.coefficient:.4g} ± {e.standard_error:.2g} (SI), which was "
        "taken off before the fit"
        for e in regression.effects
    )
    return replace(
        found,
        flags=(*ready.flags(robustly), *followed, *regression.flags, *found.flags),
        lines=ready.lines,
        effects=regression.effects,
    )


def with_lines(found: Identification, lines: tuple[Line, ...]) -> Identification:
    """Add steady lines to a result as sinusoids."""
    steady = [line for line in lines if line.steady]
    if not steady:
        return found
    before = len(found.process.parts)
    sinusoids = tuple(Sinusoid(line.amplitude, line.frequency) for line in steady)
    process = ProcessSum((*found.process.parts, *sinusoids))
    errors, intervals = dict(found.standard_errors), dict(found.intervals)
    for name, line in zip(process.names[before:], steady, strict=True):
        for key, value, error in (
            ("amplitude", line.amplitude, line.amplitude_error),
            ("frequency", line.frequency, line.frequency_error),
        ):
            errors[f"{name}.{key}"] = error
            intervals[f"{name}.{key}"] = (value - 1.96 * error, value + 1.96 * error)
    return replace(found, process=process, standard_errors=errors, intervals=intervals)
