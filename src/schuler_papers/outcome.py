"""What an experiment came to, and the verdicts, which follow from numbers alone."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from schuler import ModelError

Source = Literal["spec", "theory", "frozen"]
Kind = Literal["printed", "shown", "arithmetic", "setting"]
Mark = Literal["line", "dash", "points", "band"]
Role = Literal["printed", "ours", "theory", "paper", "better", "data", "x", "y", "z", "other"]
VERDICTS = {
    "reproduced": "the printed number lies in a band narrower than a quarter, or in its own error",
    "reproduced in kind": "it lies in a wider band, in the scatter of one draw, or the words hold",
    "not met": "it lies outside; the twin may differ from what the authors had",
    "wrong in the paper": "it lies outside, and a proof that ran says that it cannot be right",
    "beyond the paper": "nothing is printed; ours lies where theory or a forecast says",
    "shown": "there is no band, so no verdict",
    "setting": "an input of the experiment, or solved from printed values",
    "outside its band": "ours does not lie where it has to: the check failed",
}
"""All verdicts with what they mean."""
NARROW = 0.25
"""Widest band, relative to its middle, in which a printed number counts as reproduced."""
OWN_ERRORS = 2.0
"""Standard deviations of the printed number, or of one draw, that are allowed for."""


class Estimate(NamedTuple):
    """A number with its standard error: NaN where nothing is random, or with one repetition."""

    value: float
    standard_error: float = math.nan


@dataclass(frozen=True, slots=True)
class Band:
    """Where a value has to lie, and who says so."""

    # low, high: ends of the band; infinite where there is none.
    low: float
    high: float
    # the specification of the project, a proof, or a forecast that was frozen at given seeds
    source: Source = "spec"
    note: str = ""  # which law, or the value that was measured when the band was frozen
    standard_errors: float = 0.0  # how many standard errors of the value are added on both sides

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise ModelError(f"a band from {self.low} to {self.high}", expected="low <= high")
        if self.source == "frozen" and not self.note:
            raise ModelError("a frozen band without a note", expected="the value that was measured")

    def holds(self, value: Estimate, slack: float = 0.0) -> bool:
        """Tell whether a value lies in the band."""
        error = value.standard_error if math.isfinite(value.standard_error) else 0.0
        slack += self.standard_errors * error
        return self.low - slack <= value.value <= self.high + slack

    @property
    def width(self) -> float:
        """Relative to the middle; infinite around zero."""
        middle = 0.5 * abs(self.low + self.high)
        span = self.high - self.low
        if span == 0.0:
            return 0.0
        return span / middle if math.isfinite(span) and middle > 0.0 else math.inf


@dataclass(frozen=True, slots=True)
class Proof:
    """Why a printed number or statement cannot be right: something that was run."""

    statement: str  # one sentence
    value: Estimate | float  # what was computed
    # low, high: the proof holds if the value lies between them
    low: float
    high: float
    # of which kind it is; a counter-experiment has the paper's own conditions.
    method: Literal["identity", "bound", "counter-experiment"] = "identity"

    @property
    def holds(self) -> bool:
        """Whether the value lies where the proof needs it."""
        value = self.value.value if isinstance(self.value, Estimate) else float(self.value)
        return self.low <= value <= self.high

    def to_dict(self) -> dict[str, Any]:
        """Return the proof as plain values."""
        value = self.value.value if isinstance(self.value, Estimate) else float(self.value)
        return {
            "statement": self.statement,
            "method": self.method,
            "value": value,
            "range": [self.low, self.high],
            "holds": self.holds,
        }


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity: what is printed, what came out, and where it has to lie."""

    quantity: str  # what it is, in the field's words
    ours: Estimate | float | str  # what came out; words where it is not a number.
    # what the paper says, in the same unit; None where it says nothing.
    printed: float | str | None = None
    unit: str = ""  # of all values of the row
    band: Band | None = None  # where ours has to lie
    printed_error: float = math.nan  # standard deviation of the printed number, as it is printed
    # standard deviation of one draw of ours, where the printed number is one draw
    scatter: float = math.nan
    # computed from printed numbers alone; an input. Else the kind follows from the numbers.
    role: Literal["", "arithmetic", "setting"] = ""
    # the printed number is computed from printed ones, or implied by the text
    derived: bool = False
    against: bool = False  # the band contradicts what is said in words
    proof: Proof | None = None  # why the paper cannot be right
    reason: str = ""  # a remark, or what would explain a difference
    erratum: str = ""  # label of the slip, such as "E-000-5"

    def __post_init__(self) -> None:
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

    @property
    def kind(self) -> Kind:
        """What the row can tell."""
        if self.role:
            return self.role
        number = self.printed is not None and not isinstance(self.printed, str)
        return "printed" if number and self.compared is not None else "shown"

    @property
    def compared(self) -> Band | None:
        """What the printed number is compared with: ours within its own error, or the band.

        A frozen forecast is the mean of many draws, so the error of this run does not widen it.
        """
        value, error = self.estimate
        error = error if math.isfinite(error) else 0.0
        for own in (self.printed_error, math.nan if self.band else self.scatter):
            if math.isfinite(own):
                slack = OWN_ERRORS * math.hypot(own, error)
                return Band(value - slack, value + slack, "theory", "errors of both")
        if self.band is None:
            return None
        slack = 0.0 if self.band.source == "frozen" else self.band.standard_errors * error
        return Band(self.band.low - slack, self.band.high + slack, "theory", "with our error")

    @property
    def agrees(self) -> bool:
        """Whether the printed number lies where it is compared, rounding allowed for."""
        if self.compared is None or self.printed is None or isinstance(self.printed, str):
            return False
        slack = 0.0 if self.derived else rounding(self.printed)
        return self.compared.holds(Estimate(float(self.printed)), slack)

    @property
    def may_be_drawn(self) -> bool:
        """Whether the printed number lies in the scatter of one draw around the band."""
        if self.band is None or not isinstance(self.printed, float):
            return False
        middle = 0.5 * (self.band.low + self.band.high)
        return abs(self.printed - middle) <= OWN_ERRORS * self.scatter

    @property
    def narrow(self) -> bool:
        """Whether the comparison is narrower than a quarter, or the printed number's own error."""
        if math.isfinite(self.printed_error):
            return not self.estimate.standard_error > self.printed_error
        return self.compared is not None and self.compared.width <= NARROW + 1e-9

    @property
    def verdict(self) -> str:
        """What follows about the paper."""
        if not self.holds:
            return "outside its band"
        if self.role == "setting":
            return "setting"
        if self.compared is None:
            return "shown"
        proven = self.proof is not None and self.proof.holds
        if isinstance(self.printed, str):
            if not self.against:
                return "reproduced in kind"
            return "wrong in the paper" if proven else "not met"
        if self.printed is None:
            return "beyond the paper"
        if self.agrees:
            return "reproduced" if self.narrow else "reproduced in kind"
        if self.may_be_drawn:
            return "reproduced in kind"
        return "wrong in the paper" if proven else "not met"

    def to_dict(self) -> dict[str, Any]:
        """Return the row as plain values."""
        value, error = self.estimate
        band = self.band
        return {
            "quantity": self.quantity,
            "kind": self.kind,
            "verdict": self.verdict,
            "printed": self.printed,
            "derived": self.derived,
            "printed_error": self.printed_error if math.isfinite(self.printed_error) else None,
            "scatter": self.scatter if math.isfinite(self.scatter) else None,
            "ours": self.ours if isinstance(self.ours, str) else value,
            "standard_error": error if math.isfinite(error) else None,
            "unit": self.unit,
            "band": None if band is None else [band.low, band.high],
            "band_source": None if band is None else band.source,
            "band_note": "" if band is None else band.note,
            "holds": self.holds,
            "narrow": self.kind == "printed" and self.narrow,
            "proof": None if self.proof is None else self.proof.to_dict(),
            "reason": self.reason,
            "erratum": self.erratum,
        }


