"""`schuler characterize --method ...`: several ways to the noise of an IMU, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schuler.errors import EstimationError, InputError, SchulerError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.cli.outputs import Outputs
    from schuler.data.imu import ImuRecording
    from schuler.estimation.comparison.methods import ImuMethodComparison
    from schuler.noise import NoiseModel
    from schuler.screening.screen import Screening

MOST_FINDINGS = 24


@dataclass(frozen=True, slots=True)
class MethodFiles:
    """What is read and written.

    Parameters
    ----------
    file : Path
        Recording.
    report, json, noise_out, kalibr : Path or None
        As for `schuler characterize`.
    topic : str
        Name of the ROS topic in the Kalibr file.
    """

    file: Path
    report: Path | None
    json: Path | None
    noise_out: Path | None
    kalibr: Path | None
    topic: str


def chosen_methods(named: tuple[str, ...], *, needs_model: bool) -> tuple[str, ...]:
    """Check the methods that were asked for."""
    if not named or set(named) == {"allan"}:
        return ()
    from schuler.estimation.identify import METHODS, STRUCTURAL

    for method in named:
        if method not in METHODS and method != "all":
            raise InputError(f"method '{method}'", expected=f"all, {', '.join(METHODS)}")
    chosen = tuple(dict.fromkeys(METHODS if "all" in named else named))
    if needs_model and chosen[0] not in STRUCTURAL:
        raise InputError(
            f"a noise model by method '{chosen[0]}'",
            expected=f"one of {', '.join(STRUCTURAL)} named first",
        )
    return chosen


def compare_and_write(
    imu: ImuRecording,
    screening: Screening,
    methods: tuple[str, ...],
    files: MethodFiles,
    outputs: Outputs,
    *,
    strict: bool,
    model: str = "auto",
) -> int:
    """Put the methods to every channel, write what was asked for, show the rest."""
    from schuler.cli.console import Screen, say
    from schuler.cli.loading import title_of
    from schuler.cli.outputs import STDOUT, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.estimation.comparison.methods import compare_methods_imu
    from schuler.execution.progress import progress

    with progress("Finding the noise") as shown:

        def told(what: str, share: float) -> None:
            shown.say(what)
            shown.share(share)

        wanted = "shared" if model == "auto" else model
        comparison = compare_methods_imu(imu, methods, model=wanted, told=told)
    origin = command_provenance(
        inputs=(files.file,), settings={"methods": list(methods), "model": model}
    )
    if files.report is not None:
        from schuler.report import render_report

        title = f"Noise of {title_of(files.file)}, {len(methods)} methods"
        if len(methods) == 1:
            title = f"Noise of {title_of(files.file)} by {methods[0]}"
        page = render_report(comparison, screening, imu, title=title, provenance=origin)
        outputs.text(files.report, lambda: page)
    more = {"screening": screening.to_dict(), "provenance": origin.to_dict()}
    outputs.text(files.json, lambda: json_text(_to_dict(comparison, methods[0]) | more))
    refused = ""
    if files.noise_out is not None or files.kalibr is not None:
        try:
            found = noise_model_of(comparison, methods[0])
            outputs.text(files.noise_out, found.to_yaml)
            refused = add_kalibr(outputs, files.kalibr, found, imu.rate, files.topic)
        except SchulerError as error:
            refused = f"no noise model was written: {error}"
    written = outputs.commit()
    show_methods(Screen(json_on_stdout=files.json == STDOUT), comparison, written)
    if refused:
        say(refused)
        return 1
    watch = sum(f.severity != "info" for f in screening.findings)
    if strict and watch:
        say(f"check failed: {watch} finding{'' if watch == 1 else 's'} to watch")
        return 1
    return 0


def add_kalibr(
    outputs: Outputs, path: Path | None, model: NoiseModel, rate: float, topic: str
) -> str:
    """Hand a Kalibr file to the outputs, or return why there is none."""
    from schuler.io.kalibr import kalibr_yaml

    if path is None:
        return ""
    try:
        text = kalibr_yaml(model, rate=rate, topic=topic)
    except SchulerError as error:
        return f"{path.name} was not written: {error}"
    outputs.text(path, lambda: text)
    return ""


def _to_dict(comparison: ImuMethodComparison, first: str) -> dict[str, Any]:
    """Channels as the first method finds them, then everything."""
    from schuler.estimation.ieee952 import ieee952_to_dict

    return {
        "recording": comparison.recording_name,
        "rate_hz": comparison.rate,
        "duration_s": comparison.duration,
        "method": first,
        "channels": {
            name: c.results[first].to_dict() if first in c.results else None
            for name, c in comparison.channels.items()
        },
        "ieee952": {
            name: ieee952_to_dict(c.results[first].ieee952)
            for name, c in comparison.channels.items()
            if first in c.results
        },
        "findings": list(comparison.findings),
        "methods": comparison.to_dict()["channels"],
    }


def noise_model_of(comparison: ImuMethodComparison, method: str) -> NoiseModel:
    """Return the noise model that one method found."""
    from schuler.estimation.identify import METHODS
    from schuler.noise import NoiseModel

    processes, errors, limits = {}, {}, {}
    for name, c in comparison.channels.items():
        found = c.results.get(method)
        if found is None or found.process is None:
            raise EstimationError(
                c.failures.get(method, f"method '{method}' gave no process"),
                where=f"{comparison.recording_name}, {name}",
            )
        processes[name] = found.process
        errors[name] = found.standard_errors
        limits[name] = found.limits
    return NoiseModel(
        processes=processes,
        standard_errors=errors,
        rate=comparison.rate,
        source=f"{METHODS[method]} on {comparison.recording_name}",
        limits=limits,
    )


def show_methods(
    screen: Screen, comparison: ImuMethodComparison, written: tuple[Path, ...] = ()
) -> None:
    """Print the parameters by method and what to think of them."""
    from schuler.report.numbers import duration
    from schuler.report.sections.estimators import predictor_rows
    from schuler.report.sections.methods import parameter_table, residual_words

    screen.heading(
        f"Noise of {comparison.recording_name} by {', '.join(comparison.methods)}",
        f"{duration(comparison.duration)} at {comparison.rate:.6g} Hz",
    )
    table = parameter_table(comparison.channels)
    if table.rows:
        screen.table(table.columns, table.rows, words=3)
    predictors = predictor_rows(comparison.channels)
    if predictors:
        screen.table(("channel", "method", "model", "what is left"), predictors, words=4)
    else:
        screen.table(
            ("channel", "method", "what is left"), residual_words(comparison.channels), words=3
        )
    findings = comparison.findings
    for text in findings[:MOST_FINDINGS]:
        screen.finding("warning" if "methods differ" in text else "info", text)
    if len(findings) > MOST_FINDINGS:
        screen.line(f"... and {len(findings) - MOST_FINDINGS} more (see the report)", "dim")
    for path in written:
        screen.line(f"wrote {path}", "dim")
