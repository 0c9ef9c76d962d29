"""The door is light: nothing heavy is imported before it is needed."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

HEAVY = ("numba", "scipy", "pandas", "polars", "plotly", "jinja2", "rosbags")
PROBE = """
import sys, time
sys.argv = ["schuler", *{arguments!r}]
{statement}
spent = time.process_time()
heavy = [m for m in {heavy!r} if m in sys.modules]
print(f"\\n@@{{spent:.3f}} {{','.join(heavy)}}")
"""


def probe(statement: str, arguments: list[str]) -> tuple[float, list[str], str]:
    code = PROBE.format(statement=statement, arguments=arguments, heavy=HEAVY)
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    spoken, _, tail = done.stdout.rpartition("@@")
    seconds, _, names = tail.strip().partition(" ")
    return float(seconds), names.split(",") if names else [], spoken


HELP = "from schuler.cli import main; assert main() == 0"


@pytest.mark.parametrize(
    ("arguments", "most"),
    [
        (["--help"], 2.5),
        (["--version"], 2.5),
        (["characterize", "--help"], 7.0),
        (["outages", "--help"], 7.0),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_help_costs_little_and_imports_nothing_heavy(arguments: list[str], most: float) -> None:
    # In turn with the import of NumPy, and the minimum of five: a shared machine makes single
    # runs slower, never faster.
    runs = [(probe("import numpy", []), probe(HELP, arguments)) for _ in range(5)]
    numpy = min(seconds for (seconds, _, _), _ in runs)
    seconds, heavy, spoken = min(told for _, told in runs)
    assert heavy == []
    assert spoken.strip()
    assert seconds < most * numpy


def test_import_of_the_package_imports_not_even_numpy() -> None:
    began = time.monotonic()
    code = "import schuler, sys; print('numpy' in sys.modules, len(schuler.__all__) > 30)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]
    assert time.monotonic() - began < 30.0


def test_python_dash_m_is_the_same_program() -> None:
    import schuler

    done = subprocess.run(
        [sys.executable, "-m", "schuler", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == schuler.__version__
