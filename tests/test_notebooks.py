"""The notebooks tell the stories of the first hour, and each runs alone, as printed."""

from __future__ import annotations

import importlib.util
import json
import shlex
from pathlib import Path

import pytest

from schuler.cli import main

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SPEC = importlib.util.spec_from_file_location("example_notebooks", EXAMPLES / "notebooks.py")
assert SPEC is not None and SPEC.loader is not None
MAKER = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(MAKER)


def test_they_say_what_the_page_says() -> None:
    for path, content in MAKER.notebooks().items():
        cure = f"python examples/notebooks.py writes {path.name} anew"
        assert path.read_text(encoding="utf-8") == content, cure


@pytest.mark.parametrize("name", MAKER.NAMES)
def test_each_runs_alone(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("pandas", "matplotlib"):
        pytest.importorskip(package)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for cell in json.loads((EXAMPLES / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]:
        text = "".join(cell["source"])
        if cell["cell_type"] == "code" and text.startswith("!schuler "):
            assert main(shlex.split(text)[1:]) == 0, text
        elif cell["cell_type"] == "code":
            exec(compile(text, name, "exec"), names)
