"""What was seen in a drive before and while it was navigated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from schuler.report.blocks import Finding, Findings, Section
from schuler.report.makers import moments, things


def condition_section(findings: Sequence[dict[str, Any]]) -> Section:
    """Show the findings of a run."""
    order = {"error": 0, "warning": 1, "info": 2}
    items = tuple(
        Finding(
            f["severity"],
            f"{f['message']}." if not f["cure"] else f"{f['message']}: {f['cure']}.",
            moments(f["intervals_s"], f["severity"]),
        )
        for f in sorted(findings, key=lambda f: order.get(f["severity"], 3))
    )
    serious = sum(f["severity"] != "info" for f in findings)
    if not items:
        items = (Finding("good", "Nothing to remark: IMU and GNSS fit each other throughout."),)
    if serious:
        sentence = f"The drive shows {things(serious)}."
    else:
        sentence = "The recordings of the drive are whole and fit each other."
    return Section("Condition of the drive", (Findings(items),), (sentence,))
