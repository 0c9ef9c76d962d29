"""The imports of the rooms run one way, and no two files import each other."""

from __future__ import annotations

import ast
import importlib
import inspect
import pydoc
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def imports_of(source: Path, module: str, modules: set[str]) -> set[str]:
    """Modules of this project that a file imports anywhere outside `if TYPE_CHECKING`."""
    tree = ast.parse(source.read_text(encoding="utf-8"))
    checking = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    found: set[str] = set()
    for node in ast.walk(tree):
        if node in checking:
            continue
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner_module = f"{node.module}.{alias.name}"
                found.add(inner_module if inner_module in modules else node.module)
        elif isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
    return (found & modules) - {module}


def all_imports() -> dict[str, set[str]]:
    sources = {
        ".".join(p.relative_to(ROOT / "src").with_suffix("").parts).removesuffix(".__init__"): p
        for p in (ROOT / "src").rglob("*.py")
    }
    return {name: imports_of(path, name, set(sources)) for name, path in sources.items()}


PLUGIN_ROOMS = ("schuler", "schuler.report", "schuler.cli", "schuler.execution")
"""Where a package of its own, such as `schuler_papers`, may import from: names that are listed."""


def library_imports(source: Path) -> list[tuple[str, str]]:
    """Every (module, name) that a file imports from the library, under TYPE_CHECKING too."""
    found: list[tuple[str, str]] = []
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            if node.module.partition(".")[0] == "schuler":
                found += [(node.module, alias.name) for alias in node.names]
        elif isinstance(node, ast.Import):
            found += [
                (alias.name, "")
                for alias in node.names
                if alias.name.partition(".")[0] == "schuler"
            ]
    return found


def cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Strongly connected components of more than one module (Tarjan)."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        order[node] = low[node] = len(order)
        stack.append(node)
        for other in sorted(graph[node]):
            if other not in order:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], order[other])
        if low[node] == order[node]:
            component = [stack.pop()]
            while component[-1] != node:
                component.append(stack.pop())
            if len(component) > 1:
                found.append(sorted(component))

    sys.setrecursionlimit(10_000)
    for node in sorted(graph):
        if node not in order:
            visit(node)
    return found


def test_the_rooms_import_one_way() -> None:
    pytest.importorskip("importlinter")
    program = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [str(program), "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


def test_no_two_files_import_each_other() -> None:
    assert cycles({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == [["b", "c"]]
    assert cycles(all_imports()) == []


def test_papers_use_public_names_alone() -> None:
    """Names of `schuler.__all__`, and what reports, verbs and spread work list for plug-ins."""
    listed = {room: set(importlib.import_module(room).__all__) for room in PLUGIN_ROOMS}
    listed["schuler"] |= {""}  # `import schuler` itself
    sources = sorted((ROOT / "src" / "schuler_papers").rglob("*.py"))
    assert len(sources) > 20
    private = [
        f"{source.relative_to(ROOT)}: {module}.{name}"
        for source in sources
        for module, name in library_imports(source)
        if name not in listed.get(module, set())
    ]
    assert private == []


def test_folders_stay_small_enough_to_look_through() -> None:
    for folder in {p.parent for p in (ROOT / "src").rglob("*.py")}:
        modules = [p.name for p in folder.glob("*.py") if p.name != "__init__.py"]
        assert len(modules) <= 20, (folder, len(modules))


def functions() -> list[tuple[str, int, int]]:
    """Place, parameters (a `**options` counts as one) and lines without docstring of them all."""
    found = []
    for path in (ROOT / "src").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.FunctionDef):
                continue
            given = node.args
            taken = [*given.posonlyargs, *given.args, *given.kwonlyargs]
            taken += [a for a in (given.vararg, given.kwarg) if a is not None]
            count = sum(a.arg not in ("self", "cls") for a in taken)
            first = node.body[0]
            told = first.end_lineno - first.lineno + 1 if ast.get_docstring(node) else 0
            lines = node.end_lineno - node.lineno + 1 - told
            found.append((f"{path.relative_to(ROOT)}:{node.lineno} {node.name}", count, lines))
    return found


def test_functions_take_few_parameters_and_fit_on_a_screen() -> None:
    """What takes more is a settings object, what is longer is cut where a reader would stop."""
    every = functions()
    assert len(every) > 3000
    for most, allowed in ((8, 15), (12, 0)):
        many = [(name, count) for name, count, _ in every if count > most]
        assert len(many) <= allowed, (most, many)
    for longest, allowed in ((60, 20), (100, 0)):
        long = [(name, lines) for name, _, lines in every if lines > longest]
        assert len(long) <= allowed, (longest, long)


def test_every_public_name_is_there_and_only_those_are_promised() -> None:
    import schuler

    for name in schuler.__all__:
        value = getattr(schuler, name)
        assert value.__module__.startswith("schuler."), name
        assert callable(value), name
        assert value.__doc__, name
    assert list(schuler.__all__) == sorted(schuler.__all__)
    assert set(schuler.__all__) <= set(dir(schuler))
    with pytest.raises(AttributeError, match="No schuler attribute nonsense"):
        _ = schuler.nonsense


@pytest.mark.parametrize("name", ["navigate", "identify", "denoise"])
def test_help_of_a_verb_shows_the_function_and_its_parameters(name: str) -> None:
    code = f"import schuler.{'navigation.navigate' if name == 'navigate' else 'estimation'}"
    code += f"; import schuler; help(schuler.{name})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.startswith(f"Help on function {name} in module schuler."), done.stderr
    assert "Parameters" in done.stdout


def test_signatures_of_verbs_are_read_by_tools() -> None:
    import schuler

    assert list(inspect.signature(schuler.navigate).parameters)[:3] == [
        "imu",
        "gnss",
        "noise_model",
    ]
    assert "noise_model" in pydoc.render_doc(schuler.navigate)
