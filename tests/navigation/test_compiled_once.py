"""What `schuler warm` compiled is all that a stream needs, and the filter has one signature."""

from __future__ import annotations

import subprocess
import sys

COMPILED = """
import importlib
import pkgutil

import numpy as np

import schuler.kernels


def compiled():
    found = {}
    for module in pkgutil.walk_packages(schuler.kernels.__path__, "schuler.kernels."):
        loaded = importlib.import_module(module.name)
        for name, value in vars(loaded).items():
            if hasattr(value, "py_func") and value.__module__ == loaded.__name__:
                place = module.name.removeprefix("schuler.kernels.")
                found[f"{place}.{name}"] = len(value.signatures)
    return found


def unchanged(before):
    after = compiled()
    assert after == before, {k: (v, after[k]) for k, v in before.items() if after[k] != v}
"""

STREAM = """
from schuler.cli.example import example_drive, example_noise
from schuler.cli.rehearsal import REHEARSALS
from schuler.navigation.preparation.prepare import prepare
from schuler.navigation.stream.navigation_filter import NavigationFilter

for rehearse in REHEARSALS:
    rehearse()
before = compiled()
steps = tuple(f"navigation.{m}." for m in ("filter", "aiding", "smoother"))
twice = {k: v for k, v in before.items() if v > 1 and k.startswith(steps)}
assert twice == {}, twice
assert before["navigation.filter.run_filter"] == before["navigation.smoother.smooth_with_lag"] == 1

drive = example_drive(120.0, standstill=20.0)
imu, gnss = drive.imu, drive.gnss
imu, setup = prepare(imu, gnss, example_noise())
begin = float(imu.time[0])
for lag in (None, 1.0):
    stream = NavigationFilter.from_setup(setup, imu, gnss, late=1.0, lag=lag)
    waiting = int(np.searchsorted(gnss.time, begin))
    for k in range(1500):
        now = float(imu.time[k])
        stream.add_imu(now, imu.gyro[k], imu.accel[k])
        while gnss.time[waiting] + 0.3 < now:
            fix = [gnss.position[waiting], gnss.position_sd[waiting]]
            assert stream.add_gnss(float(gnss.time[waiting]), *fix)
            waiting += 1
    assert waiting > 10
    if lag is not None:
        assert stream.smoothed_state() is not None
unchanged(before)

from schuler.data import ImuArray
from schuler.navigation.mechanizations.array_preparation import prepare_array
from schuler.navigation.mechanizations.array_stream import ArrayFilter
from schuler.navigation.settings import NavigationSettings
from schuler.arrays.geometry import tetrahedron_mounting
from schuler.noise import NoiseModel, WhiteNoise
from schuler.simulation import motorcycle, simulate_array, simulate_gnss

rng, place = np.random.default_rng(1), tetrahedron_mounting(0.05)
ride = motorcycle(60.0, 1, standstill=15.0)
noise = NoiseModel.isotropic(WhiteNoise(1e-3), WhiteNoise(3e-3))
parts = simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
array = ImuArray.from_recordings(parts, place)
gnss = simulate_gnss(ride, 1.0, position_sd=0.1, velocity_sd=0.05, rng=rng)
told = NavigationSettings(time_offset=0.0, tune_noise=False)
live = ArrayFilter(prepare_array(array, gnss, noise, told), gnss)
array.gyro.flags.writeable = False
for k in range(1000):
    gyro = array.gyro[k]
    if k > 700:
        gyro = gyro + np.array([[0.1, 0.0, 0.0]] + 3 * [[0.0] * 3])
    if 300 < k < 330:
        gyro = gyro.copy()
        gyro[1] = np.nan
    live.add_array(float(array.time[k]), gyro, array.accel[k])
assert live.out.sum() == 1
unchanged(before)
"""

SECOND = """
from schuler.kernels.noise.autoregressive import dot

values = np.ones(3)
dot(values, values)
before = compiled()
dot(values, values)
unchanged(before)
values.flags.writeable = False
dot(values, values)
unchanged(before)
"""


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", COMPILED + code],
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )


def test_a_stream_compiles_nothing_after_the_rehearsals() -> None:
    done = run(STREAM)
    assert done.returncode == 0, done.stderr[-3000:]


def test_a_second_signature_is_noticed() -> None:
    done = run(SECOND)
    assert "AssertionError: {'noise.autoregressive.dot': (1, 2)}" in done.stderr
