"""The geometrically constrained mechanization as a solution for the origin of the body.

S002, section III: every IMU has a solution in one filter (stacked.py), and the body ties them.
"""

from __future__ import annotations

import numpy as np

from schuler.data import GnssRecording, Innovations, NavigationSolution
from schuler.errors import NavigationError
from schuler.navigation.aiding.schedule import KIND_NAMES
from schuler.navigation.engine import gate_thresholds
from schuler.navigation.mechanizations.array_preparation import PreparedArray
from schuler.navigation.mechanizations.array_solution import at_lever_arm, mean_trajectory
from schuler.navigation.mechanizations.stacked import CONSTRAINT, RigidBody, StackedRun, run_stack
from schuler.navigation.run import run_record

CONSTRAINT_NAMES = ("relative attitude", "relative position", "relative velocity")


def run_constrained(
    prepared: PreparedArray, gnss: GnssRecording, rigid: RigidBody | None = None
) -> tuple[NavigationSolution, StackedRun]:
    """Run the stacked filter and average what its blocks say of the body."""
    findings, false_alarm = prepared.setup.condition.findings, prepared.settings.false_alarm
    if not prepared.whole:
        raise NavigationError(
            "; ".join(f.message for f in findings if f.kind == "gap"),
            expected="an array recording without gaps for the constrained mechanization",
            cure="take the extended, synthetic or system mechanization (--mechanization extended), "
            "or navigate the parts before and after by themselves",
        )
    stack = run_stack(prepared, gnss, gate=gate_thresholds(false_alarm), rigid=rigid)
    mounting = prepared.array.mounting
    at_origin = [
        at_lever_arm(t, -(c.T @ place), c.T)
        for t, c, place in zip(
            stack.trajectories, mounting.rotation, mounting.position, strict=True
        )
    ]
    innovations, out = _innovations(stack), stack.outputs
    names = tuple(
        f"{name} {state}"
        for name, model in zip(prepared.array.names, prepared.models, strict=True)
        for state in model.names
    )
    solution = NavigationSolution(
        trajectory=mean_trajectory(at_origin, stack.weight),
        position_covariance=out.position_covariance,
        velocity_sd=out.velocity_sd,
        attitude_sd=out.attitude_sd,
        sensor_error_time=out.node_time,
        sensor_errors=out.node_sensor,
        sensor_errors_sd=out.node_sensor_sd,
        sensor_error_names=names,
        innovations=innovations,
        settings=prepared.setup.to_dict()
        | run_record(prepared.recording, gnss, prepared.setup, innovations)
        | {"sensor_error_states": list(names), "smoothed": False},
        log_likelihood=stack.log_likelihood,
    )
    return solution, stack


def _innovations(stack: StackedRun) -> Innovations:
    """GNSS, and the constraints of every pair."""
    out, schedule = stack.outputs, stack.schedule
    fixes = np.flatnonzero(schedule.kind != CONSTRAINT)
    ties = np.flatnonzero(schedule.kind == CONSTRAINT)
    each = out.tie_nis[0].size
    tied = each * ties.size
    time = np.concatenate([schedule.time[fixes], np.repeat(schedule.time[ties], each)])
    kind = [KIND_NAMES[q] for q in schedule.kind[fixes]]
    kind += list(CONSTRAINT_NAMES) * (tied // 3)
    order = np.argsort(time, kind="stable")
    return Innovations(
        time=time[order],
        kind=tuple(kind[q] for q in order.tolist()),
        value=np.concatenate([out.residual[fixes], out.tie_residual.reshape(-1, 3)])[order],
        sd=np.concatenate([out.deviation[fixes], out.tie_deviation.reshape(-1, 3)])[order],
        nis=np.concatenate([out.nis[fixes], out.tie_nis.ravel()])[order],
        degrees=np.concatenate([out.degrees[fixes], np.full(tied, 3)])[order],
        accepted=np.concatenate([out.accepted[fixes], np.ones(tied, bool)])[order],
    )
