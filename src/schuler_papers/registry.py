"""The papers; their experiments are imported when they are asked for."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING

from schuler import InputError

if TYPE_CHECKING:
    from schuler_papers.experiment import Experiment


@dataclass(frozen=True, slots=True)
class Paper:
    """One of the papers: module name, number in the documents, authors, title, journal."""

    name: str
    label: str
    authors: str
    title: str
    journal: str

    @property
    def short(self) -> str:
        """First author and year, as one would quote it."""
        return f"{self.name[:-4].capitalize()} {self.name[-4:]}"


PAPERS = {
    paper.name: paper
    for paper in (
        Paper(
            "waegli2010",
            "S000",
            "Waegli, Skaloud, Guerrier, Parés, Colomina (2010)",
            "Noise reduction and estimation in multiple micro-electro-mechanical inertial systems",
            "Measurement Science and Technology 21, 065201",
        ),
        Paper(
            "waegli2008",
            "S002",
            "Waegli, Guerrier, Skaloud (2008)",
            "Redundant MEMS-IMU integrated with GPS for performance assessment in sports",
            "IEEE/ION PLANS",
        ),
        Paper(
            "tamazin2013",
            "S003",
            "Tamazin, Noureldin, Korenberg (2013)",
            "Robust modeling of low-cost MEMS sensor errors in mobile devices using fast "
            "orthogonal search",
            "Journal of Sensors 2013",
        ),
        Paper(
            "quinchia2013",
            "S004",
            "Quinchia, Falco, Falletti, Dovis, Ferrer (2013)",
            "A comparison between different error modeling of MEMS applied to GPS/INS integrated "
            "systems",
            "Sensors 13, 9549",
        ),
    )
}


def find_paper(name: str) -> Paper:
    """Return a paper by its name or number."""
    for paper in PAPERS.values():
        if name.lower() in (paper.name, paper.label.lower()):
            return paper
    known = ", ".join(f"{p.name} ({p.label})" for p in PAPERS.values())
    raise InputError(f"no paper '{name}'", expected=f"one of {known}")


def experiments_of(paper: str) -> tuple[Experiment, ...]:
    """Return the experiments of a paper."""
    module = f"schuler_papers.{find_paper(paper).name}"
    if find_spec(module) is None:
        return ()
    found: tuple[Experiment, ...] = import_module(module).EXPERIMENTS
    return found
