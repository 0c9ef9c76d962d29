"""Trajectories as tables, Parquet or CSV."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.data.trajectory import NavigationSolution
from schuler.errors import InputError
from schuler.io.tables.parquet_file import parquet_frame

FORMS = (".parquet", ".csv")


def check_trajectory_name(path: str | Path) -> None:
    """Raise when the ending of a file does not say which format is wanted."""
    if Path(path).suffix.lower() not in FORMS:
        raise InputError(
            f"ending '{Path(path).suffix}' is not known",
            expected=" or ".join(FORMS),
            where=str(path),
        )


def write_trajectory(path: str | Path, solution: NavigationSolution, form: str = "") -> None:
    """Write a solution as a table; the file appears only when it is complete."""
    write_columns(path, solution.to_columns(), form)


def write_columns(
    path: str | Path, columns: dict[str, NDArray[np.float64]], form: str = ""
) -> None:
    """Write named columns as Parquet or CSV."""
    from schuler.data.table import write_atomically, write_parquet

    if not form:
        check_trajectory_name(path)
    if (form or Path(path).suffix).lower() == ".parquet":
        write_parquet(path, columns)
        return
    import polars

    frame = polars.DataFrame({_inert(n): _cells(n, c) for n, c in columns.items()})
    write_atomically(path, lambda temporary: frame.write_csv(temporary))


def _cells(name: str, values: NDArray[Any]) -> Any:
    if values.dtype.kind == "f":
        return np.round(values, _digits(name))
    return values if values.dtype.kind in "iub" else [_inert(str(v)) for v in values]


def _inert(text: str) -> str:
    """Return text that a spreadsheet does not take for a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


_DIGITS = (
    (r"time_s", 9),
    (r"(?:latitude|longitude)_deg", 11),
    (r"(?:height|pos_std_\w+)_m", 5),
    (r"vel_\w+_m_s", 6),
    (r"(?:roll|pitch|heading|att_std_\w+)_deg", 7),
)
"""Digits behind the point that mean something in CSV; other columns keep all of theirs."""


def _digits(name: str) -> int:
    return next((d for pattern, d in _DIGITS if re.fullmatch(pattern, name)), 15)


def read_columns(path: str | Path) -> dict[str, NDArray[np.float64]]:
    """Read the columns of a trajectory that `write_trajectory` wrote as Parquet."""
    file = Path(path)
    if not file.is_file():
        raise InputError("no such file", where=str(file))
    frame = parquet_frame(file)
    needed = {"time_s", "latitude_deg", "longitude_deg", "height_m"}
    if not needed <= set(frame.columns):
        raise InputError(
            f"has no column '{sorted(needed - set(frame.columns))[0]}'",
            expected="a trajectory from `schuler navigate --out`",
            where=str(file),
        )
    return {name: frame[name].to_numpy() for name in frame.columns}
