"""Noise models in the forms of other programs: the numbers and the units each of them means."""

from __future__ import annotations

import io
import math
import re

import numpy as np
import pytest
import yaml

from schuler.io.format import NoiseRequest
from schuler.io.registry import noise_format
from schuler.noise import GaussMarkov, NoiseModel, ProcessSum, RandomWalk, WhiteNoise

N_G, N_A, K_G, K_A, SIGMA, TC = 1e-4, 2e-3, 1e-6, 3e-5, 2e-5, 500.0
ASK = NoiseRequest(100.0, "/imu")


def model() -> NoiseModel:
    gyro = ProcessSum((WhiteNoise(N_G), GaussMarkov(SIGMA, TC), RandomWalk(K_G)))
    accel = ProcessSum((WhiteNoise(N_A), RandomWalk(K_A)))
    names = {f"gyro_{a}": gyro for a in "xyz"} | {f"accel_{a}": accel for a in "xyz"}
    return NoiseModel(names, rate=100.0, source="a test: [x]")


def text(name: str) -> str:
    write = noise_format(name).write_noise
    assert write is not None
    made = write(model(), ASK)
    assert isinstance(made, str)
    return made


def parsed(name: str) -> dict[str, object]:
    return dict(yaml.safe_load(text(name).replace("%YAML:1.0", "")))


WALK_G = math.sqrt(K_G**2 + 2.0 * SIGMA**2 / TC)


def test_densities_are_continuous_where_they_are_densities() -> None:
    for name in ("kalibr", "allan-variance-ros"):
        found = parsed(name)
        assert found["gyroscope_noise_density"] == pytest.approx(N_G)
        assert found["accelerometer_random_walk"] == pytest.approx(K_A)
        assert found["gyroscope_random_walk"] == pytest.approx(WALK_G)
    chain = parsed("openvins")["imu0"]
    assert isinstance(chain, dict)
    assert chain["accelerometer_noise_density"] == pytest.approx(N_A)
    assert len(chain["T_i_b"]) == 4
    assert text("openvins").startswith("%YAML:1.0\n")


def test_forms_of_one_sample() -> None:
    vins = parsed("vins-fusion")
    assert vins["gyr_n"] == pytest.approx(N_G * 10.0)
    assert vins["acc_w"] == pytest.approx(K_A * 10.0)
    covariances = parsed("robot-localization")["imu_covariances"]
    assert isinstance(covariances, dict)
    assert covariances["angular_velocity_variance"] == pytest.approx(N_G**2 * 100.0)
    driver = parsed("ros2-imu")["imu_driver"]
    assert isinstance(driver, dict)
    assert driver["ros__parameters"]["linear_acceleration_stdev"] == pytest.approx(N_A * 10.0)


def test_gtsam_takes_squares() -> None:
    code = text("gtsam")
    compile(code, "gtsam", "exec")
    found = re.search(r"setGyroscopeCovariance\(([\d.e-]+)", code)
    assert found is not None
    assert float(found[1]) == pytest.approx(N_G**2)


def test_units_of_gnss_ins_programs() -> None:
    noise = parsed("kf-gins-noise")["imunoise"]
    assert isinstance(noise, dict)
    assert noise["arw"][0] == pytest.approx(math.degrees(N_G) * 60.0)
    assert noise["vrw"][2] == pytest.approx(N_A * 60.0)
    assert noise["gbstd"][0] == pytest.approx(math.degrees(SIGMA) * 3600.0)
    assert noise["abstd"][0] == pytest.approx(K_A * 60.0 * 1e5)  # what the walk makes in an hour
    call = re.search(r"imuerrset\(([-\d., e]+)\);", text("psins"))
    assert call is not None
    numbers = [float(x) for x in call[1].split(",")]
    assert numbers[2] == pytest.approx(math.degrees(N_G) * 60.0)
    assert numbers[3] == pytest.approx(N_A / 9.80665e-6)
    scipy_io = pytest.importorskip("scipy.io")
    write = noise_format("navego").write_noise
    assert write is not None
    made = write(model(), ASK)
    assert isinstance(made, bytes)
    imu = scipy_io.loadmat(io.BytesIO(made), simplify_cells=True)["imu"]
    assert np.allclose(imu["arw"], N_G)
    assert np.allclose(imu["gb_dyn"], SIGMA)
    assert np.allclose(imu["gb_corr"], TC)
