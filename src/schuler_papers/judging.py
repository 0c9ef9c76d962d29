"""Papers as data: what is printed, with units and bands, is read from YAML; numbers come from runs.

Each paper has a file ``paper.yaml`` beside its modules: experiments, their items, and for each
item the rows and tables that are printed. A judge, ``(results, size) -> Found``, says what came out
under the names that rows and tables ask for. Nothing else decides a verdict.
"""

from __future__ import annotations

import ast
import itertools
import json
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from importlib.resources import files
from typing import Any, Literal

import numpy as np
import yaml

from schuler import ModelError
from schuler_papers.experiment import (
    Experiment,
    FloatArray,
    Item,
    Repetitions,
    Results,
    Size,
    stacked,
)
from schuler_papers.outcome import Band, Digits, Estimate, Outcome, Panel, Proof, Row, Sheet

Value = FloatArray | Estimate | float | str
_ROW_KEYS = {
    "is", "at", "of", "printed", "derived", "unit", "band", "within", "around", "near", "from",
    "note", "errors", "because", "slip", "proof", "identity", "against", "kind", "error", "for",
    "each", "quick", "full", "only", "forecast",
}  # fmt: skip
_TABLE_KEYS = _ROW_KEYS | {"title", "corner", "lines", "columns"}
_OPERATIONS: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


@dataclass(frozen=True, slots=True)
class Found:
    """What a judge found, by the names that the rows of the paper ask for."""

    # arrays have one entry for each repetition first; their mean and its error are taken.
    values: Mapping[str, Value]
    # computed bands: (2, ...) arrays of low and high ends
    bands: Mapping[str, Band | FloatArray] = field(default_factory=dict)
    proofs: Mapping[str, Proof] = field(default_factory=dict)  # that were run
    # printed values that other tables of the paper give
    printed: Mapping[str, Any] = field(default_factory=dict)
    panels: tuple[Panel, ...] = ()  # what is drawn again
    notes: tuple[str, ...] = ()  # sentences with numbers in them


def plain(results: Results, size: Size) -> Found:
    """Judge by what the runs returned, as it is."""
    return Found({name: stacked(results, name) for name in results[0]})


@cache
def forecasts(package: str) -> dict[str, Any]:
    """Return what many seeds of the quick size gave, by table; frozen by `benchmarks.forecast`.

    Of every cell the mean and the scatter of one draw, and the first seed with their number.
    """
    place = files(package).joinpath("forecasts.json")
    found: dict[str, Any] = json.loads(place.read_text()) if place.is_file() else {}
    return found


def load_experiments(package: str) -> tuple[Experiment, ...]:
    """Read the experiments of a paper from the YAML file in its package."""
    paper = package.rpartition(".")[2]
    text = files(package).joinpath("paper.yaml").read_text(encoding="utf-8")
    return tuple(_experiment(package, paper, entry) for entry in yaml.load(text, _Loader))


class _Loader(yaml.SafeLoader):
    """Numbers keep their digits."""


