"""What the guide names is there: names of `schuler`, modules, verbs of the program."""

from __future__ import annotations

import importlib
import importlib.util
import re
from pathlib import Path

import pytest

import schuler
from schuler.cli.registry import verbs

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"])


def code(page: Path) -> str:
    """Blocks and words set as code."""
    text = page.read_text(encoding="utf-8")
    return "\n".join(re.findall(r"```.*?```|`[^`\n]+`", text, re.S))


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_names_of_the_package_are_there(page: Path) -> None:
    for name in re.findall(r"\bschuler\.([A-Za-z_]\w*)\b(?!\.)", code(page)):
        found = name in schuler.__all__ or (ROOT / "src" / "schuler" / name).is_dir()
        # groups of entry points are written like names
        assert found or name in {"verbs", "report_sections", "formats", "processes", "yaml"}, name
    one_line = r"(?m)^(?:>>> )?from (schuler[\w.]*) import ([\w, ]+)$"
    bracketed = r"from (schuler[\w.]*) import \(([\w, \n]+)\)"
    for module, names in re.findall(f"{one_line}", code(page)) + re.findall(bracketed, code(page)):
        room = importlib.import_module(module)
        for name in re.findall(r"\w+", names.partition(" as ")[0]):
            there = hasattr(room, name) or importlib.util.find_spec(f"{module}.{name}")
            assert there, (module, name)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_verbs_of_the_program_are_there(page: Path) -> None:
    known = set(verbs())
    for name in re.findall(r"(?m)^(?:\$ )?schuler ([a-z]+)", code(page).replace("`", "\n")):
        assert name in known, name
