"""Withhold GNSS, navigate through the gap, compare with what was withheld. Spec 7.9, 8.4.

The withheld epochs are taken out of the recording before anything looks at it: alignment, time
offsets, noise and filter of a run never see the windows on which the run is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Unpack

from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.data.exportable import Exportable
from schuler.evaluation.outage_windows import (
    OutageStatistics,
    OutageWindow,
    Window,
    asked_windows,
    deal_windows,
    in_order,
    judge_run,
)
from schuler.navigation.navigate import withhold
from schuler.navigation.preparation.prepare import prepare_drive
from schuler.navigation.run import run
from schuler.navigation.settings import (
    NavigationOptions,
    NavigationSettings,
    Progress,
    navigation_settings,
)
from schuler.navigation.threads import in_threads
from schuler.noise.noise_model import NoiseModel


@dataclass(frozen=True, slots=True, eq=False)
class OutageEvaluation(Exportable):
    """Causal and smoothed solutions against the GNSS that was withheld from them.

    Parameters
    ----------
    causal, smoothed : OutageStatistics
        The smoothed solution uses GNSS after the gap, never inside it.
    sweep : bool
        Whether the windows were laid out systematically.
    runs : tuple of dict
        Settings of every run: which windows it withheld, what it estimated.
    solutions : tuple of (NavigationSolution, NavigationSolution)
        Causal and smoothed solution of every run.
    lagged : OutageStatistics or None
        Of fixed-lag smoothing: what is known `lag` seconds after each moment.
    lag : float or None
        s.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, evaluate_outages, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> found = evaluate_outages(imu, gnss, model, windows=((60.0, 10.0),), time_offset=0.0)
    >>> len(found.causal.windows)
    1
    """

    causal: OutageStatistics
    smoothed: OutageStatistics
    sweep: bool
    runs: tuple[dict[str, Any], ...]
    solutions: tuple[tuple[NavigationSolution, NavigationSolution], ...] = field(default=())
    lagged: OutageStatistics | None = None
    lag: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON.

        Returns
        -------
        dict
            Keys "causal", "smoothed", "sweep", "runs", and "fixed_lag" where it was asked for.
        """
        late = (
            {}
            if self.lagged is None
            else {"fixed_lag": {"lag_s": self.lag} | self.lagged.to_dict()}
        )
        return late | {
            "causal": self.causal.to_dict(),
            "smoothed": self.smoothed.to_dict(),
            "sweep": self.sweep,
            "runs": list(self.runs),
        }


def evaluate_outages(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None = None,
    *,
    windows: Sequence[Window] = (),
    sweep: Window | None = None,
    lag: float | None = None,
    progress: Callable[[str], None] | None = None,
    **options: Unpack[NavigationOptions],
) -> OutageEvaluation:
    """Withhold GNSS in windows and judge the solutions there.

    Given windows that lie apart are withheld together in one run, as an engineer would drive
    them; overlapping ones, as a dense sweep has, are dealt into several runs.

    Parameters
    ----------
    imu, gnss, noise_model
        As for `navigate`.
    windows : sequence of (start, seconds)
        Seconds after the first GNSS epoch.
    sweep : (seconds, every) or None
        Windows of `seconds` that start every `every` seconds, instead of `windows`.
    lag : float or None
        Judge fixed-lag smoothing by so many seconds as well.
    progress, **options
        As for `navigate`.

    Returns
    -------
    OutageEvaluation
        Causal, smoothed and perhaps fixed-lag figures.

    Raises
    ------
    InputError
        No windows, windows outside the run, or inputs that cannot be used.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, evaluate_outages, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> found = evaluate_outages(imu, gnss, model, windows=((60.0, 10.0),), time_offset=0.0)
    >>> len(found.causal.windows)
    1
    """
    settings = navigation_settings(evaluate_outages, options)
    groups = deal_windows(asked_windows(windows, sweep, gnss, imu))

    def one(number: int) -> _JudgedRun:
        label = f"run {number + 1} of {len(groups)}: " if len(groups) > 1 else ""
        say = None if progress is None else _prefixed(progress, label)
        return _judged_run(imu, gnss, noise_model, settings, groups[number], lag, say)

    runs = in_threads(one, range(len(groups)))
    return OutageEvaluation(
        causal=in_order(w for r in runs for w in r.causal),
        smoothed=in_order(w for r in runs for w in r.smoothed),
        sweep=sweep is not None,
        runs=tuple(r.settings for r in runs),
        solutions=tuple(r.solutions for r in runs),
        lagged=None if lag is None else in_order(w for r in runs for w in r.lagged),
        lag=lag,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _JudgedRun:
    """One run with some windows withheld: what came of it, and its solutions."""

    causal: tuple[OutageWindow, ...]
    smoothed: tuple[OutageWindow, ...]
    lagged: tuple[OutageWindow, ...]
    settings: dict[str, Any]
    solutions: tuple[NavigationSolution, NavigationSolution]


def _judged_run(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None,
    settings: NavigationSettings,
    group: tuple[Window, ...],
    lag: float | None,
    say: Progress | None,
) -> _JudgedRun:
    """Prepare, filter and smooth without the fixes of some windows, and judge each of them."""
    used = withhold(gnss, group)
    prepared = prepare_drive(imu, used, noise_model, settings, say)
    if say is not None:
        say("filtering and smoothing")
    done = run(prepared.imu, used, prepared.setup, smooth=True, lag=lag)
    assert done.smoothed is not None
    setup = prepared.setup
    told = done.causal.settings | {"outages": [list(w) for w in group]}
    return _JudgedRun(
        judge_run(done.causal, gnss, setup, group),
        judge_run(done.smoothed, gnss, setup, group),
        () if done.lagged is None else judge_run(done.lagged, gnss, setup, group),
        told,
        (done.causal, done.smoothed),
    )


def _prefixed(progress: Callable[[str], None], label: str) -> Callable[[str], None]:
    return lambda text: progress(label + text)
