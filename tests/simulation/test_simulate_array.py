"""Several IMUs on one body, and GNSS receivers of several grades."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import earth
from schuler import simulation as simulate
from schuler.data import CHANNELS
from schuler.errors import InputError
from schuler.noise import NoiseModel, WhiteNoise
from schuler.rotations import dcm_from_euler

MODEL = NoiseModel({c: WhiteNoise(1e-3) for c in CHANNELS})


@pytest.fixture(scope="module")
def ride() -> simulate.Profile:
    return simulate.ski(10.0, 40.0, 1)


def mountings(k: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    return dcm_from_euler(*rng.uniform(-1.5, 1.5, (3, k))), rng.uniform(-0.1, 0.1, (k, 3))


def test_each_imu_sees_the_motion_in_its_own_axes(ride) -> None:
    rotations, positions = mountings(3)
    centre = simulate.ideal_imu(ride, 100.0)
    array = simulate.simulate_array(
        ride, rotations, positions, None, 100.0, np.random.default_rng(1)
    )
    assert [imu.name for imu in array] == ["imu 1", "imu 2", "imu 3"]
    for imu, c_bs, arm in zip(array, rotations, positions, strict=True):
        gyro = np.einsum("ij,nj->ni", c_bs, imu.gyro)
        np.testing.assert_allclose(gyro, centre.gyro, atol=1e-12)
        added = np.einsum("ij,nj->ni", c_bs, imu.accel) - centre.accel
        # closed form at the middle of the interval, by differences of the true rate
        t, h = centre.time[3000:3100] - 0.005, 1e-4
        w, slope = ride.rates(t)[0], (ride.rates(t + h)[0] - ride.rates(t - h)[0]) / (2 * h)
        expected = np.cross(slope, arm) + np.cross(w, np.cross(w, arm))
        np.testing.assert_allclose(added[3000:3100], expected, atol=2e-4)
        assert np.abs(added).max() > 0.05


def test_the_size_effect_can_be_switched_off(ride) -> None:
    rotations, positions = mountings(2)
    centre = simulate.ideal_imu(ride, 50.0)
    array = simulate.simulate_array(
        ride, rotations, positions, None, 50.0, np.random.default_rng(1), size_effect=False
    )
    for imu, c_bs in zip(array, rotations, strict=True):
        np.testing.assert_allclose(
            np.einsum("ij,nj->ni", c_bs, imu.accel), centre.accel, atol=1e-11
        )


def test_noise_is_independent_between_imus_and_axes_and_stays_when_imus_are_added() -> None:
    still = simulate.static(200.0)
    rotations, positions = np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3))

    def make(k: int, seed: int = 3):
        return simulate.simulate_array(
            still, rotations[:k], positions[:k], MODEL, 100.0, np.random.default_rng(seed)
        )

    array = make(4)
    signals = np.hstack([imu.signals() for imu in array])
    np.testing.assert_allclose(signals.std(axis=0), 1e-2, rtol=0.03)  # 20 000: 0.005
    assert np.abs(np.corrcoef(signals.T) - np.eye(24)).max() < 0.035  # 276 pairs of sd 0.007
    mean = np.mean([imu.gyro for imu in array], axis=0)
    assert mean.std() == pytest.approx(0.5e-2, rel=0.02)
    for few, many in zip(make(2), array, strict=False):
        np.testing.assert_array_equal(few.signals(), many.signals())
    assert np.abs(make(1, 4)[0].gyro - array[0].gyro).max() > 1e-3


def test_models_and_errors_may_differ(ride) -> None:
    rotations, positions = np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))
    biased = simulate.TriadErrors(bias=(0.1, 0.0, 0.0))
    quiet, loud = simulate.simulate_array(
        simulate.static(100.0), rotations, positions, [None, MODEL], 100.0,
        np.random.default_rng(1), gyro_errors=[biased, None], names=("a", "b"),
    )  # fmt: skip
    assert quiet.gyro[:, 0].mean() - loud.gyro[:, 0].mean() == pytest.approx(0.1, abs=4e-4)
    assert np.ptp(quiet.accel[:, 0]) == 0.0
    assert loud.accel[:, 0].std() == pytest.approx(1e-2, rel=0.04)


def test_arrays_that_cannot_be_are_refused(ride) -> None:
    rng = np.random.default_rng(1)
    mirror = np.diag([1.0, 1.0, -1.0])[None]
    with pytest.raises(InputError, match="left-handed"):
        simulate.simulate_array(ride, mirror, np.zeros((1, 3)), None, 50.0, rng)
    with pytest.raises(InputError, match="no rotation"):
        simulate.simulate_array(ride, 1.1 * np.eye(3)[None], np.zeros((1, 3)), None, 50.0, rng)
    with pytest.raises(InputError, match="mounting position has shape"):
        simulate.simulate_array(ride, np.eye(3)[None], np.zeros((2, 3)), None, 50.0, rng)
    with pytest.raises(InputError, match="noise models"):
        simulate.simulate_array(ride, np.eye(3)[None], np.zeros((1, 3)), [MODEL] * 2, 50.0, rng)


def gnss_errors(gnss, position):
    north, east = earth.metres_per_radian(position)
    return (gnss.position - position) * np.stack([north, east, -np.ones(gnss.size)], axis=-1)


@pytest.mark.parametrize(
    ("grade", "horizontal", "vertical", "quality"),
    [
        (simulate.L1_CODE, (1.5, 2.5), (2.25, 3.75), 5),
        (simulate.DIFFERENTIAL_CODE, (0.4, 1.0), (0.6, 1.5), 4),
        (simulate.RTK_FIXED, (0.02, 0.03), (0.03, 0.06), 1),
    ],
)
def test_grades_are_as_good_as_the_specification_says(grade, horizontal, vertical, quality) -> None:
    still = simulate.static(30_000.0)
    gnss = simulate.simulate_receiver(still, grade, rng=np.random.default_rng(2))
    error = gnss_errors(gnss, still.trajectory(gnss.time).position)
    deviation = error.std(axis=0)
    assert horizontal[0] < deviation[0] < horizontal[1]
    assert vertical[0] < deviation[2] < vertical[1]
    assert gnss.velocity.std(axis=0).min() * 1.02 >= 0.03
    assert gnss.velocity.std(axis=0).max() < 0.1
    # it claims what it has: slow noise of 60 s, 250 independent stretches, sd of a sd 4.5 %
    np.testing.assert_allclose(deviation, gnss.position_sd[0], rtol=0.18)
    np.testing.assert_array_equal(gnss.quality, quality)
    share = (np.array(grade.correlated_sd) / grade.position_sd) ** 2
    for lag in (1, 30, 60):
        found = np.mean(error[lag:] * error[:-lag], axis=0) / np.mean(error**2, axis=0)
        np.testing.assert_allclose(found, share * np.exp(-lag / 60.0), atol=0.2)


def test_outliers_are_as_many_and_as_large_as_asked() -> None:
    still = simulate.static(20_000.0)
    make = lambda **how: simulate.simulate_receiver(  # noqa: E731
        still, simulate.RTK_FIXED, rng=np.random.default_rng(3), **how
    )
    plain, spoilt = make(), make(outlier_rate=0.02, outlier_size=30.0)
    moved = np.linalg.norm(gnss_errors(spoilt, plain.position), axis=1)
    far = moved > 1.0
    assert far.mean() == pytest.approx(0.02, rel=0.2)  # 400 +- 20
    np.testing.assert_allclose(moved[far], 30.0, rtol=1e-4)
    np.testing.assert_allclose(moved[~far], 0.0, atol=1e-6)
    direction = gnss_errors(spoilt, plain.position)[far] / 30.0
    np.testing.assert_allclose(np.mean(direction**2, axis=0), 1.0 / 3.0, atol=0.06)
    np.testing.assert_array_equal(spoilt.position_sd, plain.position_sd)  # nobody notices
    np.testing.assert_array_equal(spoilt.velocity, plain.velocity)


def test_receivers_that_cannot_be_are_refused() -> None:
    still, rng = simulate.static(100.0), np.random.default_rng(1)
    with pytest.raises(InputError, match="correlation time for it"):
        simulate.simulate_gnss(still, position_sd=1.0, velocity_sd=None, rng=rng, correlated_sd=1.0)
    with pytest.raises(InputError, match="share"):
        simulate.simulate_receiver(still, simulate.L1_CODE, rng=rng, outlier_rate=1.5)
