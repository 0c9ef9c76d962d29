"""Run the experiments of papers, and lay what comes out beside what is printed."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import schuler
from schuler import InputError, SchulerError
from schuler.execution import CPU_SECONDS, Kept, Task, Workers, run_tasks, workers
from schuler_papers.experiment import Experiment, Item, Numbers, Results, Size
from schuler_papers.outcome import Outcome
from schuler_papers.registry import PAPERS, Paper, experiments_of
from schuler_papers.selection import select

OWN = Path(__file__).parent
LIBRARY = Path(schuler.__file__).parent
_NOT_COUNTED = ("cli", "report", "execution")


@dataclass(frozen=True, slots=True)
class ItemResult:
    """What one item of a paper came to."""

    experiment: Experiment
    item: Item
    outcome: Outcome

    @property
    def paper(self) -> Paper:
        """The paper it belongs to."""
        return PAPERS[self.experiment.paper]


@dataclass(frozen=True, slots=True)
class Effort:
    """What an experiment cost: seeds, and CPU seconds of all of them."""

    repetitions: int
    cpu_seconds: float


@dataclass(frozen=True, slots=True)
class Reproduction:
    """Papers done again: items in order, efforts by (paper, experiment), and what was left out."""

    size: Size
    items: tuple[ItemResult, ...]
    efforts: dict[tuple[str, str], Effort]
    left_out: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether every row lies in its band."""
        return all(result.outcome.holds for result in self.items)

    @property
    def cpu_seconds(self) -> float:
        """CPU time of all experiments."""
        return sum(effort.cpu_seconds for effort in self.efforts.values())

    def rows(self) -> list[dict[str, Any]]:
        """Return all rows as plain values, each with its paper and item."""
        return [
            {"paper": result.experiment.paper, "item": result.item.label} | row.to_dict()
            for result in self.items
            for row in result.outcome.rows
        ]


def code_version(paper: str) -> str:
    """Return a digest of all sources that the numbers of a paper depend on.

    What is only shown or judged afterwards, and other papers, do not count.
    """
    digest = hashlib.sha256(np.__version__.encode())
    library = [
        p for p in LIBRARY.rglob("*.py") if p.relative_to(LIBRARY).parts[0] not in _NOT_COUNTED
    ]
    for source in sorted([*library, OWN / "experiment.py", *(OWN / paper).glob("*.py")]):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:8]


def run_unit(paper: str, name: str, seed: int, size: Size, folder: str | None) -> Numbers:
    """Do one unit of work; other processes find it by this name."""
    experiment = next(e for e in experiments_of(paper) if e.name == name)
    try:
        if experiment.recordings:
            return experiment.run(seed, size, Path(folder or "."))
        return experiment.run(seed, size)
    except SchulerError as error:
        raise error.at(f"{PAPERS[paper].short}, {experiment.title}, seed {seed}") from error


def data_folder(given: Path | None = None) -> Path | None:
    """Return the folder of measured data."""
    named = given or (Path(os.environ["SCHULER_DATA"]) if os.environ.get("SCHULER_DATA") else None)
    if named is not None and not named.is_dir():
        if given is not None:
            raise InputError("no such folder of recordings", where=str(given))
        return None
    return named


def reproduce(
    papers: Sequence[str] = (),
    *,
    item: str | None = None,
    size: Size = "quick",
    seeds: int | None = None,
    processes: int | None = 1,
    scheduler: str | None = None,
    keep: Path | None = None,
    data: Path | None = None,
    told: Callable[[str, float], None] | None = None,
) -> Reproduction:
    """Run the experiments of papers on twins with known truth, and judge them."""
    if seeds is not None and seeds < 1:
        raise InputError(f"{seeds} seeds", expected="one or more")
    crew = workers(processes, scheduler)
    folder = data_folder(data)
    chosen = select(papers, item)
    left_out = []
    doable = []
    for experiment, items in chosen:
        missing = [r for r in experiment.recordings if folder is None or not (folder / r).is_dir()]
        if not experiment.repetitions.of(size):
            left_out.append(f"{PAPERS[experiment.paper].short}, {experiment.title}: takes --full")
        elif missing:
            left_out.append(
                f"{PAPERS[experiment.paper].short}, {experiment.title}: needs the recordings "
                f"{', '.join(missing)} (say where: --data, or SCHULER_DATA)"
            )
        else:
            doable.append((experiment, items))
    if not doable:
        raise InputError("nothing can be done", cure="; ".join(left_out))
    plan = {
        (experiment.paper, experiment.name): _tasks(experiment, size, seeds, folder)
        for experiment, _ in doable
    }
    done = _run(plan, crew, keep, told)
    return _judged(doable, {key: done[key] for key in plan}, size, tuple(left_out))


