"""Rows and counts in words, for terminal, page and documentation."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from schuler.report import MISSING, with_error
from schuler_papers.outcome import VERDICTS, Band, Digits, Outcome, Row, Sheet
from schuler_papers.reproduction import ItemResult

SOURCES = {"spec": "specification", "theory": "theory", "frozen": "forecast"}
MARKS = {
    "reproduced": "=",
    "reproduced in kind": "≈",
    "not met": "≠",
    "wrong in the paper": "!",
    "outside its band": "?",
}
"""Signs of verdicts in the cells of tables."""
GRAVEST = tuple(reversed(VERDICTS))
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@dataclass(frozen=True, slots=True)
class Counts:
    """What the values of some items came to.

    `inside` of `banded` values lie in their band; `met` of `printed` numbers agree (derived ones
    are not counted); `narrow` of these are compared within a quarter or their own printed error,
    of which `close` agree.
    """

    values: int
    kinds: Counter[str]
    verdicts: Counter[str]
    banded: int
    inside: int
    printed: int
    met: int
    narrow: int
    close: int

    @property
    def shown(self) -> int:
        """Values without a verdict."""
        return self.verdicts["shown"] + self.verdicts["setting"]

    @property
    def sentence(self) -> str:
        """All of it in words."""
        return (
            f"{self.values} values: {self.inside} of {self.banded} with a band lie in it; "
            f"{self.met} of {self.printed} printed numbers are met ({self.close} of the "
            f"{self.narrow} that are compared within a quarter or their own error); "
            f"{self.kinds['arithmetic']} are arithmetic, {self.shown} just shown."
        )


def counts_of(items: Sequence[ItemResult]) -> Counts:
    """Count the rows of items."""
    rows = [row for result in items for row in result.outcome.rows]
    printed = [row for row in rows if row.kind == "printed" and not row.derived]
    banded = [row for row in rows if row.band is not None]
    return Counts(
        len(rows),
        Counter(row.kind for row in rows),
        Counter(row.verdict for row in rows),
        len(banded),
        sum(row.holds for row in banded),
        len(printed),
        sum(row.agrees for row in printed),
        sum(row.narrow for row in printed),
        sum(row.agrees for row in printed if row.narrow),
    )


def verdict_of_item(outcome: Outcome) -> str:
    """Return the verdict of most rows that have one, unless a value is off."""
    if not outcome.holds:
        return "outside its band"
    counts = Counter(row.verdict for row in outcome.rows)
    judged = [v for v in GRAVEST if v not in ("shown", "setting") and counts[v]]
    about = [v for v in judged if v != "beyond the paper"]
    if not judged:
        return "shown"
    return max(about or judged, key=lambda v: counts[v])


def slips_of(outcome: Outcome) -> str:
    """Return the labels of the slips that the rows of an item are about."""
    return ", ".join(sorted({row.erratum for row in outcome.rows if row.erratum}))


def short(value: float, digits: int = 4) -> str:
    """A number without needless zeros, as papers print it."""
    mantissa, _, power = f"{value:.{digits}g}".partition("e")
    text = mantissa if not power else f"{mantissa}·10{str(int(power)).translate(_SUPERSCRIPT)}"
    return text.replace("-", "−")


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


def printed_text(row: Row, *, unit: bool = True) -> str:
    """Return the printed value as a person would write it; derived ones are marked."""
    if row.printed is None:
        return MISSING
    if isinstance(row.printed, str):
        return row.printed
    text = short(row.printed, 4 if row.derived else 6)
    if isinstance(row.printed, Digits) and "e" not in row.printed.text:
        text = row.printed.text.replace("-", "−")
    if math.isfinite(row.printed_error):
        text += f" ± {short(row.printed_error, 2)}"
    text = _with_unit(text, row.unit if unit else "")
    return f"{text} (derived)" if row.derived else text


def own_text(row: Row, *, unit: bool = True) -> str:
    """Return what came out, with its standard error and unit."""
    if isinstance(row.ours, str):
        return row.ours
    value, error = row.estimate
    if math.isnan(value):
        return MISSING
    shown = row.unit if unit else ""
    if not error > 1e-6 * abs(value):  # nothing is random, or the same in every repetition
        return _with_unit(short(value), shown)
    return _with_unit(with_error(value, error), shown)


def band_text(limits: Band | None) -> str:
    """Return a band in words."""
    if limits is None:
        return MISSING
    low, high = limits.low, limits.high
    if low == high:
        return f"exactly {short(low)}"
    if math.isinf(high):
        return f"above {short(low)}"
    if math.isinf(low):
        return f"below {short(high)}"
    if short(low) == short(high):
        return f"{short(0.5 * (low + high))} ± {short(0.5 * (high - low), 1)}"
    return f"{short(low)} to {short(high)}"


def source_text(row: Row) -> str:
    """Return who says where a value has to lie."""
    if row.band is None:
        return ""
    source = SOURCES[row.band.source]
    source += f": {row.band.note}" if row.band.note else ""
    if row.band.standard_errors:
        source += f", ± {row.band.standard_errors:g} standard errors"
    return source


def detail_text(row: Row) -> str:
    """Return the remark, the slip and the proof of a row."""
    parts = [f"{row.reason} ({row.erratum})" if row.erratum and row.reason else row.reason]
    if row.erratum and not row.reason:
        parts = [row.erratum]
    if row.proof is not None:
        proof, held = row.proof, "held" if row.proof.holds else "did not hold"
        value = short(proof.to_dict()["value"])
        parts.append(f"{proof.method} that {held}: {proof.statement} ({value})")
    return "; ".join(p for p in parts if p)


def _marked(cell: Row) -> str:
    return f"{own_text(cell, unit=False)} {MARKS.get(cell.verdict, '')}".strip()


def sheet_lines(sheet: Sheet) -> list[tuple[str, ...]]:
    """Return a table of the paper: each line as printed, ours with signs, and what was foreseen."""
    lines: list[tuple[str, ...]] = []
    for name, cells in zip(sheet.lines, sheet.cells, strict=True):
        printed = [MISSING if c is None else printed_text(c, unit=False) for c in cells]
        ours = [MISSING if c is None else _marked(c) for c in cells]
        lines += [(name, "printed", *printed), ("", "ours", *ours)]
        if any(c is not None and math.isfinite(c.scatter) for c in cells):
            lines.append(("", "one draw", *map(_one_draw, cells)))
    return lines


def _one_draw(cell: Row | None) -> str:
    """The forecast as one draw has it: mean of many, with the scatter of one."""
    if cell is None or cell.band is None or not math.isfinite(cell.scatter):
        return MISSING
    return with_error(0.5 * (cell.band.low + cell.band.high), cell.scatter)


SIGNS = (
    ", ".join(f"{sign} {verdict}" for verdict, sign in MARKS.items())
    + "; none: shown. Ours: mean with its standard error; one draw: forecast with its scatter."
)
