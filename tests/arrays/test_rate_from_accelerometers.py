"""Angular rate beyond the range of the gyros, and its bound."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.arrays.redundant import redundant_sensors
from schuler.arrays.synthesis.rate_from_accelerometers import rate_from_array
from schuler.arrays.synthesis.synthetic import synthesize
from schuler.data import ImuArray, Mounting
from schuler.errors import InputError
from schuler.rotations import skew

RANGE = float(np.radians(2000.0))
GYRO, ACCEL = 0.01, 0.05


def spun(seed: int, seconds: float = 20.0, still: float = 11.0) -> tuple[ImuArray, np.ndarray]:
    """Four IMUs 5 cm from the centre that spin beyond the range of their gyros after a rest."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(200 * (seconds + still))) / 200.0
    phase = rng.uniform(0.0, 6.0, 3)
    rate = np.array([40.0, 30.0, 45.0]) * np.sin(np.array([1.1, 0.7, 0.5]) * time[:, None] + phase)
    rate *= np.clip((time - still) / 3.0, 0.0, 1.0)[:, None]
    slope = np.gradient(rate, time, axis=0)
    tensor = np.stack([skew(w) @ skew(w) + skew(a) for w, a in zip(rate, slope, strict=True)])
    mount = tetrahedron_mounting(0.05)
    force = np.array([0.0, 0.0, -9.81]) + np.einsum("nab,kb->nka", tensor, mount.position)
    gyro = np.einsum("kba,nb->nka", mount.rotation, rate)
    accel = np.einsum("kba,nkb->nka", mount.rotation, force)
    gyro = np.clip(gyro + GYRO * rng.standard_normal(gyro.shape), -RANGE, RANGE)
    accel = accel + ACCEL * rng.standard_normal(accel.shape)
    return ImuArray(time, gyro, accel, mount), rate


def test_the_bound_is_reached_where_gyros_are_out_of_range_and_where_they_are_not() -> None:
    ratios = []
    for seed in (31, 32, 33):
        array, truth = spun(seed)
        found = rate_from_array(
            redundant_sensors(array, "gyro"),
            redundant_sensors(array, "accel"),
            np.full(12, GYRO**2),
            np.full(12, ACCEL**2),
            gyro_range=RANGE,
        )
        error = found.rate - truth
        out = found.saturated
        assert 0.1 < out.mean() < 0.9
        square = np.einsum("na,nab,nb->n", error, np.linalg.inv(found.bound), error) / 3.0
        ratios.append([square[out].mean(), square[~out].mean()])
    assert np.all(np.abs(np.mean(ratios, axis=0) - 1.0) < 0.1)


def test_fusion_finds_the_range_and_is_not_clipped() -> None:
    array, truth = spun(34)
    fused = synthesize(array, "ewma")
    assert fused.beyond is not None
    assert fused.beyond.gyro_range == RANGE and fused.beyond.found == fused.beyond.samples > 500
    error = fused.imu.gyro - truth[fused.rows]
    assert np.abs(error).max() < 0.05
    assert fused.beyond.bound.max() < 0.01
    quiet = synthesize(array.between(0.0, 11.0), "ewma")
    assert quiet.beyond is None


def test_imus_at_one_place_or_on_a_line_tell_nothing() -> None:
    array, _ = spun(35, seconds=2.0)
    line = np.outer(np.arange(4.0), [0.05, 0.0, 0.0])
    for places in (np.zeros((4, 3)), line):
        there = ImuArray(
            array.time, array.gyro, array.accel, Mounting(array.mounting.rotation, places)
        )
        with pytest.raises(InputError, match="do not tell the rate"):
            rate_from_array(
                redundant_sensors(there, "gyro"),
                redundant_sensors(there, "accel"),
                np.full(12, GYRO**2),
                np.full(12, ACCEL**2),
                gyro_range=RANGE,
            )
