"""A long life for one stream: hours at a high rate, poles, heights, slow and fast receivers.

    python -m benchmarks.endurance [--hours 24] [--rate 200] [--places]

The long run stands for an hour, drives on a circle, and has GNSS outages of an hour; a sensor with
white noise and a wandering bias is drawn sample by sample, so that nothing is kept. Judged: finite
states, a covariance that is symmetric and positive, NEES of position over 3 outside of outages
between 1/BAND and BAND, and memory that does not grow after the first tenth (by at most 20 MB).
`--places` goes to poles, date line, -400 m, 40 km, and GNSS of 0.01 to 20 Hz, minutes each. The
command ends with exit code 1 when anything is missed.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from schuler import (
    InitialState,
    NavigationFilter,
    NoiseModel,
    RandomWalk,
    SensorErrorModel,
    WhiteNoise,
    earth,
    gate_thresholds,
    sensor_error_model,
)
from schuler.errors import SchulerError
from schuler.rotations import dcm_from_euler

BAND = 3.0
GROWTH = 20e6
POSITION_SD, VELOCITY_SD = 0.5, 0.1
GYRO_N, ACCEL_N = 5e-5, 7e-4
SPEED, TURN = 10.0, 0.02
CHUNK = 100_000


@dataclass(frozen=True)
class Run:
    """One stream: where, how long, and with what.

    Parameters
    ----------
    name : str
        For people.
    duration, rate, gnss_rate : float
        s and Hz.
    latitude, longitude, height : float
        Degrees and m.
    standing : float
        Seconds at rest in the beginning.
    outages : tuple of (float, float)
        Start and length, s.
    """

    name: str
    duration: float
    rate: float = 100.0
    gnss_rate: float = 1.0
    latitude: float = 48.0
    longitude: float = 11.0
    height: float = 500.0
    standing: float = 20.0
    outages: tuple[tuple[float, float], ...] = ()


PLACES = (
    Run("usual", 300.0),
    Run("near the north pole", 300.0, latitude=89.9),
    Run("2.2 km from north pole", 300.0, latitude=89.98),
    Run("2.2 km from south pole", 300.0, latitude=-89.98),
    Run("date line", 300.0, longitude=179.9999),
    Run("-400 m", 300.0, height=-400.0),
    Run("40 km", 300.0, height=40e3),
    Run("GNSS 0.01 Hz", 1500.0, gnss_rate=0.01),
    Run("GNSS 0.1 Hz", 600.0, gnss_rate=0.1),
    Run("GNSS 20 Hz", 300.0, gnss_rate=20.0),
)


class Circle:
    """A level circle in the tangent plane of a place, exact up to the curvature of the Earth.

    The truth is integrated with the same closed form for rate and force, which are those of a
    vehicle that follows it: the curvature, transport rate and Coriolis force are put in.
    """

    def __init__(self, run: Run, rng: np.random.Generator) -> None:
        self.run, self.rng = run, rng
        self.start = np.array([np.radians(run.latitude), np.radians(run.longitude), run.height])
        # constants as large as the filter expects
        self.bias = rng.normal(size=6) * np.repeat([1e-4, 0.01], 3)

    def motion(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, velocity NED, and heading."""
        moving = np.clip(t - self.run.standing, 0.0, None)
        # The rate of turn grows from zero, so that force and rate are smooth.
        pace = SPEED * np.clip(moving / 20.0, 0.0, 1.0)
        way = SPEED * np.where(moving < 20.0, moving**2 / 40.0, moving - 10.0)
        heading = TURN * way / SPEED
        north = SPEED / TURN * np.sin(heading)
        east = SPEED / TURN * (1.0 - np.cos(heading))
        metres_north, metres_east = earth.metres_per_radian(self.start)
        position = np.column_stack(
            [
                self.start[0] + north / metres_north,
                self.start[1] + east / metres_east,
                np.full(t.size, self.start[2]),
            ]
        )
        velocity = np.column_stack([pace * np.cos(heading), pace * np.sin(heading), 0.0 * t])
        return position, velocity, heading

    def samples(self, first: int, last: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return time, gyro and accel of samples `first` to `last`."""
        dt = 1.0 / self.run.rate
        edges = np.arange(first - 1, last) * dt
        position, velocity, heading = self.motion(edges)
        middle = 0.5 * (edges[1:] + edges[:-1])
        p, v, _ = self.motion(middle)
        true_velocity = self._exact(p, v)
        exact = self._exact(position, velocity)
        turn = earth.earth_rate_ned(p[:, 0]), earth.transport_rate_ned(p, true_velocity)
        acceleration = np.diff(exact, axis=0) / dt
        force = acceleration + np.cross(2.0 * turn[0] + turn[1], true_velocity)
        force[:, 2] -= earth.gravity(p[:, 0], p[:, 2])
        yaw = 0.5 * (heading[1:] + heading[:-1])
        c_bn = dcm_from_euler(np.zeros_like(yaw), np.zeros_like(yaw), yaw).transpose(0, 2, 1)
        gyro = np.einsum("nij,nj->ni", c_bn, turn[0] + turn[1])
        gyro[:, 2] += np.diff(heading) / dt
        accel = np.einsum("nij,nj->ni", c_bn, force)
        n = last - first
        walk = np.cumsum(self.rng.normal(size=(n, 6)), axis=0) * np.sqrt(dt)
        walk = self.bias + walk * np.repeat([1e-6, 1e-5], 3)
        self.bias = walk[-1]
        noise = self.rng.normal(size=(n, 6)) * np.repeat([GYRO_N, ACCEL_N], 3) / np.sqrt(dt)
        return edges[1:], gyro + (noise + walk)[:, :3], accel + (noise + walk)[:, 3:]

    def _exact(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Velocity that belongs to the changes of latitude and longitude."""
        start_north, start_east = earth.metres_per_radian(self.start)
        north, east = earth.metres_per_radian(position)
        scale = np.column_stack([north / start_north, east / start_east, np.ones_like(north)])
        return np.asarray(velocity * scale)


def resident() -> float:
    """Bytes of this process in memory."""
    words = Path("/proc/self/statm").read_text(encoding="ascii").split()
    return float(words[1]) * os.sysconf("SC_PAGE_SIZE")


def endure(run: Run, seed: int = 1) -> list[str]:
    """Run one stream, print what happened, and return what was missed."""
    rng = np.random.default_rng(seed)
    circle = Circle(run, rng)
    noise = NoiseModel.isotropic(
        WhiteNoise(GYRO_N) + RandomWalk(1e-6), WhiteNoise(ACCEL_N) + RandomWalk(1e-5)
    )
    model = sensor_error_model(noise, turn_on_accel=0.01, turn_on_gyro=1e-4)
    began, squares, count, missed = time.monotonic(), 0.0, 0, []
    memory: list[float] = []
    filter_ = None
    total, next_fix = int(run.duration * run.rate), 0.0
    worst = 0.0
    try:
        for first in range(1, total, CHUNK):
            times, gyros, accels = circle.samples(first, min(first + CHUNK, total))
            for now, gyro, accel in zip(times.tolist(), gyros, accels, strict=True):
                if filter_ is None:
                    filter_ = _started(circle, model, now)
                filter_.add_imu(now, gyro, accel)
                if now < next_fix:
                    continue
                next_fix += 1.0 / run.gnss_rate
                position, velocity, _ = circle.motion(np.array([now]))
                velocity = circle._exact(position, velocity)
                out = any(a <= now < a + length for a, length in run.outages)
                settled = not any(a <= now < a + length + 60.0 for a, length in run.outages)
                if settled and now > 60.0:
                    state = filter_.state()
                    covariance = state.covariance
                    part = covariance[:3, :3]
                    error = _metres(state.position, position[0])
                    squares += float(error @ np.linalg.solve(part, error)) / 3.0
                    count += 1
                    if count % 500 == 1:
                        worst = max(worst, float(np.abs(covariance - covariance.T).max()))
                        if np.linalg.eigvalsh(covariance).min() <= 0.0:
                            missed.append(f"{run.name}: covariance not positive at {now:.0f} s")
                if not out:
                    noisy = position[0] + _radians(POSITION_SD * rng.normal(size=3), position[0])
                    speed = velocity[0] + VELOCITY_SD * rng.normal(size=3)
                    filter_.add_gnss(
                        now, noisy, np.full(3, POSITION_SD), speed, np.full(3, VELOCITY_SD)
                    )
            memory.append(resident())
    except SchulerError as error:
        missed.append(f"{run.name}: {error}")
    ratio = squares / max(count, 1)
    # the first pieces fill caches
    early = memory[min(max(2, len(memory) // 10), len(memory) - 1)] if memory else 0.0
    growth = (memory[-1] - early) / 1e6 if memory else 0.0
    print(
        f"{run.name:22} {total:9d} samples in {time.monotonic() - began:6.0f} s, "
        f"NEES/3 {ratio:6.2f} of {count}, asymmetry {worst:.1e}, memory {growth:+.1f} MB",
        flush=True,
    )
    if not 1.0 / BAND < ratio < BAND:
        missed.append(f"{run.name}: NEES/3 {ratio:.2f}")
    if growth > GROWTH / 1e6:
        missed.append(f"{run.name}: memory grew by {growth:.0f} MB")
    return missed


def _started(circle: Circle, model: SensorErrorModel, now: float) -> NavigationFilter:
    position, velocity, heading = circle.motion(np.array([now]))
    covariance = np.zeros((9 + model.size, 9 + model.size))
    sd = [*[1.0] * 3, *[0.1] * 3, *np.radians([0.1, 0.1, 1.0])]
    covariance[:9, :9] = np.diag(np.square(sd))
    covariance[9:, 9:] = model.initial_covariance
    initial = InitialState(
        position[0],
        velocity[0],
        dcm_from_euler(0.0, 0.0, heading[0]),
        np.zeros(model.size),
        covariance,
    )
    return NavigationFilter(initial, model, rate=circle.run.rate, gate=gate_thresholds(0.0))


def _metres(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    north, east = earth.metres_per_radian(other)
    apart = one - other
    apart[1] = (apart[1] + np.pi) % (2.0 * np.pi) - np.pi
    return np.asarray(apart * (float(north), float(east), -1.0))


def _radians(metres: np.ndarray, at: np.ndarray) -> np.ndarray:
    north, east = earth.metres_per_radian(at)
    return np.asarray(metres / (float(north), float(east), -1.0))


def main() -> int:
    """Run and judge."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--rate", type=float, default=200.0)
    parser.add_argument("--places", action="store_true", help="poles, heights, rates of GNSS")
    options = parser.parse_args()
    if options.places:
        missed = [m for run in PLACES for m in endure(run)]
    else:
        seconds = 3600.0 * options.hours
        third = seconds / 3.0
        outages = ((third, seconds / 24.0), (2.0 * third, seconds / 24.0))
        missed = endure(
            Run("long", seconds, options.rate, standing=seconds / 24.0, outages=outages)
        )
    for what in missed:
        print(f"MISSED {what}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
