"""Make the notebooks beside this file: one for each story of the first hour.

`python examples/notebooks.py` writes them anew from docs/first-hour.md; a test sees to it that they
say the same.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
PAGE = HERE.parent / "docs" / "first-hour.md"
NAMES = ("noise-of-a-sensor", "a-drive-with-gnss", "several-imus")


def cell(kind: str, text: str) -> dict[str, Any]:
    """Return one cell."""
    made: dict[str, Any] = {"cell_type": kind, "metadata": {}}
    made["source"] = text.strip().splitlines(keepends=True)
    return made | ({"execution_count": None, "outputs": []} if kind == "code" else {})


def notebook(story: str) -> str:
    """Return a story as a notebook: words as they are, Python and commands to run."""
    cells = []
    for part in re.split(r"(?ms)^(```\w*\n.*?^```)", story):
        block = re.fullmatch(r"(?s)```(\w*)\n(.*)```", part.strip())
        if block is None:
            text = re.sub(r"\]\((?!http)([\w-]+\.md)", r"](../docs/\1", part)
            cells += [cell("markdown", text)] if text.strip() else []
        elif block[1] == "python":
            cells.append(cell("code", block[2]))
        else:
            cells.append(cell("code", re.sub(r"(?m)^(?=schuler )", "!", block[2])))
    for number, one in enumerate(cells):
        one["id"] = f"cell-{number}"
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    whole = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
    return json.dumps(whole, indent=1, ensure_ascii=False) + "\n"


def notebooks() -> dict[Path, str]:
    """Return the content of every notebook."""
    page = PAGE.read_text(encoding="utf-8").partition("\n---\n")[0]
    stories = re.split(r"(?m)^(?=## )", page)[1:]
    return {
        HERE / f"{name}.ipynb": notebook(story) for name, story in zip(NAMES, stories, strict=True)
    }


if __name__ == "__main__":
    for path, content in notebooks().items():
        path.write_text(content, encoding="utf-8")
