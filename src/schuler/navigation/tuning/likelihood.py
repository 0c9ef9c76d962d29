"""How likely the innovations of a drive are, GNSS thinned or not, and the time offset by it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.schedule import VELOCITY, AidingSchedule
from schuler.navigation.engine import FilterRun, gate_thresholds
from schuler.navigation.innovation_likelihood import RUN, InnovationSequence
from schuler.navigation.preparation.setup import RunSetup, TimeOffsets
from schuler.navigation.segments import run_in_segments
from schuler.types import FloatArray, IntArray

EDGE = 1.0
"""Seconds from the ends of a recording within which fixes do not judge."""
NO_NODES = 1e9
"""Seconds between them."""


def innovations(
    imu: ImuRecording,
    gnss: Sequence[GnssRecording],
    setup: RunSetup,
    level: FloatArray | None = None,
) -> InnovationSequence:
    """Filter a drive once for every thinning of GNSS and gather the innovations of GNSS.

    What is known of a vehicle takes part in the filter, but only GNSS judges, and of that the same
    fixes in the same order whatever the time offsets are: all but those that an offset might push
    over the ends of the recording.
    """
    found = []
    scale = noise_scale(imu, setup, level)
    for number, fixes in enumerate(gnss):
        schedule, done = filtered(imu, fixes, setup, scale, first=gnss[0])
        rows, key = judging_rows(schedule, fixes, setup.offsets, imu)
        key += number * RUN // 3
        found.append(InnovationSequence.of_run(done, schedule.time, rows, key))
    return InnovationSequence(
        *(
            np.concatenate([getattr(s, f) for s in found])
            for f in ("value", "variance", "time", "key")
        )
    )


def noise_scale(imu: ImuRecording, setup: RunSetup, level: FloatArray | None) -> FloatArray | None:
    """Return what multiplies the squared white-noise densities, vibration at its `level`."""
    scale = None
    if level is not None and setup.vibration.active:
        scale = setup.vibration.white_scale(level)
    return setup.condition.noise_scale(imu.time, scale, setup.model.white_density)


def filtered(
    imu: ImuRecording,
    fixes: GnssRecording,
    setup: RunSetup,
    scale: FloatArray | None,
    *,
    first: GnssRecording,
    nodes: float | None = None,
) -> tuple[AidingSchedule, FilterRun]:
    """Filter a drive from where the `first` of its recordings begins; no gate, nothing is refused.

    `nodes`: longest time between nodes, with what a smoother needs of them; None: none is kept.
    """
    schedule = setup.schedule(imu, fixes)
    done = run_in_segments(
        imu,
        setup.initial_state(imu, first),
        setup.restarts(first),
        setup.model,
        schedule,
        gate=gate_thresholds(0.0),
        white_scale=scale,
        vehicle=setup.vehicle_states,
        keep_samples=nodes is not None,
        keep_nodes=nodes is not None,
        node_interval=nodes or NO_NODES,
        smoother_memory=np.inf,
    )
    return schedule, done


def judging_rows(
    schedule: AidingSchedule, fixes: GnssRecording, offsets: TimeOffsets, imu: ImuRecording
) -> tuple[IntArray, IntArray]:
    """Rows of a schedule that judge, and a number for each that no time offset changes."""
    rows = np.flatnonzero(schedule.kind <= VELOCITY)
    shift = np.array([offsets.position, offsets.velocity])[schedule.kind[rows]]
    at = schedule.time[rows] - shift
    fix = epochs_at(fixes, at)
    key = fix + fixes.size * schedule.kind[rows]
    inside = (fixes.time[fix] > imu.time[0] + EDGE) & (fixes.time[fix] < imu.time[-1] - EDGE)
    kept = np.flatnonzero(inside if 2 * inside.sum() > rows.size else np.ones_like(inside))
    kept = kept[np.argsort(key[kept], kind="stable")]
    return rows[kept], key[kept]


def epochs_at(fixes: GnssRecording, time: FloatArray) -> IntArray:
    """Nearest epochs."""
    after = np.clip(np.searchsorted(fixes.time, time), 1, fixes.size - 1)
    return np.asarray(after - (time - fixes.time[after - 1] < fixes.time[after] - time))


# searches around the edge of the one before
WIDENINGS = 3
# offsets and noise are looked for in so much motion (s), at this speed or more (m/s): an hour
# tells hardly more
ENOUGH_MOTION = 400.0
LEAST_SPEED = 1.0


def velocity_lag(gnss: GnssRecording) -> float:
    """Delay of a receiver's velocity behind its position, from GNSS alone.

    Regression of (rate of position - velocity) on acceleration, horizontal components.
    """
    if gnss.velocity is None or gnss.size < 20:
        return 0.0
    from schuler.earth import ned_from_geodetic

    step = np.diff(gnss.time)
    local = ned_from_geodetic(gnss.position, gnss.position[0])[:, :2]
    span = (gnss.time[2:] - gnss.time[:-2])[:, None]
    regular = (span[:, 0] < 2.5 * np.median(step)) & (np.abs(np.diff(step)) < 0.1 * step[:-1])
    if regular.sum() < 10:
        return 0.0
    rate = (local[2:] - local[:-2]) / span
    velocity = gnss.velocity[:, :2]
    acceleration = (velocity[2:] - velocity[:-2]) / span
    left = (rate - velocity[1:-1])[regular].ravel()
    a = acceleration[regular].ravel()
    power = float(a @ a)
    if power <= 0.0:
        return 0.0
    lag = float(left @ a) / power
    sd = float(np.sqrt(np.mean((left - lag * a) ** 2) / power))
    return lag if abs(lag) > 3.0 * sd and abs(lag) < 1.0 else 0.0


def end_of_enough_motion(gnss: GnssRecording) -> float:
    """Time by which GNSS has moved for long enough."""
    from schuler.earth import ned_from_geodetic

    step = np.diff(gnss.time)
    way = np.diff(ned_from_geodetic(gnss.position, gnss.position[0])[:, :2], axis=0)
    moving = np.linalg.norm(way, axis=1) > LEAST_SPEED * step
    enough = np.flatnonzero(np.cumsum(np.where(moving, step, 0.0)) >= ENOUGH_MOTION)
    return float(gnss.time[enough[0] + 1] if enough.size else gnss.time[-1])


def enough_to_tune(imu: ImuRecording, gnss: GnssRecording, setup: RunSetup) -> float:
    """Time up to which a recording tells offsets and noise; its end, if it begins anew later."""
    stop = end_of_enough_motion(gnss) + 1.0
    later = any(r.time >= stop for r in setup.condition.restarts)
    return float(imu.time[-1]) if later else min(stop, float(imu.time[-1]))


def find_time_offset(
    imu: ImuRecording, gnss: GnssRecording, setup: RunSetup, *, reach: float = 1.0
) -> float:
    """Coarse search for the offset common to position and velocity, by likelihood."""

    def value(shift: float) -> float:
        offsets = TimeOffsets(setup.offsets.position + shift, setup.offsets.velocity + shift)
        return innovations(imu, [gnss], replace(setup, offsets=offsets)).log_likelihood

    centre = 0.0
    for _ in range(WIDENINGS):
        shifts = centre + np.arange(-reach, reach + 0.05, 0.1)
        values = np.array([value(float(s)) for s in shifts])
        best = int(np.argmax(values))
        if 0 < best < shifts.size - 1:
            left, top, right = values[best - 1 : best + 2]
            bend = left - 2.0 * top + right
            if bend < 0.0:
                return float(shifts[best] + 0.05 * (left - right) / bend)
            break
        # at the edge: the best may lie beyond
        centre = float(shifts[best])
    return float(shifts[best])
