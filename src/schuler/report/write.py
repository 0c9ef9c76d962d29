"""The verb: results in, one HTML file out."""

from __future__ import annotations

from pathlib import Path

from schuler.data.table import write_text
from schuler.errors import InputError
from schuler.report.page import render_page
from schuler.report.provenance import Provenance, record_provenance
from schuler.report.sections import sections_of


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
