"""imu.yaml for Kalibr: numbers, worst axes, and nothing that Kalibr would refuse."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import yaml

from schuler.errors import ModelError
from schuler.io.kalibr import kalibr_yaml, write_kalibr
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Process,
    Quantization,
    RandomWalk,
    WhiteNoise,
)

KEYS = (
    "accelerometer_noise_density",
    "accelerometer_random_walk",
    "gyroscope_noise_density",
    "gyroscope_random_walk",
    "update_rate",
)


def model(gyro: list[Process], accel: list[Process], **more: object) -> NoiseModel:
    named = {f"gyro_{a}": p for a, p in zip("xyz", gyro, strict=False)}
    named |= {f"accel_{a}": p for a, p in zip("xyz", accel, strict=False)}
    return NoiseModel(named, rate=200.0, source="bench", **more)  # type: ignore[arg-type]


def test_worst_axis_and_plain_numbers() -> None:
    text = kalibr_yaml(
        model(
            [WhiteNoise(1e-4) + RandomWalk(5e-7), WhiteNoise(3e-4) + RandomWalk(2e-7)],
            [WhiteNoise(2e-3), WhiteNoise(1e-3) + RandomWalk(4e-5), WhiteNoise(1.5e-3)],
        ),
        topic="/imu: raw",
    )
    read = yaml.safe_load(text)
    assert read["gyroscope_noise_density"] == pytest.approx(3e-4)
    assert read["gyroscope_random_walk"] == pytest.approx(5e-7)
    assert read["accelerometer_noise_density"] == pytest.approx(2e-3)
    assert read["accelerometer_random_walk"] == pytest.approx(4e-5)
    assert read["rostopic"] == "/imu: raw"
    assert read["update_rate"] == 200.0
    for key in KEYS:
        assert type(read[key]) is float
        assert read[key] > 0.0
    assert "np.float64" not in text
    assert "white noise of gyro_y" in text
    assert "rad/s^2/sqrt(Hz)" in text


def test_a_walk_that_was_not_found_is_the_most_that_is_not_excluded() -> None:
    text = kalibr_yaml(
        model(
            [WhiteNoise(1e-4)] * 3,
            [WhiteNoise(2e-3) + RandomWalk(0.0)] * 3,
            limits={
                f"gyro_{a}": {"random_walk.density": v}
                for a, v in zip("xyz", (1e-8, 3e-8, 2e-8), strict=True)
            },
        )
    )
    read = yaml.safe_load(text)
    assert read["gyroscope_random_walk"] == pytest.approx(3e-8)
    assert "no random walk was found in gyro_y, but Kalibr refuses zero" in text
    # nothing known: as strong as the white noise after an hour
    walk = read["accelerometer_random_walk"]
    assert RandomWalk(walk).allan_variance(3600.0) == pytest.approx(
        WhiteNoise(2e-3).allan_variance(3600.0)
    )
    assert "after 1 h" in text


def test_gauss_markov_becomes_the_walk_that_starts_as_fast() -> None:
    slow = GaussMarkov(2e-4, 600.0)
    text = kalibr_yaml(model([WhiteNoise(1e-4) + slow] * 3, [WhiteNoise(1e-3) + RandomWalk(1e-5)]))
    walk = yaml.safe_load(text)["gyroscope_random_walk"]
    # far below Tc the two have the same Allan variance
    assert RandomWalk(walk).allan_variance(1.0) == pytest.approx(slow.allan_variance(1.0), rel=2e-3)
    assert "equivalent walk of gyro_x" in text


def test_fast_gauss_markov_counts_as_white_noise() -> None:
    fast = GaussMarkov(5e-3, 0.02)
    text = kalibr_yaml(model([WhiteNoise(1e-4) + fast] * 3, [WhiteNoise(1e-3) + RandomWalk(1e-5)]))
    density = yaml.safe_load(text)["gyroscope_noise_density"]
    total = WhiteNoise(1e-4) + fast
    # far above Tc the sum has the Allan variance of that white noise
    assert WhiteNoise(density).allan_variance(100.0) == pytest.approx(
        total.allan_variance(100.0), rel=1e-3
    )


def test_flicker_is_taken_apart() -> None:
    flicker = BiasInstability(1e-4, 10.0, 1000.0)
    text = kalibr_yaml(model([WhiteNoise(1e-4) + flicker], [WhiteNoise(1e-3) + RandomWalk(1e-5)]))
    expected = math.sqrt(sum(2 * g.sigma**2 / g.correlation_time for g in flicker.gauss_markovs))
    assert yaml.safe_load(text)["gyroscope_random_walk"] == pytest.approx(expected)


def test_file_is_written_and_rate_can_be_given(tmp_path: Path) -> None:
    path = tmp_path / "imu.yaml"
    write_kalibr(path, model([WhiteNoise(1e-4)], [WhiteNoise(1e-3)]), rate=400, topic="/imu1")
    read = yaml.safe_load(path.read_text())
    assert read["update_rate"] == 400.0
    assert read["rostopic"] == "/imu1"
    assert [p.name for p in tmp_path.iterdir()] == ["imu.yaml"]


def test_what_kalibr_cannot_have_is_refused() -> None:
    white = WhiteNoise(1e-3)
    with pytest.raises(ModelError, match="no accel channel"):
        kalibr_yaml(model([white], []))
    with pytest.raises(ModelError, match="no gyro channel"):
        kalibr_yaml(model([], [white]))
    with pytest.raises(ModelError, match="gyro_x has no white noise"):
        kalibr_yaml(model([Quantization(1e-5)], [white]))
    with pytest.raises(ModelError, match="no rate"):
        kalibr_yaml(NoiseModel({"gyro_x": white, "accel_x": white}))
    with pytest.raises(ModelError, match="no rate"):
        kalibr_yaml(model([white], [white]), rate=0.0)
