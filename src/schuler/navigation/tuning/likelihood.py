"""How likely the innovations of a drive are, GNSS thinned or not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.schedule import VELOCITY
from schuler.navigation.engine import gate_thresholds
from schuler.navigation.innovation_likelihood import InnovationSequence
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.segments import run_in_segments
from schuler.types import FloatArray


def innovations(
    imu: ImuRecording,
    gnss: Sequence[GnssRecording],
    setup: RunSetup,
    level: FloatArray | None = None,
) -> InnovationSequence:
    """Filter a drive once for every thinning of GNSS and gather the innovations of GNSS.

    What is known of a vehicle takes part in the filter, but only GNSS judges.
    """
    initial = setup.initial_state(imu, gnss[0])
    gate = gate_thresholds(0.0)
    scale = None
    if level is not None and setup.vibration.active:
        scale = setup.vibration.white_scale(level)
    scale = setup.condition.noise_scale(imu.time, scale, setup.model.white_density)
    restarts = setup.restarts(gnss[0])
    found = []
    for fixes in gnss:
        schedule = setup.schedule(imu, fixes)
        done = run_in_segments(
            imu,
            initial,
            restarts,
            setup.model,
            schedule,
            gate=gate,
            white_scale=scale,
            vehicle=setup.vehicle_states,
            keep_samples=False,
            keep_nodes=False,
            node_interval=1e9,
        )
        found.append(InnovationSequence.of_run(done, schedule.time, schedule.kind <= VELOCITY))
    return InnovationSequence(
        *(np.concatenate([getattr(s, f) for s in found]) for f in ("value", "variance", "time"))
    )
