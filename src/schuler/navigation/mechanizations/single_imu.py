"""One IMU of an array by itself: its samples in the axes of the body, and what it starts from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.data.array import ImuArray
from schuler.errors import InputError
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.mechanizations.array_model import Fusion, fused_model
from schuler.navigation.mechanizations.array_preparation import (
    PreparedArray,
    merged_start,
    sensor_start,
)
from schuler.navigation.preparation.prepare import prepare_drive
from schuler.navigation.preparation.setup import RunSetup


def single_recording(array: ImuArray, imu: int) -> ImuRecording:
    """Return one IMU of an array in the axes of the body."""
    recording, c_bs = array.imu(imu), array.mounting.rotation[imu]
    return replace(recording, gyro=recording.gyro @ c_bs.T, accel=recording.accel @ c_bs.T)


def single_setup(
    prepared: PreparedArray, gnss: GnssRecording, imu: int
) -> tuple[ImuRecording, RunSetup]:
    """One IMU in the axes of the body, with its own alignment and the offsets of the array."""
    array, setup = prepared.array, prepared.setup
    if not 0 <= imu < array.count:
        raise InputError(f"IMU {imu}", expected=f"a number from 0 to {array.count - 1}")
    place, vehicle, settings = array.mounting.position[imu], setup.vehicle, prepared.settings
    known_errors = setup.measurements.correlated
    if isinstance(known_errors, GnssErrorModel):
        # one receiver: all IMUs see the errors that the fused one has found
        known_errors = replace(known_errors, fit=False, place=-1)
    own = prepare_drive(
        single_recording(array, imu),
        gnss,
        prepared.noise_models[imu],
        replace(
            settings,
            lever_arm=prepared.lever_arm - place,
            time_offset=(setup.offsets.position, setup.offsets.velocity),
            tune_noise=False,
            measurements=replace(settings.measurements, correlated=known_errors),
            mounting=settings.mounting if vehicle is None else vehicle.mounting,
        ),
    )
    c_bs = array.mounting.rotation[imu]
    alone = Fusion(c_bs, c_bs, c_bs.T, place)
    turned, merge = fused_model((prepared.models[imu],), alone)
    own_array = array.select([imu]).between(float(own.imu.time[0]), np.inf)
    start = sensor_start(own_array, (prepared.models[imu],), alone, own.setup.alignment)
    known = replace(
        own.setup,
        factors=setup.factors,
        vibration=setup.vibration,
        sensor_start=merged_start(start, merge),
    )
    return own.imu, known.with_sensors(turned)
