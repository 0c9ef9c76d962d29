"""One thing that a look at a recording has seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from schuler.data.to_dict import ToDict

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding(ToDict):
    """One thing that was seen."""

    JSON = "kind severity message channels intervals_s=intervals value cure"

    # "rate", "gap", "repeated rows", "stuck axis", "stuck for a while", "noise burst",
    # "saturation", "knock", "outlier", "heavy tails", "units", "gravity", "grid", "rest",
    # "channels", "source of rate"
    kind: str
    severity: Severity  # an error makes results wrong; a warning can.
    message: str  # in plain words, with numbers
    channels: tuple[str, ...] = ()  # channels concerned; empty: all.
    # first and last second concerned, on the recording's time axis
    intervals: tuple[tuple[float, float], ...] = ()
    value: float | None = None  # the number behind it, SI
    cure: str = ""  # what the user can do about it; empty where the message says all.

    @property
    def text(self) -> str:
        """Message and cure in one line."""
        return f"{self.message}; {self.cure}" if self.cure else self.message
