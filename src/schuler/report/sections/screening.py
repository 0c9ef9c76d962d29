"""What is wrong with a recording, and what is good to know about it."""

from __future__ import annotations

from schuler.report.blocks import Facts, Finding, Findings, Section
from schuler.report.makers import moments, things
from schuler.report.numbers import duration, number
from schuler.report.sections.registry import register
from schuler.screening.screen import Screening


@register
def screening_sections(screening: Screening) -> tuple[Section, ...]:
    """Show a screening."""
    facts = Facts(
        (
            ("Rate", f"{screening.rate:.6g} Hz"),
            ("Jitter of the time stamps", _jitter(screening.jitter)),
            ("Repeated rows", str(int(screening.repeated.sum()))),
            ("Knocks and outliers", str(len(screening.disturbed))),
            ("Gaps", str(len(screening.gaps))),
            ("Stood still", "throughout" if screening.static else _rest(screening)),
        )
    )
    items = tuple(
        Finding(f.severity, f.message, moments(f.intervals, f.severity)) for f in screening.findings
    )
    if not items:
        items = (Finding("good", "Nothing to remark: the recording looks as it should."),)
    serious = sum(f.severity != "info" for f in screening.findings)
    words = f"has {things(serious)}" if serious else "is clean"
    sentence = f"The recording {screening.name} ({duration(screening.duration)}) {words}."
    return (Section("Screening", (facts, Findings(items)), (sentence,)),)


def _jitter(seconds: float) -> str:
    return f"{number(1e3 * seconds)} ms" if seconds >= 1e-6 else "below 1 µs"


def _rest(screening: Screening) -> str:
    seconds = sum(stop - start for start, stop in screening.rest)
    return duration(seconds) if seconds else "never"
