"""Mechanizations of one array side by side: errors, claims, biases, cost. S002 Tables 1 to 3.

All of them start from one preparation. The improvement over a single IMU is given as a reduction,
1 - error / error of the average single IMU (spec 6.3); where a run has outages, they are judged at
the epochs that were withheld, and with a true trajectory at every sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler import earth
from schuler.data import GnssRecording, NavigationSolution, Trajectory
from schuler.data.array import ImuArray
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.evaluation.outage_windows import OutageStatistics, Window, judge_window
from schuler.navigation.engine import gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_states import FILTER_CHANNELS
from schuler.navigation.mechanizations.array_preparation import PreparedArray, prepare_array
from schuler.navigation.mechanizations.navigate_array import (
    MECHANIZATIONS,
    ArrayNavigation,
    Mechanization,
    check_mechanization,
    run_mechanization,
)
from schuler.navigation.mechanizations.stacked import RigidBody
from schuler.navigation.navigate import withhold
from schuler.navigation.observability import state_names
from schuler.navigation.settings import FALSE_ALARM, NavigationSettings, Progress, nobody_listens
from schuler.navigation.threads import in_threads
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import rotation_vector_from_dcm
from schuler.types import FloatArray

COMPONENTS = ("N", "E", "D", "vN", "vE", "vD", "roll", "pitch", "heading")
"""As S002 has them: metres, m/s, and the attitude in the axes of the body (rad)."""


@dataclass(frozen=True, slots=True, eq=False)
class MechanizationResult:
    """What one mechanization came to."""

    label: str  # for people: "synthetic", "imu 2 alone"
    mechanization: Mechanization  # one of `MECHANIZATIONS`
    navigation: ArrayNavigation  # solution and all that belongs to it
    # rms, largest: (9,) errors against the truth, by `COMPONENTS`; NaN without truth.
    rms: FloatArray
    largest: FloatArray
    # (9,): root mean square of the standard deviations over the same samples; the attitude about
    # north, east and down.
    claimed: FloatArray
    outages: OutageStatistics | None  # at the epochs that were withheld

    @property
    def solution(self) -> NavigationSolution:
        """The solution for the origin of the body."""
        return self.navigation.solution


@dataclass(frozen=True, slots=True, eq=False)
class MechanizationComparison(Exportable):
    """All mechanizations on one array.

    Parameters
    ----------
    results : tuple of MechanizationResult
        One for each; "single" for every IMU.
    prepared : PreparedArray
        From which all started.
    windows : tuple of (start, seconds)
        Outages, seconds after the first GNSS epoch.
    judged : (start, stop) or None
        Time over which errors against the truth are taken, s.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> ride = schuler.motorcycle(120.0)
    >>> gyro = schuler.WhiteNoise(1e-3) + schuler.GaussMarkov(1e-3, 100.0)
    >>> accel = schuler.WhiteNoise(1e-2) + schuler.GaussMarkov(0.02, 100.0)
    >>> noise, place = schuler.NoiseModel.isotropic(gyro, accel), schuler.Mounting.aligned(2)
    >>> rng = np.random.default_rng(0)
    >>> two = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(two, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.05, velocity_sd=0.03, rng=rng)
    >>> truth = ride.trajectory(np.arange(90.0, 110.0, 0.1))
    >>> found = schuler.compare_mechanizations(
    ...     array, gnss, noise, mechanizations=("single", "synthetic"), truth=truth,
    ...     judged=(90.0, 110.0), settings=schuler.NavigationSettings(time_offset=0.0),
    ... )
    >>> found.average("synthetic").shape
    (9,)
    """

    results: tuple[MechanizationResult, ...]
    prepared: PreparedArray
    windows: tuple[Window, ...]
    judged: tuple[float, float] | None

    def of(self, mechanization: Mechanization) -> tuple[MechanizationResult, ...]:
        """Return the results of one mechanization."""
        return tuple(r for r in self.results if r.mechanization == mechanization)

    def average(self, mechanization: Mechanization, what: str = "rms") -> FloatArray:
        """Return the mean of an error over the runs of a mechanization, (9,)."""
        mean: FloatArray = np.mean([getattr(r, what) for r in self.of(mechanization)], axis=0)
        return mean

    def reduction(self, mechanization: Mechanization, what: str = "rms") -> FloatArray:
        """Return 1 - error / error of the average single IMU, (9,). Spec 6.3."""
        less: FloatArray = 1.0 - self.average(mechanization, what) / self.average("single", what)
        return less

    def biases(self) -> tuple[tuple[str, ...], dict[str, tuple[FloatArray, FloatArray]]]:
        """Return the bias of every sensor axis at the end, as each mechanization has it."""
        array = self.prepared.array
        names = tuple(f"{n} {c}" for n in array.names for c in FILTER_CHANNELS)
        found = {}
        for result in self.results:
            value, sd = sensor_biases(result.navigation)
            found[result.label] = (value, sd)
        return names, found

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "imus": list(self.prepared.array.names),
            "notes": list(self.prepared.notes),
            "windows": [list(w) for w in self.windows],
            "components": list(COMPONENTS),
            "mechanizations": [
                {
                    "label": r.label,
                    "mechanization": r.mechanization,
                    "states": r.navigation.states,
                    "rms": _plain(r.rms),
                    "largest": _plain(r.largest),
                    "claimed_sd": _plain(r.claimed),
                    "nis_over_degrees": r.solution.innovations.gnss.mean_nis,
                    "outages": None if r.outages is None else r.outages.to_dict(),
                    "cpu_us_per_sample": 1e6
                    * r.navigation.cpu_seconds
                    / r.solution.trajectory.size,
                }
                for r in self.results
            ],
        }


def compare_mechanizations(
    array: ImuArray,
    gnss: GnssRecording,
    noise_models: NoiseModel | Sequence[NoiseModel] | None = None,
    settings: NavigationSettings | None = None,
    *,
    mechanizations: Sequence[Mechanization] = MECHANIZATIONS,
    parity: bool = True,
    rigid: RigidBody | None = None,
    truth: Trajectory | None = None,
    judged: tuple[float, float] | None = None,
    outages: Sequence[Window] = (),
    progress: Progress | None = None,
) -> MechanizationComparison:
    """Run several mechanizations on one array and judge them alike.

    Parameters
    ----------
    array : ImuArray
        Of k IMUs.
    gnss : GnssRecording
        Of one antenna.
    noise_models : NoiseModel or sequence of NoiseModel, optional
        Of all IMUs, or of each.
    settings : NavigationSettings, optional
        Lever arm, heading, mounting, time offsets, tuning, aiding and the rest of a run.
    mechanizations : sequence of str
        "single", "synthetic", "extended", "constrained", "system".
    parity : bool
        Whether the extended filter measures differences between the sensors.
    rigid : RigidBody, optional
        How stiff the body of the constrained filter is.
    truth : Trajectory, optional
        Against which errors are taken.
    judged : (start, stop), optional
        Time over which, s.
    outages : sequence of (start, seconds)
        GNSS is taken away there, s after its first epoch.
    progress : callable, optional
        Is told what is being run.

    Returns
    -------
    MechanizationComparison
        Root mean square and largest errors north, east, down (m), of velocity (m/s) and of roll,
        pitch, heading (rad), for each run.

    Raises
    ------
    InputError
        Neither truth nor outages to judge by, or recordings that do not overlap.

    Notes
    -----
    S002 section III and S000 Figs. 1 to 3.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> ride = schuler.motorcycle(120.0)
    >>> gyro = schuler.WhiteNoise(1e-3) + schuler.GaussMarkov(1e-3, 100.0)
    >>> accel = schuler.WhiteNoise(1e-2) + schuler.GaussMarkov(0.02, 100.0)
    >>> noise, place = schuler.NoiseModel.isotropic(gyro, accel), schuler.Mounting.aligned(2)
    >>> rng = np.random.default_rng(0)
    >>> two = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(two, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.05, velocity_sd=0.03, rng=rng)
    >>> truth = ride.trajectory(np.arange(90.0, 110.0, 0.1))
    >>> found = schuler.compare_mechanizations(
    ...     array, gnss, noise, mechanizations=("single", "synthetic"), truth=truth,
    ...     judged=(90.0, 110.0), settings=schuler.NavigationSettings(time_offset=0.0),
    ... )
    >>> found.average("synthetic").shape
    (9,)
    """
    if not mechanizations:
        raise InputError("no mechanization to compare", expected=", ".join(MECHANIZATIONS))
    told = settings or NavigationSettings()
    for name in mechanizations:
        check_mechanization(name, told, smooth=False)
    say = progress or nobody_listens
    used = withhold(gnss, outages) if outages else gnss
    prepared = prepare_array(array, used, noise_models, told, progress)
    setup = prepared.setup

    def one(case: tuple[Mechanization, int]) -> MechanizationResult:
        name, imu = case
        label = f"{prepared.array.names[imu]} alone" if name == "single" else str(name)
        say(f"filtering: {label}")
        navigation = run_mechanization(prepared, used, name, parity=parity, imu=imu, rigid=rigid)
        rms, largest, claimed = _errors(navigation.solution, truth, judged)
        windows = tuple(
            judge_window(
                navigation.solution,
                gnss,
                window,
                lever_arm=prepared.lever_arm,
                time_offset=setup.offsets.position,
                sd_factor=setup.factors.position_sd,
            )
            for window in outages
        )
        statistics = OutageStatistics(windows) if windows else None
        return MechanizationResult(label, name, navigation, rms, largest, claimed, statistics)

    cases = [
        (name, imu)
        for name in mechanizations
        for imu in range(prepared.array.count if name == "single" else 1)
    ]
    results = in_threads(one, cases)
    return MechanizationComparison(tuple(results), prepared, tuple(outages), judged)


def sensor_biases(navigation: ArrayNavigation) -> tuple[FloatArray, FloatArray]:
    """Return the estimated bias of every sensor axis at the end of a run."""
    solution, array = navigation.solution, navigation.prepared.array
    value, square = np.full(6 * array.count, np.nan), np.full(6 * array.count, np.nan)
    own = solution.settings.get("imu_used")
    for j, name in enumerate(solution.sensor_error_names):
        for i, imu in enumerate(array.names):
            if own == imu:
                rest = name
            elif name.startswith(f"{imu} "):
                rest = name[len(imu) + 1 :]
            else:
                continue
            for c, channel in enumerate(FILTER_CHANNELS):
                if rest.startswith(channel):
                    at = 6 * i + c
                    value[at] = np.nan_to_num(value[at]) + solution.sensor_errors[-1, j]
                    square[at] = np.nan_to_num(square[at]) + solution.sensor_errors_sd[-1, j] ** 2
    if navigation.mechanization in ("single", "system"):
        # an IMU by itself is filtered in the axes of the body
        turn = array.mounting.rotation
        value, square = _in_own_axes(value, turn), _in_own_axes(square, turn**2)
    return value, np.sqrt(square)


def _in_own_axes(values: FloatArray, turn: FloatArray) -> FloatArray:
    """Triads (6 k,) in the axes of the body, turned into those of each IMU; NaN where empty."""
    triads = values.reshape(-1, 2, 3)
    own = np.einsum("kba,ktb->kta", turn, np.nan_to_num(triads))
    own[np.isnan(triads).all(axis=2)] = np.nan
    flat: FloatArray = own.ravel()
    return flat


def bias_correlation(
    prepared: PreparedArray, gnss: GnssRecording, *, parity: bool
) -> tuple[tuple[str, ...], FloatArray]:
    """Return the correlation of all states of the extended filter at the end.

    Parameters
    ----------
    prepared : PreparedArray
        Of a `MechanizationComparison`.
    gnss : GnssRecording
        The one it was prepared with.
    parity : bool
        Whether differences between the sensors are measured.

    Returns
    -------
    names : tuple of str
        Of all states, navigation first.
    correlation : (s, s) ndarray
        In the same order.

    Notes
    -----
    S002 Fig. 17; for n equal sensors the biases correlate as -(h_i·h_j)/(n - 1).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> ride = schuler.motorcycle(120.0)
    >>> gyro = schuler.WhiteNoise(1e-3) + schuler.GaussMarkov(1e-3, 100.0)
    >>> accel = schuler.WhiteNoise(1e-2) + schuler.GaussMarkov(0.02, 100.0)
    >>> noise, place = schuler.NoiseModel.isotropic(gyro, accel), schuler.Mounting.aligned(2)
    >>> rng = np.random.default_rng(0)
    >>> two = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(two, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.05, velocity_sd=0.03, rng=rng)
    >>> found = schuler.compare_mechanizations(
    ...     array, gnss, noise, mechanizations=("extended",), outages=[(100.0, 5.0)],
    ...     settings=schuler.NavigationSettings(time_offset=0.0),
    ... )
    >>> names, correlation = schuler.bias_correlation(found.prepared, gnss, parity=False)
    >>> correlation.shape[0] == len(names)
    True
    """
    setup, imu = prepared.extended_setup(parity=parity), prepared.recording
    run = run_engine(
        imu,
        setup.initial_state(imu, gnss),
        setup.model,
        setup.schedule(imu, gnss),
        gate=gate_thresholds(FALSE_ALARM),
        white_scale=setup.white_scale(imu),
        node_interval=1e9,
    )
    covariance = run.nodes.covariance[-1]
    sd = np.sqrt(np.diag(covariance))
    names = state_names(setup.model)
    return names, covariance / np.outer(sd, sd)


def trajectory_errors(solution: NavigationSolution, truth: Trajectory) -> FloatArray:
    """Return the errors of a solution at the stamps of the truth.

    Parameters
    ----------
    solution : NavigationSolution
        Of any filter.
    truth : Trajectory
        Known motion.

    Returns
    -------
    (n, 9) ndarray
        North, east, down in m; the same of velocity in m/s; roll, pitch, heading in rad.

    Raises
    ------
    InputError
        Truth outside the solution.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> ride = schuler.motorcycle(120.0)
    >>> gyro = schuler.WhiteNoise(1e-3) + schuler.GaussMarkov(1e-3, 100.0)
    >>> accel = schuler.WhiteNoise(1e-2) + schuler.GaussMarkov(0.02, 100.0)
    >>> noise, place = schuler.NoiseModel.isotropic(gyro, accel), schuler.Mounting.aligned(2)
    >>> rng = np.random.default_rng(0)
    >>> two = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(two, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.05, velocity_sd=0.03, rng=rng)
    >>> found = schuler.navigate_array(array, gnss, noise, time_offset=0.0)
    >>> truth = ride.trajectory(np.arange(90.0, 110.0, 0.1))
    >>> schuler.trajectory_errors(found.solution, truth).shape
    (200, 9)
    """
    path = solution.trajectory
    inside = (truth.time >= path.time[0]) & (truth.time <= path.time[-1])
    if not inside.any():
        raise InputError(
            "the true trajectory and the solution do not overlap in time",
            expected="one time axis",
        )
    time = truth.time[inside]

    def at(values: FloatArray) -> FloatArray:
        return np.column_stack([np.interp(time, path.time, values[:, i]) for i in range(3)])

    position = truth.position[inside]
    north, east = earth.metres_per_radian(position)
    scale = np.stack([north, east, -np.ones(north.size)], axis=-1)
    near = np.clip(np.searchsorted(path.time, time - 1e-9), 0, path.size - 1)
    turn = truth.rotation[inside].transpose(0, 2, 1) @ path.rotation[near]
    return np.hstack(
        [
            (at(path.position) - position) * scale,
            at(path.velocity) - truth.velocity[inside],
            rotation_vector_from_dcm(turn),
        ]
    )


def _errors(
    solution: NavigationSolution, truth: Trajectory | None, judged: tuple[float, float] | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    start, stop = judged or (-np.inf, np.inf)
    time = solution.trajectory.time
    part = (time >= start) & (time <= stop)
    sd = np.hstack([solution.position_sd, solution.velocity_sd, solution.attitude_sd])[part]
    claimed = np.sqrt(np.mean(sd**2, axis=0)) if part.any() else np.full(9, np.nan)
    if truth is None:
        return np.full(9, np.nan), np.full(9, np.nan), claimed
    inside = (truth.time >= max(start, time[0])) & (truth.time <= min(stop, time[-1]))
    error = trajectory_errors(
        solution,
        Trajectory(
            truth.time[inside],
            truth.position[inside],
            truth.velocity[inside],
            truth.rotation[inside],
        ),
    )
    return np.sqrt(np.mean(error**2, axis=0)), np.abs(error).max(axis=0), claimed


def _plain(values: FloatArray) -> list[float] | None:
    return None if np.isnan(values).all() else [float(v) for v in values]
