"""`schuler reproduce`: the four papers again, printed beside ours."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from schuler import InputError

if TYPE_CHECKING:
    from schuler.cli import Outputs, Screen
    from schuler_papers.reproduction import ItemResult, Reproduction


def reproduce(
    *paper: str,
    item: str | None = None,
    full: bool = False,
    seeds: int | None = None,
    processes: int | None = None,
    scheduler: str | None = None,
    resume: Path | None = None,
    kept: Path | None = None,
    against: Path | None = None,
    data: Path | None = None,
    report: Path | None = None,
    json: Path | None = None,
) -> int:
    """Do the experiments of the four papers again on twins with known truth.

    Each value stands beside what is printed, with the band in which it has to lie. The verdict
    follows from these numbers: reproduced, reproduced in kind, not met, wrong in the paper (with
    a proof that ran), beyond the paper, or just shown. Exit code 1 when a value lies outside its
    band.

    Parameters
    ----------
    *paper : str
        waegli2010, waegli2008, tamazin2013 or quinchia2013 (S000, S002, S003, S004); all four if
        none is named.
    item : str, optional
        One table, figure, equation or slip: "Table 2", "Fig. 7", "eq. (12)", "E-000-9".
    full : bool
        The papers' lengths with at least 20 seeds; else a minute or two for all.
    seeds : int, optional
        Repetitions of whatever is random.
    processes : int, optional
        Processes of this machine; one for each core if not given. The numbers are the same.
    scheduler : str, optional
        Address of a Dask scheduler that does the work, such as tcp://10.0.0.5:8786.
    resume : Path, optional
        Folder where results are kept one by one; a run that was stopped goes on there.
    kept : Path, optional
        Judge and draw what an earlier run has kept there, and run nothing.
    against : Path, optional
        With --kept: compare with the results kept in this second folder.
    data : Path, optional
        Folder of measured data for what is done on real recordings; SCHULER_DATA if not given.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all values here; - for standard output.
    """
    if "numpy" not in sys.modules:
        from schuler.execution import one_thread

        one_thread()
    from schuler.cli import STDOUT, Outputs, Screen, say, say_when_compiling
    from schuler_papers.reproduction import judge_kept
    from schuler_papers.reproduction import reproduce as run

    outputs = Outputs(report, json)
    if against is not None and kept is None:
        raise InputError("--against without --kept", expected="both folders")
    if kept is not None and (resume is not None or scheduler is not None or full):
        raise InputError("--kept runs nothing", cure="leave out --full, --resume and --scheduler")
    screen = Screen(json_on_stdout=json == STDOUT)
    if kept is not None:
        found = judge_kept(kept, paper, item=item)
        if against is not None:
            return _compare(found, judge_kept(against, paper, item=item), screen, outputs, json)
    else:
        from schuler.execution import progress

        say_when_compiling()
        with progress("Reproducing") as shown:

            def told(what: str, share: float) -> None:
                shown.say(what)
                shown.share(share)

            found = run(
                paper,
                item=item,
                size="full" if full else "quick",
                seeds=seeds,
                processes=processes,
                scheduler=scheduler,
                keep=resume,
                data=data,
                told=told,
            )
    _write(found, outputs, report, json)
    show_reproduction(screen, found, outputs.commit(), detailed=item is not None)
    bad = sum(not row.holds for r in found.items for row in r.outcome.rows)
    if bad:
        say(f"check failed: {bad} value{'' if bad == 1 else 's'} outside the band")
        return 1
    return 0


def _write(found: Reproduction, outputs: Outputs, report: Path | None, json: Path | None) -> None:
    from schuler.cli import json_text

    if report is not None:
        from schuler.cli import command_provenance
        from schuler.report import render_report

        names = list(dict.fromkeys(r.paper.authors for r in found.items))
        title = f"{names[0]} done again" if len(names) == 1 else f"{len(names)} papers done again"
        counts = {f"{p} {e}": effort.repetitions for (p, e), effort in found.efforts.items()}
        settings = {"size": found.size, "seeds from 0, number of them": counts}
        page = render_report(found, title=title, provenance=command_provenance(settings=settings))
        outputs.text(report, lambda: page)
    outputs.text(json, lambda: json_text(found.rows()))


def show_reproduction(
    screen: Screen, found: Reproduction, written: tuple[Path, ...] = (), *, detailed: bool = False
) -> None:
    """Print verdicts, one line an item, or all values of a few."""
    from schuler.report import duration
    from schuler_papers.registry import PAPERS

    for paper in PAPERS.values():
        items = [r for r in found.items if r.paper.name == paper.name]
        if not items:
            continue
        cost = sum(e.cpu_seconds for (name, _), e in found.efforts.items() if name == paper.name)
        screen.heading(paper.authors, f"{found.size}, {duration(cost)} of CPU")
        if detailed:
            _show_values(screen, items)
        else:
            _show_items(screen, items)
    for text in found.left_out:
        screen.finding("info", f"left out: {text}")
    for path in written:
        screen.line(f"wrote {path}", "dim")


def _show_items(screen: Screen, items: list[ItemResult]) -> None:
    """One line an item: what its values came to, by kind and verdict."""
    from schuler_papers.wording import counts_of, slips_of, verdict_of_item

    rows = []
    for r in items:
        counts = counts_of([r])
        rows.append(
            (
                r.item.label,
                r.item.title,
                verdict_of_item(r.outcome),
                slips_of(r.outcome),
                f"{counts.met} of {counts.printed}" if counts.printed else "",
                f"{counts.inside} of {counts.banded}" if counts.banded else "",
                str(counts.shown) if counts.shown else "",
            )
        )
    columns = ("item", "about", "verdict", "slips", "printed met", "in band", "shown")
    screen.table(columns, rows, words=4)
    screen.line(counts_of(items).sentence, "dim")


def _show_values(screen: Screen, items: list[ItemResult]) -> None:
    """All values of a few items."""
    from schuler_papers.wording import band_text, own_text, printed_text

    for r in items:
        screen.line(f"{r.item.label}: {r.item.title}", "bold")
        screen.line(f"The paper: {r.item.claim}", "dim")
        each = [
            (row.quantity, row.verdict, printed_text(row), own_text(row), band_text(row.band))
            for row in r.outcome.rows
        ]
        screen.table(("quantity", "verdict", "printed", "ours", "has to lie"), each, words=2)
        for note in r.outcome.notes:
            screen.finding("info", note)


def _compare(
    first: Reproduction,
    second: Reproduction,
    screen: Screen,
    outputs: Outputs,
    json: Path | None,
) -> int:
    from schuler.cli import json_text, say
    from schuler.report import number
    from schuler_papers.comparison import compare_runs
    from schuler_papers.wording import own_text

    differences = compare_runs(first, second)
    outputs.text(json, lambda: json_text([d.to_dict() for d in differences]))
    written = outputs.commit()
    same = sum(d.same for d in differences)
    screen.heading("Two runs", f"{len(differences)} values, {same} the same number")
    rows = [
        (d.paper, d.item, d.first.quantity, own_text(d.first), own_text(d.second), number(d.sigmas))
        for d in differences
        if d.noticeable
    ]
    if rows:
        columns = ("paper", "item", "quantity", "first", "second", "standard errors")
        screen.table(columns, rows, words=3)
        say(f"check failed: {len(rows)} values differ by more than chance")
    else:
        screen.finding("good", "no value differs by more than chance")
    for path in written:
        screen.line(f"wrote {path}", "dim")
    return 1 if rows else 0
