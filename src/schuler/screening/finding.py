"""One thing that a look at a recording has seen."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from schuler.data.to_dict import ToDict

Severity = Literal["info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding(ToDict):
    """One thing that was seen.

    Parameters
    ----------
    kind : str
        "rate", "gap", "repeated rows", "stuck axis", "stuck for a while", "noise burst",
        "saturation", "knock", "outlier", "heavy tails", "units", "gravity", "grid", "rest",
        "channels", "source of rate".
    severity : {"info", "warning", "error"}
        An error makes results wrong; a warning can.
    message : str
        In plain words, with numbers.
    channels : tuple of str
        Channels concerned; empty: all.
    intervals : tuple of (float, float)
        First and last second concerned, on the recording's time axis.
    value : float or None
        The number behind it, SI.
    cure : str
        What the user can do about it; empty where the message says all.
    """

    JSON = "kind severity message channels intervals_s=intervals value cure"

    kind: str
    severity: Severity
    message: str
    channels: tuple[str, ...] = ()
    intervals: tuple[tuple[float, float], ...] = ()
    value: float | None = None
    cure: str = ""

    @property
    def text(self) -> str:
        """Message and cure in one line."""
        return f"{self.message}; {self.cure}" if self.cure else self.message
