"""CPU time a sample of the filter, beside a plain NumPy twin of the same filter.

100 Hz IMU, GNSS position and velocity once a second; 15 states and more (states are added to the
sensors' error models, at 23 those of a vehicle), with storage for the smoother, and the smoother
itself. The twin does the
same in dense 15 x 15 matrices, on the first minute of the same drive; both trajectories are
compared, so that the comparison is of like with like. `python -m benchmarks.filter_speed`, or
with `--against PATH` the ratio to another checkout, in turn with it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.against import least_in_turn
from schuler.data import CHANNELS, ImuRecording
from schuler.navigation.aiding.schedule import POSITION, AidingSchedule
from schuler.navigation.aiding.vehicle import with_vehicle_states
from schuler.navigation.engine import InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_error_model import SensorErrorModel, sensor_error_model
from schuler.navigation.smoother import smooth_run
from schuler.noise import GaussMarkov, RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel

Array = NDArray[np.float64]

DURATION = 600.0
TWIN_DURATION = 60.0
REPEATS = 7
STATES = (15, 23, 33, 57, 105)
LEAST_RATIO = 48.0
# microseconds a sample
MOST = {15: 0.8, 33: 4.0}
MOST_STORED = {23: 1.2}
MOST_SMOOTHER = {15: 2.0, 23: 2.0, 33: 2.0}
LEVER = np.array([0.8, -0.4, -1.3])
EARTH_RATE = 7.292115e-5
# in turn with another checkout
ROUNDS = 60
COMPARED = (15, 23, 33)
CODE = """
import time
import benchmarks.filter_speed as b
# short, so that a run often passes undisturbed
b.DURATION = 120.0
imu, schedule, start = b.recordings()
gate, kept = b.gate_thresholds(0.0), {}

def answer(states):
    model = b.sensor_model(states)
    begin = b.started(start, model)
    clock = [time.process_time()]
    b.run_engine(imu, begin, model, schedule, gate=gate, keep_nodes=False)
    clock.append(time.process_time())
    run = b.run_engine(imu, begin, model, schedule, gate=gate)
    clock.append(time.process_time())
    b.smooth_run(run, model, imu.time)
    clock.append(time.process_time())
    return [(b - a) / imu.size * 1e6 for a, b in zip(clock, clock[1:])]
"""


def sensor_model(states: int) -> SensorErrorModel:
    """A random walk on every channel and as many Gauss-Markov processes as it takes."""
    if states == 23:
        return with_vehicle_states(sensor_model(15))
    more = (states - 15) // 6
    times = np.geomspace(1.0, 1000.0, more) if more > 1 else np.full(more, 30.0)
    accel = WhiteNoise(3e-3) + RandomWalk(2e-4, initial_sd=0.05)
    gyro = WhiteNoise(3e-4) + RandomWalk(5e-6, initial_sd=2e-3)
    for tc in times:
        accel += GaussMarkov(3e-3, float(tc))
        gyro += GaussMarkov(1e-4, float(tc))
    noise = NoiseModel(
        processes={c: gyro if c.startswith("gyro") else accel for c in CHANNELS},
        source="benchmark",
    )
    model = sensor_error_model(noise, turn_on_accel=0.0, turn_on_gyro=0.0)
    assert 9 + model.size == states
    return model


def recordings() -> tuple[ImuRecording, AidingSchedule, InitialState]:
    """A simulated drive; the state starts at the truth, with the covariance of 15 states."""
    from schuler.navigation.aiding.gnss import GnssPosition, GnssVelocity
    from schuler.navigation.aiding.schedule import merge_schedules
    from schuler.simulation import car_urban, ideal_imu, simulate_gnss, simulate_imu

    rng = np.random.default_rng(1)
    profile = car_urban(DURATION, 3, standstill=10.0)
    noise = NoiseModel(
        processes={
            c: WhiteNoise(3e-4 if c.startswith("gyro") else 3e-3) + RandomWalk(1e-6)
            for c in CHANNELS
        },
        source="benchmark",
    )
    imu = simulate_imu(ideal_imu(profile, 100.0), noise, rng)
    gnss = simulate_gnss(
        profile, 1.0, position_sd=0.5, velocity_sd=0.05, lever_arm=LEVER, rng=rng, start=1.0
    )
    rows = [source(gnss, LEVER).rows() for source in (GnssPosition, GnssVelocity)]
    schedule = merge_schedules(rows, float(imu.time[0]), float(imu.time[-1]))
    truth = profile.trajectory(imu.time[:1])
    start = InitialState(
        truth.position[0], truth.velocity[0], truth.rotation[0], np.empty(0), np.empty((0, 0))
    )
    return imu, schedule, start


def started(start: InitialState, model: SensorErrorModel) -> InitialState:
    covariance = np.zeros((9 + model.size, 9 + model.size))
    sd = np.repeat([1.0, 0.1, 0.02], 3)
    covariance[:9, :9] = np.diag(sd**2)
    covariance[9:, 9:] = model.initial_covariance
    return InitialState(
        start.position, start.velocity, start.rotation, np.zeros(model.size), covariance
    )


def least_cpu(task: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest CPU time of several runs, s; the first one compiles and does not count."""
    task()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        task()
        times.append(time.process_time() - begin)
    return min(times)


def skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rotation(v: Array) -> Array:
    """Rodrigues' formula to the fourth order, enough for steps of a hundredth of a second."""
    k = skew(v)
    square = k @ k
    angle = v @ v
    return np.eye(3) + (1.0 - angle / 6.0) * k + (0.5 - angle / 24.0) * square


class NumpyTwin:
    """The filter of 15 states in plain NumPy."""

    def __init__(self, start: InitialState, model: SensorErrorModel) -> None:
        self.r, self.v = start.position.copy(), start.velocity.copy()
        self.c, self.bias = np.array(start.rotation), np.zeros(6)
        self.p = start.covariance.copy()
        self.white = model.white_density**2
        self.walk = model.diffusion[:, 0]
        self.last = np.zeros(3), np.zeros(3)

    def step(self, gyro: Array, accel: Array, dt: float) -> None:
        angle, thrust = (gyro - self.bias[3:]) * dt, (accel - self.bias[:3]) * dt
        last_angle, last_thrust = self.last
        k = skew(angle)
        turn = angle + skew(last_angle) @ angle / 12.0
        push = thrust + (0.5 * k + k @ k / 6.0) @ thrust
        push += (skew(last_angle) @ thrust + skew(last_thrust) @ angle) / 12.0
        force = self.c @ push
        self.last = angle, thrust

        sine, cosine = np.sin(self.r[0]), np.cos(self.r[0])
        root = 1.0 - 6.69437999014e-3 * sine**2
        east_radius = 6378137.0 / np.sqrt(root)
        north_radius = east_radius * (1.0 - 6.69437999014e-3) / root + self.r[2]
        east_radius += self.r[2]
        gravity = 9.7803253359 * (1.0 + 0.0019318526565863525 * sine**2) / np.sqrt(root)
        ratio = self.r[2] / 6378137.0
        slope = 1.0 + 3.35281066475e-3 * (1.0 - 2.0 * sine**2) + 3.449786506841e-3
        gravity *= 1.0 - 2.0 * slope * ratio + 3.0 * ratio**2
        down = np.array([0.0, 0.0, gravity * dt])
        middle = self.v + 0.5 * (force + down)
        w_ie = EARTH_RATE * np.array([cosine, 0.0, -sine])
        w_en = np.array(
            [
                middle[1] / east_radius,
                -middle[0] / north_radius,
                -middle[1] * sine / cosine / east_radius,
            ]
        )
        w_in = skew(w_ie + w_en)
        coriolis = skew(2.0 * w_ie + w_en)
        after = self.v + force - 0.5 * dt * w_in @ force - dt * coriolis @ middle + down
        mean = 0.5 * (self.v + after)
        latitude = self.r[0] + dt * mean[0] / north_radius
        self.r[1] += dt * mean[1] / (east_radius * np.cos(0.5 * (self.r[0] + latitude)))
        self.r[0] = latitude
        self.r[2] -= dt * mean[2]
        self.v = after
        self.c = rotation(-(w_ie + w_en) * dt) @ self.c @ rotation(turn)

        f = np.zeros((15, 15))
        f[:3, 3:6] = np.eye(3)
        f[3:6, 3:6] = -coriolis
        f[3:6, 6:9] = skew(force / dt)
        f[3:6, 9:12] = self.c
        f[5, 2] = 2.0 * gravity / (6378137.0 + self.r[2])
        f[6:9, 6:9] = -w_in
        f[6:9, 12:15] = -self.c
        f[6, 4] = 1.0 / east_radius
        f[7, 3] = -1.0 / north_radius
        f[8, 4] = -sine / cosine / east_radius
        f *= dt
        transition = np.eye(15) + f + 0.5 * f @ f
        self.p = transition @ self.p @ transition.T
        self.p[3:6, 3:6] += (self.c * self.white[:3]) @ self.c.T * dt
        self.p[6:9, 6:9] += (self.c * self.white[3:]) @ self.c.T * dt
        diagonal = np.arange(9, 15)
        self.p[diagonal, diagonal] += self.walk * dt
        self.rate = angle / dt - self.c.T @ (w_ie + w_en)
        self.scale = np.array([north_radius, east_radius * cosine, -1.0])

    def update(self, kind: int, value: Array, variance: Array) -> None:
        h = np.zeros((3, 15))
        if kind == POSITION:
            arm = self.c @ LEVER
            z = (self.r - value) * self.scale + arm
            h[:, :3] = np.eye(3)
        else:
            arm = self.c @ np.cross(self.rate, LEVER)
            z = self.v + arm - value
            h[:, 3:6] = np.eye(3)
            h[:, 12:15] = -self.c @ skew(LEVER)
        h[:, 6:9] = skew(arm)
        r = np.diag(variance)
        gain = self.p @ h.T @ np.linalg.inv(h @ self.p @ h.T + r)
        x = gain @ z
        left = np.eye(15) - gain @ h
        self.p = left @ self.p @ left.T + gain @ r @ gain.T
        self.r -= x[:3] / self.scale
        self.v -= x[3:6]
        self.c = rotation(x[6:9]) @ self.c
        self.bias += x[9:]


