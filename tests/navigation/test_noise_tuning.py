"""How much to inflate the numbers of a bench: found again where the truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twins import LEVER, draw_twin, perfect

from schuler.data import CHANNELS
from schuler.errors import SchulerError
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.tuning.inflation import inflated, tune_noise
from schuler.navigation.tuning.tune import Sought, tune
from schuler.noise import GaussMarkov, RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.simulation import car_urban

SEEDS = 6
BENCH = NoiseModel(
    processes={
        c: WhiteNoise(2e-4) + RandomWalk(1e-5, initial_sd=2e-3)
        if c.startswith("gyro")
        else WhiteNoise(3e-3) + RandomWalk(4e-4, initial_sd=0.05)
        for c in CHANNELS
    },
    source="bench",
)
TRUTH = {
    ("accelerometer", "white noise"): 6.0,
    ("gyro", "white noise"): 10.0,
    ("accelerometer", "bias walk"): 3.0,
    ("gyro", "bias walk"): 4.0,
}
PARAMETERS = {
    "white accel": ("accelerometer", "white noise"),
    "white gyro": ("gyro", "white noise"),
    "drive accel": ("accelerometer", "bias walk"),
    "drive gyro": ("gyro", "bias walk"),
}


@pytest.fixture(scope="module")
def car() -> tuple:  # type: ignore[type-arg]
    profile = car_urban(420.0, 8, standstill=15.0)
    return profile, perfect(profile, 50.0)


def test_known_factors_are_found_within_their_intervals(car: tuple) -> None:  # type: ignore[type-arg]
    on_the_road = inflated(BENCH, TRUTH)
    bench = sensor_error_model(BENCH, turn_on_accel=0.0, turn_on_gyro=0.0)
    ratios, sds = [], []
    for seed in range(SEEDS):
        twin = draw_twin(*car, seed, noise=on_the_road)
        found = tune(
            twin.imu,
            twin.gnss,
            replace(twin.setup, model=bench),
            Sought("sensors", offsets=False, prior_sd=4.0),
        )
        assert found.converged
        wrong = [found.values[n] - np.log(TRUTH[p]) for n, p in PARAMETERS.items()]
        wrong += [found.values["sd position"], found.values["sd velocity"]]
        sd = [found.standard_errors[n] for n in (*PARAMETERS, "sd position", "sd velocity")]
        ratios.append(np.array(wrong) / sd)
        sds.append(sd)
    squares = np.array(ratios) ** 2
    # chi-square of 36 at 99.9 %: 0.40 to 1.96
    assert 0.4 < squares.mean() < 1.96
    assert np.mean(squares < 1.96**2) > 0.8
    # and it is worth knowing: no factor is vaguer than a factor of two
    assert np.median(sds, axis=0).max() < np.log(2.0)


def test_the_whole_answer(car: tuple) -> None:  # type: ignore[type-arg]
    twin = draw_twin(*car, 50, noise=inflated(BENCH, TRUTH))
    answer = tune_noise(
        twin.imu, twin.gnss, BENCH, lever_arm=LEVER, time_offset=0.0, factors=(1.0, 3.0, 10.0)
    )
    assert [(i.sensor, i.kind) for i in answer.inflations] == list(PARAMETERS.values())
    for inflation in answer.inflations:
        true = TRUTH[inflation.sensor, inflation.kind]
        assert inflation.lower < inflation.factor < inflation.upper
        # three standard deviations, the interval is two
        assert abs(np.log(inflation.factor / true)) < 1.53 * np.log(
            inflation.upper / inflation.factor
        )
        # the likelihood falls with the distance from the maximum (here in standard deviations)
        sd = np.log(inflation.upper / inflation.factor) / 1.96
        away = np.abs(np.log(inflation.profile_factors / inflation.factor)) / sd
        assert np.argmin(inflation.profile_loss) == np.argmin(away)
        np.testing.assert_allclose(inflation.tuned, inflation.static * inflation.factor)
    assert answer.gain > 100.0
    assert answer.nis_before > 1.5
    assert answer.nis_after == pytest.approx(1.0, abs=0.12)
    white = answer.inflations[1]
    assert white.static == pytest.approx([2e-4] * 3)
    found = answer.noise_model.process("gyro_y").components[0]
    assert isinstance(found, WhiteNoise)
    assert found.density == pytest.approx(2e-4 * white.factor)


def test_inflation_multiplies_deviations_and_leaves_the_switch_on() -> None:
    model = NoiseModel(
        {"gyro_x": WhiteNoise(1e-3) + GaussMarkov(2e-3, 50.0) + RandomWalk(1e-5, initial_sd=0.1)}
    )
    parts = (
        inflated(model, {("gyro", "white noise"): 3.0, ("gyro", "bias walk"): 7.0})
        .process("gyro_x")
        .components
    )
    before = model.process("gyro_x").components
    taus = np.array([0.1, 10.0])
    for part, old, factor in zip(parts, before, (3.0, 7.0, 7.0), strict=True):
        ratio = np.sqrt(part.allan_variance(taus) / old.allan_variance(taus))
        np.testing.assert_allclose(ratio, factor)
    assert isinstance(parts[2], RandomWalk)
    assert parts[2].initial_sd == 0.1


def test_too_little_gnss_is_said(car: tuple) -> None:  # type: ignore[type-arg]
    twin = draw_twin(*car, 1, noise=BENCH)
    few = twin.gnss.select(np.arange(twin.gnss.size) % 30 == 0)
    with pytest.raises(SchulerError, match="epochs to tune with"):
        tune(twin.imu, few, twin.setup, Sought("sensors", offsets=False))
