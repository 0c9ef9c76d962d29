"""N, B, K, Q and R of IEEE Std 952 as a table: one row a coefficient, x, y and z side by side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from schuler.estimation.ieee952 import KEYS, WORDS, Coefficient
from schuler.noise.parameter_names import parameter_kind
from schuler.report.numbers import MISSING, compact_with_error, number, with_error
from schuler.report.sections.recording import pretty
from schuler.units import kind_of, scale

Rows = tuple[tuple[str, ...], ...]


def ieee952_rows(
    channels: Mapping[str, Mapping[str, Coefficient]],
    units: Literal["datasheet", "si"],
    *,
    compact: bool = False,
) -> tuple[tuple[str, ...], Rows]:
    """Return the coefficients of all channels as a table."""
    rows: list[tuple[str, ...]] = []
    write = compact_with_error if compact else with_error
    for sensor in ("gyro", "accel"):
        present = [c for c in channels if c.startswith(sensor)]
        for letter, key in KEYS.items():
            if not present:
                continue
            kind = parameter_kind(present[0], key) or ""
            unit = kind_of(kind).datasheet if units == "datasheet" else kind_of(kind).si
            size = scale(unit, kind)
            cells = []
            for axis in "xyz":
                found = channels.get(f"{sensor}_{axis}", {}).get(letter, Coefficient())
                if found.value is not None:
                    cells.append(write(found.value / size, (found.standard_error or 0.0) / size))
                elif found.upper_limit is not None:
                    cells.append(f"< {number(found.upper_limit / size)}")
                else:
                    cells.append(MISSING)
            first = sensor if letter == "N" else ""
            rows.append((first, WORDS[letter], pretty(unit), *cells))
    return ("sensor", "IEEE 952", "unit", "x", "y", "z"), tuple(rows)


def plateau_note(channels: Mapping[str, Mapping[str, Coefficient]]) -> str:
    """Say where B is that of several Gauss-Markov noises; empty if nowhere."""
    noted = [c for c, found in channels.items() if found["B"].note]
    if not noted:
        return ""
    return f"B of {', '.join(noted)}: {channels[noted[0]]['B'].note}."
