"""Mathematics that once could be broken without any test noticing: each has a guard here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from schuler import earth
from schuler.arrays.geometry import Geometry, tetrahedron_mounting
from schuler.arrays.merit import parity_matrix
from schuler.arrays.redundant import redundant_sensors
from schuler.arrays.tracking import OnlineSettings, follow_sensors
from schuler.curves.autocorrelation import autocorrelation
from schuler.data import ImuArray, Mounting
from schuler.estimation.orthogonal_search.search import fast_orthogonal_search
from schuler.kernels.navigation.update import add_rate_noise
from schuler.navigation.aiding.schedule import POSITION, VELOCITY, AidingSchedule
from schuler.navigation.engine import FilterRun, InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_model import extended_model, fusion_of
from schuler.noise import NoiseModel, WhiteNoise
from schuler.rotations import dcm_from_euler, skew
from schuler.simulation import ideal_imu, static


def white_model(density: float) -> NoiseModel:
    channels = [f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"]
    return NoiseModel({c: WhiteNoise(density) for c in channels})


def sensor(density: float) -> SensorErrorModel:
    return sensor_error_model(white_model(density), turn_on_accel=0.1, turn_on_gyro=0.01)


@pytest.mark.parametrize("count", [2, 4, 9])
def test_white_noise_of_a_fused_imu_is_divided_by_the_root_of_their_number(count: int) -> None:
    models = [sensor(3e-3)] * count
    fusion = fusion_of(Mounting.aligned(count), models)
    fused = extended_model(models, fusion, [f"imu {i}" for i in range(count)])
    np.testing.assert_allclose(fused.white_density, 3e-3 / np.sqrt(count), rtol=1e-12)


def test_white_noise_of_unequal_imus_adds_up_by_its_inverse() -> None:
    models = [sensor(d) for d in (1e-3, 3e-3)]
    fused = extended_model(models, fusion_of(Mounting.aligned(2), models), ["a", "b"])
    wanted = 1.0 / np.sqrt(1.0 / 1e-6 + 1.0 / 9e-6)
    np.testing.assert_allclose(fused.white_density, wanted, rtol=1e-12)


def test_the_gate_of_a_measurement_knows_its_degrees_of_freedom() -> None:
    found = gate_thresholds(1e-3)
    np.testing.assert_allclose(found[1:4], chi2.isf(1e-3, [1, 2, 3]), rtol=1e-9)


def test_orthogonal_search_takes_a_term_of_white_noise_in_five_runs_of_a_hundred() -> None:
    rng = np.random.default_rng(7)
    runs = 300
    taken = sum(
        bool(fast_orthogonal_search(rng.standard_normal(1000), 50).terms) for _ in range(runs)
    )
    # 15 expected; with a threshold for one candidate instead of fifty nearly all runs take one
    assert 4 <= taken <= 32


def test_the_band_of_the_unbiased_autocorrelation_widens_with_the_lag() -> None:
    x = np.random.default_rng(3).standard_normal(2000)
    plain = autocorrelation(x, 1.0, max_lag=1000, kind="biased")
    wide = autocorrelation(x, 1.0, max_lag=1000, kind="unbiased")
    pairs = (2000 - np.arange(1001)) / 2000
    np.testing.assert_allclose(wide.band, plain.band / pairs, rtol=1e-12)
    np.testing.assert_allclose(plain.band, 1.96 / np.sqrt(2000), rtol=1e-3)
    np.testing.assert_allclose(wide.robust_band, plain.robust_band / pairs, rtol=1e-9)


def test_variances_of_equal_sensors_are_drawn_together() -> None:
    rng = np.random.default_rng(2)
    gyro = 1e-3 * rng.standard_normal((12_000, 4, 3))
    array = ImuArray(
        np.arange(12_000) / 100.0, gyro, np.full_like(gyro, np.nan), Mounting.aligned(4)
    )
    sensors = redundant_sensors(array, "gyro")

    def scatter(settings: OnlineSettings) -> float:
        used = follow_sensors(sensors, None, settings).variance[200:]
        return float((used.std(axis=1) / used.mean(axis=1)).mean())

    how = OnlineSettings()
    assert scatter(how) < 0.8 * scatter(replace(how, shrink=False))


def test_gyro_noise_reaches_the_velocity_of_an_antenna_through_its_lever_arm() -> None:
    rotation, lever, step = dcm_from_euler(0.3, -0.5, 1.1), np.array([0.5, -1.0, 0.8]), 0.005
    density = np.array([1e-3, 2e-3, 3e-3])
    white = np.zeros((2, 3, 3))
    white[1] = np.diag(density**2)
    found = np.zeros(3)
    add_rate_noise(lever, rotation, white, step, found)
    through = rotation @ skew(lever)
    wanted = np.diag(through @ white[1] @ through.T) / step
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
    rates = np.random.default_rng(4).standard_normal((20_000, 3)) * density / np.sqrt(step)
    seen = (np.cross(rates, lever) @ rotation.T).var(axis=0)
    np.testing.assert_allclose(found, seen, rtol=0.06)


def test_parity_of_unequal_sensors_is_blind_to_motion_and_white() -> None:
    axes = Geometry.from_mounting(tetrahedron_mounting()).axes
    deviation = np.linspace(0.5, 4.0, 12)
    parity = parity_matrix(axes, deviation)
    np.testing.assert_allclose(parity @ axes, 0.0, atol=1e-12)
    covariance = (parity * deviation**2) @ parity.T
    np.testing.assert_allclose(covariance, np.eye(9), atol=1e-12)


def one_measurement(
    kind: int, value: list[float], variance: list[float], lever: tuple[float, float, float]
) -> FilterRun:
    """A filter that knows its state, level at rest, and one measurement after half a second."""
    profile, model = static(2.0), sensor(0.02)
    imu = ideal_imu(profile, 50.0)
    truth = profile.trajectory(imu.time[:1])
    covariance = np.zeros((9 + model.size, 9 + model.size))
    start = InitialState(
        truth.position[0], truth.velocity[0], truth.rotation[0], np.zeros(model.size), covariance
    )
    north, east = earth.metres_per_radian(truth.position[0])
    place = truth.position[0] + np.array(value) / [float(north), float(east), -1.0]
    schedule = AidingSchedule(
        np.array([0.02]),
        np.array([kind]),
        np.array([place if kind == POSITION else value]),
        np.array([variance]),
        np.array([lever]),
    )
    return run_engine(imu, start, model, schedule, gate=gate_thresholds(1e-3))


def test_the_filter_adds_the_noise_of_the_gyros_to_the_velocity_of_an_antenna() -> None:
    near, far = (
        one_measurement(VELOCITY, [0.0] * 3, [1e-4] * 3, (arm, 0.0, 0.0)) for arm in (0.0, 2.0)
    )
    more = far.aiding.deviation[0] ** 2 - near.aiding.deviation[0] ** 2
    # one sample of 20 ms with 0.02 rad/s/sqrt(Hz), across an arm of 2 m that points north
    np.testing.assert_allclose(more, [0.0, 0.08, 0.08], atol=2e-3)


@pytest.mark.parametrize(("components", "taken"), [(1, False), (3, True)])
def test_the_filter_asks_the_gate_of_as_many_degrees_as_were_measured(
    components: int, taken: bool
) -> None:
    # 13 lies between the limits for one and for three degrees of freedom, 10.8 and 16.3
    off, sd = [np.sqrt(13.0), 0.0, 0.0], [1.0] * components + [np.inf] * (3 - components)
    run = one_measurement(POSITION, off, sd, (0.0, 0.0, 0.0))
    assert abs(run.aiding.nis[0] - 13.0) < 0.1 and run.aiding.degrees[0] == components
    assert bool(run.aiding.accepted[0]) is taken
