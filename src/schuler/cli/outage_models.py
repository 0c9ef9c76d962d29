"""`schuler outages --models ...`: several error models through the same outages."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.evaluation.error_model_comparison import ErrorModelComparison
    from schuler.noise.noise_model import NoiseModel

MOST_ROWS = 12


@dataclass(frozen=True)
class ModelOptions:
    """Which error models to compare.

    Parameters
    ----------
    models : str, optional
        Error models with commas between, each through the same outages: 15AV, 18AV, 18AVWD, 15AR,
        27AR (Quinchia et al. 2013), flicker4, own; with +corrected, +turn-on, +scale,
        +misalignment, +averaged, +garch behind them.
    static : Path, optional
        The same sensor at rest, at the rate of the drive: gives the noise where no --noise is
        given, and what AR models are fitted to.
    denoising : str
        For 18AVWD: off-line, which looks ahead, or causal, which answers late.
    """

    models: str | None = None
    static: Path | None = None
    denoising: Literal["off-line", "causal"] = "off-line"

    @property
    def names(self) -> tuple[str, ...]:
        """The models asked for."""
        from schuler.navigation.error_models.catalogue import split_model_name

        if self.models is None:
            if self.static is not None:
                raise InputError("--static without --models", expected="both")
            return ()
        names = tuple(n.strip() for n in self.models.split(",") if n.strip())
        whole = ["+".join((base, *more)) for base, more in map(split_model_name, names)]
        if not whole or len(set(whole)) != len(whole):
            raise InputError(f"--models {self.models}", expected="names, each once")
        return tuple(whole)


def compare(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise: NoiseModel | None,
    options: ModelOptions,
    keywords: dict[str, Any],
) -> ErrorModelComparison:
    """Run the models that were asked for."""
    from schuler.cli.loading import load_imu
    from schuler.evaluation.error_model_comparison import compare_error_models
    from schuler.execution.progress import progress
    from schuler.navigation.error_models.allan_readings import readings_of_static
    from schuler.navigation.error_models.sources import error_models
    from schuler.screening.screen import screen

    if "measurements" in keywords:
        raise InputError(
            "--models with --update, --adaptive, --gnss-correlated or other sensors",
            expected="error models side by side with the gate and the receiver's own deviations",
        )
    if keywords.pop("tune_noise", None):
        raise InputError(
            "--tune-noise with --models", expected="one of them: tuning would change every model"
        )
    static = None
    if options.static is not None:
        static = load_imu(options.static, {})
        screen(static).require_usable()
    with progress("Error models") as shown:
        shown.say("finding their parameters")
        models = error_models(
            options.names,
            noise_model=noise,
            static=static,
            rate=imu.rate,
            denoising=options.denoising,
        )
        base = noise
        if base is None:
            assert static is not None
            base = readings_of_static(static)[0]
        return compare_error_models(
            imu, gnss, models, base=base, smooth=True, progress=shown.say, **keywords
        )


def comparison_json(comparison: ErrorModelComparison) -> dict[str, Any]:
    """Return plain values: what `outages` always writes, of the first model, and the comparison."""
    first = comparison.results[0]
    return {
        "model": first.model.name,
        "causal": first.causal[0].to_dict(),
        "smoothed": first.smoothed[0].to_dict(),
        "comparison": comparison.to_dict(),
    }


def show_comparison(
    screen: Screen, comparison: ErrorModelComparison, written: tuple[Path, ...] = ()
) -> None:
    """Print the models side by side."""
    from schuler.report.numbers import number, percent

    count = len(comparison.results[0].causal[0].windows)
    screen.heading("Error models", f"{count} outages, causal horizontal error in m")
    rows = []
    for r in comparison.results:
        s = r.all_causal
        rows.append(
            (
                r.model.name,
                str(r.model.states),
                number(s.mean_of_max_m),
                number(s.mean_m),
                number(s.worst_m),
                number(s.claimed_over_real),
                percent(s.within_2_sigma),
                number(s.floor_m) if s.floor_m is not None else "",
            )
        )
    screen.table(
        (
            "error model",
            "states",
            "mean of maxima",
            "mean",
            "worst",
            "claimed/real",
            "inside 2 sigma",
            "floor",
        ),
        rows,
    )
    names = comparison.names
    pairs = []
    for other in names[1:]:
        p = comparison.paired(names[0], other)
        pairs.append(
            (
                f"{names[0]} against {other}",
                number(p.difference),
                number(p.standard_error),
                f"{p.wins} of {p.cases}",
                number(p.wilcoxon_p, 2),
                percent(p.mean_of_ratios),
                percent(p.ratio_of_sums),
            )
        )
    if pairs:
        screen.table(
            (
                "largest error",
                "difference",
                "its error",
                "better",
                "Wilcoxon p",
                "gain (ratios)",
                "gain (sums)",
            ),
            pairs[:MOST_ROWS],
        )
        screen.line("gain: mean of 1 - a/b over the outages, and 1 - sum(a)/sum(b)", "dim")
    for note in sorted({n for r in comparison.results for n in r.model.notes}):
        screen.finding("info", note)
    for path in written:
        screen.line(f"wrote {path}", "dim")
