"""The pages of the documentation about the papers, written from what came out.

    python -m schuler_papers.summary FOLDER [--kept RESULTS]

What a paper claims and what to do instead is written by hand in ``about.md`` of its package; all
numbers, verdicts, tables and proofs are computed.
"""

from __future__ import annotations

import argparse
from importlib.resources import files
from pathlib import Path

from schuler_papers.outcome import VERDICTS, Row, Sheet
from schuler_papers.registry import PAPERS, Paper
from schuler_papers.reproduction import ItemResult, Reproduction, judge_kept, reproduce
from schuler_papers.wording import (
    SIGNS,
    band_text,
    counts_of,
    detail_text,
    own_text,
    printed_text,
    sheet_lines,
)

HEADINGS = {
    "outside its band": "Outside its band: our own check failed",
    "wrong in the paper": "Wrong in the paper, with the proof",
    "not met": "Not met by our twin",
    "reproduced": "Reproduced",
    "reproduced in kind": "Reproduced in kind",
}


def paper_page(paper: Paper, done: Reproduction) -> str:
    """Return the page of one paper in Markdown."""
    items = [r for r in done.items if r.paper.name == paper.name]
    about = files(f"schuler_papers.{paper.name}").joinpath("about.md").read_text(encoding="utf-8")
    head, mark, advice = about.partition("## What it wishes")
    counts = counts_of(items)
    lines = [
        f"# {paper.authors}",
        "",
        head.strip(),
        "",
        "## What came out",
        "",
        f"{counts.sentence} This page was written by `python -m schuler_papers.summary` from the "
        f"{done.size} size; `schuler reproduce {paper.name}` does it again.",
        "",
        "| verdict | values | meaning |",
        "|---|---|---|",
        *(
            f"| {v} | {counts.verdicts[v]} | {VERDICTS[v]} |"
            for v in VERDICTS
            if counts.verdicts[v]
        ),
    ]
    for result in items:
        for sheet in result.outcome.sheets:
            lines += ["", f"### {sheet.title}", "", *_table(sheet)]
    for verdict, heading in HEADINGS.items():
        lines += _listed(items, verdict, heading)
    notes = [(r.item.label, note) for r in items for note in r.outcome.notes]
    lines += ["", "## Notes", "", *(f"* {label}: {note}" for label, note in notes)]
    lines += ["", f"{mark}{advice}".strip(), ""]
    return "\n".join(lines)


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _table(sheet: Sheet) -> list[str]:
    heads = (sheet.corner, "", *sheet.columns)
    rows = [heads, ("---",) * len(heads), *sheet_lines(sheet)]
    return [*("| " + " | ".join(map(_cell, row)) + " |" for row in rows), "", SIGNS]


def _listed(items: list[ItemResult], verdict: str, heading: str) -> list[str]:
    """Rows of one verdict that stand in no table."""
    found = []
    for result in items:
        inside = {id(c) for s in result.outcome.sheets for cells in s.cells for c in cells}
        found += [
            _line(result.item.label, row)
            for row in result.outcome.rows
            if row.verdict == verdict and id(row) not in inside
        ]
    if not found:
        return []
    columns = ["| item | quantity | printed | ours | has to lie | |", "|---|---|---|---|---|---|"]
    return ["", f"## {heading}", "", *columns, *found]


def _line(label: str, row: Row) -> str:
    cells = (
        label,
        row.quantity,
        printed_text(row),
        own_text(row),
        band_text(row.band),
        detail_text(row),
    )
    return "| " + " | ".join(map(_cell, cells)) + " |"


def main() -> None:
    """Write a page for each paper."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kept", type=Path, help="judge what an earlier run kept, run nothing")
    options = parser.parse_args()
    done = reproduce() if options.kept is None else judge_kept(options.kept)
    for paper in PAPERS.values():
        if any(r.paper.name == paper.name for r in done.items):
            page = paper_page(paper, done)
            (options.folder / f"{paper.name}.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
