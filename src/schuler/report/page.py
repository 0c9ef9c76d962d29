"""Results in, one self-contained HTML page out; it works from a USB stick."""

from __future__ import annotations

import hashlib
import json
import platform
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schuler.data.table import write_text
from schuler.data.to_dict import ToDict
from schuler.errors import InputError
from schuler.report.blocks import Figure, FigureGrid, Section
from schuler.report.figures import plain
from schuler.report.sections import sections_of

if TYPE_CHECKING:
    from jinja2 import Template


@dataclass(frozen=True, slots=True)
class InputFile:
    """A file that went into a result."""

    name: str  # name without folder
    size: int  # bytes
    sha256: str  # digest of the content


@dataclass(frozen=True, slots=True)
class Provenance(ToDict):
    """What a result depends on."""

    version: str  # version of this package
    python: str  # version of Python and the kind of machine
    created: str  # local date and time with the offset to UTC
    command: str = ""  # command line, empty when called from Python
    inputs: tuple[InputFile, ...] = ()  # files
    seeds: Mapping[str, int] = field(default_factory=dict)  # seeds of everything that was drawn
    settings: Mapping[str, Any] = field(default_factory=dict)  # options, as plain JSON values


def digest_file(path: str | Path) -> InputFile:
    """Return name, size and SHA-256 of a file."""
    file = Path(path)
    try:
        with file.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return InputFile(file.name, file.stat().st_size, digest)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(file)) from None


def record_provenance(
    *,
    command: str = "",
    inputs: Iterable[str | Path] = (),
    seeds: Mapping[str, int] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Provenance:
    """Record what a result made here and now depends on."""
    from schuler import __version__

    files: list[Path] = []
    for item in map(Path, inputs):
        files += sorted(p for p in item.iterdir() if p.is_file()) if item.is_dir() else [item]
    return Provenance(
        version=__version__,
        python=f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        created=datetime.now().astimezone().isoformat(sep=" ", timespec="seconds"),
        command=command,
        inputs=tuple(digest_file(p) for p in files),
        seeds=dict(seeds or {}),
        settings=dict(settings or {}),
    )


_FLAT_LIST = re.compile(r"\[\n\s+((?:\[[^\[\]\"{}]*\]|[^\[\]\"{}])*?)\n\s*\]")
"""A list of numbers or of lists of numbers, over several lines."""


@dataclass(frozen=True, slots=True)
class _Page:
    """What the template sees."""

    title: str
    sections: tuple[Section, ...]
    summary: tuple[str, ...]
    provenance: Provenance


@lru_cache(maxsize=1)
def plotly_script() -> str:
    """Return the source of plotly.js that is installed with the package."""
    spec = find_spec("plotly")  # importing plotly would cost more than reading one file of it
    if spec is None or spec.origin is None:
        raise InputError("plotly is not installed", cure="pip install plotly")
    path = Path(spec.origin).parent / "package_data" / "plotly.min.js"
    try:
        source = path.read_text(encoding="utf-8")
    except OSError:
        raise InputError(
            "the installed plotly has no plotly.min.js", cure="pip install --force-reinstall plotly"
        ) from None
    return source.replace("</script", "<\\/script")


def safe_json(value: Any) -> str:
    """Return JSON that is safe inside a script element and holds no NaN."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"), ensure_ascii=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


@lru_cache(maxsize=1)
def _template() -> Template:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("schuler.report", "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["anchor"] = anchor
    return environment.get_template("page.html.jinja")


def anchor(title: str) -> str:
    """Return a name for links out of a title."""
    letters = [c if c.isascii() and c.isalnum() else "-" for c in title.lower()]
    return "-".join(filter(None, "".join(letters).split("-"))) or "section"


def _figure_data(sections: Iterable[Section]) -> list[dict[str, Any]]:
    return [
        {"traces": figure.traces, "layout": figure.layout, "height": figure.height}
        for figure in _figures(sections)
    ]


def _figures(sections: Iterable[Section]) -> Iterable[Figure]:
    for section in sections:
        for block in section.blocks:
            if isinstance(block, FigureGrid):
                yield from block.figures


def render_page(title: str, sections: Iterable[Section], provenance: Provenance) -> str:
    """Return the whole page."""
    sections = tuple(sections)
    assets = files("schuler.report") / "assets"
    page = _Page(
        title=title,
        sections=sections,
        summary=tuple(sentence for section in sections for sentence in section.summary),
        provenance=provenance,
    )
    return _template().render(
        page=page,
        style=(assets / "style.css").read_text(encoding="utf-8"),
        script=(assets / "page.js").read_text(encoding="utf-8"),
        plotly=plotly_script() if any(_figures(sections)) else "",
        figure_data=[safe_json(figure) for figure in _figure_data(sections)],
        settings=_pretty(dict(provenance.settings)),
        plain=plain,
    )


def _pretty(settings: dict[str, Any]) -> str:
    """Return JSON for people: lists of numbers take one line, not one a number."""
    text = json.dumps(settings, indent=2, default=str, ensure_ascii=False)
    for _ in range(2):  # lists of pairs, too
        text = _FLAT_LIST.sub(lambda m: f"[{_one_line(m[1])}]", text)
    return text


def _one_line(text: str) -> str:
    return " ".join(text.split()).replace("[ ", "[").replace(" ]", "]")


def render_report(
    *results: object, title: str = "Report", provenance: Provenance | None = None
) -> str:
    """Return the page that shows results in the given order."""
    if not results:
        raise InputError("a report without a result", expected="at least one result")
    sections = [section for result in results for section in sections_of(result)]
    return render_page(title, sections, provenance or record_provenance())


def write_report(
    path: str | Path, *results: object, title: str = "Report", provenance: Provenance | None = None
) -> None:
    """Write one self-contained HTML page; the file appears only when it is complete.

    Parameters
    ----------
    path : str or Path
        File to write.
    *results : object
        Recordings, screenings, characterizations, navigation runs, outage evaluations, or
        sections of your own, in reading order.
    title : str
        Title of the page.
    provenance : Provenance, optional
        Where the results came from; by default this version, now.

    Raises
    ------
    InputError
        No result, one that a report cannot show, or a folder that cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from schuler import simulate_static, write_report
    >>> imu = simulate_static(None, 10.0, 100.0, np.random.default_rng(1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_report(Path(folder) / "report.html", imu, title="Ten seconds")
    ...     print((Path(folder) / "report.html").stat().st_size > 10_000)
    True
    """
    write_text(path, render_report(*results, title=title, provenance=provenance))
