"""Every table and figure of the papers, small: each row in its band, none missing (spec 8, 11)."""

from __future__ import annotations

from pathlib import Path

import pytest

from schuler_papers.reproduction import reproduce
from schuler_papers.selection import named_parts, select
from schuler_papers.wording import counts_of

FIGURES = {
    "waegli2010": (*range(1, 15),),
    "waegli2008": (*range(1, 18),),
    "tamazin2013": (*range(1, 8),),
    "quinchia2013": (*range(1, 27),),
}
TABLES = {
    "waegli2010": (1, 2, 3, 4),
    "waegli2008": (1, 2, 3),
    "tamazin2013": (1, 2),
    "quinchia2013": (*range(1, 11),),
}
EQUATIONS = {
    "waegli2010": (*range(1, 14),),
    "waegli2008": (*range(1, 14),),
    "tamazin2013": (*range(1, 30),),
    "quinchia2013": (*range(1, 37),),
}
SLIPS = {
    "waegli2010": (*range(1, 17),),
    "waegli2008": (*range(1, 15),),
    "tamazin2013": (*range(1, 13),),
    "quinchia2013": (*range(1, 20),),
}


@pytest.mark.parametrize("paper", FIGURES)
def test_nothing_of_a_paper_is_missing(paper: str) -> None:
    parts = set()
    for _, items in select([paper]):
        for item in items:
            parts |= named_parts(" ".join((item.label, *item.slips)))
    for kind, numbers in (("fig", FIGURES), ("table", TABLES), ("eq", EQUATIONS)):
        missing = [n for n in numbers[paper] if (kind, str(n)) not in parts]
        assert not missing, f"{kind} {missing}"
    number = next(s for kind, s in parts if kind == "slip")[2:5]
    assert {f"e-{number}-{n}" for n in SLIPS[paper]} <= {s for kind, s in parts if kind == "slip"}


LEAST_NARROW = {"waegli2010": 36, "waegli2008": 62, "tamazin2013": 20, "quinchia2013": 100}
"""Printed numbers that have to be compared within a quarter or their own error; 200 in all."""
TABLES_IN_LAYOUT = {
    "waegli2010": {"Table 1", "Table 2, eq. (7)", "Table 4, eq. (13)"},
    "waegli2008": {"Table 1", "Table 2, Fig. 14", "Table 3"},
    "tamazin2013": {"Table 1", "Table 2"},
    "quinchia2013": {
        "Table 2", "Table 3, Figs. 12-14", "Table 4, Figs. 15-16", "Table 5",
        "Table 5, standard deviations", "Table 6, Fig. 18", "Table 7",
        "Table 8, eqs. (19)-(20)", "Table 9", "Table 10",
    },
}  # fmt: skip


@pytest.mark.parametrize("paper", FIGURES)
def test_every_row_lies_in_its_band(paper: str, data_folder: Path) -> None:
    done = reproduce([paper], data=data_folder)
    assert all("takes --full" in text for text in done.left_out)
    bad = [
        f"{r.item.label}: {row.quantity}: {row.estimate} outside {row.band}"
        for r in done.items
        for row in r.outcome.rows
        if not row.holds
    ]
    assert not bad
    for result in done.items:
        assert result.item.title
        assert result.item.claim
        assert result.outcome.rows
        proven = {row.erratum for row in result.outcome.rows if row.erratum}
        allowed = {*result.item.label.split(", "), *result.item.slips}
        assert proven <= allowed, result.item.label
        for row in result.outcome.rows:
            if row.verdict == "wrong in the paper":
                assert row.role == "arithmetic" or (row.proof is not None and row.proof.holds)
            if row.kind == "printed":
                assert row.compared is not None
    assert counts_of(done.items).narrow >= LEAST_NARROW[paper]
    assert {r.item.label for r in done.items if r.outcome.sheets} == TABLES_IN_LAYOUT[paper]
