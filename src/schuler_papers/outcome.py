"""What an experiment came to: rows of printed and own values, and what is drawn again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import ModelError

Verdict = Literal[
    "reproduced",
    "reproduced in kind",
    "cannot be expected",
    "wrong in the paper",
    "beyond the paper",
]
Source = Literal["spec", "theory", "frozen"]
Mark = Literal["line", "dash", "points", "band"]
Role = Literal["printed", "ours", "theory", "paper", "better", "data", "x", "y", "z", "other"]


class Estimate(NamedTuple):
    """A number with its standard error.

    Parameters
    ----------
    value : float
        Mean over repetitions, or the number itself.
    standard_error : float
        Of that mean; NaN where nothing is random or there was one repetition only.
    """

    value: float
    standard_error: float = math.nan


@dataclass(frozen=True, slots=True)
class Band:
    """Where a value has to lie, and who says so.

    Parameters
    ----------
    low, high : float
        Ends of the band; infinite where there is none.
    source : {"spec", "theory", "frozen"}
        The specification of the project, a proof, or a forecast that was frozen after the first
        full run.
    note : str
        Which law, or the value that was measured when the band was frozen.
    standard_errors : float
        How many standard errors of the value are added on both sides.
    """

    low: float
    high: float
    source: Source
    note: str = ""
    standard_errors: float = 0.0

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise ModelError(f"a band from {self.low} to {self.high}", expected="low <= high")
        if self.source == "frozen" and not self.note:
            raise ModelError("a frozen band without a note", expected="the value that was measured")

    def holds(self, value: Estimate) -> bool:
        """Tell whether a value lies in the band."""
        error = value.standard_error if math.isfinite(value.standard_error) else 0.0
        slack = self.standard_errors * error
        return self.low - slack <= value.value <= self.high + slack


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity: what is printed, what came out, and what to think of it.

    Parameters
    ----------
    quantity : str
        What it is, in the field's words.
    ours : Estimate, float or str
        What came out; words where it is not a number.
    printed : float, str or None
        What the paper says, in the same unit; None where it gives no number.
    verdict : Verdict
        About the paper.
    unit : str
        Of all values of the row.
    band : Band or None
        Where ours has to lie.
    reason : str
        Why it cannot be expected, or the proof that the paper is wrong; else a remark.
    erratum : str
        Label of the slip, such as "E-000-5".
    """

    quantity: str
    ours: Estimate | float | str
    printed: float | str | None = None
    verdict: Verdict = "reproduced"
    unit: str = ""
    band: Band | None = None
    reason: str = ""
    erratum: str = ""

    def __post_init__(self) -> None:
        if self.verdict in ("cannot be expected", "wrong in the paper") and not self.reason:
            raise ModelError(f"'{self.quantity}' is '{self.verdict}' without a reason")
        if self.band is not None and isinstance(self.ours, str):
            raise ModelError(f"'{self.quantity}' has a band but no number")

    @property
    def estimate(self) -> Estimate:
        """Ours as a number with its error; NaN for words."""
        if isinstance(self.ours, Estimate):
            return self.ours
        return Estimate(math.nan if isinstance(self.ours, str) else float(self.ours))

    @property
    def holds(self) -> bool:
        """Whether ours lies in its band (or has none)."""
        return self.band is None or self.band.holds(self.estimate)

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values."""
        value, error = self.estimate
        band = self.band
        return {
            "quantity": self.quantity,
            "verdict": self.verdict,
            "printed": self.printed,
            "ours": self.ours if isinstance(self.ours, str) else value,
            "standard_error": error if math.isfinite(error) else None,
            "unit": self.unit,
            "band": None if band is None else [band.low, band.high],
            "band_source": None if band is None else band.source,
            "band_note": "" if band is None else band.note,
            "holds": self.holds,
            "reason": self.reason,
            "erratum": self.erratum,
        }


@dataclass(frozen=True, slots=True)
class Curve:
    """Something to be drawn.

    Parameters
    ----------
    name : str
        Its label.
    x, y : (n,) array_like
        Places; `x` counts the categories of a panel that has them. NaN is a gap.
    role : str
        What it is, which chooses the colour: "printed" in the paper, "ours", "theory", the
        "paper" 's method, our "better" one, "data", an axis "x", "y", "z", or "other".
    mark : {"line", "dash", "points", "band"}
        How it is drawn; a band needs `lower` and `upper`.
    lower, upper : (n,) array_like or None
        Ends of the error bars, or of the band.
    """

    name: str
    x: ArrayLike
    y: ArrayLike
    role: Role = "ours"
    mark: Mark = "line"
    lower: ArrayLike | None = None
    upper: ArrayLike | None = None

    def __post_init__(self) -> None:
        columns = {}
        for name in ("x", "y", "lower", "upper"):
            value = getattr(self, name)
            if value is not None:
                columns[name] = np.atleast_1d(np.asarray(value, dtype=np.float64))
                object.__setattr__(self, name, columns[name])
        if len({c.shape for c in columns.values()}) != 1 or columns["x"].ndim != 1:
            raise ModelError(f"curve '{self.name}' has columns of different lengths")
        if self.mark == "band" and (self.lower is None or self.upper is None):
            raise ModelError(f"band '{self.name}' has no ends")


@dataclass(frozen=True, slots=True)
class Panel:
    """One plot of a figure that is drawn again.

    Parameters
    ----------
    title : str
        Above it.
    x, y : str
        Quantity and unit of the axes.
    curves : tuple of Curve
        Drawn in this order.
    description : str
        What is to be seen, for readers who cannot see it.
    log_x, log_y : bool
        Logarithmic axes.
    categories : tuple of str
        Names for x = 0, 1, 2 ... instead of numbers.
    """

    title: str
    x: str
    y: str
    curves: tuple[Curve, ...]
    description: str
    log_x: bool = False
    log_y: bool = False
    categories: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Outcome:
    """All that is said about one table, figure, equation or erratum.

    Parameters
    ----------
    rows : tuple of Row
        At least one.
    panels : tuple of Panel
        What is drawn again.
    notes : tuple of str
        What the reader should take away, a sentence or two each.
    """

    rows: tuple[Row, ...]
    panels: tuple[Panel, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every row lies in its band."""
        return all(row.holds for row in self.rows)
