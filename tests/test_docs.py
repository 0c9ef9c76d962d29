"""What the guide names is there: names of `schuler`, modules, verbs of the program."""

from __future__ import annotations

import importlib
import importlib.util
import re
import shlex
from pathlib import Path

import pytest

import schuler
from schuler.cli.app import check
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


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and content of every fenced block."""
    return re.findall(r"(?m)^```(\w*)\n(.*?)^```", page.read_text(encoding="utf-8"), re.S)


def commands(block: str) -> list[list[str]]:
    """Arguments of every command of a block; what is piped into other programs is left out."""
    lines = re.sub(r"\\\n\s*", " ", block).splitlines()
    ours = [x.removeprefix("$ ") for x in lines if x.removeprefix("$ ").startswith("schuler ")]
    return [shlex.split(re.split(r"\s+[#>|]|&&|; ", x)[0])[1:] for x in ours]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_commands_are_understood_and_python_is_python(page: Path) -> None:
    for language, block in blocks(page):
        for arguments in commands(block):
            check(arguments, page.name)
        if language == "python":
            compile(block, page.name, "exec")