class Digits(float):
    """A number with the digits that are printed: 0.30 is surer than 0.3."""

    def __new__(cls, text: str) -> Digits:
        """Read a number; YAML wants 5.0e-9 for 5e-9."""
        number = super().__new__(cls, text)
        number.text = re.sub(r"\.0(?=e)", "", text.lower())
        return number

    text: str


def rounding(printed: float) -> float:
    """Half a unit of the last digit of a number as it is printed."""
    text = printed.text if isinstance(printed, Digits) else repr(printed).lower()
    mantissa, _, power = text.partition("e")
    if mantissa.endswith(".0") and not isinstance(printed, Digits):
        mantissa = mantissa[:-2]
    digits = len(mantissa.partition(".")[2])
    return 0.5 * 10.0 ** (int(power or 0) - digits)


@dataclass(frozen=True, slots=True)
class Curve:
    """Something to be drawn: (n,) columns; `x` counts the categories of a panel that has them.

    `role` chooses the colour, `mark` how it is drawn; `lower` and `upper` are the ends of error
    bars, or of a band. NaN is a gap.
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
    """One plot of a figure: axes with quantity and unit, curves in order, names for x = 0, 1, 2 ...

    `description` says what is to be seen, for readers who cannot see it.
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
class Sheet:
    """A table in the layout of the paper: a row for each cell, None where it has nothing."""

    title: str
    corner: str
    columns: tuple[str, ...]
    lines: tuple[str, ...]
    cells: tuple[tuple[Row | None, ...], ...]

    def __post_init__(self) -> None:
        if len(self.cells) != len(self.lines) or any(
            len(c) != len(self.columns) for c in self.cells
        ):
            raise ModelError(f"table '{self.title}' has cells of another shape than its heads")


@dataclass(frozen=True, slots=True)
class Outcome:
    """All that is said about an item: rows (those of the sheets too), plots, notes, tables."""

    rows: tuple[Row, ...]
    panels: tuple[Panel, ...] = ()
    notes: tuple[str, ...] = ()
    sheets: tuple[Sheet, ...] = field(default=())

    @property
    def holds(self) -> bool:
        """Whether every row lies in its band."""
        return all(row.holds for row in self.rows)
