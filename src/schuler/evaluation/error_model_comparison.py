"""Which error model carries a vehicle through an outage: the same windows for all, in pairs.

Everything but the sensor error model is found once, with GNSS of the windows withheld, and held
the same for all: time offsets, alignment, mounting, receiver. Spec 7.3, 7.9, 8.4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, Unpack

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.evaluation.outage_windows import (
    OutageStatistics,
    OutageWindow,
    Window,
    asked_windows,
    deal_windows,
    in_order,
    judge_run,
)
from schuler.evaluation.paired import PERCENTAGES, PairedStatistics, paired_statistics
from schuler.navigation.error_models.catalogue import ErrorModel
from schuler.navigation.navigate import withhold
from schuler.navigation.preparation.prepare import PreparedDrive, prepare_drive
from schuler.navigation.run import run_error_model
from schuler.navigation.settings import NavigationOptions, navigation_settings
from schuler.navigation.threads import in_threads
from schuler.noise.noise_model import NoiseModel
from schuler.types import FloatArray

Metric = Literal["max_m", "mean_m", "rms_m", "end_m"]
METRICS: dict[Metric, str] = {
    "max_m": "largest error",
    "mean_m": "mean error",
    "rms_m": "rms error",
    "end_m": "error at the end",
}


@dataclass(frozen=True, slots=True, eq=False)
class ModelOutages:
    """One error model through all windows of all repetitions."""

    model: ErrorModel  # what the filter was told
    # one for every repetition: a drive, or a draw of the noise
    causal: tuple[OutageStatistics, ...]
    # the same of the smoother; empty if it was not run.
    smoothed: tuple[OutageStatistics, ...] = ()
    # normalised innovations squared over their degrees of freedom, by repetition
    nis: tuple[float, ...] = ()

    @property
    def all_causal(self) -> OutageStatistics:
        """Every window of every repetition."""
        return OutageStatistics(tuple(w for s in self.causal for w in s.windows))

    def values(self, metric: Metric = "max_m") -> FloatArray:
        """Return a figure of every causal window."""
        return np.array([[getattr(w, metric) for w in s.windows] for s in self.causal])


@dataclass(frozen=True, slots=True, eq=False)
class ErrorModelComparison(Exportable):
    """Error models on the same windows.

    Parameters
    ----------
    results : tuple of ModelOutages
        In the order asked for.
    sweep : bool
        Whether the windows were laid out systematically.
    tracks : tuple of dict of str to ndarray
        For every window of the first repetition: "time" (k,) in s, "reference" (k, 2) and one
        (k, 2) by model name, east and north in m from where the window begins.
    settings : dict
        What all models share.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, simulate_drive
    >>> from schuler import compare_error_models, error_models
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> models = error_models(("own",), noise_model=model)
    >>> found = compare_error_models(imu, gnss, models, base=model, windows=((60.0, 10.0),))
    >>> len(found.results)
    1
    """

    results: tuple[ModelOutages, ...]
    sweep: bool = False
    tracks: tuple[dict[str, FloatArray], ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the models."""
        return tuple(r.model.name for r in self.results)

    def __getitem__(self, name: str) -> ModelOutages:
        """Return the result of one model."""
        for result in self.results:
            if result.model.name == name:
                return result
        raise InputError(f"error model '{name}'", expected=", ".join(self.names))

    def paired(
        self,
        a: str,
        b: str,
        metric: Metric = "max_m",
        windows: Sequence[int] | None = None,
    ) -> PairedStatistics:
        """Compare two models.

        Parameters
        ----------
        a, b : str
            Out of `names`.
        metric : {"max_m", "mean_m", "rms_m", "end_m"}
            Which figure of a window.
        windows : sequence of int, optional
            Only these, by number; default all.

        Returns
        -------
        PairedStatistics
            Cases are the repetitions, each by its mean over the windows, as windows of one draw
            share it; with a single repetition the windows.
        """
        one, two = (self[n].values(metric) for n in (a, b))
        if windows is not None:
            one, two = one[:, list(windows)], two[:, list(windows)]
        if one.shape[0] > 1:
            return paired_statistics(one.mean(axis=1), two.mean(axis=1))
        return paired_statistics(one[0], two[0])

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON.

        Returns
        -------
        dict
            "models": by name figures and, with one repetition, windows; "pairs": every model
            against every later one; "percentages": what they mean; "settings".
        """
        models = {}
        for r in self.results:
            entry = r.model.to_dict() | {"causal": r.all_causal.to_dict(), "nis": list(r.nis)}
            if r.smoothed:
                every = tuple(w for s in r.smoothed for w in s.windows)
                entry["smoothed"] = OutageStatistics(every).to_dict()
            models[r.model.name] = entry
        pairs = [
            {"a": a, "b": b, "metric": metric} | self.paired(a, b, metric).to_dict()
            for metric in METRICS
            for i, a in enumerate(self.names)
            for b in self.names[i + 1 :]
        ]
        return {
            "models": models,
            "pairs": pairs,
            "percentages": PERCENTAGES,
            "sweep": self.sweep,
            "repetitions": len(self.results[0].causal),
            "settings": self.settings,
        }


def compare_error_models(
    imu: ImuRecording,
    gnss: GnssRecording,
    models: Sequence[ErrorModel],
    *,
    base: NoiseModel,
    windows: Sequence[Window] = (),
    sweep: Window | None = None,
    smooth: bool = False,
    progress: Callable[[str], None] | None = None,
    **options: Unpack[NavigationOptions],
) -> ErrorModelComparison:
    """Run every error model through the same outages of a drive.

    Parameters
    ----------
    imu, gnss
        As for `navigate`.
    models : sequence of ErrorModel
        From `error_model`, with different names.
    base : NoiseModel
        With which time offsets, alignment and mounting are found, once for all models.
    windows, sweep
        As for `evaluate_outages`.
    smooth : bool
        Judge the smoothed solutions as well.
    progress, **options
        As for `navigate`, but for `tune_noise`: every model is taken as it is.

    Returns
    -------
    ErrorModelComparison
        With one repetition.

    Raises
    ------
    InputError
        No windows or models, the same name twice, or inputs that cannot be used.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, simulate_drive
    >>> from schuler import compare_error_models, error_models
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> models = error_models(("own",), noise_model=model)
    >>> found = compare_error_models(imu, gnss, models, base=model, windows=((60.0, 10.0),))
    >>> len(found.results)
    1
    """
    check_models(models)
    settings = navigation_settings(compare_error_models, options, tune_noise=False)
    groups = deal_windows(asked_windows(windows, sweep, gnss, imu))
    measured = {m.name: m.measured(imu) for m in models}

    def one(number: int) -> _ComparedRun:
        label = f"run {number + 1} of {len(groups)}"
        if progress is not None:
            progress(f"preparing {label}")
        used = withhold(gnss, groups[number])
        prepared = prepare_drive(imu, used, base, settings, progress)
        found = _ComparedRun(prepared.setup.to_dict(), [{} for _ in groups[number]])
        for model in models:
            if progress is not None:
                progress(f"{label}: {model.name}")
            found.add(model, measured[model.name], prepared, gnss, groups[number], smooth)
        return found

    runs = in_threads(one, range(len(groups)))
    tracks = [
        (window[0], track)
        for group, found in zip(groups, runs, strict=True)
        for window, track in zip(group, found.tracks, strict=True)
    ]

    def windows_of(model: ErrorModel, smoothed: bool) -> OutageStatistics:
        return in_order(w for r in runs for w in r.windows[model.name, smoothed])

    return ErrorModelComparison(
        results=tuple(
            ModelOutages(
                model,
                (windows_of(model, False),),
                (windows_of(model, True),) if smooth else (),
                (float(np.mean([r.nis[model.name] for r in runs])),),
            )
            for model in models
        ),
        sweep=sweep is not None,
        tracks=tuple(t for _, t in sorted(tracks, key=lambda pair: pair[0])),
        settings=runs[0].settings,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _ComparedRun:
    """All models on one drive with some windows withheld."""

    settings: dict[str, Any]
    tracks: list[dict[str, FloatArray]]
    windows: dict[tuple[str, bool], tuple[OutageWindow, ...]] = field(default_factory=dict)
    nis: dict[str, float] = field(default_factory=dict)

    def add(
        self,
        model: ErrorModel,
        imu: ImuRecording,
        prepared: PreparedDrive,
        gnss: GnssRecording,
        group: tuple[Window, ...],
        smooth: bool,
    ) -> None:
        """Run the filter with one error model, and judge it."""
        setup = prepared.setup
        done = run_error_model(
            model, imu, prepared.imu, withhold(gnss, group), setup, smooth=smooth
        )
        self.nis[model.name] = done.causal.innovations.gnss.mean_nis
        self.windows[model.name, False] = judge_run(done.causal, gnss, done.setup, group)
        if done.smoothed is not None:
            self.windows[model.name, True] = judge_run(done.smoothed, gnss, done.setup, group)
        for track, window in zip(self.tracks, self.windows[model.name, False], strict=True):
            add_track(track, model.name, window, gnss)


def check_models(models: Sequence[ErrorModel]) -> None:
    """Refuse an empty list and names that are given twice."""
    names = [m.name for m in models]
    if not names or len(set(names)) != len(names):
        raise InputError(
            f"error models {', '.join(names) or 'none'}", expected="at least one, each once"
        )


def add_track(
    track: dict[str, FloatArray], name: str, window: OutageWindow, gnss: GnssRecording
) -> None:
    """Add a model's path through a window to what Figures 21 to 25 of S004 show."""
    from schuler.earth import ned_from_geodetic

    if "reference" not in track:
        first = int(np.searchsorted(gnss.time - gnss.time[0], window.time[0] - 1e-6))
        part = gnss.position[first : first + window.time.size]
        track["reference"] = ned_from_geodetic(part, part[0])[:, 1::-1]
        track["time"] = window.time - window.start_s
    track[name] = track["reference"] + window.error_ned[:, 1::-1]


def group_by_model(
    models: Sequence[ErrorModel], draws: Sequence[Mapping[str, tuple[OutageStatistics, float]]]
) -> tuple[ModelOutages, ...]:
    """Put repetitions together model by model."""
    return tuple(
        ModelOutages(m, tuple(d[m.name][0] for d in draws), (), tuple(d[m.name][1] for d in draws))
        for m in models
    )
