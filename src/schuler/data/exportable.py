"""What every result offers to those who use it: a short look, tables, plots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from html import escape
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from schuler.data.columns import Columns, columns_of, index_of
from schuler.data.to_dict import ToDict
from schuler.errors import InputError

MOST_ITEMS, MOST_LETTERS = 4, 72
"""Of one field in the short look at a result."""


class Exportable(ToDict):
    """A result that shows itself and goes over into other tools.

    A class that wants another table than the one found from its fields has its own `to_columns`,
    or names the field in `TABLE` and the parts of its vectors in `AXES`.
    """

    __slots__ = ()
    TABLE: ClassVar[str] = ""
    AXES: ClassVar[str] = "x y z"

    def __init_subclass__(cls, **how: Any) -> None:
        super().__init_subclass__(**how)
        if "__repr__" not in cls.__dict__:  # else `dataclass` would write one with all numbers
            cls.__repr__ = Exportable.__repr__  # type: ignore[method-assign]

    def __repr__(self) -> str:
        inner = ", ".join(f"{name}={text}" for name, text in _looks(self))
        return f"{type(self).__name__}({inner})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the answer in words, the fields, a small plot."""
        from schuler.data.sketch import sketch

        said = "".join(f"<p>{escape(line)}</p>" for line in _page().summary(self))
        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(name)}</th>"
            f"<td style='text-align:left'>{escape(text)}</td></tr>"
            for name, text in _looks(self)
        )
        title = escape(type(self).__name__)
        return f"<div><b>{title}</b>{said}{sketch(self.to_columns())}<table>{rows}</table></div>"

    def to_columns(self) -> Columns:
        """Return named columns: a series by its samples, else one row for each part."""
        return columns_of(self, self.TABLE, self.AXES)

    def to_pandas(self) -> Any:
        """Return the columns as a pandas DataFrame, by time where there is time."""
        pandas = optional("pandas", "frames")
        columns = self.to_columns()
        index = index_of(columns)
        frame = pandas.DataFrame(columns)
        return frame.set_index(index) if index else frame

    def to_polars(self) -> Any:
        """Return the columns as a polars DataFrame."""
        import polars

        return polars.DataFrame(dict(self.to_columns()))

    def to_xarray(self) -> Any:
        """Return the columns as an xarray Dataset, by time where there is time."""
        xarray = optional("xarray", "frames")
        columns = self.to_columns()
        index = index_of(columns)
        along = index or "row"
        variables = {name: (along, c) for name, c in columns.items() if name != index}
        return xarray.Dataset(variables, coords={index: columns[index]} if index else None)

    def to_parquet(self, path: str | Path) -> None:
        """Write the columns as Parquet; the file appears only when it is complete.

        Parameters
        ----------
        path : str or Path
            File to write.
        """
        from schuler.data.table import write_parquet

        write_parquet(path, self.to_columns())

    def plot(self, figure: str = "", *, backend: Literal["plotly", "matplotlib"] = "plotly") -> Any:
        """Return a plot of the result, as the report shows it.

        Parameters
        ----------
        figure : str
            Part of the title of the wanted plots, where the report has several; the first ones
            by default.
        backend : {"plotly", "matplotlib"}
            Library that draws.

        Returns
        -------
        plotly.graph_objects.Figure or matplotlib.figure.Figure
            It can be changed further.
        """
        return _page().plot(self, figure, backend=backend)


def optional(package: str, extra: str) -> Any:
    """Import a package that not everybody needs; its lack is told with the cure."""
    try:
        return import_module(package)
    except ImportError:
        raise InputError(
            f"this needs the package {package}, which is not installed",
            cure=f"install it with: pip install 'schuler[{extra}]'",
        ) from None


def _page() -> Any:
    """Return the room that can draw every result; only here do results know that it is there."""
    return import_module("schuler.report.plots")


def _looks(result: Any) -> list[tuple[str, str]]:
    return [(f.name, _look(getattr(result, f.name))) for f in fields(result) if f.repr]


def _look(value: Any) -> str:
    """Return a value in a few letters."""
    if isinstance(value, np.ndarray):
        if value.size <= MOST_ITEMS and value.ndim == 1:
            return f"[{', '.join(_look(v) for v in value.tolist())}]"
        return f"<{'×'.join(map(str, value.shape))} {value.dtype}>"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return _items(value, "{}", [f"{k}: {_look(v)}" for k, v in [*value.items()][:MOST_ITEMS]])
    if isinstance(value, list | tuple):
        return _items(value, "()", [_look(v) for v in value[:MOST_ITEMS]])
    if is_dataclass(value) and isinstance(value, Exportable):
        return f"{type(value).__name__}(...)"
    text = repr(value)
    return text if len(text) <= MOST_LETTERS else f"{text[: MOST_LETTERS - 3]}..."


def _items(value: Any, brackets: str, looks: list[str]) -> str:
    text = ", ".join(looks)
    if len(value) > MOST_ITEMS or len(text) > MOST_LETTERS:
        return f"{brackets[0]}{len(value)} items{brackets[1]}"
    return f"{brackets[0]}{text}{brackets[1]}"