def run_twin(
    imu: ImuRecording, schedule: AidingSchedule, start: InitialState, model: SensorErrorModel
) -> Array:
    """Positions (n, 3) at the samples."""
    twin = NumpyTwin(start, model)
    path = np.empty((imu.size, 3))
    path[0] = twin.r
    done = 0
    for k in range(1, imu.size):
        twin.step(imu.gyro[k], imu.accel[k], imu.time[k] - imu.time[k - 1])
        while done < schedule.size and schedule.time[done] <= imu.time[k] + 1e-6:
            twin.update(schedule.kind[done], schedule.value[done], schedule.variance[done])
            done += 1
        path[k] = twin.r
    return path


def compare(other: Path) -> int:
    """Print microseconds a sample here, and their ratio to those of another checkout."""
    print("CPU microseconds a sample, and over those of the other checkout")
    worst = 0.0
    found = least_in_turn(other, CODE, COMPARED, ROUNDS)
    for states, (ours, theirs) in zip(COMPARED, found, strict=True):
        ratios = [a / b for a, b in zip(ours, theirs, strict=True)]
        worst = max(worst, *ratios)
        words = zip(("filter", "stored", "smoother"), ours, ratios, strict=True)
        print(
            f"{states:4d} states: " + ", ".join(f"{w} {t:.3f} ({r:.2f})" for w, t, r in words),
            flush=True,
        )
    print(f"largest ratio {worst:.2f}")
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--against", type=Path, help="another checkout, e.g. of a release")
    other = parser.parse_args().against
    return compare(other.resolve()) if other else judge()


def judge() -> int:
    """Print what a sample costs, and whether that is little enough."""
    imu, schedule, start = recordings()
    gate = gate_thresholds(0.0)
    cost: dict[int, list[float]] = {}
    print(f"filter over {imu.size} samples at 100 Hz with 1 Hz GNSS, CPU microseconds a sample")
    for states in STATES:
        model = sensor_model(states)
        begin = started(start, model)

        def plain(begin: InitialState = begin, model: SensorErrorModel = model) -> object:
            return run_engine(imu, begin, model, schedule, gate=gate, keep_nodes=False)

        def stored(begin: InitialState = begin, model: SensorErrorModel = model) -> object:
            return run_engine(imu, begin, model, schedule, gate=gate)

        kept = run_engine(imu, begin, model, schedule, gate=gate)

        def smoothed(model: SensorErrorModel = model, kept: object = kept) -> object:
            return smooth_run(kept, model, imu.time)  # type: ignore[arg-type]

        heavy = 3 if states > 33 else REPEATS
        times = [least_cpu(task, heavy) / imu.size * 1e6 for task in (plain, stored, smoothed)]
        cost[states] = times
        print(
            f"{states:4d} states: filter {times[0]:6.3f}, storing for the smoother {times[1]:6.3f},"
            f" smoother {times[2]:6.3f}"
        )
    part = imu.between(0.0, TWIN_DURATION)
    model = sensor_model(15)
    begin = started(start, model)
    inside = schedule.time <= part.time[-1]
    short = AidingSchedule(
        schedule.time[inside],
        schedule.kind[inside],
        schedule.value[inside],
        schedule.variance[inside],
        schedule.lever_arm[inside],
    )
    twin = least_cpu(lambda: run_twin(part, short, begin, model), 3) / part.size * 1e6
    path = run_twin(part, short, begin, model)
    ours = run_engine(part, begin, model, short, gate=gate, keep_nodes=False).samples.position
    apart = np.abs(path - ours).max(axis=0) @ np.array([6.4e6, 6.4e6, 1.0])
    ratio = twin / cost[15][0]
    print(f"NumPy twin of 15 states: {twin:.1f}; both paths agree to {apart * 1e3:.2f} mm")
    checks = [
        (
            cost[states][place] <= most,
            f"{states} states {what} {cost[states][place]:.3f} (at most {most})",
        )
        for place, what, wanted in (
            (0, "filtered", MOST),
            (1, "stored", MOST_STORED),
            (2, "smoothed, more", MOST_SMOOTHER),
        )
        for states, most in wanted.items()
    ]
    checks += [
        (ratio >= LEAST_RATIO, f"twin over filter {ratio:.0f} (at least {LEAST_RATIO:g})"),
        (apart < 0.01, "both paths agree to 10 mm"),
    ]
    for good, text in checks:
        print(("reached: " if good else "MISSED: ") + text)
    return 0 if all(good for good, _ in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
