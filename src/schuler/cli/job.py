"""What every verb does: check the outputs, work, then write page, files and JSON, and show."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schuler.cli.console import Screen, printable, say
from schuler.cli.loading import assumptions, forget_assumptions, say_when_compiling
from schuler.cli.options.files import Written
from schuler.cli.outputs import STDOUT, Outputs, json_text, refuse_existing
from schuler.errors import InputError
from schuler.execution.progress import Progress, progress

if TYPE_CHECKING:
    from schuler.report.page import Provenance

GOOD, FAILED_CHECK = 0, 1


def _nothing(screen: Screen) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True)
class Result:
    """What a verb found, and all that can be made of it.

    Parameters
    ----------
    title : str
        Title of the page.
    sections : tuple
        Results that the page shows, in reading order.
    show : callable
        Prints the short answer.
    json : callable
        Returns what the JSON holds.
    settings, seeds : mapping
        What the result depends on beside its inputs.
    texts, files : tuple of (Path or None, callable)
        Other files: a function that returns the text, or one that writes to a path.
    with_origin : bool
        The JSON tells where it comes from.
    failed : tuple of str
        Checks that failed, each told in one line.
    refused : tuple of str
        Files that were asked for and could not be written, and why.
    passed : bool
        False where the answer itself is a failed check.
    """

    title: str = ""
    sections: tuple[object, ...] = ()
    show: Callable[[Screen], None] = _nothing
    json: Callable[[], Any] = dict
    settings: Mapping[str, Any] = field(default_factory=dict)
    seeds: Mapping[str, int] | None = None
    texts: tuple[tuple[Path | None, Callable[[], str]], ...] = ()
    files: tuple[tuple[Path | None, Callable[[Path], Any]], ...] = ()
    with_origin: bool = False
    failed: tuple[str, ...] = ()
    refused: tuple[str, ...] = ()
    passed: bool = True


class Job:
    """One call of a verb: its inputs and outputs, checked before the work starts.

    Parameters
    ----------
    written : Written
        Page and JSON.
    *others : Path or None
        Other files that will be written.
    inputs : iterable of Path or None
        Files that are read.
    """

    def __init__(
        self, written: Written, *others: Path | None, inputs: Iterable[Path | None] = ()
    ) -> None:
        forget_assumptions()
        self.written = written
        self.inputs = tuple(path for path in inputs if path is not None)
        self.outputs = Outputs(*others, written.report, written.json, inputs=self.inputs)
        self._check_figures()
        self.screen = Screen(json_on_stdout=written.json == STDOUT)

    def finish(self, result: Result) -> int:
        """Write all files together, show the answer, and return the exit code."""
        origin = self._origin(result)
        if self.written.report is not None:
            from schuler.report import render_report

            page = render_report(*result.sections, title=result.title, provenance=origin)
            self.outputs.text(self.written.report, lambda: page)
        self._add_figures(result)
        for path, write in result.files:
            self.outputs.file(path, write)
        for path, make in result.texts:
            self.outputs.text(path, _with_assumptions(path, make))
        self.outputs.text(self.written.json, lambda: json_text(_with_origin(result, origin)))
        paths = self.outputs.commit()
        result.show(self.screen)
        for path in paths:
            self.screen.line(f"wrote {path}", "dim")
        for check in result.failed:
            say(f"check failed: {check}")
        for why in result.refused:
            say(why)
        good = result.passed and not result.failed and not result.refused
        return GOOD if good else FAILED_CHECK

    def _check_figures(self) -> None:
        """Raise before the work where figures could not be drawn or would be lost."""
        folder = self.written.figures
        if folder is None:
            return
        from schuler.data.exportable import optional

        optional("matplotlib", "figures")
        if folder.exists() and not folder.is_dir():
            raise InputError("is a file", expected="a folder for figures", where=str(folder))
        if not folder.parent.is_dir():
            raise InputError("the folder above it does not exist", where=str(folder))
        for file in sorted(folder.glob(f"*.{self.written.figure_format}")):
            refuse_existing(file)

    def _add_figures(self, result: Result) -> None:
        """Add one file for each group of figures, numbered in the order of the page."""
        folder, form = self.written.figures, self.written.figure_format
        if folder is None:
            return
        from schuler.report.drawing.matplotlib import save_figure
        from schuler.report.page import anchor
        from schuler.report.plots import titled_grids
        from schuler.report.sections import sections_of

        grids = titled_grids(s for one in result.sections for s in sections_of(one))
        if not grids:
            say("this result has no figures")
            return
        folder.mkdir(exist_ok=True)
        for k, one in enumerate(grids, 1):
            path = folder / f"{k:02d}-{anchor(one.title)[:60]}.{form}"
            self.outputs.file(path, partial(save_figure, one.grid, form=form))

    def _origin(self, result: Result) -> Provenance | None:
        if self.written == Written():
            return None
        settings = dict(result.settings)
        if assumptions():
            settings["assumptions"] = list(assumptions())
        return command_provenance(inputs=self.inputs, seeds=result.seeds, settings=settings)


def command_provenance(
    *,
    inputs: Iterable[Path] = (),
    seeds: Mapping[str, int] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Provenance:
    """Record this command with its inputs."""
    from schuler.data.to_dict import plain
    from schuler.report.page import record_provenance

    return record_provenance(
        command="schuler " + shlex.join(sys.argv[1:]),
        inputs=inputs,
        seeds=seeds,
        settings=plain(dict(settings or {})),
    )


def _with_origin(result: Result, origin: Provenance | None) -> Any:
    found = result.json()
    if isinstance(found, Mapping) and assumptions():
        found = {**found, "assumptions": list(assumptions())}
    if not result.with_origin or origin is None:
        return found
    return found | {"provenance": origin.to_dict()}


def _with_assumptions(path: Path | None, make: Callable[[], str]) -> Callable[[], str]:
    """Put what was taken for granted into comments above a file of YAML."""
    if path is None or path.suffix.lower() not in (".yaml", ".yml") or not assumptions():
        return make
    lines = [f"# assumed: {printable(line)}\n" for line in assumptions()]
    return lambda: "".join(lines) + make()


@contextmanager
def working(title: str) -> Iterator[Progress]:
    """Show that work goes on, and say when kernels have to be compiled first."""
    say_when_compiling()
    with progress(title) as shown:
        yield shown
