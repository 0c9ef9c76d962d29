"""What `schuler warm` compiled is all that a stream needs, and every kernel has one signature."""

from __future__ import annotations

import subprocess
import sys

CODE = """
import importlib
import pkgutil

import numpy as np

import schuler.kernels
from schuler.cli.example import example_drive, example_noise
from schuler.cli.rehearsal import REHEARSALS
from schuler.navigation.preparation.prepare import prepare
from schuler.navigation.streaming import NavigationFilter


def compiled():
    found = {}
    for module in pkgutil.walk_packages(schuler.kernels.__path__, "schuler.kernels."):
        loaded = importlib.import_module(module.name)
        for name, value in vars(loaded).items():
            if hasattr(value, "py_func") and value.__module__ == loaded.__name__:
                found[f"{module.name}.{name}"] = len(value.signatures)
    return found


next(r for r in REHEARSALS if r.__name__ == "_navigate")()
before = compiled()
assert before["filter.run_filter"] == before["smoother.smooth_with_lag"] == 1, before
assert {k: v for k, v in before.items() if v > 1} == {}, before

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
after = compiled()
assert after == before, {k: (v, after[k]) for k, v in before.items() if after[k] != v}
"""


def test_a_stream_compiles_nothing_after_the_rehearsal() -> None:
    done = subprocess.run(
        [sys.executable, "-c", CODE], capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
