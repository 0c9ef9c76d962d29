"""Two runs of the same studies, value by value."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from schuler import InputError
from schuler_papers.outcome import Row
from schuler_papers.reproduction import Reproduction

NOTICEABLE = 3.0
"""Standard errors of a difference that is more than chance."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One value in two runs.

    Parameters
    ----------
    paper, item : str
        Where it belongs.
    first, second : Row
        What came out in each.
    """

    paper: str
    item: str
    first: Row
    second: Row

    @property
    def sigmas(self) -> float:
        """Difference over its standard error; NaN where none is known."""
        one, two = self.first.estimate, self.second.estimate
        error = math.hypot(one.standard_error, two.standard_error)
        return (two.value - one.value) / error if error > 0.0 else math.nan

    @property
    def same(self) -> bool:
        """Whether the two values are the same number."""
        return self.first.ours == self.second.ours

    @property
    def noticeable(self) -> bool:
        """Whether they differ by more than chance, or one is in its band and the other is not."""
        return abs(self.sigmas) > NOTICEABLE or self.first.holds != self.second.holds

    def to_dict(self) -> dict[str, Any]:
        """Return the difference as plain values."""
        return {
            "paper": self.paper,
            "item": self.item,
            "quantity": self.first.quantity,
            "first": self.first.to_dict()["ours"],
            "second": self.second.to_dict()["ours"],
            "standard_errors": self.sigmas if math.isfinite(self.sigmas) else None,
            "same": self.same,
            "noticeable": self.noticeable,
        }


def compare_runs(first: Reproduction, second: Reproduction) -> tuple[Difference, ...]:
    """Return every value that both runs have."""
    known = {
        (r.experiment.paper, r.item.label, k): row
        for r in second.items
        for k, row in enumerate(r.outcome.rows)
    }
    found = tuple(
        Difference(r.experiment.paper, r.item.label, row, other)
        for r in first.items
        for k, row in enumerate(r.outcome.rows)
        if (other := known.get((r.experiment.paper, r.item.label, k))) is not None
        and not (isinstance(row.ours, str) or isinstance(other.ours, str))
    )
    if not found:
        raise InputError("two runs without a common item")
    return found
