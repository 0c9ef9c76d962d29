"""`schuler evaluate`: any trajectory judged by a reference."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cyclopts import Parameter

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import reading_file
from schuler.cli.options.files import Written
from schuler.cli.options.outages import parse_windows
from schuler.cli.options.reading import TrackReading
from schuler.cli.parsing import parse_numbers, title_of
from schuler.errors import SchulerError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.track import Track
    from schuler.data.trajectory import NavigationSolution
    from schuler.evaluation.accuracy import TrajectoryEvaluation


@Parameter(name="*")
@dataclass(frozen=True)
class Reference:
    """How the reference relates to the trajectory.

    Parameters
    ----------
    truth_offset : float
        Seconds to add to the time of the reference.
    truth_lever_arm : str
        X,Y,Z in m, in body axes, from the point of the trajectory to that of the reference, such
        as its antenna.
    align : {"auto", "none", "shift", "turn"}
        Best fit that is taken out first: none, a shift, or a rotation and a shift; auto turns
        only what is in local axes, and refuses what does not fit.
    """

    truth_offset: float = 0.0
    truth_lever_arm: str = "0,0,0"
    align: Literal["auto", "none", "shift", "turn"] = "auto"

    def keywords(self) -> dict[str, Any]:
        """Return them as `evaluate_trajectory` wants them."""
        text = "--truth-lever-arm X,Y,Z in m, such as 0,-0.05,0"
        return {
            "time_offset": self.truth_offset,
            "lever_arm": parse_numbers(self.truth_lever_arm, 3, text),
            "align": self.align,
        }


def evaluate(
    trajectory: Path,
    /,
    *,
    truth: Path,
    window: tuple[str, ...] = (),
    reference: Reference = Reference(),
    reading: TrackReading = TrackReading(),
    written: Written = Written(),
) -> int:
    """Judge the trajectory of any program by a reference.

    Absolute (ATE) and relative (RPE) errors, errors by axis and in windows, and whether the
    deviations that it claims are honest.

    Example: `schuler evaluate odometry.tum --truth reference.pos --report errors.html`

    Parameters
    ----------
    trajectory : Path
        What is judged: of `schuler navigate --out`, TUM, EuRoC, SBET, .pos, KF-GINS, NMEA, CSV.
    truth : Path
        The reference, in any of these forms.
    reading : TrackReading, optional
        How to read the trajectory, where it is text.
    window : tuple of str
        START:SECONDS, with START in seconds after the first common moment. May be repeated.
    """
    from schuler.io.tracks import read_track

    job = Job(written, inputs=(trajectory, truth))
    with reading_file(trajectory.name, "one"):
        track = read_track(trajectory, **reading.positions())
    with working("Evaluating"):
        found = judged(track, truth, reference, parse_windows(window))
    title = f"{title_of(trajectory)} against {title_of(truth)}"
    return job.finish(
        Result(
            title=title,
            sections=(found,),
            show=lambda screen: show_evaluation(screen, found),
            json=found.to_dict,
            settings=reference.keywords(),
        )
    )


def judged(
    answer: Track | NavigationSolution,
    truth: Path,
    reference: Reference,
    windows: tuple[tuple[float, float], ...] = (),
) -> TrajectoryEvaluation:
    """Return the errors of an answer against the reference in a file."""
    from schuler.evaluation.accuracy import evaluate_trajectory
    from schuler.io.tracks import read_track

    with reading_file(truth.name, "one"):
        better = read_track(truth)
    try:
        return evaluate_trajectory(answer, better, windows=windows, **reference.keywords())
    except SchulerError as error:
        cure = error.cure.replace("time_offset=", "--truth-offset")
        raise type(error)(error.found, expected=error.expected, cure=cure) from None


def show_evaluation(screen: Screen, found: TrajectoryEvaluation) -> None:
    """Print how far off the trajectory is, and whether it knew."""
    from schuler.report.sections.navigation.accuracy import (
        answer,
        claims_judged,
        error_table,
        relative_table,
        window_table,
    )

    screen.heading(f"Errors of {found.name} against the reference", f"{found.samples} moments")
    for _, columns, rows in (error_table(found), relative_table(found), window_table(found)):
        if rows:
            screen.table(columns, rows)
    for sentence in answer(found):
        screen.line(sentence)
    screen.findings(("warning", text) for text in claims_judged(found))
    screen.findings(("info", note) for note in found.notes)
