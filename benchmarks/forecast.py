"""Freeze what many seeds give for the tables of the papers: the bands of `schuler reproduce`.

    python -m benchmarks.forecast [PAPER ...] [--seeds N] [--experiment NAME]

Tables that ask for a forecast in `paper.yaml` get the mean of N draws and the scatter of one, cell
by cell, written to `forecasts.json` beside it. The seeds start at 100, so that no run of
`reproduce` judges itself. What is kept (`--keep FOLDER`) is not run again.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import schuler_papers
from schuler.execution import Kept, Task, run_tasks, workers
from schuler_papers.experiment import Experiment, Size
from schuler_papers.judging import judge_of
from schuler_papers.registry import PAPERS, experiments_of
from schuler_papers.reproduction import code_version, run_unit

FIRST_SEED = 100
SIZE: Size = "quick"
"""What both sizes expect: the full one has more seeds and longer records of the same noise."""


def asks(item: dict[str, Any]) -> list[dict[str, Any]]:
    """Tables of an item that ask for a forecast."""
    return [
        table
        for table in item.get("tables", ())
        if "forecast" in table or "forecast" in table.get("each", {})
    ]


def freeze(
    paper: str, entry: dict[str, Any], experiment: Experiment, seeds: int, keep: Path
) -> dict[str, Any]:
    version = code_version(paper)
    tasks = [
        Task(
            f"{paper}.{experiment.name}.{SIZE}.{FIRST_SEED + k}.{version}",
            run_unit,
            (paper, experiment.name, FIRST_SEED + k, SIZE, None),
        )
        for k in range(seeds)
    ]
    done = run_tasks(tasks, workers(None, None), Kept(keep), lambda key, k, n: print(key, k, n))
    results = [done[task.key] for task in tasks]
    frozen = {}
    for item in entry["items"]:
        for table in asks(item):
            found = judge_of(f"schuler_papers.{paper}", item)(results, SIZE)
            draws = np.asarray(found.values[table["is"]])
            frozen[f"{item['label']}/{table['title']}"] = {
                "mean": _short(draws.mean(axis=0)),
                "scatter": _short(draws.std(axis=0, ddof=1)),
                "seeds": [FIRST_SEED, seeds],
            }
    return frozen


def _short(values: np.ndarray) -> list[list[float | None]]:
    return [[float(f"{v:.4g}") if np.isfinite(v) else None for v in line] for line in values]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("papers", nargs="*", default=list(PAPERS))
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--experiment", help="only this one of the paper")
    parser.add_argument("--keep", type=Path, default=Path("forecast-results"))
    options = parser.parse_args()
    for paper in options.papers:
        folder = Path(schuler_papers.__file__).parent / paper
        place = folder / "forecasts.json"
        frozen = json.loads(place.read_text()) if place.is_file() else {}
        entries = yaml.safe_load((folder / "paper.yaml").read_text(encoding="utf-8"))
        for entry, experiment in zip(entries, experiments_of(paper), strict=True):
            wanted = options.experiment in (None, experiment.name)
            if wanted and any(asks(item) for item in entry["items"]):
                frozen |= freeze(paper, entry, experiment, options.seeds, options.keep)
        if frozen:
            lines = (
                f"{json.dumps(key, ensure_ascii=False)}: {json.dumps(frozen[key])}"
                for key in sorted(frozen)
            )
            place.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