def judge_kept(keep: Path, papers: Sequence[str] = (), *, item: str | None = None) -> Reproduction:
    """Judge results that an earlier run has kept, without running anything."""
    if not keep.is_dir():
        raise InputError("no such folder of results", where=str(keep))
    store = Kept(keep)
    sizes: dict[Size, dict[tuple[str, str], dict[str, list[tuple[int, str]]]]]
    sizes = {"full": {}, "quick": {}}
    pattern = re.compile(r"(\w+)\.([\w-]+)\.(quick|full)\.(\d+)\.(\w+)$")
    for key in store.names():
        if match := pattern.match(key):
            paper, name, size, seed, version = match.groups()
            of = sizes["full" if size == "full" else "quick"].setdefault((paper, name), {})
            of.setdefault(version, []).append((int(seed), key))
    chosen = select(papers, item)
    wanted = {(e.paper, e.name) for e, _ in chosen}
    size = next((s for s, found in sizes.items() if wanted & set(found)), None)
    if size is None:
        raise InputError("no result of these papers is kept there", where=str(keep))
    done: dict[tuple[str, str], Results] = {}
    for name, versions in sizes[size].items():
        if name in wanted:
            best = max(versions.values(), key=len)
            loaded = [store.load(key) for _, key in sorted(best)]
            done[name] = [arrays for arrays in loaded if arrays is not None]
    there = [(e, items) for e, items in chosen if done.get((e.paper, e.name))]
    left_out = tuple(
        f"{PAPERS[e.paper].short}, {e.title}: nothing is kept"
        for e, _ in chosen
        if not done.get((e.paper, e.name))
    )
    return _judged(there, done, size, left_out)


def _tasks(
    experiment: Experiment, size: Size, seeds: int | None, folder: Path | None
) -> list[Task]:
    count = experiment.repetitions.of(size)
    if seeds is not None and experiment.repetitions.full > 1:
        count = seeds
    version = code_version(experiment.paper)
    place = str(folder) if experiment.recordings else None
    return [
        Task(
            f"{experiment.paper}.{experiment.name}.{size}.{seed}.{version}",
            run_unit,
            (experiment.paper, experiment.name, seed, size, place),
        )
        for seed in range(count)
    ]


def _run(
    plan: dict[tuple[str, str], list[Task]],
    crew: Workers,
    keep: Path | None,
    told: Callable[[str, float], None] | None,
) -> dict[tuple[str, str], Results]:
    def tell(key: str, done: int, of: int) -> None:
        if told is not None:
            paper, name, _, seed, _ = key.split(".")
            told(f"{PAPERS[paper].short} {name}, seed {seed} ({done} of {of})", done / of)

    tasks = [task for of in plan.values() for task in of]
    done = run_tasks(tasks, crew, None if keep is None else Kept(keep), tell)
    return {key: [done[task.key] for task in of] for key, of in plan.items()}


def _judged(
    chosen: Sequence[tuple[Experiment, tuple[Item, ...]]],
    done: dict[tuple[str, str], Results],
    size: Size,
    left_out: tuple[str, ...],
) -> Reproduction:
    items = []
    efforts = {}
    for experiment, wanted in chosen:
        key = (experiment.paper, experiment.name)
        results = done[key]
        efforts[key] = Effort(len(results), float(sum(r[CPU_SECONDS] for r in results)))
        items += [ItemResult(experiment, i, i.judge(results, size)) for i in wanted]
    return Reproduction(size, tuple(items), efforts, left_out)
