"""What of the site is made from the sources: reference of Python and commands, root files."""

from __future__ import annotations

import ast
import contextlib
import io
import re
from collections import defaultdict
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[2]
ROOT_PAGES = ("CONTRIBUTING.md", "CHANGELOG.md", "CODE_OF_CONDUCT.md", "SECURITY.md")
AREAS = {
    "io": "Reading and writing",
    "data": "Recordings and trajectories",
    "screening": "Screening",
    "noise": "Noise processes",
    "curves": "Curves",
    "estimation": "Estimation of noise",
    "denoising": "De-noising",
    "simulation": "Simulation",
    "arrays": "Redundant IMUs",
    "navigation": "Navigation",
    "evaluation": "Evaluation",
    "report": "Reports",
    "": "Rotations, earth, errors",
}
"""Rooms of the package in reading order; what stands in none of them comes last."""


def public_names() -> dict[str, list[str]]:
    """Return the paths of the public names by room, out of the list of them."""
    found: dict[str, list[str]] = defaultdict(list)
    tree = ast.parse((ROOT / "src/schuler/__init__.pyi").read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            room = node.module.partition(".")[0]
            key = room if room in AREAS else ""
            found[key] += [f"schuler.{node.module}.{name.name}" for name in node.names]
    return found


def help_of(verb: str) -> str:
    """Return the help of a verb as a terminal of 88 columns shows it."""
    from schuler.cli import main

    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        main([verb, "--help"])
    return re.sub(r"\x1b\[[\d;]*m", "", said.getvalue()).strip()


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that no one writes by hand."""
    from schuler.cli.registry import help_line, verbs

    for name in ROOT_PAGES:
        if (ROOT / name).is_file():
            text = (ROOT / name).read_text(encoding="utf-8")
            files.append(File.generated(config, f"project/{name}", content=text))
    names = public_names()
    listing = ["# Python", ""]
    for room, title in AREAS.items():
        page = f"reference/{room or 'basics'}.md"
        body = "\n\n".join(f"::: {path}" for path in sorted(names[room], key=str.lower))
        files.append(File.generated(config, page, content=f"# {title}\n\n{body}\n"))
        short = ", ".join(f"`{p.rpartition('.')[2]}`" for p in names[room])
        listing.append(f"**[{title}]({room or 'basics'}.md)**: {short}\n")
    files.append(File.generated(config, "reference/index.md", content="\n".join(listing)))
    commands = ["# Commands", ""]
    for verb, path in verbs().items():
        block = f"```text\n{help_of(verb)}\n```"
        commands += [f"## schuler {verb}", "", help_line(path), "", block]
    files.append(File.generated(config, "reference/commands.md", content="\n".join(commands)))
    return files


def on_config(config: Any) -> Any:
    """Put the generated pages into the navigation."""
    rooms = [f"reference/{room or 'basics'}.md" for room in AREAS]
    config.nav.append({"Reference": ["reference/index.md", "reference/commands.md", *rooms]})
    there = [f"project/{name}" for name in ROOT_PAGES if (ROOT / name).is_file()]
    config.nav.append({"Project": there})
    return config


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Let links to files above the guide lead to their pages, or to nothing."""
    up = "../" * page.file.src_path.count("/")
    own = "|".join(re.escape(name) for name in ROOT_PAGES if (ROOT / name).is_file())
    markdown = re.sub(rf"\]\((?:\.\./)+({own})", rf"]({up}project/\1", markdown)
    if page.file.src_path.startswith("project/"):
        markdown = markdown.replace("](docs/", "](../")
    elsewhere = r"\[([^\]]+)\]\((?:\.\./)+(?:benchmarks|examples|src|tests)/[^)]*\)"
    return re.sub(elsewhere, r"\1", markdown)
