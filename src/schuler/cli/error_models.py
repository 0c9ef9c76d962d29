"""`schuler outages --models ...`: several error models through the same outages."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from schuler.cli.job import Result, working
from schuler.cli.options.error_models import built
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.cli.options.error_models import ModelOptions
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.evaluation.error_model_comparison import ErrorModelComparison
    from schuler.noise.noise_model import NoiseModel

MOST_ROWS = 12


def compare(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise: NoiseModel | None,
    options: ModelOptions,
    keywords: dict[str, Any],
) -> ErrorModelComparison:
    """Run the models that were asked for."""
    from schuler.evaluation.error_model_comparison import compare_error_models

    if "measurements" in keywords:
        raise InputError(
            "--models with --update, --adaptive, --gnss-correlated or other sensors",
            expected="error models side by side with the gate and the receiver's own deviations",
        )
    if keywords.pop("tune_noise", None):
        raise InputError(
            "--tune-noise with --models", expected="one of them: tuning would change every model"
        )
    with working("Error models") as shown:
        shown.say("finding their parameters")
        models, base = built(options.names, noise, options.static, options.denoising, imu.rate)
        return compare_error_models(
            imu, gnss, models, base=base, smooth=True, progress=shown.say, **keywords
        )


def comparison_result(
    comparison: ErrorModelComparison, title: str, settings: dict[str, Any], failed: tuple[str, ...]
) -> Result:
    """Return what becomes of a comparison; the JSON begins as that of the first model alone."""
    first = comparison.results[0]
    return Result(
        title=title,
        sections=(comparison,),
        show=lambda screen: show_comparison(screen, comparison),
        json=lambda: {
            "model": first.model.name,
            "causal": first.causal[0].to_dict(),
            "smoothed": first.smoothed[0].to_dict(),
            "comparison": comparison.to_dict(),
        },
        settings=settings,
        with_origin=True,
        failed=failed,
    )


def show_comparison(screen: Screen, comparison: ErrorModelComparison) -> None:
    """Print the models side by side."""
    from schuler.report.numbers import number, percent

    count = len(comparison.results[0].causal[0].windows)
    screen.heading("Error models", f"{count} outages, causal horizontal error in m")
    rows = []
    for r in comparison.results:
        s = r.all_causal
        numbers = (s.mean_of_max_m, s.mean_m, s.worst_m, s.claimed_over_real)
        floor = "" if s.floor_m is None else number(s.floor_m)
        cells = (*map(number, numbers), percent(s.within_2_sigma), floor)
        rows.append((r.model.name, str(r.model.states), *cells))
    columns = ("error model", "states", "mean of maxima", "mean", "worst", "claimed/real")
    screen.table((*columns, "inside 2 sigma", "floor"), rows)
    first, *others = comparison.names
    pairs = []
    for other in others:
        p = comparison.paired(first, other)
        pairs.append(
            (
                f"{first} against {other}",
                number(p.difference),
                number(p.standard_error),
                f"{p.wins} of {p.cases}",
                number(p.wilcoxon_p, 2),
                percent(p.mean_of_ratios),
                percent(p.ratio_of_sums),
            )
        )
    if pairs:
        headings = ("largest error", "difference", "its error", "better", "Wilcoxon p")
        screen.table((*headings, "gain (ratios)", "gain (sums)"), pairs[:MOST_ROWS])
        screen.line("gain: mean of 1 - a/b over the outages, and 1 - sum(a)/sum(b)", "dim")
    notes = sorted({n for r in comparison.results for n in r.model.notes})
    screen.findings(("info", note) for note in notes)
