"""Stretches without GNSS, as options of the command line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cyclopts import Parameter

from schuler.cli.options.groups import OUTAGES
from schuler.cli.parsing import parse_numbers
from schuler.errors import InputError

Windows = tuple[tuple[float, float], ...]


@Parameter(name="*", group=OUTAGES)
@dataclass(frozen=True)
class OutageOptions:
    """Where GNSS is withheld, and how the answer is judged.

    Parameters
    ----------
    window : tuple of str
        START:SECONDS, with START in seconds after the first GNSS epoch. May be repeated.
    sweep : str, optional
        SECONDS:EVERY, windows of that length beginning every so many seconds; those that
        overlap are dealt into several runs.
    limit : float, optional
        Exit with code 1 when the causal mean of the largest errors (of the first error model) is
        above so many m.
    lag : float, optional
        Judge the fixed-lag smoother as well, which uses data up to so many seconds after every
        moment.
    """

    window: tuple[str, ...] = ()
    sweep: str | None = None
    limit: float | None = None
    lag: float | None = None

    def keywords(self) -> dict[str, Any]:
        """Return the windows as `evaluate_outages` wants them."""
        if bool(self.window) == (self.sweep is not None):
            raise InputError(
                "which outages" if not self.window else "--window and --sweep together",
                expected="--window START:SECONDS (may be repeated) or --sweep SECONDS:EVERY",
            )
        if self.lag is not None and not self.lag > 0.0:
            raise InputError(f"--lag {self.lag:g}", expected="seconds, above zero")
        if self.sweep is None:
            return {"windows": parse_windows(self.window)}
        example = "--sweep SECONDS:EVERY, both above zero, such as 30:10"
        numbers = parse_numbers(self.sweep, 2, example, ":")
        if min(numbers) <= 0.0:
            raise InputError(f"'{self.sweep}' is not understood", expected=example)
        return {"sweep": numbers}

    def failed(self, mean: float) -> tuple[str, ...]:
        """Return the check that fails when a mean of the largest errors is above the limit."""
        if self.limit is None or mean <= self.limit:
            return ()
        return (f"mean of the largest errors {mean:.3g} m is above {self.limit:g} m",)


def parse_windows(texts: tuple[str, ...]) -> Windows:
    """Return start and length of every window, s."""
    example = "--window START:SECONDS with SECONDS above zero, such as 120:30"
    windows = []
    for text in texts:
        start, seconds = parse_numbers(text, 2, example, ":")
        if seconds <= 0.0:
            raise InputError(f"'{text}' is not understood", expected=example)
        windows.append((start, seconds))
    return tuple(windows)
