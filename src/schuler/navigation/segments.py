"""A run in segments: where the filter begins anew, with the sensor errors it has learnt.

A long gap or an axis that was stuck for long leaves nothing of attitude, and of velocity only what
GNSS tells. The filter then stops and starts again like at the beginning, from an alignment of its
own, but the states of the sensor errors go on: they only forget what their processes forget in
the time between. The segments are joined into one run, in which the transition over the break lets
nothing of the navigation states through, so that the smoother looks back through the sensor errors
alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.kernels.navigation.filter_data import AidingOutputs, NodeOutputs, SampleOutputs
from schuler.navigation.aiding.schedule import AidingSchedule
from schuler.navigation.engine import FilterRun, run_engine
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.stepping import InitialState
from schuler.types import FloatArray

DOUBLINGS = 6
KEPT_BY_SEGMENTS = ("covariance", "top", "transition", "error", "aid")


def run_in_segments(
    imu: ImuRecording,
    initial: InitialState,
    restarts: Sequence[tuple[float, InitialState]],
    model: SensorErrorModel,
    schedule: AidingSchedule,
    *,
    white_scale: FloatArray | None = None,
    **options: Any,
) -> FilterRun:
    """Run the filter over a recording, beginning anew where it has to."""
    if not restarts:
        return run_engine(imu, initial, model, schedule, white_scale=white_scale, **options)
    runs: list[FilterRun] = []
    breaks: list[FloatArray] = []
    end = 0.0
    for part in split_at_restarts(imu, initial, restarts, schedule, white_scale):
        begin = part.start
        if runs and begin.sensors_anew:
            breaks.append(np.zeros((model.size, model.size)))
        elif runs:
            full, noise = sensor_step(model, float(part.imu.time[0] - end))
            breaks.append(full)
            begin = _carried(begin, runs[-1].final, full, noise)
        end = float(part.imu.time[-1])
        runs.append(
            run_engine(
                part.imu, begin, model, part.schedule, white_scale=part.white_scale, **options
            )
        )
    return _joined(runs, model, breaks)


@dataclass(frozen=True, slots=True, eq=False)
class RunSegment:
    """A stretch between two restarts, with what belongs to it."""

    imu: ImuRecording  # its samples
    start: InitialState  # at its first sample; sensor states as if nothing was before.
    schedule: AidingSchedule  # measurements from its first sample to that of the next segment
    white_scale: FloatArray | None  # (n, 6): of its samples


def split_at_restarts(
    imu: ImuRecording,
    initial: InitialState,
    restarts: Sequence[tuple[float, InitialState]],
    schedule: AidingSchedule,
    white_scale: FloatArray | None = None,
) -> list[RunSegment]:
    """Cut a run at its restarts."""
    edges = [0, *(int(np.searchsorted(imu.time, t - 1e-6)) for t, _ in restarts), imu.size]
    starts = [initial, *(state for _, state in restarts)]
    whole = [
        (a, b, start)
        for a, b, start in zip(edges[:-1], edges[1:], starts, strict=True)
        if b - a >= 2
    ]
    # what is measured between two segments stays with the first and is never reached
    begins = [float(imu.time[a]) for a, _, _ in whole]
    places = [0, *np.searchsorted(schedule.time, begins[1:], side="left"), schedule.size]
    segments = []
    for k, (a, b, start) in enumerate(whole):
        part = replace(
            imu, time=imu.time[a:b], gyro=imu.gyro[a:b], accel=imu.accel[a:b], temperature=None
        )
        rows = slice(int(places[k]), int(places[k + 1]))
        scale = None if white_scale is None else white_scale[a:b]
        segments.append(RunSegment(part, start, schedule.select(rows), scale))
    return segments


def sensor_step(model: SensorErrorModel, span: float) -> tuple[FloatArray, FloatArray]:
    """Transition and noise of the sensor states over some time."""
    from schuler.kernels.navigation.transition import raise_blocks, sensor_transition, set_blocks

    layout, m = model.layout(), model.size
    rows, added = np.zeros_like(layout.drift), np.zeros_like(layout.drift)
    # doubled so often: the noise of pairs is a trapezoid, good for short steps
    sensor_transition(
        span / 2.0**DOUBLINGS,
        layout.drift,
        layout.diffusion,
        layout.block,
        layout.interval,
        rows,
        added,
    )
    full, noise = _matrix(rows, layout.block), _matrix(added, layout.block)
    for _ in range(DOUBLINGS):
        noise = noise + full @ noise @ full.T
        full = full @ full
    if model.blocks:
        steps = np.zeros(m, dtype=np.int64)
        power, power_noise = np.zeros_like(rows), np.zeros_like(rows)
        raise_blocks(
            span,
            layout.drift,
            layout.diffusion,
            layout.block,
            layout.interval,
            steps,
            power,
            power_noise,
        )
        set_blocks(True, layout.block, layout.interval, power, power_noise, rows, added)
        discrete = np.ix_(layout.interval > 0.0, layout.interval > 0.0)
        full[discrete] = _matrix(rows, layout.block)[discrete]
        noise[discrete] = _matrix(added, layout.block)[discrete]
    return full, 0.5 * (noise + noise.T)


def _matrix(rows: FloatArray, block: NDArray[np.int64]) -> FloatArray:
    m = block.shape[0]
    full = np.zeros((m, m))
    for j in range(m):
        first, size = block[j]
        full[j, first : first + size] = rows[j, :size]
    return full


def _carried(
    start: InitialState, final: InitialState, full: FloatArray, noise: FloatArray
) -> InitialState:
    """Navigation from the alignment, sensor states from the end of the segment before."""
    covariance = np.zeros_like(start.covariance)
    covariance[:9, :9] = start.covariance[:9, :9]
    covariance[9:, 9:] = full @ final.covariance[9:, 9:] @ full.T + noise
    return replace(start, sensor_state=full @ final.sensor_state, covariance=covariance)


def _joined(runs: list[FilterRun], model: SensorErrorModel, breaks: list[FloatArray]) -> FilterRun:
    """One run that keeps its segments for the smoother."""
    s = 9 + model.size
    none = NodeOutputs.empty(0, 0, s, runs[0].nodes.transition.shape[2])
    aiding = AidingOutputs.empty(0, 0, s)

    def stacked(kind: type, parts: list[Any], without: Any, names: tuple[str, ...]) -> Any:
        return kind(
            **{
                f.name: getattr(without, f.name)
                if f.name in names
                else np.concatenate([getattr(p, f.name) for p in parts])
                for f in fields(kind)
            }
        )

    return FilterRun(
        samples=stacked(SampleOutputs, [r.samples for r in runs], None, ()),
        aiding=stacked(AidingOutputs, [r.aiding for r in runs], aiding, ("row", "gain")),
        nodes=stacked(NodeOutputs, [r.nodes for r in runs], none, KEPT_BY_SEGMENTS),
        log_likelihood=float(sum(r.log_likelihood for r in runs)),
        final=runs[-1].final,
        pieces=tuple(runs),
        breaks=tuple(breaks),
    )
