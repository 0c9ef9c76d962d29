"""CPU time a sample of the mechanizations for arrays, beside the filter of a single IMU.

100 Hz, GNSS position and velocity once a second, one bias state a sensor axis: the extended filter
has 33, 57 and 105 states for 4, 8 and 16 IMUs, with its parity update once a second; the
constrained one and the one at system level hold as many solutions as IMUs. Beside each stands the
filter of a single IMU with 15 states in the same run, and for 4 IMUs a plain NumPy twin of the
covariance propagation. `python -m benchmarks.mechanizations`.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import CHANNELS, GnssRecording, ImuArray, Mounting
from schuler.navigation.mechanizations.array_model import extended_model
from schuler.navigation.mechanizations.array_preparation import PreparedArray, prepare_array
from schuler.navigation.mechanizations.navigate_array import Mechanization, run_mechanization
from schuler.navigation.observability import Segment, system_matrix
from schuler.navigation.settings import NavigationSettings
from schuler.noise import RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.simulation import motorcycle, simulate_array, simulate_gnss

Array = NDArray[np.float64]

DURATION = 300.0
REPEATS = 5
MOST_MICROSECONDS = {4: 4.0, 8: 11.0, 16: 35.0}


def mounting(count: int) -> Mounting:
    """Tetrahedra inside each other, each turned a little further."""
    from schuler.rotations import dcm_from_euler

    four = tetrahedron_mounting(0.05)
    turned = [dcm_from_euler(0.2 * i, 0.3 * i, 0.1 * i) for i in range(count // 4)]
    return Mounting(
        np.concatenate([c @ four.rotation for c in turned]),
        np.concatenate([four.position @ c.T for c in turned]),
    )


def recordings(count: int) -> tuple[PreparedArray, GnssRecording]:
    """A ride with consumer MEMS IMUs."""
    rng = np.random.default_rng(count)
    profile = motorcycle(DURATION, 3, standstill=30.0)
    accel = WhiteNoise(3e-3) + RandomWalk(2e-4, initial_sd=0.02)
    gyro = WhiteNoise(5e-4) + RandomWalk(5e-6, initial_sd=1e-3)
    noise = NoiseModel({c: gyro if c.startswith("gyro") else accel for c in CHANNELS})
    mount = mounting(count)
    parts = simulate_array(profile, mount.rotation, mount.position, noise, 100.0, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.5, velocity_sd=0.05, rng=rng)
    array = ImuArray.from_recordings(parts, mount)
    return prepare_array(array, gnss, noise, NavigationSettings(time_offset=0.0)), gnss


def least_cpu(task: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest CPU time of several runs, s; the first one compiles and does not count."""
    task()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        task()
        times.append(time.process_time() - begin)
    return min(times)


def engine_cpu(prepared: PreparedArray, gnss: GnssRecording, name: Mechanization) -> float:
    """Microseconds a sample of the filter pass itself."""
    from dataclasses import replace

    from schuler.navigation.aiding.parity import Parity
    from schuler.navigation.engine import gate_thresholds, run_engine
    from schuler.navigation.mechanizations.array_model import fused_model

    setup = prepared.setup
    if name == "extended":
        model = extended_model(prepared.models, prepared.fusion, prepared.array.names)
        source = Parity(prepared.array, prepared.table, prepared.models, model.size)
        setup = replace(setup, model=model, sensor_start=prepared.sensor_start(), sources=(source,))
    else:
        setup = replace(setup, model=fused_model(prepared.models, prepared.fusion)[0])
    initial = setup.initial_state(prepared.recording, gnss)
    schedule = setup.schedule(prepared.recording, gnss)

    def task() -> object:
        return run_engine(
            prepared.recording, initial, setup.model, schedule, gate=gate_thresholds(1e-6),
            keep_nodes=False,
        )  # fmt: skip

    return 1e6 * least_cpu(task) / prepared.array.size


def twin_cpu(prepared: PreparedArray) -> float:
    """Microseconds a step of the plain covariance propagation F P F' + Q in NumPy."""
    model = extended_model(prepared.models, prepared.fusion, prepared.array.names)
    f = system_matrix(model, Segment(np.array([0.3, 0.1, -9.8]), np.eye(3)))
    covariance, noise = np.eye(f.shape[0]), 1e-6 * np.eye(f.shape[0])

    def task() -> object:
        p = covariance
        for _ in range(1000):
            transition = np.eye(f.shape[0]) + 0.01 * f + 5e-5 * f @ f
            p = transition @ p @ transition.T + noise
        return p

    return 1e6 * least_cpu(task, 3) / 1000


def main() -> int:
    """Print the table; 1 if a target is missed."""
    missed = []
    print("CPU µs a sample        4 IMUs   8 IMUs  16 IMUs")
    table: dict[str, list[str]] = {}
    for count in MOST_MICROSECONDS:
        prepared, gnss = recordings(count)
        single = engine_cpu(prepared, gnss, "synthetic")
        extended = engine_cpu(prepared, gnss, "extended")
        table.setdefault("synthetic (15 states)", []).append(f"{single:7.2f}")
        table.setdefault("extended with parity", []).append(f"{extended:7.2f}")
        table.setdefault("  over 15 states", []).append(f"{extended / single:7.1f}")
        plain = twin_cpu(prepared)
        table.setdefault("  NumPy twin, covariance", []).append(f"{plain:7.1f}")
        if extended > MOST_MICROSECONDS[count]:
            missed.append(f"extended, {count} IMUs: {extended:.1f} > {MOST_MICROSECONDS[count]}")
        for name in ("constrained", "system"):
            if count == 16:
                table.setdefault(name, []).append("      -")
                continue
            cpu = least_cpu(partial(run_mechanization, prepared, gnss, name), 2)
            table.setdefault(name, []).append(f"{1e6 * cpu / prepared.array.size:7.1f}")
    for name, cells in table.items():
        print(f"{name:<24}" + "  ".join(cells))
    for line in missed:
        print("MISSED", line)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
