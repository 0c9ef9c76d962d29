"""`schuler compare`: the results of several runs beside each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from schuler.cli.job import Job, Result
from schuler.cli.options.files import Written

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.evaluation.compare import ResultComparison

Results = Annotated[tuple[Path, ...], Parameter(name="RESULTS", negative=())]


def compare(results: Results, /, *, all_numbers: bool = False, written: Written = Written()) -> int:
    """Compare the results of several runs, number by number.

    Example: `schuler compare before.json after.json`

    Parameters
    ----------
    results : tuple of Path
        Files that `--json` of the same command wrote; the first is the one to compare with.
    all_numbers : bool
        Show every number, also those that are the same.
    """
    from schuler.evaluation.compare import compare_results

    job = Job(written, inputs=results)
    found = compare_results(dict(zip(_names(results), results, strict=True)))
    return job.finish(
        Result(
            title=f"Comparison of {', '.join(found.names)}",
            sections=(found,),
            show=lambda screen: show_comparison(screen, found, all_numbers=all_numbers),
            json=found.to_dict,
        )
    )


def _names(paths: tuple[Path, ...]) -> list[str]:
    """Return short names that tell the files apart."""
    stems = [p.stem for p in paths]
    return stems if len(set(stems)) == len(stems) else [str(p) for p in paths]


def show_comparison(screen: Screen, found: ResultComparison, *, all_numbers: bool) -> None:
    """Print what differs, most first."""
    from schuler.report.sections.comparison import MOST_ROWS, comparison_table, verdict

    screen.heading("Comparison", verdict(found))
    columns, rows = comparison_table(found, all_numbers=all_numbers)
    most = len(rows) if all_numbers else MOST_ROWS
    if rows:
        screen.table(columns, rows[:most])
        screen.more(len(rows) - most)
    for key, said in found.words[:MOST_ROWS]:
        screen.line(f"{key}: {' | '.join(said)}", "dim")