def _number(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> float:
    """A number as it is written; infinities are none of a paper."""
    text = str(loader.construct_scalar(node))
    return math.copysign(math.inf, -(text[0] == "-")) if "inf" in text else Digits(text)


_Loader.add_constructor("tag:yaml.org,2002:float", _number)


def _experiment(package: str, paper: str, entry: dict[str, Any]) -> Experiment:
    return Experiment(
        paper,
        entry["name"],
        entry["title"],
        _function(package, entry["run"]),
        tuple(_item(package, item) for item in entry["items"]),
        Repetitions(*entry.get("times", (1, 1))),
        tuple(entry.get("recordings", ())),
    )


def _item(package: str, entry: dict[str, Any]) -> Item:
    for kind, known in (("rows", _ROW_KEYS), ("tables", _TABLE_KEYS)):
        for spec in entry.get(kind, ()):
            unknown = set(spec) - known
            if unknown:
                raise ModelError(f"{entry['label']}: {', '.join(sorted(unknown))} in {spec}")
    judge = partial(_judge, judge_of(package, entry), entry, forecasts(package))
    return Item(
        entry["label"], entry["title"], entry["claim"], judge, tuple(entry.get("slips", ()))
    )


def judge_of(package: str, entry: dict[str, Any]) -> Callable[[Results, Size], Found]:
    """Return the function that says what an item came to."""
    return _function(package, entry["judge"]) if "judge" in entry else plain


def _function(package: str, name: str) -> Callable[..., Any]:
    module, _, function = name.rpartition(".")
    found: Callable[..., Any] = getattr(import_module(f"{package}.{module}"), function)
    return found


def _judge(
    find: Callable[[Results, Size], Found],
    entry: dict[str, Any],
    frozen: Mapping[str, Any],
    results: Results,
    size: Size,
) -> Outcome:
    found = find(results, size)
    rows = [row for spec in entry.get("rows", ()) for row in _rows(spec, found, size)]
    sheets = tuple(
        _sheet(spec, found, size, frozen.get(f"{entry['label']}/{spec['title']}"))
        for spec in entry.get("tables", ())
    )
    cells = [row for sheet in sheets for line in sheet.cells for row in line if row is not None]
    notes = (*entry.get("notes", ()), *found.notes)
    return Outcome((*rows, *cells), found.panels, notes, sheets)


def _rows(spec: dict[str, Any], found: Found, size: Size) -> Iterator[Row]:
    """Rows of one entry: one, or one for each combination of what stands under `for`."""
    if spec.get("only", size) != size:
        return
    spec = {**spec, **spec.get(size, {})}
    loops: dict[str, list[Any]] = spec.get("for", {})
    each: dict[str, list[Any]] = spec.get("each", {})
    ranges = [range(len(values)) for values in loops.values()]
    for k, places in enumerate(itertools.product(*ranges)):
        names = {n: v[i] for (n, v), i in zip(loops.items(), places, strict=True)}
        own = {key: values[k] for key, values in each.items()}
        yield _row({**spec, **own}, names, places, found)


def _row(
    spec: Mapping[str, Any], names: Mapping[str, Any], places: tuple[int, ...], found: Found
) -> Row:
    key = str(spec["is"]).format(**names)
    ours, index = _value(found.values[key], spec.get("at", places))
    scatter = float(spec.get("scatter", math.nan))
    if math.isfinite(scatter) and isinstance(ours, Estimate):
        # few seeds do not tell the scatter, the forecast's many do
        ours = Estimate(ours.value, scatter / math.sqrt(len(np.atleast_1d(found.values[key]))))
    printed, derived = _printed(spec, key, index, found)
    role: Literal["", "arithmetic", "setting"] = spec.get("kind", "")
    error = spec.get("error")
    band = _band(spec, key, index, printed, found)
    return Row(
        spec["of"].format(**names),
        ours,
        printed,
        spec.get("unit", ""),
        band,
        math.nan if error is None else float(error),
        scatter,
        role,
        derived,
        bool(spec.get("against", False)),
        _proof(spec, names, ours, band, found),
        spec.get("because", ""),
        spec.get("slip", ""),
    )


def _proof(
    spec: Mapping[str, Any],
    names: Mapping[str, Any],
    ours: Estimate | float | str,
    band: Band | None,
    found: Found,
) -> Proof | None:
    """One that the judge ran, or arithmetic of printed numbers that is an identity by itself."""
    if (statement := spec.get("identity")) is not None:
        assert band is not None
        assert not isinstance(ours, str)
        return Proof(str(statement).format(**names), ours, band.low, band.high)
    proof = spec.get("proof")
    return None if proof is None else found.proofs[str(proof).format(**names)]


def _value(value: Value, at: Any) -> tuple[Estimate | float | str, tuple[int, ...]]:
    index = (at,) if isinstance(at, int) else tuple(at)
    if isinstance(value, str | Estimate):
        return value, index
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 0:
        return float(array), index
    picked = array[(slice(None), *index[: array.ndim - 1])]
    if picked.ndim != 1:
        raise ModelError(f"a value of shape {array.shape} at {index}", expected="one a repetition")
    error = picked.std(ddof=1) / math.sqrt(picked.size) if picked.size > 1 else math.nan
    return Estimate(float(picked.mean()), float(error)), index


def _part(values: Any, index: tuple[int, ...]) -> Any:
    """One entry of what may be given for all or for each."""
    if isinstance(values, np.ndarray):
        return values[index[: values.ndim]]
    return values


def _printed(
    spec: Mapping[str, Any], key: str, index: tuple[int, ...], found: Found
) -> tuple[float | str | None, bool]:
    if "derived" in spec:
        return arithmetic(str(spec["derived"])), True
    printed = spec.get("printed", _part(found.printed.get(key), index))
    if printed is None or isinstance(printed, str):
        return printed, False
    return printed if isinstance(printed, Digits) else float(printed), False


def _band(
    spec: Mapping[str, Any],
    key: str,
    index: tuple[int, ...],
    printed: float | str | None,
    found: Found,
) -> Band | None:
    extra = (spec.get("from", "spec"), spec.get("note", ""), float(spec.get("errors", 0.0)))
    number = float(printed) if isinstance(printed, float) else math.nan
    if "band" in spec:
        low, high = (float(end) for end in spec["band"])
    elif "near" in spec:
        middle, slack = (float(v) for v in spec["near"])
        low, high = middle - slack, middle + slack
    elif "around" in spec:
        low, high = number - spec["around"], number + spec["around"]
    elif "within" in spec:
        slack = spec["within"] * abs(number)
        low, high = number - slack, number + slack
    elif (computed := found.bands.get(key)) is not None:
        if isinstance(computed, Band):
            return computed
        low, high = (float(end[index[: end.ndim]]) for end in computed)
        if math.isnan(low):
            return None
    else:
        return None
    return Band(low, high, *extra)


def _sheet(
    spec: dict[str, Any], found: Found, size: Size, forecast: dict[str, Any] | None
) -> Sheet:
    """A table of the paper, cell by cell."""
    spec = {"of": "{line}, {column}", **spec, **spec.get(size, {})}
    lines, columns = [str(x) for x in spec["lines"]], [str(x) for x in spec["columns"]]
    printed: list[list[Any]] = spec.get("printed") or found.printed[spec["is"]]
    cells: list[tuple[Row | None, ...]] = []
    for i, line in enumerate(lines):
        row: list[Row | None] = []
        for j, column in enumerate(columns):
            own = {**spec, **_for_cell(spec, i, j), "printed": printed[i][j]}
            if forecast is not None and own.get("forecast") is not None:
                own |= _foreseen(own["forecast"], forecast, i, j)
            names = {"line": line, "column": column}
            row.append(None if printed[i][j] is None else _row(own, names, (i, j), found))
        cells.append(tuple(row))
    return Sheet(spec["title"], spec.get("corner", ""), tuple(columns), tuple(lines), tuple(cells))


def _foreseen(relative: float, forecast: Mapping[str, Any], i: int, j: int) -> dict[str, Any]:
    """The band around a frozen forecast: not narrower than the forecast itself is sure."""
    first, count = forecast["seeds"]
    mean, scatter = forecast["mean"][i][j], forecast["scatter"][i][j]
    if mean is None:
        return {}
    slack = max(relative * abs(mean), 2.0 * scatter / math.sqrt(count))
    note = f"{mean:.4g}, mean of {count} draws (seeds from {first})"
    return {"band": [mean - slack, mean + slack], "from": "frozen", "note": note,
            "scatter": scatter}  # fmt: skip


def _for_cell(spec: Mapping[str, Any], i: int, j: int) -> dict[str, Any]:
    """Settings that are given by line, by column, or for every cell."""
    own: dict[str, Any] = {}
    for key, values in spec.get("each", {}).items():
        if isinstance(values, dict):
            way, listed = next(iter(values.items()))
            value = listed[i] if way == "line" else listed[j]
        else:
            value = values[i][j]
        if value is not None:
            own[key] = value
    return own


def arithmetic(text: str) -> float:
    """Compute a number from printed ones: + - * / and powers of numbers alone."""

    def value(node: ast.expr) -> float:
        if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            return float(node.value)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -value(node.operand)
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
            return _OPERATIONS[type(node.op)](value(node.left), value(node.right))
        raise ModelError(f"'{text}' is no arithmetic of numbers")

    return value(ast.parse(text, mode="eval").body)
