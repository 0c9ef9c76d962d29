"""Choosing experiments by the tables, figures and equations that people ask for."""

from __future__ import annotations

import re
from collections.abc import Sequence

from schuler import InputError
from schuler_papers.experiment import Experiment, Item
from schuler_papers.registry import PAPERS, experiments_of, find_paper

_KINDS = {"figure": "fig", "figures": "fig", "figs": "fig", "tables": "table"}
_KINDS |= {"equation": "eq", "equations": "eq", "eqs": "eq", "sections": "sec", "section": "sec"}


def named_parts(label: str) -> set[tuple[str, str]]:
    """Return the tables, figures and equations that a label names, one by one."""
    text = label.lower().translate(str.maketrans("\u2013()", "-  "))
    slips = set(re.findall(r"e-\d+-\d+", text))
    parts = {("slip", slip) for slip in slips}
    for slip in slips:
        text = text.replace(slip, " ")
    kind = ""
    for word, first, last in re.findall(r"([a-z]+)|(\d+)(?:\s*-\s*(\d+))?", text):
        if word:
            kind = _KINDS.get(word, word)
            continue
        numbers = range(int(first), int(last or first) + 1)
        parts |= {(kind, str(number)) for number in numbers}
    return parts


def select(
    papers: Sequence[str] = (), item: str | None = None
) -> tuple[tuple[Experiment, tuple[Item, ...]], ...]:
    """Return experiments with the items that were asked for."""
    names = [find_paper(name).name for name in papers] or list(PAPERS)
    chosen = []
    wanted = named_parts(item) if item else set()
    known: list[str] = []
    for name in dict.fromkeys(names):
        for experiment in experiments_of(name):
            known += [i.label for i in experiment.items]
            items = tuple(
                i
                for i in experiment.items
                if item is None
                or i.label.lower() == item.lower()
                or (wanted and wanted <= named_parts(" ".join((i.label, *i.slips))))
            )
            if items:
                chosen.append((experiment, items))
    if not chosen:
        raise InputError(f"no item '{item}'", expected=f"one of {', '.join(known)}")
    return tuple(chosen)
