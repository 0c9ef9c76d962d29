"""An IMU alone: strapdown without any aiding."""

from __future__ import annotations

import numpy as np

from schuler.data import ImuRecording
from schuler.navigation.aiding.schedule import POSITION, schedule_rows
from schuler.navigation.engine import InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_states import no_sensor_states
from schuler.types import FloatArray


def dead_reckon(
    imu: ImuRecording, position: FloatArray, velocity: FloatArray, rotation: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Integrate an IMU without any aiding."""
    nothing = schedule_rows(np.empty(0), POSITION, np.empty((0, 3)), np.empty((0, 3)))
    start = InitialState(position, velocity, rotation, np.empty(0), np.zeros((9, 9)))
    run = run_engine(
        imu, start, no_sensor_states(), nothing, gate=gate_thresholds(0.0), keep_nodes=False
    )
    return run.samples.position, run.samples.velocity, run.samples.rotation
