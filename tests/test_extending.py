"""What a user adds from outside is used to the report with no file of ours touched.

A temporary folder with a package and its ``dist-info`` on the path is what an installed package is
to Python, so that entry points are found without installing anything.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TIDES = '''
"""A package of a user: a result of its own, its section, and the verb that shows it."""
from dataclasses import dataclass
from pathlib import Path

from schuler.cli.job import Job, Result
from schuler.cli.options.files import Written


@dataclass(frozen=True)
class Tide:
    height: float


def tide(log: Path, /, *, written: Written = Written(), level: float = 1.0) -> int:
    """Tell the highest water of a log.

    Parameters
    ----------
    log : Path
        One height a line, m.
    level : float
        A check fails above this, m.
    """
    found = Tide(max(float(line) for line in log.read_text().split()))
    failed = (f"{found.height:g} m is too high",) if found.height > level else ()
    return Job(written, inputs=(log,)).finish(
        Result(
            title="Tides",
            sections=(found,),
            show=lambda screen: screen.line(f"highest water {found.height:g} m"),
            json=lambda: {"height_m": found.height},
            failed=failed,
        )
    )
'''
SECTION = """
from tides import Tide

from schuler.report.blocks import Facts, Section
from schuler.report.sections.registry import register


@register
def tide_sections(result: Tide) -> tuple[Section, ...]:
    return (Section("High water", (Facts((("Highest", f"{result.height:g} m"),)),)),)
"""
ENTRY_POINTS = """
[schuler.verbs]
tide = tides:tide
# a broken one beside it
broken = tides_broken:verb
[schuler.report_sections]
tides = tides_section
"""


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A folder that looks like the site-packages with a user's package in it."""
    place = tmp_path / "site"
    (place / "tides-1.0.dist-info").mkdir(parents=True)
    (place / "tides-1.0.dist-info" / "entry_points.txt").write_text(ENTRY_POINTS)
    (place / "tides-1.0.dist-info" / "METADATA").write_text("Name: tides\nVersion: 1.0\n")
    (place / "tides.py").write_text(TIDES)
    (place / "tides_section.py").write_text(SECTION)
    (place / "tides_broken.py").write_text("def verb(:\n")
    (tmp_path / "log.txt").write_text("0.3\n1.7\n0.9\n")
    return tmp_path


def call(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run the program as a user does who has installed the package."""
    paths = os.pathsep.join([str(folder / "site"), *filter(None, sys.path)])
    return subprocess.run(
        [sys.executable, "-m", "schuler", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": paths, "COLUMNS": "100"},
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_a_verb_and_a_section_of_a_user_go_all_the_way_to_the_page(installed: Path) -> None:
    done = call(
        installed, "tide", "log.txt", "--level", "2", "--report", "page.html", "--json", "-"
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == '{\n  "height_m": 1.7\n}'
    assert "highest water 1.7 m" in done.stderr
    page = (installed / "page.html").read_text()
    assert "High water" in page
    assert "1.7 m" in page
    assert "log.txt" in page  # where it came from


def test_its_checks_options_and_mistakes_are_told_as_ours(installed: Path) -> None:
    done = call(installed, "tide", "log.txt")
    assert (done.returncode, done.stderr) == (1, "schuler: check failed: 1.7 m is too high\n")
    assert "A check fails above this, m." in call(installed, "tide", "--help").stdout
    wrong = call(installed, "tide", "log.txt", "--report", "log.txt")
    assert wrong.returncode == 2
    assert wrong.stderr == "schuler: log.txt: is also an input; expected another name\n"


def test_the_listing_shows_it_and_a_broken_one_is_named_and_breaks_nothing(
    installed: Path,
) -> None:
    listing = call(installed, "--help")
    assert "Tell the highest water of a log." in listing.stdout
    assert "Do the experiments of the four papers again" in listing.stdout
    done = call(installed, "broken")
    assert done.returncode == 2
    assert done.stderr.startswith(
        "schuler: the verb 'broken' of another package (tides_broken:verb)"
    )
    assert len(done.stderr.splitlines()) == 1


def test_a_broken_section_is_named_and_the_others_are_shown(installed: Path) -> None:
    (installed / "site" / "tides-1.0.dist-info" / "entry_points.txt").write_text(
        ENTRY_POINTS + "broken = tides_broken\n"
    )
    done = call(installed, "tide", "log.txt", "--level", "2", "--report", "page.html")
    assert done.returncode == 0, done.stderr
    assert "note: the report section 'broken' of another package (tides_broken)" in done.stderr
    assert "High water" in (installed / "page.html").read_text()


def test_a_result_that_nobody_shows_is_refused_by_name(installed: Path) -> None:
    (installed / "site" / "tides-1.0.dist-info" / "entry_points.txt").write_text(
        "[schuler.verbs]\ntide = tides:tide\n"
    )
    done = call(installed, "tide", "log.txt", "--report", "page.html")
    assert done.returncode == 2
    assert "a report cannot show a Tide" in done.stderr
    assert not (installed / "page.html").exists()
