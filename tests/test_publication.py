"""What is published says the same thing everywhere."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
import yaml

import schuler

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
FILES = sorted(
    [*(ROOT / ".github").rglob("*.yml"), ROOT / ".pre-commit-config.yaml", ROOT / "CITATION.cff"]
)


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[<>= ]", r)[0].lower() for r in requirements}


def test_one_version_everywhere() -> None:
    assert PROJECT["version"] == schuler.__version__
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert (cited["version"], cited["license"]) == (schuler.__version__, PROJECT["license"])
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text(encoding="utf-8"))
    assert recipe["context"]["version"] == schuler.__version__
    run = names(recipe["requirements"]["run"]) - {"python"}
    assert run == names(PROJECT["dependencies"])


def test_every_extra_that_a_message_names_is_there() -> None:
    named = set()
    for file in (ROOT / "src").rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        named |= set(re.findall(r"schuler\[(\w+)\]", text))
        named |= set(re.findall(r"optional\(\"\w+\", \"(\w+)\"\)", text))
    assert {"figures", "frames"} <= named
    assert named <= set(EXTRAS)


def test_python_versions_of_the_classifiers_are_tested() -> None:
    flow = yaml.safe_load((ROOT / ".github/workflows/tests.yml").read_text(encoding="utf-8"))
    matrix = flow["jobs"]["tests"]["strategy"]["matrix"]["python"]
    said = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if ":: 3." in c]
    assert matrix == said
    assert PROJECT["requires-python"] == f">={said[0]}"


@pytest.mark.parametrize("file", FILES, ids=lambda p: p.name)
def test_files_for_the_public_are_whole(file: Path) -> None:
    assert yaml.safe_load(file.read_text(encoding="utf-8"))


def test_the_paper_has_its_sections_and_cites_what_it_lists() -> None:
    text = (ROOT / "paper/paper.md").read_text(encoding="utf-8")
    for title in (
        "Summary", "Statement of need", "State of the field", "Software design",
        "Research impact statement", "AI usage disclosure", "Acknowledgements", "References",
    ):  # fmt: skip
        assert f"\n# {title}\n" in text, title
    cited = set(re.findall(r"@(\w+)", text.partition("# Summary")[2]))
    listed = set(re.findall(r"@\w+\{(\w+),", (ROOT / "paper/paper.bib").read_text("utf-8")))
    assert cited == listed
