"""`schuler fuse` and `schuler faults` from files to answers and exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from schuler.data import ImuRecording
from schuler.io import read_imu
from schuler.noise.noise_model import NoiseModel

SIGMA = np.array([1e-3, 1e-3, 2e-3, 1e-3])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four IMUs at rest for 60 s, the third twice as noisy, the second broken from 40 s on."""
    path = tmp_path_factory.mktemp("array")
    rng = np.random.default_rng(1)
    time = np.arange(6000) / 100.0
    for k in range(4):
        gyro = SIGMA[k] * rng.standard_normal((6000, 3))
        if k == 1:
            gyro[time > 40.0, 2] += 0.01
        accel = 0.02 * rng.standard_normal((6000, 3)) + [0.0, 0.0, -9.8]
        ImuRecording(time, gyro, accel).to_parquet(path / f"imu{k + 1}.parquet")
    return path


def test_four_files_become_one_imu_with_its_noise_model(call, folder: Path, tmp_path) -> None:
    fused, noise, page = tmp_path / "one.parquet", tmp_path / "n.yaml", tmp_path / "r.html"
    outcome = call(
        "fuse",
        str(folder),
        "--out",
        str(fused),
        "--noise-out",
        str(noise),
        "--report",
        str(page),
        "--json",
        "-",
    )
    assert outcome.code == 0, outcome.err
    answer = json.loads(outcome.out)
    gyro = answer["sensors"]["gyro"]
    # 1 / sqrt(3 + 1/4) of the good ones
    np.testing.assert_allclose(gyro["fused_deviation"], 1e-3 / np.sqrt(3.25), rtol=0.1)
    assert gyro["weight"]["imu3 x"] < 0.4 * gyro["weight"]["imu1 x"]
    recording = read_imu(fused)
    assert recording.size == 6000 and recording.complete
    assert recording.gyro[1000:4000].std() == pytest.approx(1e-3 / np.sqrt(3.25), rel=0.1)
    density = NoiseModel.load(noise).process("gyro_x").parameters["white_noise.density"]
    assert density == pytest.approx(1e-4 / np.sqrt(3.25), rel=0.1)
    text = page.read_text()
    assert "Synthetic IMU" in text and "Sensor axes" in text and "together" in text


def test_a_fault_is_named_with_its_time_and_the_exit_code_says_so(call, folder, tmp_path) -> None:
    page = tmp_path / "r.html"
    outcome = call("faults", str(folder), "--report", str(page), "--json", str(tmp_path / "f"))
    assert outcome.code == 1
    assert "gyro imu2 z taken out" in " ".join(outcome.out.split())
    (line,) = json.loads((tmp_path / "f").read_text())["log"]
    assert 40.0 < line["start_s"] < 41.5 and line["kind"] == "axis" and line["stop_s"] is None
    assert "gyro imu2 z taken out" in page.read_text()
    files = [str(folder / f"imu{k}.parquet") for k in (1, 3, 4)]
    assert call("faults", *files).code == 0
    mended = call("fuse", str(folder), "--without-faults", "--json", "-")
    assert json.loads(mended.out)["faults"]["healthy"] is False


def test_one_imu_is_refused_in_one_line(call, folder) -> None:
    outcome = call("fuse", str(folder / "imu1.parquet"))
    assert outcome.code == 2 and "at least two IMUs" in outcome.one_line()
    assert call("faults", str(folder / "none.parquet")).code == 2


def test_imus_that_are_not_turned_onto_common_axes_are_refused_with_the_cure(
    call, tmp_path: Path
) -> None:
    rng = np.random.default_rng(2)
    time = np.arange(3000) / 100.0
    down = [[0.0, 0.0, -9.8], [0.0, 0.0, 9.8], [0.0, 0.0, -9.8], [0.0, 9.8, 0.0]]
    for k, force in enumerate(down):
        gyro = 1e-3 * rng.standard_normal((3000, 3))
        accel = 0.02 * rng.standard_normal((3000, 3)) + force
        ImuRecording(time, gyro, accel).to_parquet(tmp_path / f"imu{k + 1}.parquet")
    for verb in ("fuse", "faults"):
        outcome = call(verb, str(tmp_path))
        assert outcome.code == 2
        assert "gravity in imu2 by 180 deg, gravity in imu4 by 90 deg" in outcome.err
        assert "schuler calibrate" in outcome.err


def test_one_imu_with_a_stuck_accelerometer_is_a_fault_and_no_question_of_axes(
    call, tmp_path: Path
) -> None:
    rng = np.random.default_rng(3)
    time = np.arange(3000) / 100.0
    for k in range(4):
        gyro = 1e-3 * rng.standard_normal((3000, 3))
        accel = 0.02 * rng.standard_normal((3000, 3)) + [0.0, 0.0, -9.8]
        if k == 2:
            accel[:, 0] += 9.8
        ImuRecording(time, gyro, accel).to_parquet(tmp_path / f"imu{k + 1}.parquet")
    assert call("faults", str(tmp_path)).code in (0, 1)
