"""The parameters of a noise model as a table: one row a parameter, x, y and z side by side."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Literal

from schuler.noise.noise_model import NoiseModel
from schuler.noise.parameter_names import class_and_number, parameter_kind, parameter_words
from schuler.report.numbers import MISSING, compact_with_error, number, with_error
from schuler.report.sections.recording import pretty
from schuler.units import kind_of, scale

Place = tuple[str, str, int]
"""Kind, field and number of a part, 1 for an only one."""


def shown_words(key: str) -> str:
    """Name of a parameter in tables; empty if it is not shown."""
    return parameter_words(key).replace("Gauss-Markov sigma", "Gauss-Markov σ")


def _place(key: str) -> Place:
    name, _, field = key.partition(".")
    cls, number = class_and_number(name)
    return (name if cls is None else cls.kind), field, number


def parameter_rows(
    model: NoiseModel,
    units: Literal["datasheet", "si"],
    *,
    short: bool = False,
    compact: bool = False,
) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return a noise model as a table."""
    rows: list[tuple[str, ...]] = []
    for sensor in ("gyro", "accel"):
        channels = [f"{sensor}_{axis}" for axis in "xyz"]
        present = [c for c in channels if c in model.channels]
        places = {_place(k) for c in present for k in model.process(c).parameters}
        places |= {_place(k) for c in present for k in model.limits.get(c, {})}
        found = {_place(k) for c in present for k in model.process(c).parameters}
        if short:
            places = {p for p in places if p in found or p[:2] == ("random_walk", "density")}
        shown = sorted((p for p in places if shown_words(f"{p[0]}.{p[1]}")), key=_order)
        for place in shown:
            kind, field, count = place
            unit, factor = _unit(parameter_kind(present[0], f"{kind}.{field}"), units)
            words = shown_words(f"{kind}.{field}")
            if any((kind, field, k) in shown for k in (2, 3, 4)):
                words = words.replace("Gauss-Markov", f"Gauss-Markov {count}")
            cells = [_cell(model, c, place, factor, compact) for c in channels]
            first = place == shown[0]
            rows.append((sensor if first else "", words, pretty(unit), *cells))
    return ("sensor", "parameter", "unit", "x", "y", "z"), tuple(rows)


def _unit(kind: str | None, units: str) -> tuple[str, float]:
    """Unit of a parameter and its size in SI; a plain number has none."""
    if kind is None:
        return "", 1.0
    named = kind_of(kind)
    unit = named.datasheet if units == "datasheet" else named.si
    return unit, scale(unit, kind)


def _order(place: Place) -> tuple[float, str, int, int]:
    """Put the parts in order, and within a part its fields."""
    kind, field, number = place
    cls, _ = class_and_number(kind)
    if cls is None:
        return math.inf, kind, number, 0
    names = [f.name for f in fields(cls)]  # type: ignore[arg-type]
    return cls.rank, kind, number, names.index(field) if field in names else len(names)


def _cell(model: NoiseModel, channel: str, place: Place, factor: float, compact: bool) -> str:
    if channel not in model.channels:
        return MISSING
    errors = model.standard_errors.get(channel, {})
    for key, value in model.process(channel).parameters.items():
        if _place(key) == place:
            write = compact_with_error if compact else with_error
            return write(value / factor, errors.get(key, 0.0) / factor)
    for key, limit in model.limits.get(channel, {}).items():
        if _place(key) == place:
            return f"< {number(limit / factor)}"
    return MISSING
