"""The same filter with and without its compiler: kernels are plain Python as well."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

SCRIPT = """
import sys
import numpy as np
from schuler.data import CHANNELS
from schuler.navigation.run import run
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.noise import Autoregressive, GaussMarkov, RandomWalk, RateRamp, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.simulation import car_urban, ideal_imu, simulate_gnss, simulate_imu

accel = WhiteNoise(3e-3) + RandomWalk(2e-4, initial_sd=0.03)
gyro = WhiteNoise(3e-4) + GaussMarkov(1e-4, 20.0) + RateRamp(1e-6)
gyro += Autoregressive((-1.2, 0.25), 1e-11, 0.05)
noise = NoiseModel(
    processes={c: gyro if c.startswith("gyro") else accel for c in CHANNELS}, source="test"
)
rng = np.random.default_rng(3)
profile = car_urban(60.0, 3, standstill=4.0)
imu = simulate_imu(ideal_imu(profile, 20.0), noise, rng).between(10.0, 20.0)
gnss = simulate_gnss(
    profile, 2.0, position_sd=0.3, velocity_sd=0.05, rng=rng, lever_arm=(1.0, 0.2, -1.0),
    start=10.13,
)
truth = profile.trajectory(imu.time[:1])
alignment = Alignment(
    truth.rotation[0], 0.01, 0.02, np.zeros(3), None, None, "truth", truth.velocity[0]
)
model = sensor_error_model(noise, turn_on_accel=0.1, turn_on_gyro=0.01, interval=0.05)
setup = RunSetup(
    model, NoiseFactors.none(), TimeOffsets(), alignment, np.array([1.0, 0.2, -1.0])
)
done = run(imu, gnss, setup, smooth=True)
values = {}
for label, s in (("causal", done.causal), ("smoothed", done.smoothed)):
    values |= {
        f"{label} position": s.trajectory.position,
        f"{label} velocity": s.trajectory.velocity,
        f"{label} rotation": s.trajectory.rotation,
        f"{label} covariance": s.position_covariance,
        f"{label} velocity sd": s.velocity_sd,
        f"{label} attitude sd": s.attitude_sd,
        f"{label} sensors": s.sensor_errors,
        f"{label} sensors sd": s.sensor_errors_sd,
        f"{label} nis": s.innovations.nis,
    }
from schuler.kernels.navigation.filter import run_filter
values["compiled"] = np.array([float(hasattr(run_filter, "py_func"))])
values["likelihood"] = np.array([done.causal.log_likelihood])
np.savez(sys.argv[1], **values)
"""


def outputs(path: Path, **environment: str) -> dict[str, np.ndarray]:
    subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT, str(path)],
        check=True,
        env=os.environ | environment,
        timeout=300,
    )
    with np.load(path) as stored:
        return dict(stored)


def test_the_filter_gives_the_same_numbers_without_its_compiler(tmp_path: Path) -> None:
    compiled = outputs(tmp_path / "compiled.npz", NUMBA_DISABLE_JIT="0")
    plain = outputs(tmp_path / "plain.npz", NUMBA_DISABLE_JIT="1")
    assert compiled.pop("compiled") == 1.0
    assert plain.pop("compiled") == 0.0
    assert set(compiled) == set(plain)
    assert compiled["causal position"].shape[0] == 200
    for name, values in compiled.items():
        assert np.all(np.isfinite(values)), name
        size = np.abs(values).max(axis=0)
        off = np.abs(plain[name] - values) / np.where(size > 0.0, size, 1.0)
        assert off.max() < 1e-12, name
