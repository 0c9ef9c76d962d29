"""`schuler characterize`: a static log in, a noise model with errors out."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import reduce
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import Parameter

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_imu, load_imu_pieces, tell_assumptions
from schuler.cli.options.files import ModelFiles, Written
from schuler.cli.options.reading import ImuReading
from schuler.cli.parsing import title_of
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.imu import ImuRecording
    from schuler.estimation.characterization import ImuCharacterization
    from schuler.screening.screen import Screening

MOST_FINDINGS = 8
SUMS = ".sums.npz"
SHORTEST = 5.0
_HANDLED = 5.0
"""Seconds beyond which a disturbance is no knock but motion."""
"""Seconds below which nothing is said about motion."""
NARROW = 110
"""Columns below which errors are written in brackets."""


@Parameter(name="*")
@dataclass(frozen=True)
class Piecewise:
    """Records larger than memory.

    Parameters
    ----------
    memory : float, optional
        Megabytes for the recording; a larger one (a file, or a folder of files that follow each
        other) is read in pieces, once. A third of this machine's if not given.
    sums_out : Path, optional
        Read in pieces and keep the sums here, such as monday.sums.npz: `schuler characterize` of
        a folder of such files is that of the whole week.
    """

    memory: float | None = None
    sums_out: Path | None = None


def characterize(
    file: Path,
    /,
    *,
    written: Written = Written(),
    files: ModelFiles = ModelFiles(),
    repair: bool = False,
    strict: bool = False,
    method: tuple[str, ...] = (),
    model: str = "auto",
    rest: bool = False,
    pieces: Piecewise = Piecewise(),
    calibration: Path | None = None,
    reading: ImuReading = ImuReading(),
) -> int:
    """Find the noise model of an IMU from a log of it lying still.

    Reads the log, screens it, computes the Allan deviation with its confidence, fits white
    noise, Gauss-Markov, random walk and what else the data support, and says how far the
    numbers can be trusted.

    Example: `schuler characterize static.csv --noise-out noise.yaml --report noise.html`

    Parameters
    ----------
    file : Path
        Static log: CSV, text, Parquet, NPZ, ROS 1 or ROS 2 bag, or a folder with imu.* in it, or
        what --sums-out wrote (or a folder of that).
    repair : bool
        Repair what the screening finds (knocks, outliers, repeated rows) before fitting.
    strict : bool
        Exit with code 1 when the screening finds something to watch that was not repaired.
    method : tuple of str
        How to find the noise: allan (the usual one), slope, psd, autocorrelation, gmwm,
        gmwm-robust, ml, ar, ar-covariance, ar-yule-walker, arma, fos, garch, or all. Given more
        than once, the methods are compared; noise model and Kalibr file come from the first.
    model : str
        Which processes to fit: auto (chosen by the data), classical (W+B+K), or letters such as
        W+G+K: W white noise, Q quantisation, B bias instability, G Gauss-Markov (up to three),
        K random walk, R ramp.
    rest : bool
        Use only the longest rest of a log in which the sensor was moved.
    calibration : Path, optional
        Calibration of the IMU as YAML, from `schuler calibrate`.
    """
    from schuler.cli.methods import chosen_methods, methods_result
    from schuler.estimation.parts import checked_model

    outputs = (files.noise_out, files.kalibr, pieces.sums_out)
    job = Job(written, *outputs, inputs=(file, calibration))
    methods = chosen_methods(method, needs_model=files.wanted)
    model = str(checked_model(model))
    if kept_sums(file) or pieces.sums_out is not None or too_large(file, pieces.memory):
        if methods not in ((), ("gmwm",), ("psd",)) or rest or repair or calibration is not None:
            raise InputError(
                f"{file.name} is read in pieces",
                expected="--method allan, gmwm or psd, without --rest, --repair or --calibration",
                cure="--memory MEGABYTES allows more, or take a part of it",
            )
        how = (model, methods[0] if methods else "allan")
        return job.finish(_in_pieces(file, files, how, reading, pieces.sums_out))
    recording = load_imu(file, reading.options(repair=repair), calibration=calibration)
    with working("Screening"):
        recording, screening = screened(recording, repair=repair, rest=rest)
    watch = sum(f.severity != "info" for f in screening.findings) if strict and not repair else 0
    failed = (f"{watch} finding{'' if watch == 1 else 's'} to watch",) if watch else ()
    title = f"Noise of {title_of(file)}"
    if methods:
        return job.finish(
            methods_result(recording, screening, methods, files, title, failed, model=model)
        )
    with working("Fitting the noise of every channel"):
        from schuler.estimation.characterization import characterize_imu

        found = characterize_imu(recording, model)
    result = characterization_result(found, screening, recording, files, repaired=repair)
    settings = {"repair": repair, "model": model}
    return job.finish(replace(result, title=title, failed=failed, settings=settings))


def characterization_result(
    found: ImuCharacterization,
    screening: Screening,
    recording: ImuRecording,
    files: ModelFiles,
    *,
    repaired: bool,
) -> Result:
    """Return what becomes of the noise of a recording."""
    texts, refused = files.texts(found.noise_model, recording.rate)
    return Result(
        sections=(found, screening, recording),
        show=lambda screen: show_characterization(screen, found, screening, repaired=repaired),
        json=lambda: found.to_dict() | {"screening": screening.to_dict()},
        settings={"repair": repaired},
        texts=texts,
        with_origin=True,
        refused=refused,
    )


def too_large(file: Path, memory: float | None) -> bool:
    """Whether a recording has to be read in pieces."""
    from schuler.io.pieces import is_partitioned, size_of_table

    if is_partitioned(file):
        return True
    size = size_of_table(file)
    if memory is None:
        known = hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names
        most = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 3.0 if known else 4e9
    else:
        most = 1e6 * memory
    return size > 0 and 3.0 * size > most  # columns, recording and work beside it


def kept_sums(file: Path) -> list[Path]:
    """Return the files of sums that are meant."""
    if file.is_dir():
        return sorted(file.glob(f"*{SUMS}"))
    return [file] if file.name.endswith(SUMS) else []


def _in_pieces(
    file: Path, files: ModelFiles, how: tuple[str, str], reading: ImuReading, out: Path | None
) -> Result:
    from schuler.estimation.long_record import RecordSums, characterize_sums, collect_sums
    from schuler.estimation.record import spell_duration

    with working("Reading the record in pieces") as shown:

        def told() -> Iterator[ImuRecording]:
            for piece in load_imu_pieces(file, reading.options(repair=False)):
                shown.say(f"{spell_duration(float(piece.time[-1]))} read")
                yield piece

        kept = kept_sums(file)
        sums = reduce(add, (RecordSums.load(k) for k in kept)) if kept else collect_sums(told())
        tell_assumptions(file.name, sums.sample.assumptions, "one")
        if out is not None:
            sums.save(out)
        shown.say("fitting")
        model, method = how
        found = characterize_sums(sums, model, title_of(file), method)
    texts, refused = files.texts(found.noise_model, found.rate)
    return Result(
        title=f"Noise of {title_of(file)}" + ("" if method == "allan" else f" by {method}"),
        sections=(found,),
        show=lambda screen: _show_noise(screen, found),
        json=found.to_dict,
        settings={"model": model, "method": method, "pieces": True},
        texts=texts,
        with_origin=True,
        refused=refused,
    )


def screened(
    imu: ImuRecording, *, repair: bool, rest: bool = False
) -> tuple[ImuRecording, Screening]:
    """Return a recording that can be used, repaired when asked, and what is to be said of it."""
    from schuler.screening.screen import longest_rest, repair_until_clean, screen

    screening = screen(imu)
    screening.require_usable()
    if rest:
        imu = longest_rest(imu, screening)
        screening = screen(imu)
    return (repair_until_clean(imu, screening) if repair else imu), screening


def _moved(screening: Screening) -> str:
    """Say that a log is not one of a sensor at rest, and where it is."""
    total = sum(stop - start for start, stop in screening.rest)
    text = f"the sensor moved: it stood still for {total:.0f} of {screening.duration:.0f} s"
    if not screening.rest:
        return f"{text}; what follows holds motion, not noise alone"
    start, stop = max(screening.rest, key=lambda r: r[1] - r[0])
    return (
        f"{text}, the longest from {start:.1f} to {stop:.1f} s; what follows holds motion, not "
        "noise alone: --rest takes only the longest rest"
    )


def _handled(screening: Screening) -> str:
    """Say that a log of a sensor at rest holds a time in which it was moved about."""
    knocks = [i for f in screening.of_kind("knock") for i in f.intervals]
    start, stop = max(knocks, key=lambda i: i[1] - i[0], default=(0.0, 0.0))
    if stop - start < _HANDLED:
        return ""
    return (
        f"the sensor was moved from {start:.1f} to {stop:.1f} s; what follows holds that motion: "
        "--repair cuts it out"
    )


def show_characterization(
    screen: Screen, result: ImuCharacterization, screening: Screening, *, repaired: bool
) -> None:
    """Print the noise model and what to think of it."""
    moved = not screening.static and screening.duration > SHORTEST
    changed = "; ".join(f.message for f in screening.of_kind("noise level"))
    warning = _moved(screening) if moved else _handled(screening) or changed
    _show_noise(screen, result, "" if repaired and not moved else warning)
    serious = [
        (f.severity, f.message)
        for f in screening.findings
        if f.severity != "info" and (f.kind != "noise level" or warning != changed)
    ]
    screen.findings(serious, most=MOST_FINDINGS)
    if screening.disturbed and not repaired:
        screen.line("--repair cuts out knocks and outliers before the fit.", "dim")


def _show_noise(screen: Screen, result: ImuCharacterization, warning: str = "") -> None:
    from schuler.report.sections.noise.ieee952 import ieee952_rows, plateau_note
    from schuler.report.sections.noise.parameters import parameter_rows

    screen.heading(f"Noise of {result.recording_name}")
    if warning:
        screen.finding("warning", warning)
    narrow = screen.console.width < NARROW
    columns, rows = parameter_rows(result.noise_model, "datasheet", short=True, compact=narrow)
    screen.table(columns, rows, words=2)
    coefficients = {c: one.ieee952 for c, one in result.channels.items()}
    columns, rows = ieee952_rows(coefficients, "datasheet", compact=narrow)
    screen.table(columns, rows, words=2)
    if note := plateau_note(coefficients):
        screen.line(note, "dim")
    screen.findings(("info", text) for text in result.findings)
