"""`navigate --model`: an error model of the catalogue drives the filter."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import schuler
from schuler.cli.app import run


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model")
    assert run(["simulate", str(folder), "--duration", "150", "--seed", "8"]) == 0
    return folder


def command(drive: Path, *more: str) -> list[str]:
    files = [f"--{k}={drive / f'{k}.parquet'}" for k in ("imu", "gnss")]
    return ["navigate", *files, "--time-offset", "0", *more]


def test_the_model_is_used_and_named(
    drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    noise = ["--noise", str(drive / "noise.yaml")]
    states = {}
    for name in ("own", "15AV+turn-on", "flicker4"):
        out = tmp_path / f"{name}.json"
        assert run(command(drive, *noise, "--model", name, "--smooth", "--json", str(out))) == 0
        told = json.loads(out.read_text())["settings"]["error_model"]
        states[told["name"]] = told["states"]
    assert states["flicker4"] != states["15AV+turn-on"] != states["own"]
    run(command(drive, *noise, "--model", "15AV"))
    assert "+turn-on adds one" in capsys.readouterr().err


def test_python_takes_it_too(drive: Path) -> None:
    model = schuler.NoiseModel.load(drive / "noise.yaml")
    imu = schuler.read_imu(drive / "imu.parquet")
    gnss = schuler.read_gnss(drive / "gnss.parquet")
    (own,) = schuler.error_models(["own"], noise_model=model)
    plain = schuler.navigate(imu, gnss, model, time_offset=0.0)
    same = schuler.navigate(imu, gnss, model, time_offset=0.0, error_model=own)
    away = plain.trajectory.position[:, 2] - same.trajectory.position[:, 2]
    assert np.sqrt(np.mean(away**2)) < 0.02
    assert "error_model" in same.settings


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--model", "15AV,18AV"], "one error model"),
        (["--model", "99XX"], "15AV"),
        (["--model", "15AV"], "unknown sensor"),
        (["--static", "x.csv"], "--static without --model"),
    ],
)
def test_mistakes(
    drive: Path, more: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command(drive, *more)) == 2
    assert said in capsys.readouterr().err
