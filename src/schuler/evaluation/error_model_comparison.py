"""Which error model carries a vehicle through an outage: the same windows for all, in pairs.

Everything but the sensor error model is found once, with GNSS of the windows withheld, and held
the same for all: time offsets, alignment, mounting, receiver. Spec 7.3, 7.9, 8.4.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError
from schuler.evaluation.outages import (
    OutageStatistics,
    OutageWindow,
    Window,
    check_windows,
    deal_windows,
    judge_window,
    sweep_windows,
)
from schuler.evaluation.paired import PERCENTAGES, PairedStatistics, paired_statistics
from schuler.navigation.aiding.vehicle import with_vehicle_states
from schuler.navigation.error_models.catalogue import ErrorModel
from schuler.navigation.error_models.generic_noise import TURN_ON_ACCEL, TURN_ON_GYRO
from schuler.navigation.navigate import withhold
from schuler.navigation.preparation.prepare import prepare
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.run import FALSE_ALARM, run
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
    """One error model through all windows of all repetitions.

    Parameters
    ----------
    model : ErrorModel
        What the filter was told.
    causal : tuple of OutageStatistics
        One for every repetition: a drive, or a draw of the noise.
    smoothed : tuple of OutageStatistics
        The same of the smoother; empty if it was not run.
    nis : tuple of float
        Normalised innovations squared over their degrees of freedom, by repetition.
    """

    model: ErrorModel
    causal: tuple[OutageStatistics, ...]
    smoothed: tuple[OutageStatistics, ...] = ()
    nis: tuple[float, ...] = ()

    @property
    def all_causal(self) -> OutageStatistics:
        """Every window of every repetition."""
        return OutageStatistics(tuple(w for s in self.causal for w in s.windows))

    def values(self, metric: Metric = "max_m") -> FloatArray:
        """Return a figure of every causal window."""
        return np.array([[getattr(w, metric) for w in s.windows] for s in self.causal])


@dataclass(frozen=True, slots=True, eq=False)
class ErrorModelComparison:
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


def with_error_model(
    setup: RunSetup,
    model: ErrorModel,
    turn_on_accel: float,
    turn_on_gyro: float,
    interval: float,
) -> RunSetup:
    """Return a setup whose filter is told another error model, all else the same."""
    sensors = model.sensor_model(turn_on_accel, turn_on_gyro, interval)
    vehicle = setup.vehicle
    if vehicle is not None and vehicle.first_state >= 0:
        vehicle = replace(vehicle, first_state=sensors.size)
        sensors = with_vehicle_states(sensors, vehicle.constraints)
    return replace(setup, model=sensors, vehicle=vehicle)


def compare_error_models(
    imu: ImuRecording,
    gnss: GnssRecording,
    models: Sequence[ErrorModel],
    *,
    base: NoiseModel,
    windows: Sequence[Window] = (),
    sweep: Window | None = None,
    smooth: bool = False,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    turn_on_accel: float = TURN_ON_ACCEL,
    turn_on_gyro: float = TURN_ON_GYRO,
    false_alarm: float = FALSE_ALARM,
    progress: Callable[[str], None] | None = None,
    **how: Any,
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
    lever_arm, turn_on_accel, turn_on_gyro, false_alarm, progress
        As for `navigate`.
    **how
        heading, mounting, time_offset, aiding as for `navigate`.

    Returns
    -------
    ErrorModelComparison
        With one repetition.

    Raises
    ------
    InputError
        No windows or models, the same name twice, or inputs that cannot be used.
    """
    check_models(models)
    if sweep is not None:
        windows = sweep_windows(sweep[0], sweep[1], gnss.duration)
    if not windows:
        raise InputError("no outage was asked for", cure="give windows or a sweep")
    check_windows(windows, gnss)
    arm = np.asarray(lever_arm, dtype=np.float64)
    found: dict[str, dict[bool, list[OutageWindow]]] = {
        m.name: {False: [], True: []} for m in models
    }
    nis: dict[str, list[float]] = {m.name: [] for m in models}
    tracks: list[tuple[float, dict[str, FloatArray]]] = []
    measured = {m.name: m.measured(imu) for m in models}
    groups = deal_windows(windows)
    settings: dict[str, Any] = {}
    for number, group in enumerate(groups):
        used = withhold(gnss, group)
        if progress is not None:
            progress(f"preparing run {number + 1} of {len(groups)}")
        cut, setup = prepare(
            imu, used, base, lever_arm=arm, tune_noise=False, progress=progress, **how
        )
        settings = settings or setup.to_dict()
        group_tracks: list[dict[str, FloatArray]] = [{} for _ in group]
        for model in models:
            if progress is not None:
                progress(f"run {number + 1} of {len(groups)}: {model.name}")
            own = _same_span(measured[model.name], cut)
            told = with_error_model(setup, model, turn_on_accel, turn_on_gyro, 1.0 / imu.rate)
            scale = model.white_scale(cut)
            done = run(
                own,
                used,
                told,
                smooth=smooth,
                false_alarm=false_alarm,
                white_scale=None if scale is None else scale[: own.size],
            )
            nis[model.name].append(done.causal.innovations.gnss.mean_nis)
            for solution in (done.causal, done.smoothed):
                if solution is None:
                    continue
                judged = [
                    judge_window(
                        solution,
                        gnss,
                        window,
                        lever_arm=arm,
                        time_offset=setup.offsets.position,
                        sd_factor=setup.factors.position_sd,
                        white_density=told.model.white_density,
                    )
                    for window in group
                ]
                found[model.name][solution.smoothed] += judged
                if not solution.smoothed:
                    for track, window in zip(group_tracks, judged, strict=True):
                        add_track(track, model.name, window, gnss)
        tracks += [(w[0], t) for w, t in zip(group, group_tracks, strict=True)]
    return ErrorModelComparison(
        results=tuple(
            ModelOutages(
                model,
                (_ordered(found[model.name][False]),),
                (_ordered(found[model.name][True]),) if smooth else (),
                (float(np.mean(nis[model.name])),),
            )
            for model in models
        ),
        sweep=sweep is not None,
        tracks=tuple(t for _, t in sorted(tracks, key=lambda pair: pair[0])),
        settings=settings,
    )


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


def _same_span(imu: ImuRecording, cut: ImuRecording) -> ImuRecording:
    """Cut a de-noised recording as preparation has cut the raw one."""
    if imu.time[0] == cut.time[0]:
        return imu
    return imu.between(float(cut.time[0]), np.inf)


def _ordered(windows: list[OutageWindow]) -> OutageStatistics:
    return OutageStatistics(tuple(sorted(windows, key=lambda w: (w.start_s, w.duration_s))))


def group_by_model(
    models: Sequence[ErrorModel], draws: Sequence[Mapping[str, tuple[OutageStatistics, float]]]
) -> tuple[ModelOutages, ...]:
    """Put repetitions together model by model."""
    return tuple(
        ModelOutages(m, tuple(d[m.name][0] for d in draws), (), tuple(d[m.name][1] for d in draws))
        for m in models
    )
