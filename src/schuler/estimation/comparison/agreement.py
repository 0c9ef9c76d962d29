"""Do several runs of one sensor share one model? Estimates against their own errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from schuler.data.to_dict import ToDict
from schuler.errors import EstimationError
from schuler.estimation.identification import Identification


@dataclass(frozen=True, slots=True)
class Agreement(ToDict):
    """One parameter over several runs."""

    JSON = "* shared"

    parameter: str  # such as "white_noise.density"
    value: float  # weighted mean over the runs (of logarithms), SI
    standard_error: float  # of that mean, if the runs share one value
    chi_square: float  # sum of squared deviations from the mean over the squared errors
    degrees_of_freedom: int  # runs less one
    p_value: float  # probability of a larger chi-square if the runs share one value
    # relative standard deviation from run to run beyond the errors (DerSimonian-Laird)
    between: float

    @property
    def shared(self) -> bool:
        """True where the runs agree within their errors, at the 1 % level."""
        return self.p_value > 0.01


def compare_runs(runs: Sequence[Identification], parameter: str) -> Agreement:
    """Test whether runs agree on one parameter within their own standard errors."""
    from scipy.special import chdtrc

    found = [
        (math.log(r.parameters[parameter]), r.standard_errors[parameter] / r.parameters[parameter])
        for r in runs
        if r.parameters.get(parameter, 0.0) > 0.0
    ]
    if len(found) < 2:
        raise EstimationError(
            f"{len(found)} of {len(runs)} runs have '{parameter}'", expected="at least two"
        )
    weights = [1.0 / error**2 for _, error in found]
    total = math.fsum(weights)
    mean = math.fsum(w * x for w, (x, _) in zip(weights, found, strict=True)) / total
    chi_square = math.fsum(w * (x - mean) ** 2 for w, (x, _) in zip(weights, found, strict=True))
    freedom = len(found) - 1
    scale = total - math.fsum(w * w for w in weights) / total
    return Agreement(
        parameter=parameter,
        value=math.exp(mean),
        standard_error=math.exp(mean) / math.sqrt(total),
        chi_square=chi_square,
        degrees_of_freedom=freedom,
        p_value=float(chdtrc(freedom, chi_square)),
        between=math.sqrt(max(chi_square - freedom, 0.0) / scale),
    )
