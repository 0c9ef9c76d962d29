"""What a person sees: short tables on standard output, single lines on standard error.

Text from files is never taken for markup, and characters that steer a terminal are shown, not
obeyed.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


# Argument of the readers: option of commands that read one file, of the IMU and of the GNSS of
# commands that read two.
_OPTIONS: Mapping[str, tuple[str, str, str]] = {
    "time_unit": ("--time-unit", "--imu-time-unit", "--gnss-time-unit"),
    "time_offset": ("--time-offset", "--imu-time-offset", "--gnss-time-offset"),
    "rate": ("--rate", "--imu-rate", "--gnss-rate"),
    "gyro_unit": ("--gyro-unit",) * 3,
    "accel_unit": ("--accel-unit",) * 3,
    "angle_unit": ("--angle-unit", "--gnss-angle-unit", "--gnss-angle-unit"),
    "velocity_unit": ("--velocity-unit", "--gnss-velocity-unit", "--gnss-velocity-unit"),
    "origin": ("--origin", "--gnss-origin", "--gnss-origin"),
    "position_sd": ("--position-sd", "--gnss-position-sd", "--gnss-position-sd"),
    "velocity_sd": ("--velocity-sd", "--gnss-velocity-sd", "--gnss-velocity-sd"),
    "delimiter": ("--delimiter", "--imu-delimiter", "--gnss-delimiter"),
    "decimal": ("--decimal", "--imu-decimal", "--gnss-decimal"),
    "comment": ("--comment", "--imu-comment", "--gnss-comment"),
    "skip_lines": ("--skip-lines", "--imu-skip-lines", "--gnss-skip-lines"),
    "topic": ("--ros-topic", "--imu-topic", "--gnss-topic"),
    "clock": ("--clock", "--imu-clock", "--gnss-clock"),
    "imu": ("--imu", "--imu-number", "--imu-number"),
    "repair": ("--repair",) * 3,
    "close_up": ("--repair",) * 3,
    "increments": ("--increments",) * 3,
    "align": ("--align",) * 3,
}
_COLUMN = ("--column", "--imu-column", "--gnss-column")
_COLUMNS = ("--columns", "--imu-columns", "--gnss-columns")
PLACES = {"one": 0, "imu": 1, "gnss": 2}
"""Which of the options is meant, by the file that is read."""

_VALUE = r"(?:'(?P<quoted>[^']*)'|(?P<bare>[^\s,;()'\"]*))"
_ARGUMENT = re.compile(rf"\b(?P<name>{'|'.join(_OPTIONS)})={_VALUE}")
_MAPPING = re.compile(r"\bcolumns=\{(?P<pairs>[^}]*)\}")
_SEQUENCE = re.compile(r"\bcolumns=\((?P<names>[^)]*)\)")


def in_options(text: str, place: str = "one") -> str:
    """Return a message with the arguments of Python as options of the command line."""
    k = PLACES[place]
    text = _MAPPING.sub(lambda m: _pairs(m["pairs"], _COLUMN[k]), text)
    text = _SEQUENCE.sub(lambda m: f"{_COLUMNS[k]} {_names(m['names'])}", text)
    text = re.sub(r"\bcolumns=", f"{_COLUMN[k]} ", text)
    return _ARGUMENT.sub(lambda m: _option(m, k), text)


def _option(match: re.Match[str], k: int) -> str:
    option = _OPTIONS[match["name"]][k]
    value = match["quoted"] if match["quoted"] is not None else match["bare"]
    if value in ("True", "False", ""):
        return option
    return f"{option} '{value}'" if re.search(r"[^\w.+-]", value) else f"{option} {value}"


def _names(text: str) -> str:
    return ",".join(n.strip().strip("'") for n in text.split(",")).strip(",")


def _pairs(text: str, option: str) -> str:
    shown = []
    for role, value in re.findall(r"'(\w+)':\s*(\([^)]*\)|[^,}]+)", text):
        if value.startswith("("):
            first = _names(value[1:-1]).split(",")[0].strip(".") or "NAME"
            shown.append(f"{option} {role}_x={first} and so on")
        else:
            name = value.strip().strip("'")
            shown.append(f"{option} {role}=" + {"...": "NAME", "None": ""}.get(name, name))
    return " ".join(shown) or f"{option} ROLE=NAME"


PIPE_WIDTH = 160
"""Columns when nobody watches: wide enough that no cell is broken."""


@dataclass
class Manners:
    """How a command behaves, whatever its verb.

    Parameters
    ----------
    quiet : bool
        Print no tables and no progress, only failed checks and errors.
    no_color : bool
        Print without colours.
    force : bool
        Write over files that exist.
    """

    quiet: bool = False
    no_color: bool = False
    force: bool = False

    def options(self) -> list[str]:
        """Return the options that make another command behave alike."""
        given = {"--quiet": self.quiet, "--no-color": self.no_color, "--force": self.force}
        return [option for option, there in given.items() if there]


MANNERS = Manners()
"""Of the command that runs."""


def printable(text: str) -> str:
    """Return one line of text without characters that steer a terminal."""
    joined = " ".join(text.split())
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in joined)


def say(message: str) -> None:
    """Print one line about the run on standard error."""
    line = f"schuler: {in_options(printable(message))}"
    encoding = sys.stderr.encoding or "utf-8"
    print(line.encode(encoding, "backslashreplace").decode(encoding), file=sys.stderr)


def plain_text(text: str, style: str = "") -> Text:
    """Return text that rich prints as it is."""
    from rich.text import Text

    return Text(printable(text), style=style)


def _reader_left() -> None:
    """Let the program end quietly; rich alone would exit with 1."""
    raise BrokenPipeError


class Screen:
    """The terminal of one command.

    Parameters
    ----------
    json_on_stdout : bool
        Standard output belongs to a machine; people read standard error.
    """

    def __init__(self, *, json_on_stdout: bool = False) -> None:
        from rich.console import Console

        how = {"stderr": json_on_stdout, "highlight": False, "quiet": MANNERS.quiet}
        how |= {"no_color": True} if MANNERS.no_color else {}
        self.console: Console = Console(**how)  # type: ignore[arg-type]
        if not self.console.is_terminal:
            self.console = Console(**how, width=PIPE_WIDTH)  # type: ignore[arg-type]
        self.console.on_broken_pipe = _reader_left  # type: ignore[method-assign]

    def heading(self, text: str, detail: str = "") -> None:
        """Print a heading with a quieter detail behind it."""
        line = plain_text(text, "bold")
        if detail:
            line.append("  ").append_text(plain_text(detail, "dim"))
        self.console.print()
        self.console.print(line, soft_wrap=True)

    def line(self, text: str, style: str = "") -> None:
        """Print one paragraph."""
        self.console.print(plain_text(text, style), soft_wrap=True)

    def finding(self, severity: str, text: str) -> None:
        """Print one finding with a mark that tells how much it matters."""
        text = in_options(text)
        mark, style = {
            "good": ("+", "green"),
            "info": ("-", "cyan"),
            "warning": ("!", "yellow"),
            "error": ("!!", "bold red"),
        }.get(severity, ("-", ""))
        if not self.console.is_terminal:
            self.console.print(plain_text(f"{mark} {text}"), soft_wrap=True)
            return
        from rich.table import Table

        grid = Table.grid(padding=(0, 1))
        grid.add_column(width=2, justify="right")
        grid.add_column()
        grid.add_row(plain_text(mark, style), plain_text(text))
        self.console.print(grid)

    def findings(self, found: Iterable[tuple[str, str]], *, most: int = 1000) -> None:
        """Print findings, each with how much it matters; those beyond `most` are counted."""
        every = list(found)
        for severity, text in every[:most]:
            self.finding(severity, text)
        self.more(len(every) - most)

    def more(self, left: int) -> None:
        """Tell how many lines were left out."""
        if left > 0:
            self.line(f"... and {left} more (--json or --report has all)", "dim")

    def table(self, columns: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> None:
        """Print a table."""
        from rich import box
        from rich.table import Table

        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, header_style="dim")
        for k, heading in enumerate(columns):
            table.add_column(
                plain_text(heading), justify="left" if k < words else "right", no_wrap=k < words
            )
        for row in rows:
            table.add_row(*(plain_text(cell) for cell in row))
        self.console.print(table)
