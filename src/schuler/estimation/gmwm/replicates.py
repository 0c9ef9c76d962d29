"""Several records of one sensor: one model for all, and whether they share it (spec 10)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import ArrayLike

from schuler.curves.wavelet_variance import wavelet_variance
from schuler.data.exportable import Exportable
from schuler.data.to_dict import plain
from schuler.errors import EstimationError, InputError
from schuler.estimation.comparison.agreement import Agreement, compare_runs
from schuler.estimation.disturbances.outliers import contamination
from schuler.estimation.gmwm.fit import (
    Model,
    Robust,
    at_scales_from,
    fit_gmwm_curves,
    one_channel,
)
from schuler.estimation.gmwm.moments import fit_moments, heterogeneity
from schuler.estimation.gmwm.result import GmwmIdentification, describe_fit

_SHARED = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class PooledIdentification(Exportable):
    """Several records of one sensor, together and apart.

    Parameters
    ----------
    pooled : GmwmIdentification
        One model for all records.
    runs : tuple of GmwmIdentification
        The same structure, each record alone.
    chi_square : float
        Heterogeneity: what the common parameters cost in misfit beside separate ones.
    degrees_of_freedom : int
        (records - 1) times parameters.
    p_value : float
        Probability of a larger chi-square if the records share one model.
    agreements : tuple of Agreement
        The same question for every parameter.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import WhiteNoise, fit_gmwm_replicates
    >>> rng = np.random.default_rng(1)
    >>> runs = [WhiteNoise(1e-3).simulate(5_000, 0.01, rng) for _ in range(2)]
    >>> found = fit_gmwm_replicates(runs, 100.0, WhiteNoise(1e-3))
    >>> len(found.runs)
    2
    """

    JSON = "pooled runs"

    pooled: GmwmIdentification
    runs: tuple[GmwmIdentification, ...]
    chi_square: float
    degrees_of_freedom: int
    p_value: float
    agreements: tuple[Agreement, ...]

    @property
    def shared(self) -> bool:
        """True where the records may share one model, at the 1 % level."""
        return self.p_value > _SHARED

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        names = ("chi_square", "degrees_of_freedom", "p_value", "shared")
        heterogeneity = {name: plain(getattr(self, name)) for name in names}
        heterogeneity["parameters"] = plain(self.agreements)
        return Exportable.to_dict(self) | {"heterogeneity": heterogeneity}


def fit_gmwm_replicates(
    signals: Sequence[ArrayLike],
    rate: float,
    model: Model = "auto",
    robust: Robust = False,
    efficiency: float = 0.6,
) -> PooledIdentification:
    """Fit one model to several records of one sensor, and test whether they share it.

    Parameters
    ----------
    signals : sequence of (n,) array_like
        Records of one channel, at least two; lengths may differ.
    rate : float
        Samples a second of all.
    model, robust, efficiency
        As for `fit_gmwm`.

    Returns
    -------
    PooledIdentification
        Together, apart, and the heterogeneity chi-square (spec 10, multi-signal GMWM).

    Raises
    ------
    InputError, EstimationError, ModelError
        As `fit_gmwm`; fewer than two records.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import WhiteNoise, fit_gmwm_replicates
    >>> rng = np.random.default_rng(1)
    >>> runs = [WhiteNoise(1e-3).simulate(5_000, 0.01, rng) for _ in range(2)]
    >>> found = fit_gmwm_replicates(runs, 100.0, WhiteNoise(1e-3))
    >>> len(found.runs)
    2
    """
    from scipy.special import chdtrc

    if len(signals) < 2:
        raise EstimationError(f"{len(signals)} record", expected="at least two")
    curves, tails = [], 1.0
    for k, signal in enumerate(signals):
        try:
            values = one_channel(signal)
            curves.append(wavelet_variance(values, rate, robust, efficiency))
        except (InputError, EstimationError) as error:
            raise error.at(f"record {k}") from None
        tails = max(tails, 1.0 if robust else contamination(values).ratio)
    pooled = fit_gmwm_curves(curves, model, tails)
    used = [at_scales_from(c, float(pooled.diagnostics.tau[0])) for c in curves]
    granted = 2.0 * pooled.diagnostics.discrepancy
    together = fit_moments(pooled.process.parts, used, granted)
    chi_square, freedom = heterogeneity(together, used, granted)
    runs = tuple(
        describe_fit(fit_moments(together.parts, [c], granted), [c], granted, {}, 1.0) for c in used
    )
    p_value = float(chdtrc(max(freedom, 1), chi_square))
    if p_value <= _SHARED:
        pooled = _widened(pooled, math.sqrt(max(chi_square / max(freedom, 1), 1.0)))
    return PooledIdentification(
        pooled=pooled,
        runs=runs,
        chi_square=chi_square,
        degrees_of_freedom=freedom,
        p_value=p_value,
        agreements=tuple(compare_runs(runs, key) for key in pooled.standard_errors),
    )


def _widened(found: GmwmIdentification, factor: float) -> GmwmIdentification:
    """The same with standard errors larger by a factor, and a flag that says so."""
    return replace(
        found,
        standard_errors={k: factor * e for k, e in found.standard_errors.items()},
        intervals={
            k: (v * (low / v) ** factor, v * (high / v) ** factor)
            for (k, (low, high)), v in zip(
                found.intervals.items(), found.parameters.values(), strict=True
            )
        },
        flags=(
            *found.flags,
            "the records do not share one model: errors of the common one were widened "
            f"{factor:.2g} times",
        ),
    )
