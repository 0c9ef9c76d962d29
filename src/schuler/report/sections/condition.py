"""What was seen in a drive before and while it was navigated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from schuler.report.blocks import Finding, Findings, Section

MOST_INTERVALS = 4


def condition_section(findings: Sequence[dict[str, Any]]) -> Section:
    """Show the findings of a run."""
    order = {"error": 0, "warning": 1, "info": 2}
    items = tuple(
        Finding(
            f["severity"],
            f"{f['message']}." if not f["cure"] else f"{f['message']}: {f['cure']}.",
            _where(f),
        )
        for f in sorted(findings, key=lambda f: order.get(f["severity"], 3))
    )
    serious = sum(f["severity"] != "info" for f in findings)
    if not items:
        items = (Finding("good", "Nothing to remark: IMU and GNSS fit each other throughout."),)
    if serious:
        sentence = f"The drive shows {serious} thing{'' if serious == 1 else 's'} to watch."
    else:
        sentence = "The recordings of the drive are whole and fit each other."
    return Section("Condition of the drive", (Findings(items),), (sentence,))


def _where(finding: dict[str, Any]) -> str:
    spans = finding["intervals_s"]
    if finding["severity"] == "info" or not spans:
        return ""
    shown = [
        f"{a:.8g} s" if b - a < 0.1 else f"{a:.8g} to {b:.8g} s" for a, b in spans[:MOST_INTERVALS]
    ]
    more = len(spans) - len(shown)
    return "At " + ", ".join(shown) + (f" and {more} more." if more > 0 else ".")
