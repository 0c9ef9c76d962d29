"""Print the lock file: what `schuler[check]` needs, as installed here, with the hashes of pip."""

from __future__ import annotations

import json
import subprocess
import sys
import tomllib
from importlib.metadata import distribution
from pathlib import Path
from tempfile import TemporaryDirectory

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

HEAD = """\
# Every distribution of `pip install schuler[check]` with the hash of its wheel, for CPython 3.11 on
# Linux x86-64. Install with: pip install --require-hashes -r requirements/development.txt
# and then: pip install --no-deps -e .   Made from the environment that the tests pass in, with
# python requirements/lock.py > requirements/development.txt
"""


def installed() -> set[str]:
    """Return name==version of everything needed, extras included."""
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    todo = [Requirement(r) for r in (*project["dependencies"], *extras["check"])]
    seen: set[tuple[str, frozenset[str]]] = set()
    found = set()
    while todo:
        wanted = todo.pop()
        name = canonicalize_name(wanted.name)
        if (name, frozenset(wanted.extras)) in seen:
            continue
        seen.add((name, frozenset(wanted.extras)))
        if name == "schuler":
            todo += [Requirement(r) for extra in wanted.extras for r in extras[extra]]
            continue
        there = distribution(wanted.name)
        found.add(f"{name}=={there.version}")
        for text in there.requires or ():
            inner = Requirement(text)
            chosen = ("", *wanted.extras)
            if inner.marker is None or any(inner.marker.evaluate({"extra": e}) for e in chosen):
                todo.append(inner)
    return found


def main() -> None:
    """Ask pip for the hashes of exactly these versions."""
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        pip = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--quiet"]
        options = ["--no-deps", "--only-binary", ":all:", "--report", str(report)]
        subprocess.run([*pip, *options, *sorted(installed())], check=True)
        rows = json.loads(report.read_text())["install"]
    lines = []
    for row in rows:
        what = f"{canonicalize_name(row['metadata']['name'])}=={row['metadata']['version']}"
        digest = row["download_info"]["archive_info"]["hashes"]["sha256"]
        lines.append(f"{what} \\\n    --hash=sha256:{digest}\n")
    print(HEAD + "".join(sorted(lines)), end="")


if __name__ == "__main__":
    main()
