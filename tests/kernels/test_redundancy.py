"""The on-line kernel of redundant axes against plain NumPy, with and without the compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.faults import detect_faults
from schuler.arrays.detection.thresholds import likelihood_statistics
from schuler.arrays.geometry import Geometry, tetrahedron_mounting
from schuler.arrays.redundant import redundant_sensors
from schuler.arrays.synthesis.least_squares import least_squares
from schuler.arrays.tracking import AxisNoise, OnlineSettings, follow_sensors
from schuler.data import ImuArray

SCRIPT = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
from test_redundancy import broken_array, answers
np.savez(sys.argv[2], **answers(broken_array()))
"""


def broken_array() -> ImuArray:
    """Sixteen seconds at 50 Hz with gaps, an outlier, a fault that comes and goes, and arms."""
    rng = np.random.default_rng(1)
    gyro = 0.3 * np.sin(np.arange(800) / 30.0)[:, None, None] + 1e-3 * rng.standard_normal(
        (800, 4, 3)
    )
    mounting = tetrahedron_mounting(0.1)
    gyro = np.einsum("kij,nki->nkj", mounting.rotation, gyro)
    accel = 0.02 * rng.standard_normal((800, 4, 3))
    gyro[300:500, 1, 0] += 0.02
    gyro[200, 2, 2] += 0.5
    gyro[600:640, 3] = np.nan
    gyro[100, 0, 1] = np.nan
    return ImuArray(np.arange(800) / 50.0, gyro, accel, mounting)


def answers(array: ImuArray) -> dict[str, np.ndarray]:
    """Everything that the kernel fills in."""
    settings = FaultSettings(
        time_constants=(0.2, 0.5),
        hold=0.5,
        scale_uncertainty=1e-4,
        online=OnlineSettings(learning=2.0, block=0.1),
    )
    found = detect_faults(array, settings)
    values = {}
    for s in found.sensors:
        f = s.followed
        for name in (
            "fused",
            "covariance",
            "variance",
            "usage",
            "freedom",
            "statistic",
            "axis_statistic",
            "axis_suspect",
            "unit_statistic",
            "unit_suspect",
            "smoothed",
            "factor",
            "bias",
            "events",
        ):
            values[f"{s.sensor} {name}"] = np.asarray(getattr(f, name), dtype=np.float64)
    return values


def test_compiled_and_plain_python_say_the_same(tmp_path: Path) -> None:
    out = tmp_path / "plain.npz"
    subprocess.run(
        [sys.executable, "-c", SCRIPT, str(Path(__file__).parent), str(out)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        check=True,
    )
    compiled = answers(broken_array())
    kinds = compiled["gyro events"][:, 1]
    assert 0 in kinds and 2 in kinds  # an axis went out, and came back
    with np.load(out) as plain:
        assert set(plain.files) == set(compiled)
        for name, values in compiled.items():
            # sums may be taken in another order
            np.testing.assert_allclose(plain[name], values, rtol=1e-6, atol=1e-9, err_msg=name)


def test_every_statistic_is_that_of_whitened_least_squares() -> None:
    rng = np.random.default_rng(2)
    mounting = tetrahedron_mounting()
    variance = np.exp(rng.normal(size=12)) * 1e-6
    noise = np.sqrt(variance) * rng.standard_normal((500, 12))
    array = ImuArray(
        np.arange(500) / 100.0, noise.reshape(-1, 4, 3), np.full((500, 4, 3), np.nan), mounting
    )
    sensors = redundant_sensors(array, "gyro")
    still = OnlineSettings(bias_time_constant=None, block=0.07)
    f = follow_sensors(sensors, AxisNoise(np.zeros(12), variance), still, adapting=False)
    geometry = Geometry.from_mounting(mounting)
    fit = least_squares(geometry.axes, variance)
    axis, unit = likelihood_statistics(noise, geometry, variance)
    np.testing.assert_allclose(f.fused, noise @ fit.pi.T, atol=1e-15)
    np.testing.assert_allclose(f.covariance[3], fit.covariance, rtol=1e-10)
    d = ((noise @ fit.residual.T) ** 2 / variance).sum(axis=1)
    np.testing.assert_allclose(f.statistic, d, rtol=1e-9)
    np.testing.assert_allclose(f.axis_statistic, axis.max(axis=1), rtol=1e-9)
    np.testing.assert_array_equal(f.axis_suspect, axis.argmax(axis=1))
    np.testing.assert_allclose(f.unit_statistic, unit.max(axis=1), rtol=1e-8)
    np.testing.assert_array_equal(f.unit_suspect, unit.argmax(axis=1))
    assert f.block == 7 and f.covariance.shape[0] == 72
