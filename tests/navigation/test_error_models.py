"""The catalogue of error models: states, parameters, and what each may be told. Spec 7.3, 8.4."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from schuler.data import CHANNELS
from schuler.errors import InputError, ModelError
from schuler.navigation.error_models.allan_readings import AllanReading, allan_readings
from schuler.navigation.error_models.autoregressive_fits import autoregressive_fits
from schuler.navigation.error_models.catalogue import error_model
from schuler.navigation.error_models.sensor_denoising import SensorDenoising
from schuler.noise import (
    Autoregressive,
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Process,
    RandomWalk,
    WhiteNoise,
)
from schuler.simulation import simulate_static
from schuler.units import parse

DT = 0.01
# S004 tables 4 and 5, x axes
ACCEL = AllanReading(
    parse("0.045 m/s/sqrt(h)", "accel white noise"),
    parse("5.1581 m/s/h", "accel bias instability"),
    4.56,
    parse("166.30 m/s/h^1.5", "accel random walk"),
)
GYRO = AllanReading(
    parse("2.42 deg/sqrt(h)", "gyro white noise"),
    parse("44.533 deg/h", "gyro bias instability"),
    490.89,
)
READINGS = {c: GYRO if c.startswith("gyro") else ACCEL for c in CHANNELS}
AR1 = {c: Autoregressive((-0.999,), 1e-10, DT) for c in CHANNELS}
AR3 = {c: Autoregressive((-2.5613, 2.126, -0.5646), 3e-13, DT) for c in CHANNELS}


def model(accel: Process, gyro: Process) -> NoiseModel:
    return NoiseModel(
        processes={c: gyro if c.startswith("gyro") else accel for c in CHANNELS}, source="test"
    )


@pytest.mark.parametrize(
    ("name", "states"),
    [
        ("15AV", 15),
        ("18AV", 18),
        ("18AVWD", 18),
        ("15AR", 15),
        ("27AR", 27),
        ("15AV+corrected", 15),
        # a constant on all six, where 18AV has a walk on the accelerometers already
        ("15AV+turn-on", 21),
        ("18av+turn-on", 21),
        # four Gauss-Markov noises on all, walk or constant on all
        ("flicker4", 9 + 24 + 6),
        ("18AV+scale", 18 + 6),
        ("18AV+turn-on+scale+misalignment", 21 + 6 + 12),
    ],
)
def test_states_are_those_of_table_8(name: str, states: int) -> None:
    fits = AR3 if name == "27AR" else AR1
    assert error_model(name, READINGS, autoregressive=fits).states == states


def test_27ar_is_the_companion_of_the_fit_and_shows_its_newest_state() -> None:
    # S004 (31)-(36): eigenvalues are the roots, b0² drives the newest state, which alone shows
    model27 = error_model("27AR", READINGS, autoregressive=AR3)
    sensors = model27.sensor_model(0.02, 1e-3)
    assert len(sensors.blocks) == 6
    for c, block in enumerate(sensors.blocks):
        own = slice(block.first, block.first + 3)
        roots = np.sort_complex(np.linalg.eigvals(block.transition))
        np.testing.assert_allclose(roots, np.sort_complex(AR3["gyro_x"].poles), atol=1e-8)
        np.testing.assert_allclose(block.noise_covariance, np.diag([0.0, 0.0, 3e-13]))
        shown = np.nan_to_num(sensors.direction[own], nan=1.0)[:, c % 3]
        np.testing.assert_array_equal(shown, [0.0, 0.0, 1.0])
        # all lags share what is not known at switch-on
        turn_on = 0.02 if c < 3 else 1e-3
        stationary = AR3["gyro_x"].state_space(DT).initial_covariance
        np.testing.assert_allclose(
            sensors.initial_covariance[own, own], stationary + turn_on**2, rtol=1e-9
        )
    with pytest.raises(ModelError, match="sample interval"):
        model27.sensor_model(0.02, 1e-3, 0.013)
    # AR(1) is changed exactly to any interval
    ar1 = error_model("15AR", READINGS, autoregressive=AR1).sensor_model(0.0, 0.0, 0.013)
    np.testing.assert_allclose(ar1.drift[:, 0], np.log(0.999) / DT, rtol=1e-9)
    np.testing.assert_allclose(np.diag(ar1.initial_covariance), 1e-10 / (1 - 0.999**2), rtol=1e-9)


def test_the_paper_takes_the_plateau_for_sigma_and_the_correction_does_not() -> None:
    printed = error_model("18AV", READINGS).noise_model.process("accel_x").parts
    # S004 (29): 5.1581 m/s/h * 0.664/3600 = 9.514e-4 m/s²; (30): 166.3/3600^1.5
    assert printed[0].density == pytest.approx(0.045 / 60.0, rel=1e-12)
    assert printed[1].sigma == pytest.approx(9.514e-4, rel=1e-3)
    assert printed[1].correlation_time == 4.56
    assert printed[2].density == pytest.approx(166.3 / 216000.0, rel=1e-12)
    corrected = error_model("18AV+corrected", READINGS).noise_model.process("accel_x").parts
    tau = np.geomspace(0.5, 50.0, 2000)
    for parts, height, place in ((printed, 0.617, 1.893), (corrected, 1.0, 1.0)):
        own = np.sqrt(parts[1].allan_variance(tau))
        # E-004-7: 62 % of the plateau, 1.9 times too late
        assert own.max() / (0.664283 * ACCEL.bias_instability) == pytest.approx(height, abs=2e-3)
        assert tau[own.argmax()] / 4.56 == pytest.approx(place, rel=5e-3)
    assert any("E-004-7" in note for note in error_model("15AV", READINGS).notes)
    assert not error_model("15AV+corrected", READINGS).notes
    assert len(error_model("15AV", READINGS).noise_model.process("accel_x").parts) == 2
    assert len(error_model("18AV", READINGS).noise_model.process("gyro_x").parts) == 2


def test_without_a_constant_state_the_start_is_forgotten() -> None:
    sensors = error_model("15AV", READINGS).sensor_model(0.02, 1e-3)
    for c in range(6):
        assert sensors.constant_states(c).size == 0
        own = np.flatnonzero(sensors.channel == c)
        turn_on = 0.02 if c < 3 else 1e-3
        sigma = (
            error_model("15AV", READINGS)
            .noise_model.process("accel_x" if c < 3 else "gyro_x")
            .parts[1]
            .sigma
        )
        assert sensors.initial_covariance[own[0], own[0]] == pytest.approx(sigma**2 + turn_on**2)
    held = error_model("15AV+turn-on", READINGS).sensor_model(0.02, 1e-3)
    assert all(held.constant_states(c).size == 1 for c in range(6))


def test_readings_of_a_model_give_its_numbers_back() -> None:
    gauss_markov = GaussMarkov(3e-3, 30.0)
    noise = model(
        WhiteNoise(1e-3) + gauss_markov + RandomWalk(1e-5),
        WhiteNoise(2e-4) + BiasInstability(5e-5, 0.01, 1e5),
    )
    found = allan_readings(noise)
    again = GaussMarkov.through_plateau(
        found["accel_x"].bias_instability, found["accel_x"].flat_time
    )
    assert again.sigma == pytest.approx(gauss_markov.sigma, rel=1e-6)
    assert again.correlation_time == pytest.approx(30.0, rel=1e-6)
    assert found["accel_x"].random_walk == 1e-5
    gyro = found["gyro_x"]
    assert (gyro.white_noise, gyro.bias_instability) == (2e-4, 5e-5)
    # flat from where white noise has fallen to half of the plateau
    assert gyro.flat_time > (2.0 * 2e-4 / (0.664 * 5e-5)) ** 2
    assert not gyro.crossing


def test_a_crossing_is_not_sold_as_bias_instability() -> None:
    noise = model(WhiteNoise(7.5e-4) + RandomWalk(7.7e-4), WhiteNoise(1e-4) + RandomWalk(1e-6))
    r = allan_readings(noise)["accel_x"]
    tau = np.geomspace(0.1, 100.0, 4000)
    curve = np.sqrt(noise.process("accel_x").allan_variance(tau))
    assert r.bias_instability == pytest.approx(curve.min() / 0.66428, rel=1e-4)
    assert r.flat_time == pytest.approx(tau[curve.argmin()], rel=1e-2)
    assert r.crossing
    readings = allan_readings(noise)
    assert any("E-004-9" in n for n in error_model("15AV", readings).notes)
    flicker = error_model("flicker4", readings)
    assert {p.kind for p in flicker.noise_model.process("accel_x").parts} == {
        "white_noise",
        "random_walk",
    }


def test_fits_of_a_static_record_are_those_of_the_low_pass() -> None:
    # spec 8.4: white noise alone has the fingerprint of db4 at seven levels, and AR(1) over AR(3)
    # 370 for seven levels, 130 for six
    static = simulate_static(
        model(WhiteNoise(7.5e-4), WhiteNoise(7e-4)), 1500.0, 100.0, np.random.default_rng(5)
    )
    fits = autoregressive_fits(static)
    np.testing.assert_allclose(fits[3]["gyro_x"].coefficients, (-2.556, 2.116, -0.560), atol=0.03)
    ratio = {
        c: fits[1][c].driving_variance / fits[3][c].driving_variance for c in ("gyro_x", "accel_y")
    }
    assert ratio["gyro_x"] == pytest.approx(370.0, abs=25.0)
    assert ratio["accel_y"] == pytest.approx(130.0, abs=12.0)
    assert error_model("15AR", READINGS, autoregressive=fits[1]).states == 15
    with pytest.raises(ModelError, match=r"AR\(3\)"):
        error_model("15AR", READINGS, autoregressive=fits[3])


def test_denoising_keeps_the_white_noise_density_and_says_when_it_answers() -> None:
    static = simulate_static(
        model(WhiteNoise(1e-3), WhiteNoise(1e-3)), 600.0, 100.0, np.random.default_rng(6)
    )
    off_line, causal = SensorDenoising.table_7(), SensorDenoising.table_7("causal")
    assert off_line.reach == 7 * 127
    assert 100 < causal.reach < 200
    assert "not for a filter" in off_line.notes[0]
    quiet = off_line.apply(static)
    assert quiet.gyro.std() < 0.15 * static.gyro.std()
    # integrated over half a minute they are the same
    means = [imu.gyro[:60000].reshape(20, 3000, 3).mean(axis=1) for imu in (static, quiet)]
    assert np.corrcoef(means[0].ravel(), means[1].ravel())[0, 1] > 0.98
    # causal: what comes later changes nothing, and a slow motion keeps its place
    struck = replace(static, gyro=np.where(static.time[:, None] > 300.0, 1.0, static.gyro))
    early = static.time[: -causal.reach] < 300.0 - 0.01 * causal.reach
    one, two = causal.apply(static), causal.apply(struck)
    assert one.size == static.size - causal.reach
    np.testing.assert_array_equal(one.gyro[early], two.gyro[early])
    assert np.abs(off_line.apply(struck).gyro[:28000] - quiet.gyro[:28000]).max() == 0.0
    slow = np.sin(2 * np.pi * 0.05 * static.time)[:, None] * np.ones(3)
    moved = causal.apply(replace(static, gyro=slow))
    middle = slice(3000, 50000)
    assert np.abs(moved.gyro[middle, 0] - slow[middle, 0]).max() < 0.02


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("16AV", "16AV"),
        ("15AV+fast", "fast"),
        ("own", "noise model"),
        ("27AR", "no autoregressive"),
    ],
)
def test_bad_names_are_refused_in_one_line(name: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        error_model(name, READINGS)
    assert "\n" not in str(caught.value)


def test_what_is_printed_in_table_2_is_refused() -> None:
    # E-004-10: rounded to three digits accelerometer x has a pole at 1.044
    with pytest.raises(ModelError, match=r"modulus 1\.04"):
        Autoregressive((-2.582, 2.166, -0.585), 4.973e-13, DT)
    with pytest.raises(ModelError, match="modulus 1"):
        Autoregressive((-1.0,), 2.129e-10, DT)
    assert math.isclose(sum((1.0, -2.565, 2.133, -0.568)), 0.0, abs_tol=1e-9)
