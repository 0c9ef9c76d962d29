"""The embedded example: a static log and a drive of the same simulated sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.data.trajectory import Trajectory
    from schuler.noise.noise_model import NoiseModel
    from schuler.simulation import Profile

EXAMPLE_RATE = 100.0
STATIC_HOURS = 2.0
SEEDS = {"static log": 20100, "drive": 20131, "GNSS": 20132}


@dataclass(frozen=True, slots=True)
class ExampleDrive:
    """A drive with its truth.

    Parameters
    ----------
    imu : ImuRecording
        What the sensor recorded.
    gnss : GnssRecording
        What the receiver recorded.
    truth : Trajectory
        What really happened, at the stamps of the IMU.
    """

    imu: ImuRecording
    gnss: GnssRecording
    truth: Trajectory


def example_noise() -> NoiseModel:
    """Return the noise of a consumer-grade MEMS sensor."""
    from schuler.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
    from schuler.units import parse

    gyro = WhiteNoise(parse("0.3 deg/sqrt(h)", "gyro white noise")) + GaussMarkov(
        sigma=parse("12 deg/h", "gyro bias"), correlation_time=200.0
    )
    accel = (
        WhiteNoise(parse("0.045 m/s/sqrt(h)", "accel white noise"))
        + GaussMarkov(sigma=parse("0.14 mg", "accel bias"), correlation_time=15.0)
        + RandomWalk(parse("12 m/s/h^1.5", "accel random walk"))
    )
    processes = {f"gyro_{a}": gyro for a in "xyz"} | {f"accel_{a}": accel for a in "xyz"}
    return NoiseModel(processes, rate=EXAMPLE_RATE, source="embedded example")


def example_static() -> ImuRecording:
    """Return a log of the sensor lying still."""
    import numpy as np

    from schuler.simulation import simulate_static

    rng = np.random.default_rng(SEEDS["static log"])
    return simulate_static(
        example_noise(), STATIC_HOURS * 3600.0, EXAMPLE_RATE, rng, name="simulated static log"
    )


def example_drive(duration: float, standstill: float = 60.0) -> ExampleDrive:
    """Return a drive through a town."""
    import numpy as np

    from schuler.simulation import car_urban, ideal_imu, simulate_gnss, simulate_imu

    rng = np.random.default_rng(SEEDS["drive"])
    profile: Profile = car_urban(duration, rng, standstill=standstill)
    imu = simulate_imu(
        ideal_imu(profile, EXAMPLE_RATE), example_noise(), rng, name="simulated drive"
    )
    gnss = simulate_gnss(
        profile,
        1.0,
        position_sd=0.05,
        velocity_sd=0.03,
        rng=np.random.default_rng(SEEDS["GNSS"]),
        name="simulated GNSS",
    )
    return ExampleDrive(imu, gnss, profile.trajectory(imu.time))
