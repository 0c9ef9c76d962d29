"""Whether a drive contradicts the noise model that was told.

A model of a static log knows nothing of engines and rotors: narrow bands of vibration reach down
to the frequencies at which a filter integrates, and there the noise is tens of times as large as
told. Whoever knows nothing of that would get a position whose claim is false. Where the samples
scatter more than the model says, the drive is asked: by how much do innovations of GNSS become
more likely when the noise is free, the receiver's own errors being free both times?
"""

from __future__ import annotations

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.innovation_likelihood import slower_imu, thin
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup
from schuler.navigation.tuning.likelihood import enough_to_tune, innovations
from schuler.navigation.tuning.tune import Sought, tune
from schuler.screening.screen import Finding
from schuler.types import FloatArray

LEAST_SCATTER = 2.0
"""Mean squares of differences over those of the model's white noise: less is motion."""
LEAST_GAIN = 15.0
"""Nats; drives whose noise was told rightly gain 6 at most (ten parameters, thinned runs)."""
CONTRADICTING = 1.3
"""Mean normalised square of the innovations; what fits better need not be asked."""
FEWEST_FIXES = 20
NOISE = ("white", "drive", "vibration")


def scatter(imu: ImuRecording, white_density: FloatArray) -> FloatArray:
    """Mean squares of neighbours' differences (6,) over what white noise of some density makes."""
    values = np.concatenate([imu.accel, imu.gyro], axis=1)
    square = np.mean(np.diff(values, axis=0) ** 2, axis=0)
    told: FloatArray = 2.0 * np.maximum(white_density, 1e-12) ** 2 * imu.rate
    return np.asarray(square / told)


def contradicting_noise(
    imu: ImuRecording, gnss: GnssRecording, setup: RunSetup
) -> NoiseFactors | None:
    """Factors that GNSS wants where samples scatter more than the noise of a setup; else None."""
    gnss = setup.condition.usable(gnss)
    shaken = np.any(scatter(imu, setup.model.white_density) > LEAST_SCATTER)
    if not shaken or gnss.size < FEWEST_FIXES:
        return None
    slow = slower_imu(imu)
    if innovations(slow, [thin(gnss, 1.0)], setup).misfit < CONTRADICTING:
        return None
    until = enough_to_tune(imu, gnss, setup)
    free = Sought("channels", offsets=False, until=until)
    held = {name: 0.0 for name in free.names(setup, gnss) if name.startswith(NOISE)}
    told = tune(imu, gnss, setup, Sought("channels", False, fixed=held, until=until))
    found = tune(imu, gnss, setup, free)
    gain = found.log_likelihood - told.log_likelihood
    return found.setup.factors if gain > LEAST_GAIN else None


def tuned_after_all(factors: NoiseFactors) -> Finding:
    """Say that the noise is not the one that was told."""
    accel, gyro = factors.white[:3].max(), factors.white[3:].max()
    return Finding(
        "noise",
        "info",
        "samples scatter more than the noise model says, as where an IMU shakes, and GNSS "
        "contradicts the model: the noise was tuned to the drive (white noise at most "
        f"{accel:.3g} times as told in accelerometers, {gyro:.3g} in gyros)",
        value=float(max(accel, gyro)),
        cure="--no-tune-noise takes the noise model as it was told",
    )
