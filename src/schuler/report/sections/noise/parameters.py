"""The parameters of a noise model as a table: one row a parameter, x, y and z side by side."""

from __future__ import annotations

import re
from typing import Literal

from schuler.noise.noise_model import NoiseModel
from schuler.noise.noise_model_file import parameter_kind
from schuler.report.numbers import MISSING, compact_with_error, number, with_error
from schuler.report.sections.recording import pretty
from schuler.units import kind_of, scale

WORDS = {
    "white_noise.density": "white noise N",
    "quantization.step_density": "quantisation Q",
    "gauss_markov.sigma": "Gauss-Markov σ",
    "gauss_markov.correlation_time": "Gauss-Markov T",
    "bias_instability.level": "bias instability B",
    "random_walk.density": "random walk K",
    "rate_ramp.slope": "ramp",
    "sinusoid.amplitude": "sinusoid amplitude",
    "sinusoid.frequency": "sinusoid frequency",
    "turn_on_bias.sigma": "turn-on bias",
}
"""Parameters that are shown, in the order of the rows."""

_KEY = re.compile(r"^(?P<kind>[a-z_]+?)(?:_(?P<number>\d+))?\.(?P<field>\w+)$")


def _place(key: str) -> tuple[str, int]:
    """Return "kind.field" and the number of the part, 1 for an only one."""
    match = _KEY.match(key)
    if match is None:
        return key, 1
    return f"{match['kind']}.{match['field']}", int(match["number"] or 1)


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
            places = {p for p in places if p in found or p[0] == "random_walk.density"}
        shown = sorted((p for p in places if p[0] in WORDS), key=_order)
        for name, count in shown:
            kind = kind_of(parameter_kind(present[0], name) or "scale factor")
            unit = kind.datasheet if units == "datasheet" else kind.si
            factor = scale(unit, parameter_kind(present[0], name) or "scale factor")
            words = WORDS[name]
            if any((name, k) in shown for k in (2, 3, 4)):
                words = words.replace("Gauss-Markov", f"Gauss-Markov {count}")
            cells = [_cell(model, c, (name, count), factor, compact) for c in channels]
            first = (name, count) == shown[0]
            rows.append((sensor if first else "", words, pretty(unit), *cells))
    return ("sensor", "parameter", "unit", "x", "y", "z"), tuple(rows)


def _order(place: tuple[str, int]) -> tuple[int, int, int]:
    """Put the parts in order, and within a part its fields."""
    names = list(WORDS)
    kinds = list(dict.fromkeys(name.split(".")[0] for name in names))
    return kinds.index(place[0].split(".")[0]), place[1], names.index(place[0])


def _cell(
    model: NoiseModel, channel: str, place: tuple[str, int], factor: float, compact: bool
) -> str:
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
