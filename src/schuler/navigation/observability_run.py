"""Observability along a run: its motion, the prior of its filter, what the filter learnt."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from schuler import earth
from schuler.data import GnssRecording, ImuRecording, Trajectory
from schuler.data.to_dict import ToDict
from schuler.errors import InputError
from schuler.navigation.aiding.parity import parity_rows
from schuler.navigation.engine import gate_thresholds, run_engine
from schuler.navigation.mechanizations.array_preparation import PreparedArray
from schuler.navigation.observability import (
    Gramian,
    Observability,
    Segment,
    covariance_decay,
    gramian,
    observability,
)
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.settings import FALSE_ALARM
from schuler.types import FloatArray

SEGMENT = 5.0
"""Seconds over which force and attitude are averaged."""
MOST_DIFFERENT = 5
"""Segments of the total observability matrix."""


@dataclass(frozen=True, slots=True, eq=False)
class RunObservability(ToDict):
    """What a run shows of the state of its filter."""

    JSON = (
        "title rank=matrix.rank practical_rank=matrix.practical_rank "
        "singular_values_relative=matrix.relative "
        "information_over_prior=information.information directions_learnt=information.learnt "
        "sentences"
    )

    title: str  # which filter
    matrix: Observability  # of the most different stretches of the run
    information: Gramian  # of the whole run, with the noise of GNSS and the prior
    time: FloatArray  # (k,): seconds since the start
    decay: FloatArray  # (k, s): standard deviations of the filter as shares of those at the start

    def sentences(self) -> tuple[str, ...]:
        """Say in words what the run shows and what it does not."""
        names = self.matrix.names
        last = self.decay[-1]
        best = np.argsort(last)[:3]
        still = [names[j] for j in range(len(names)) if last[j] > 0.9]
        told = [
            *self.matrix.sentences(),
            f"Over the run the measurements outweigh the prior in {self.information.learnt} of "
            f"{len(names)} directions.",
            "Learnt best: "
            + ", ".join(f"{names[j]} (to {100.0 * last[j]:.2g} % of the start)" for j in best)
            + ".",
        ]
        if still:
            shown = ", ".join(still[:6]) + (f" and {len(still) - 6} more" if len(still) > 6 else "")
            told.append(f"Hardly learnt (above 90 % of the start): {shown}.")
        return tuple(told)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        names = self.matrix.names
        return ToDict.to_dict(self) | {
            "states": len(names),
            "unseen_share": dict(zip(names, self.matrix.unseen_share.tolist(), strict=True)),
            "final_share_of_initial_sd": dict(zip(names, self.decay[-1].tolist(), strict=True)),
        }


def segments_of(trajectory: Trajectory, length: float = SEGMENT) -> tuple[Segment, ...]:
    """Cut a run into stretches and take the mean force and the attitude of each."""
    time = trajectory.time
    count = int((time[-1] - time[0]) / length)
    if count < 1:
        raise InputError(f"a run of {time[-1] - time[0]:.1f} s", expected=f"at least {length:g} s")
    edges = np.searchsorted(time, time[0] + length * np.arange(count + 1))
    edges = np.minimum(edges, time.size - 1)
    made = []
    for a, b in pairwise(edges):
        middle = (a + b) // 2
        span = float(time[b] - time[a])
        position = trajectory.position[middle]
        pull = np.array([0.0, 0.0, float(earth.gravity(position[0], position[2]))])
        force = (trajectory.velocity[b] - trajectory.velocity[a]) / span - pull
        rate = earth.earth_rate_ned(position[0]) + earth.transport_rate_ned(
            position, trajectory.velocity[middle]
        )
        made.append(Segment(force, trajectory.rotation[middle], span, np.asarray(rate)))
    return tuple(made)


def most_different(
    segments: tuple[Segment, ...], count: int = MOST_DIFFERENT
) -> tuple[Segment, ...]:
    """Choose the stretches that differ most in force and attitude, in the order of time."""
    feature = np.array([np.concatenate([s.force / 9.8, s.rotation.ravel()]) for s in segments])
    chosen = [0]
    while len(chosen) < min(count, len(segments)):
        away = np.min([np.linalg.norm(feature - feature[c], axis=1) for c in chosen], axis=0)
        if away.max() < 1e-3:
            break
        chosen.append(int(np.argmax(away)))
    return tuple(segments[c] for c in sorted(chosen))


def observe(
    title: str,
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    *,
    parity: FloatArray | None = None,
    segments: tuple[Segment, ...] | None = None,
) -> RunObservability:
    """Filter a run and analyse what it shows of the state."""
    initial = setup.initial_state(imu, gnss)
    run = run_engine(
        imu,
        initial,
        setup.model,
        setup.schedule(imu, gnss),
        gate=gate_thresholds(FALSE_ALARM),
        white_scale=setup.white_scale(imu),
        keep_nodes=False,
        node_interval=1e9,
    )
    if segments is None:
        path = Trajectory(
            imu.time, run.samples.position, run.samples.velocity, run.samples.rotation
        )
        segments = segments_of(path)
    # the prior of the filter at the start, biases seen at rest included
    model = replace(setup.model, initial_covariance=initial.covariance[9:, 9:])
    node = np.clip(np.searchsorted(imu.time, run.nodes.time - 1e-9), 0, imu.size - 1)
    samples = run.samples
    deviations = np.hstack(
        [
            np.sqrt(np.einsum("kii->ki", samples.position_covariance[node])),
            samples.velocity_sd[node],
            samples.attitude_sd[node],
            run.nodes.sensor_sd,
        ]
    )
    # before the first measurement
    deviations[0] = np.sqrt(np.diag(initial.covariance))
    assert gnss.position_sd is not None
    finite = gnss.position_sd[np.isfinite(gnss.position_sd)]
    sd = float(np.median(finite)) * setup.factors.position_sd if finite.size else 1.0
    return RunObservability(
        title=title,
        matrix=observability(
            setup.model, most_different(segments), rows=parity, velocity=gnss.velocity is not None
        ),
        information=gramian(
            model, segments, initial.covariance, position_sd=sd, rows=parity,
            interval=max(1.0, float(np.median(np.diff(gnss.time))) if gnss.size > 1 else 1.0),
        ),
        time=run.nodes.time - run.nodes.time[0],
        decay=covariance_decay(deviations),
    )  # fmt: skip


def observe_array(prepared: PreparedArray, gnss: GnssRecording) -> tuple[RunObservability, ...]:
    """Analyse the synthetic and the extended filter of an array, without and with parity."""
    extended = prepared.extended_setup(parity=True)
    rows = np.vstack(parity_rows(prepared.models, prepared.fusion, extended.model.size))
    rows = np.hstack([np.zeros((rows.shape[0], 9)), rows])
    imu = prepared.recording
    return (
        observe("synthetic", imu, gnss, prepared.synthetic_setup()),
        observe("extended, without parity", imu, gnss, prepared.extended_setup(parity=False)),
        observe("extended, with parity", imu, gnss, extended, parity=rows),
    )


def observed_states(result: RunObservability) -> list[tuple[str, float, float]]:
    """Return name, unseen share and final share of the initial sd of every state."""
    return list(
        zip(
            result.matrix.names,
            result.matrix.unseen_share.tolist(),
            result.decay[-1].tolist(),
            strict=True,
        )
    )
