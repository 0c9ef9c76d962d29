"""`schuler characterize --method ...`: several ways to the noise of an IMU, side by side."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from schuler.cli.job import Result, working
from schuler.errors import EstimationError, InputError, SchulerError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.cli.options.files import ModelFiles, Texts
    from schuler.data.imu import ImuRecording
    from schuler.estimation.comparison.methods import ImuMethodComparison
    from schuler.noise import NoiseModel
    from schuler.screening.screen import Screening

MOST_FINDINGS = 24


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


def methods_result(
    imu: ImuRecording,
    screening: Screening,
    methods: tuple[str, ...],
    files: ModelFiles,
    title: str,
    failed: tuple[str, ...],
    *,
    model: str = "auto",
) -> Result:
    """Put the methods to every channel."""
    from schuler.estimation.comparison.methods import compare_methods_imu

    with working("Finding the noise") as shown:
        wanted = "shared" if model == "auto" else model
        comparison = compare_methods_imu(imu, methods, model=wanted, told=shown.tell)
    first, many = methods[0], len(methods) > 1
    texts: Texts = ()
    refused: tuple[str, ...] = ()
    if files.wanted:
        try:
            texts, refused = files.texts(noise_model_of(comparison, first), imu.rate)
        except SchulerError as error:
            refused = (f"no noise model was written: {error}",)
    return Result(
        title=f"{title}, {len(methods)} methods" if many else f"{title} by {first}",
        sections=(comparison, screening, imu),
        show=lambda screen: show_methods(screen, comparison),
        json=lambda: _to_dict(comparison, first) | {"screening": screening.to_dict()},
        settings={"methods": list(methods), "model": model},
        texts=texts,
        with_origin=True,
        failed=failed,
        refused=refused,
    )


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


def show_methods(screen: Screen, comparison: ImuMethodComparison) -> None:
    """Print the parameters by method and what to think of them."""
    from schuler.report.numbers import duration
    from schuler.report.sections.noise.estimators import predictor_rows
    from schuler.report.sections.noise.methods import parameter_table, residual_words

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
    found = (("warning" if "methods differ" in f else "info", f) for f in comparison.findings)
    screen.findings(found, most=MOST_FINDINGS)
