"""Axes that turn slowly and clocks that drift are followed, and the same in a stream."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.arrays.slow_axes import AxesFollower, follow_axes
from schuler.data import ImuArray
from schuler.errors import InputError
from schuler.rotations import dcm_from_rotation_vector

DEGREE = float(np.pi / 180.0)
RATE, LENGTH = 50.0, 200.0
TURNS, DRIFT, LATE = 0.02 * DEGREE, 200e-6, 0.03


def rates(time: np.ndarray) -> np.ndarray:
    """At rest for 20 s, then turned by hand."""
    angle = 2.0 * np.pi * np.array([0.31, 0.23, 0.47]) * time[:, None]
    swing = np.sin(angle) + 0.5 * np.sin(2.7 * angle + 1.0)
    return 20.0 * DEGREE * np.clip((time[:, None] - 20.0) / 5.0, 0.0, 1.0) * swing


def twin(seed: int) -> tuple[ImuArray, np.ndarray, np.ndarray]:
    """Four IMUs: the second lags and its clock drifts, the fourth turns; what is true of them."""
    rng, time = np.random.default_rng(seed), np.arange(int(RATE * LENGTH)) / RATE
    place = tetrahedron_mounting(0.05)
    axis = rng.standard_normal(3)
    turn, delay = np.zeros((time.size, 4, 3)), np.zeros((time.size, 4))
    turn[:, 3] = TURNS * time[:, None] * axis / np.linalg.norm(axis)
    delay[:, 1] = LATE + DRIFT * time
    gyro, accel = np.empty((2, time.size, 4, 3))
    for i in range(4):
        own = dcm_from_rotation_vector(-turn[:, i]).transpose(0, 2, 1) @ place.rotation[i]
        gyro[:, i] = np.einsum("nji,nj->ni", own, rates(time - delay[:, i]))
        accel[:, i] = np.einsum("nji,j->ni", own, (0.0, 0.0, -9.81))
    gyro += 0.3 * DEGREE * rng.standard_normal((4, 3))
    gyro += 0.1 * DEGREE * rng.standard_normal(gyro.shape)
    return ImuArray(time, gyro, accel, place), turn, delay


def test_turns_and_clocks_are_followed_and_a_stream_gives_the_same_numbers() -> None:
    array, turn, delay = twin(831)
    followed, found = follow_axes(array)
    rows = np.searchsorted(array.time, found.time)
    later = found.time > 60.0
    off = np.linalg.norm(found.turn - turn[rows], axis=2)[later]
    late = (found.delay - delay[rows])[later]
    assert np.sqrt(np.mean(off**2, axis=0)).max() < 0.1 * DEGREE
    assert np.sqrt(np.mean(late**2, axis=0)).max() < 1e-3
    # the claim, of the three that stay: a walk is allowed for that they do not take
    still = np.abs(found.turn - turn[rows])[later][:, :3] / found.turn_sd[later][:, :3]
    assert 0.3 < np.sqrt(np.mean(still**2)) < 1.3
    body, true = followed.in_body(), rates(array.time)
    lively = slice(3_000, -20)
    rest = body.gyro[lively] - true[lively, None]
    apart = np.std(rest - rest.mean(axis=1, keepdims=True), axis=0)
    assert apart.max() < 0.13 * DEGREE
    raw = array.in_body().gyro[lively]
    assert np.std(raw[:, 1] - raw[:, 0], axis=0).max() > 1.0 * DEGREE
    assert "turned by 3.9" in found.lines[3] or "turned by 3.8" in found.lines[3]

    stream, given = AxesFollower(array.mounting, RATE), []
    stream.begin(found.turn[0], found.delay[0])
    for k in range(3_000):
        taken = stream.add(array.time[k], array.gyro[k], array.accel[k])
        given += [] if taken is None else [taken]
    n = len(given)
    assert 2_990 < n < 3_000
    np.testing.assert_array_equal([g[1] for g in given], followed.gyro[:n])
    np.testing.assert_array_equal([g[2] for g in given], followed.accel[:n])


@pytest.mark.parametrize("what", ["offset", "stuck", "silent"])
def test_a_fault_does_not_turn_the_others(what: str) -> None:
    array, turn, _ = twin(832)
    gyro = array.gyro.copy()
    late = array.time > 100.0
    if what == "offset":
        gyro[late, 0, 2] += 2.0 * DEGREE
    else:
        gyro[late, 0] = np.nan if what == "silent" else gyro[5_000, 0]
    found = follow_axes(ImuArray(array.time, gyro, array.accel, array.mounting))[1]
    rows = np.searchsorted(array.time, found.time)
    off = np.linalg.norm(found.turn - turn[rows], axis=2)[found.time > 60.0, 1:]
    assert np.sqrt(np.mean(off**2, axis=0)).max() < 0.15 * DEGREE


def test_what_cannot_be_followed_is_refused() -> None:
    array, _, _ = twin(833)
    with pytest.raises(InputError, match="one IMU"):
        follow_axes(array.select([0]))
    with pytest.raises(InputError, match="shape"):
        AxesFollower(array.mounting, RATE).add(0.0, np.zeros((3, 3)), np.zeros((4, 3)))
    with pytest.raises(InputError, match="rate"):
        AxesFollower(array.mounting, 0.0)
