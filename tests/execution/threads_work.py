"""Print what a noise model, a drive and an array come to, bit by bit."""

from __future__ import annotations

import hashlib
import warnings

import numpy as np

from schuler import (
    NoiseModel,
    RandomWalk,
    Scenario,
    WhiteNoise,
    characterize_imu,
    navigate,
    simulate_drive,
    simulate_static,
)
from schuler.simulation.receivers import RTK_FIXED


def main() -> None:
    """Run the jobs and print a digest of the numbers of each."""
    warnings.simplefilter("ignore")
    noise = NoiseModel.isotropic(WhiteNoise(5e-5) + RandomWalk(1e-6), WhiteNoise(7e-4))
    log = simulate_static(noise, 600.0, 50.0, np.random.default_rng(7))
    print("noise", characterize_imu(log).noise_model.to_yaml())
    drive = simulate_drive(Scenario("car_urban", noise, RTK_FIXED, duration=110.0), seed=7)
    solution = navigate(drive.imus[0], drive.gnss, noise, smooth=True)
    for name in ("position", "velocity", "rotation"):
        print(name, hashlib.sha256(getattr(solution.trajectory, name).tobytes()).hexdigest())
    print("covariance", hashlib.sha256(solution.position_covariance.tobytes()).hexdigest())


if __name__ == "__main__":
    main()
