"""`schuler denoise`: a recording in, a smoother one out, and what was done to it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars
import pytest

from schuler import read_imu
from schuler.cli.app import run
from schuler.navigation.error_models.sensor_denoising import SensorDenoising


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Slow motion of 0.2 Hz under noise, 100 Hz."""
    rng = np.random.default_rng(9)
    time = np.arange(6000) / 100.0
    columns = {"time_s": time}
    for k, a in enumerate("xyz"):
        columns[f"gyro_{a}_rad_s"] = 0.3 * np.sin(0.4 * np.pi * time + k)
        columns[f"accel_{a}_m_s2"] = 9.8 * (k == 2) + np.sin(0.4 * np.pi * time)
    columns = {n: c + (n != "time_s") * 0.1 * rng.standard_normal(6000) for n, c in columns.items()}
    path = tmp_path_factory.mktemp("noisy") / "imu.csv"
    polars.DataFrame(columns).write_csv(path)
    return path


@pytest.mark.parametrize("causal", [False, True])
def test_noise_goes_and_motion_stays(
    recording: Path, tmp_path: Path, causal: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    out, told, page = (tmp_path / n for n in ("out.parquet", "told.json", "page.html"))
    command = ["denoise", str(recording), str(out), "--band", "3", "--json", str(told)]
    assert run([*command, "--report", str(page), *(["--causal"] if causal else [])]) == 0
    smooth = read_imu(out)
    middle = slice(500, 5000)
    truth = 0.3 * np.sin(0.4 * np.pi * smooth.time)
    assert np.std((smooth.gyro[:, 0] - truth)[middle]) < 0.04
    found = json.loads(told.read_text())
    assert found["causal"] is causal
    assert found["channels"]["gyro_x"]["level"] == 4
    assert "De-noising" in page.read_text()
    assert ("off-line use only" in capsys.readouterr().out) is not causal


def test_band_and_level_together_are_refused(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["denoise", str(recording), str(tmp_path / "o.csv"), "--band", "3", "--level", "4"]
    assert run(command) == 2
    assert "one of them" in capsys.readouterr().err


def test_the_paper_s_levels_leave_the_same_band_at_any_rate() -> None:
    slow, fast = SensorDenoising.table_7(), SensorDenoising.table_7(rate=400.0)
    assert slow.levels["gyro_x"] == 7
    assert all(fast.levels[c] == level + 2 for c, level in slow.levels.items())
