"""From a signal to its processes by the usual way: lines out, outliers held back, Allan curve."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from numpy.typing import ArrayLike

from schuler.curves.allan import allan_deviation
from schuler.estimation.disturbances.prepare import Prepared, prepared
from schuler.estimation.gmwm.fit import fit_gmwm
from schuler.estimation.identification import Identification
from schuler.estimation.joint_fit import fit_factors, identify_curve, usual_part
from schuler.noise import Process
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
    return identify_prepared(prepared(values, rate, columns), model)


def identify_prepared(ready: Prepared, model: str | Process = "auto") -> Identification:
    """The same of a signal that was made ready."""
    rate = ready.rate
    robustly = ready.robust and not isinstance(model, Process)
    if robustly:
        found: Identification = fit_gmwm(ready.values, rate, model, robust=True)
    else:
        taus = fit_factors(ready.values.size) / rate
        curve = allan_deviation(ready.values, rate, taus)
        found = identify_curve(curve, model)
        believed = ready.believed(found.process, model)
        if believed is not None:
            found = identify_curve(curve, believed)
        if ready.lines:
            shown = usual_part(allan_deviation(ready.followed, rate, taus))
            found = replace(_with_lines(found, ready), curve=shown)
    return replace(
        found,
        flags=(*ready.flags(robustly), *found.flags),
        lines=ready.lines,
        effects=ready.effects,
    )


def _with_lines(found: Identification, ready: Prepared) -> Identification:
    """Add steady lines to a result as sinusoids."""
    process, numbers, errors = ready.with_lines(found.process)
    intervals = {k: (v - 1.96 * errors[k], v + 1.96 * errors[k]) for k, v in numbers.items()}
    return replace(
        found,
        process=process,
        standard_errors={**found.standard_errors, **errors},
        intervals={**found.intervals, **intervals},
    )
