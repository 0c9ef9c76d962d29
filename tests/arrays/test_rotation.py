"""How one triad is turned against another (spec 7.7), and the gauge of several."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import simulation as simulate
from schuler.arrays.calibration.gauge import start_rotations, to_mean
from schuler.arrays.calibration.rotation import align_rates
from schuler.errors import EstimationError, InputError
from schuler.rotations import dcm_from_euler, dcm_from_rotation_vector, rotation_vector_from_dcm


def motorcycle_like() -> np.ndarray:
    """Rates of spec 7.7's size over a minute: 0.5 to 1 rad/s of roll, less pitch and yaw."""
    t = np.arange(6000)[:, None] / 100.0
    wave = np.sin(2 * np.pi * np.array([0.35, 0.5, 0.2]) * t + np.array([0.0, 1.0, 2.0]))
    return wave * np.array([0.8, 0.4, 0.5])


@pytest.fixture(scope="module")
def rates() -> np.ndarray:
    ride = simulate.motorcycle(80.0, 2, standstill=5.0)
    return simulate.ideal_imu(ride, 100.0).gyro[1500:7500]


def test_a_minute_on_a_motorcycle_aligns_to_the_accuracy_of_the_specification() -> None:
    rates = motorcycle_like()
    errors, scores = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        c = dcm_from_euler(*np.radians(rng.uniform(-3.0, 3.0, 3)))
        seen = rates @ c + 0.0201 * rng.standard_normal(rates.shape) + rng.normal(0.0, 0.02, 3)
        found = align_rates(rates, seen)
        error = rotation_vector_from_dcm(found.rotation @ c.T)
        errors.append(np.degrees(np.linalg.norm(error)))
        scores.append(error @ np.linalg.solve(found.covariance, error))
    # spec 7.7: rms below 0.08 deg; the largest of 200 was 0.10 there
    assert np.sqrt(np.mean(np.square(errors))) < 0.08
    assert max(errors) < 0.2
    # chi-square of 3: the mean of 100 has the standard deviation sqrt(6/100) = 0.245
    assert np.mean(scores) == pytest.approx(3.0, abs=0.8)


def test_knocks_do_not_turn_it(rates) -> None:
    rng = np.random.default_rng(1)
    c = dcm_from_euler(0.3, -0.2, 1.0)
    seen = rates @ c + 0.005 * rng.standard_normal(rates.shape)
    seen[::50] += rng.normal(0.0, 3.0, (120, 3))
    seen[::97] = np.nan
    found = align_rates(rates, seen)
    assert np.linalg.norm(rotation_vector_from_dcm(found.rotation @ c.T)) < 1e-3


def test_motion_about_one_axis_says_what_it_does_not_see() -> None:
    rng = np.random.default_rng(3)
    one = np.sin(0.01 * np.arange(3000))[:, None] * np.array([0.0, 0.0, 1.0])
    first, second = (one + 0.01 * rng.standard_normal(one.shape) for _ in range(2))
    found = align_rates(first, second)
    assert found.unseen.shape == (1, 3) and abs(found.unseen[0, 2]) > 0.99
    assert found.standard_deviation[2] > 0.5 and found.standard_deviation[0] < 1e-3


def test_a_mirrored_triad_is_refused(rates) -> None:
    wrong = rates * np.array([1.0, -1.0, 1.0])
    with pytest.raises(InputError, match="left-handed"):
        align_rates(rates, wrong + 0.001)
    with pytest.raises(EstimationError, match="at least 10"):
        align_rates(rates[:5], rates[:5])


def test_the_gauge_is_the_mean_and_the_start_is_found_where_it_was_not_declared(rates) -> None:
    rng = np.random.default_rng(5)
    flipped = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    nominal = np.array([np.eye(3), flipped, np.eye(3), flipped])
    true = dcm_from_rotation_vector(rng.normal(0.0, 0.02, (4, 3))) @ nominal
    seen = np.einsum("kij,ni->nkj", true, rates) + 1e-3 * rng.standard_normal((6000, 4, 3))
    np.testing.assert_array_equal(start_rotations(seen, np.tile(np.eye(3), (4, 1, 1))), nominal)
    np.testing.assert_array_equal(start_rotations(seen, nominal), nominal)
    mean = to_mean(true, nominal)
    small = rotation_vector_from_dcm(mean @ np.swapaxes(nominal, 1, 2))
    assert np.linalg.norm(small.mean(axis=0)) < 1e-4
    # one common turn was taken off, and nothing else
    common = mean @ np.swapaxes(true, 1, 2)
    np.testing.assert_allclose(common, np.broadcast_to(common[0], common.shape), atol=1e-14)
