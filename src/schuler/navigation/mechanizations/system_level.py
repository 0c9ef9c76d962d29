"""Redundancy at system level: several finished solutions, their vote and their average.

S002, Fig 2: every IMU is integrated with GNSS by itself, and faults show in the solutions. Each
takes every option that a single IMU takes. Their errors are not independent, as they share the
receiver: the covariance of the average counts what they share where it is known (shared_errors.py:
causal solutions with GNSS alone), and is the average of their covariances where it is not, which
is true whatever they share.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler import earth
from schuler.data import GnssRecording, Innovations, NavigationSolution, Trajectory
from schuler.navigation.aiding.gnss import CorrelatedGnss, GnssErrorModel
from schuler.navigation.aiding.options import MeasurementOptions
from schuler.navigation.engine import FilterRun
from schuler.navigation.mechanizations.array_preparation import PreparedArray
from schuler.navigation.mechanizations.array_solution import (
    mean_trajectory,
    solution_at_lever_arm,
)
from schuler.navigation.mechanizations.shared_errors import SharedErrors, claims, shared_errors
from schuler.navigation.mechanizations.single_imu import single_setup
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.run import run
from schuler.navigation.threads import in_threads
from schuler.rotations import rotation_vector_from_dcm
from schuler.types import FloatArray

# a solution is outvoted when it is so many of its own standard deviations from the median of all,
# and heard again below the second number
OUTVOTED = 5.0
HEARD_AGAIN = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Vote:
    """Which solutions are averaged when."""

    heard: NDArray[np.bool_]  # (n, k): False where a solution is outvoted
    # (n, k): largest distance of any component from the median of all, in its standard deviations
    distance: FloatArray

    @property
    def share_outvoted(self) -> FloatArray:
        """Share of the time at which each solution is outvoted, (k,)."""
        share: FloatArray = 1.0 - self.heard.mean(axis=0)
        return share

    def weight(self, base: FloatArray) -> FloatArray:
        """Return weights of those that are heard."""
        weight = self.heard * base
        whole: FloatArray = weight / weight.sum(axis=1, keepdims=True)
        return whole


def vote(trajectories: Sequence[Trajectory], sd: FloatArray) -> Vote:
    """Let three solutions or more vote: who is far from the median is not heard."""
    k, n = len(trajectories), trajectories[0].size
    base = trajectories[0]
    north, east = earth.metres_per_radian(base.position)
    scale = np.stack([north, east, -np.ones(north.size)], axis=-1)
    value = np.empty((n, k, 9))
    for i, other in enumerate(trajectories):
        value[:, i, :3] = (other.position - base.position) * scale
        value[:, i, 3:6] = other.velocity
        value[:, i, 6:] = -rotation_vector_from_dcm(
            other.rotation @ base.rotation.transpose(0, 2, 1)
        )
    away = np.abs(value - np.median(value, axis=1, keepdims=True)) / np.maximum(sd, 1e-12)
    distance = away.max(axis=2)
    heard = np.ones((n, k), dtype=bool)
    if k < 3:
        return Vote(heard, distance)
    for i in range(k):
        decided = np.where(
            distance[:, i] > OUTVOTED, 0, np.where(distance[:, i] < HEARD_AGAIN, 1, -1)
        )
        last = np.maximum.accumulate(np.where(decided >= 0, np.arange(n), -1))
        heard[:, i] = np.where(last >= 0, decided[np.maximum(last, 0)] == 1, True)
    # never fewer than half: keep the nearest
    rank = distance.argsort(axis=1).argsort(axis=1)
    few = heard.sum(axis=1) < (k + 1) // 2
    heard[few] = rank[few] < (k + 1) // 2
    return Vote(heard, distance)


@dataclass(frozen=True, slots=True, eq=False)
class SystemRun:
    """The average of several solutions."""

    solution: NavigationSolution  # for the origin of the body; causal or smoothed.
    vote: Vote  # who was heard when
    states: int  # of all filters
    cpu_seconds: float  # of all threads


@dataclass(frozen=True, slots=True, eq=False)
class _Alone:
    """What one IMU came to by itself, for the origin of the body."""

    solution: NavigationSolution
    setup: RunSetup
    filter: FilterRun | None
    start_sd: FloatArray
    cpu_seconds: float


def run_system(
    prepared: PreparedArray, gnss: GnssRecording, *, smooth: bool = False, lag: float | None = None
) -> SystemRun:
    """Let every IMU navigate by itself, vote, and average."""
    settings = prepared.settings
    causal = not smooth and lag is None
    memory = settings.smoother_memory / prepared.array.count
    known = causal and not settings.constraints and _gnss_alone(settings.measurements)

    def alone(imu: int) -> _Alone:
        begin = time.thread_time()
        recording, setup = single_setup(prepared, gnss, imu)
        setup = replace(setup, settings=replace(setup.settings, smoother_memory=memory))
        done = run(recording, gnss, setup, smooth=smooth, lag=lag, keep_nodes=known)
        place = prepared.array.mounting.position[imu]
        found = solution_at_lever_arm(done.smoothed or done.lagged or done.causal, -place)
        first = setup.initial_state(recording, gnss).covariance
        # each levels itself by its own accelerometers; the rest of the start comes from GNSS
        sd = np.sqrt(np.diag(first)[:9]) * [1, 1, 1, 1, 1, 1, 0, 0, 1]
        kept = done.filter if known else None
        return _Alone(found, setup, kept, sd, time.thread_time() - begin)

    each = in_threads(alone, range(prepared.array.count))
    begin = time.thread_time()
    shared = None
    if known:
        blocks = [one.setup.model.layout().block for one in each]
        starts = np.stack([one.start_sd for one in each])
        slow = [one.setup.measurements.correlated for one in each]
        lasting = [s.places for s in slow if isinstance(s, GnssErrorModel)]
        shared = shared_errors([one.filter for one in each if one.filter], blocks, starts, lasting)
    solution, votes = average([one.solution for one in each], prepared.array.names, shared)
    return SystemRun(
        solution,
        votes,
        sum(9 + one.setup.model.size for one in each),
        sum(one.cpu_seconds for one in each) + time.thread_time() - begin,
    )


def _gnss_alone(measurements: MeasurementOptions) -> bool:
    """Whether nothing that filters share but GNSS has a state in each of them."""
    return not (isinstance(measurements.correlated, CorrelatedGnss) or measurements.sources)


def average(
    solutions: Sequence[NavigationSolution],
    names: Sequence[str],
    shared: SharedErrors | None = None,
) -> tuple[NavigationSolution, Vote]:
    """Average solutions for one point of the body after a vote, in equal parts of those heard."""
    stamps = reduce(np.intersect1d, [s.trajectory.time for s in solutions])
    cut = [_at_stamps(s, stamps) for s in solutions]
    paths = [s.trajectory for s in cut]
    sd = np.stack([np.hstack([s.position_sd, s.velocity_sd, s.attitude_sd]) for s in cut], axis=1)
    votes = vote(paths, sd)
    weight = votes.weight(np.ones(len(cut)))
    claimed = np.stack(
        [claims(s.position_covariance, s.velocity_sd**2, s.attitude_sd**2) for s in cut]
    )
    mean = _mean_claims(stamps, claimed, weight, shared)
    innovations = _joined([s.innovations for s in solutions])
    node = solutions[0].sensor_error_time
    rows = [
        np.maximum(np.searchsorted(s.sensor_error_time, node, side="right") - 1, 0)
        for s in solutions
    ]
    solution = NavigationSolution(
        trajectory=mean_trajectory(paths, weight),
        position_covariance=mean[:, :9].reshape(-1, 3, 3),
        velocity_sd=np.sqrt(mean[:, 9:12]),
        attitude_sd=np.sqrt(mean[:, 12:]),
        sensor_error_time=node,
        sensor_errors=np.hstack([s.sensor_errors[r] for s, r in zip(solutions, rows, strict=True)]),
        sensor_errors_sd=np.hstack(
            [s.sensor_errors_sd[r] for s, r in zip(solutions, rows, strict=True)]
        ),
        sensor_error_names=tuple(
            f"{name} {state}"
            for name, s in zip(names, solutions, strict=True)
            for state in s.sensor_error_names
        ),
        innovations=innovations,
        settings=_settings(solutions, names)
        | {
            "nis_over_degrees": innovations.gnss.mean_nis,
            "share_outvoted": dict(zip(names, votes.share_outvoted.tolist(), strict=True)),
            "covariance_of_average": "errors in common" if shared else "average of covariances",
        },
        smoothed=solutions[0].smoothed,
        log_likelihood=float(sum(s.log_likelihood for s in solutions)),
    )
    return solution, votes


def _mean_claims(
    stamps: FloatArray, claimed: FloatArray, weight: FloatArray, shared: SharedErrors | None
) -> FloatArray:
    """Covariance of a weighted mean; claimed (k, n, 15), weight (n, k)."""
    share = weight.T[:, :, None]
    if shared is None:
        bound: FloatArray = (share * claimed).sum(axis=0)
        return bound
    mean: FloatArray = (share**2 * claimed).sum(axis=0)
    for i in range(len(claimed)):
        for j in range(len(claimed)):
            if i != j:
                mean += share[i] * share[j] * shared.at(stamps, i, j)
    return mean


def _at_stamps(solution: NavigationSolution, stamps: FloatArray) -> NavigationSolution:
    """The samples of a solution at stamps that all have: one may have begun later."""
    path = solution.trajectory
    if path.size == stamps.size:
        return solution
    k = np.searchsorted(path.time, stamps)
    return replace(
        solution,
        trajectory=Trajectory(stamps, path.position[k], path.velocity[k], path.rotation[k]),
        position_covariance=solution.position_covariance[k],
        velocity_sd=solution.velocity_sd[k],
        attitude_sd=solution.attitude_sd[k],
    )


def _joined(parts: Sequence[Innovations]) -> Innovations:
    """The innovations of all filters in order of time."""
    order = np.argsort(np.concatenate([p.time for p in parts]), kind="stable")
    kinds = [kind for p in parts for kind in p.kind]
    values = {
        name: np.concatenate([getattr(p, name) for p in parts])[order]
        for name in ("time", "value", "sd", "nis", "degrees", "accepted")
    }
    return Innovations(kind=tuple(kinds[q] for q in order.tolist()), **values)


def _settings(solutions: Sequence[NavigationSolution], names: Sequence[str]) -> dict[str, Any]:
    """What holds for all, what for each, and the findings: once where all have them."""
    told = [{k: v for k, v in s.settings.items() if k != "findings"} for s in solutions]
    alike = {
        k: v for k, v in told[0].items() if all(k in other and other[k] == v for other in told)
    }
    findings: list[dict[str, Any]] = []
    found = [s.settings["findings"] for s in solutions]
    for name, own in zip(names, found, strict=True):
        for finding in own:
            everywhere = all(finding in other for other in found)
            said = finding if everywhere else finding | {"message": f"{name}: {finding['message']}"}
            if said not in findings:
                findings.append(said)
    each = {
        name: {k: v for k, v in own.items() if k not in alike}
        for name, own in zip(names, told, strict=True)
    }
    return alike | {"each_imu": each, "findings": findings}
