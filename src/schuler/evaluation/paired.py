"""Two methods on the same draws: is one better, and by how much.

One definition goes with every percentage, as two of them hide in one paper (E-004-17): the mean
of the ratios and the ratio of the sums answer different questions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.errors import InputError

PERCENTAGES = "mean of ratios: mean over the cases of 1 - a/b; ratio of sums: 1 - sum(a)/sum(b)"


@dataclass(frozen=True, slots=True)
class PairedStatistics(Exportable):
    """Errors of method a against those of method b on the same cases.

    Parameters
    ----------
    cases : int
        Pairs that count as independent.
    mean_a, mean_b : float
        Mean errors.
    difference : float
        Mean of a - b; negative: a is better.
    standard_error : float
        Of the difference; NaN with a single case.
    wins : int
        Cases in which a is strictly better.
    ties : int
        Cases in which both are equal.
    sign_p, wilcoxon_p : float
        Two-sided probabilities of the sign test and of Wilcoxon's signed ranks if there were no
        difference; NaN where nothing differs.
    mean_of_ratios, ratio_of_sums : float
        By how much a is better than b, as shares: see `PERCENTAGES`.

    Examples
    --------
    >>> from schuler import paired_statistics
    >>> found = paired_statistics([1.0, 2.0, 3.0], [2.0, 3.0, 4.0])
    >>> found.cases, found.difference
    (3, -1.0)
    """

    JSON = "* standard_errors_apart"

    cases: int
    mean_a: float
    mean_b: float
    difference: float
    standard_error: float
    wins: int
    ties: int
    sign_p: float
    wilcoxon_p: float
    mean_of_ratios: float
    ratio_of_sums: float

    @property
    def standard_errors_apart(self) -> float:
        """The difference in units of its standard error."""
        return self.difference / self.standard_error if self.standard_error > 0.0 else math.nan


def paired_statistics(a: ArrayLike, b: ArrayLike) -> PairedStatistics:
    """Compare two methods on the same cases.

    Parameters
    ----------
    a, b : (n,) array_like
        Errors of both, in one unit.

    Returns
    -------
    PairedStatistics
        Mean difference with its standard error, wins, sign test, Wilcoxon's signed ranks, and the
        gain of a over b by both rules of percentages.

    Raises
    ------
    InputError
        Lengths that differ.

    Notes
    -----
    Erratum E-004-17 of S004: it mixes the mean of ratios with the ratio of sums.

    Examples
    --------
    >>> import schuler
    >>> schuler.paired_statistics([1.0, 2.0, 3.0], [2.0, 3.0, 4.0]).wins
    3
    """
    from scipy.stats import binomtest, wilcoxon

    one, two = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    if one.shape != two.shape or one.ndim != 1 or not one.size:
        raise InputError(
            f"{one.shape} errors against {two.shape}", expected="the same cases for both, (n,)"
        )
    if not (np.isfinite(one).all() and np.isfinite(two).all()):
        raise InputError("errors that are not finite", expected="a number for every case")
    d = one - two
    n, ties = d.size, int((d == 0.0).sum())
    wins = int((d < 0.0).sum())
    told = n - ties
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = 1.0 - one / two
        of_sums = 1.0 - one.sum() / two.sum()
    return PairedStatistics(
        cases=n,
        mean_a=float(one.mean()),
        mean_b=float(two.mean()),
        difference=float(d.mean()),
        standard_error=float(d.std(ddof=1) / math.sqrt(n)) if n > 1 else math.nan,
        wins=wins,
        ties=ties,
        sign_p=float(binomtest(wins, told).pvalue) if told else math.nan,
        wilcoxon_p=float(wilcoxon(one, two).pvalue) if told else math.nan,
        mean_of_ratios=float(ratios.mean()),
        ratio_of_sums=float(of_sums),
    )
