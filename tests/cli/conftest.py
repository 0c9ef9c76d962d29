"""Small recordings on disk and a way to call the program inside this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from outcome import ACCEL_N, GYRO_N, Outcome

from schuler.cli import main
from schuler.noise import NoiseModel, WhiteNoise
from schuler.simulation import car_urban, ideal_imu, simulate_gnss, simulate_imu, simulate_static


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Callable[..., Outcome]:
    def run(*arguments: object) -> Outcome:
        """Call it; tests may call twice with one output, so it is written over."""
        capsys.readouterr()
        code = main([*(str(a) for a in arguments), "--force"])
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return run


@pytest.fixture(scope="session")
def noise() -> NoiseModel:
    processes = {f"gyro_{a}": WhiteNoise(GYRO_N) for a in "xyz"}
    return NoiseModel(processes | {f"accel_{a}": WhiteNoise(ACCEL_N) for a in "xyz"}, rate=50.0)


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory, noise: NoiseModel) -> Path:
    """static.parquet, imu.parquet, gnss.parquet and noise.yaml in one folder."""
    folder = tmp_path_factory.mktemp("recordings")
    rng = np.random.default_rng(11)
    simulate_static(noise, 600.0, 50.0, rng).to_parquet(folder / "static.parquet")
    profile = car_urban(180.0, np.random.default_rng(12), standstill=30.0)
    simulate_imu(ideal_imu(profile, 50.0), noise, rng).to_parquet(folder / "imu.parquet")
    gnss = simulate_gnss(profile, 1.0, position_sd=0.5, velocity_sd=0.05, rng=rng)
    gnss.to_parquet(folder / "gnss.parquet")
    noise.save(folder / "noise.yaml")
    return folder
