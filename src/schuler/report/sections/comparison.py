"""Results of several runs beside each other."""

from __future__ import annotations

import math

from schuler.evaluation.compare import ResultComparison
from schuler.report.blocks import Block, Prose, Section, Table
from schuler.report.numbers import MISSING, number
from schuler.report.sections.registry import register

MOST_ROWS = 40
"""Numbers that are shown unasked."""
MOST_SENTENCES = 2


@register
def comparison_sections(found: ResultComparison) -> tuple[Section, ...]:
    """Show what differs, most first, and the rest folded."""
    columns, rows = comparison_table(found)
    same = comparison_table(found, all_numbers=True)[1][len(rows) :]
    blocks: list[Block] = [Prose(verdict(found))]
    if rows:
        blocks.append(
            Table(
                "What differs: what a result is asked for first, then most first",
                columns,
                rows[:MOST_ROWS],
            )
        )
    rest = (*rows[MOST_ROWS:], *same)
    if rest:
        blocks.append(Table(f"{len(rest)} more numbers", columns, rest, folded=True))
    if found.words:
        words = tuple((key, *said) for key, said in found.words)
        all_words = tuple(range(len(found.names) + 1))
        blocks.append(
            Table("Texts that differ", ("what", *found.names), words, words=all_words, folded=True)
        )
    return (Section("Comparison", tuple(blocks), (verdict(found), *_foremost(found))),)


def verdict(found: ResultComparison) -> str:
    """Return how much is the same, in a sentence."""
    different, total = len(found.different), len(found.numbers)
    if not different:
        return f"All {total} numbers are the same in {', '.join(found.names)}."
    return f"{different} of {total} numbers differ."


def _foremost(found: ResultComparison) -> tuple[str, ...]:
    """Return the first numbers that differ, with their values."""
    sentences = []
    for one in found.different[:MOST_SENTENCES]:
        each = zip(one.values, found.names, strict=True)
        sentences.append(f"{one.key}: {', '.join(f'{number(v)} in {who}' for v, who in each)}.")
    return tuple(sentences)


def comparison_table(
    found: ResultComparison, *, all_numbers: bool = False
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return headings and rows; the last column is in standard errors where there are any."""
    shown = found.numbers if all_numbers else found.different
    with_errors = any(not math.isnan(n.sigmas) for n in shown)
    columns = ("number", *found.names, "differs by", *(("in sigma",) if with_errors else ()))
    rows = tuple(
        (
            n.key,
            *(number(v, 5) for v in n.values),
            f"{number(100.0 * n.change)} %",
            *((MISSING if math.isnan(n.sigmas) else number(n.sigmas, 2),) if with_errors else ()),
        )
        for n in shown
    )
    return columns, rows
