"""`schuler calibrate` on a small array: table, files, page, checks, bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from outcome import Outcome

from schuler.arrays.calibration.result import ArrayCalibration
from schuler.data.imu_calibration import ImuCalibration
from schuler.rotations import dcm_from_rotation_vector

TURN = np.array([[0.02, 0.0, -0.01], [-0.03, 0.01, 0.0], [0.01, -0.01, 0.01]])
ARM = np.array([[0.03, 0.0, 0.0], [-0.03, 0.02, 0.0], [0.0, -0.02, 0.0]])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """array.parquet of three IMUs (rest, then turning by hand), and the same with one mirrored."""
    place = tmp_path_factory.mktemp("array")
    rng = np.random.default_rng(5)
    time = np.arange(4000) / 100.0
    on = np.clip(time - 10.0, 0.0, 1.0)[:, None]
    angle = 2.0 * np.pi * np.array([0.7, 1.1, 1.6]) * time[:, None]
    pace = 2.0 * np.pi * np.array([0.7, 1.1, 1.6])
    rate = 2.0 * on * np.sin(angle)
    slope = 2.0 * (on * pace * np.cos(angle) + np.where((on > 0) & (on < 1), np.sin(angle), 0.0))
    force = np.array([0.0, 0.0, 9.81]) + 3.0 * on * np.cos(1.3 * angle)
    columns = {"time_s": time}
    for k, turn in enumerate(dcm_from_rotation_vector(TURN)):
        arm = np.cross(slope, ARM[k]) + np.cross(rate, np.cross(rate, ARM[k]))
        gyro = rate @ turn + 1e-3 * rng.standard_normal((4000, 3))
        accel = (force + arm) @ turn + 1e-2 * rng.standard_normal((4000, 3))
        for j, axis in enumerate("xyz"):
            columns[f"imu{k + 1}_gyro_{axis}_rad_s"] = gyro[:, j]
            columns[f"imu{k + 1}_accel_{axis}_m_s2"] = accel[:, j]
    pl.DataFrame(columns).write_parquet(place / "array.parquet")
    columns["imu2_gyro_y_rad_s"] = -columns["imu2_gyro_y_rad_s"]
    pl.DataFrame(columns).write_parquet(place / "mirrored.parquet")
    return place


def test_it_finds_turns_and_arms_and_writes_what_is_asked(
    folder: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    file = folder / "array.parquet"
    yaml, page, result = (tmp_path / n for n in ("a.yaml", "a.html", "a.json"))
    done = call("calibrate", file, "--on", file, "--out", yaml, "--report", page, "--json", result)
    assert done.code == 0, done.err
    assert "turn, deg" in done.out and "lever arm, mm" in done.out
    found = ArrayCalibration.load(yaml)
    np.testing.assert_allclose(found.turn, TURN, atol=1e-3)
    np.testing.assert_allclose(found.position, ARM - ARM.mean(axis=0), atol=1e-3)
    judged = json.loads(result.read_text())["judged"]
    assert [j["name"] for j in judged] == ["array", "array"]
    assert judged[1]["estimated_on_it"] == "biases at rest and delays"
    for one in judged:
        gyro = {d["condition"]: d["rms"] for d in one["calibrated"] if d["quantity"] == "gyro"}
        # three sensors of 1e-3 rad/s against their mean
        assert gyro["below 500 deg/s"] == pytest.approx(1e-3 * np.sqrt(2.0 / 3.0), rel=0.05)
        nominal = {d["condition"]: d["rms"] for d in one["nominal"] if d["quantity"] == "gyro"}
        assert nominal["below 500 deg/s"] > 10 * gyro["below 500 deg/s"]
    text = page.read_text()
    assert "Sensors against their mean" in text and "Where the accelerometers sit" in text


def test_a_check_that_fails_and_input_that_cannot_be(
    folder: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    done = call("calibrate", folder / "array.parquet", "--most", "0.001", "--model", "rotation")
    assert done.code == 1 and "check failed: gyros disagree by" in done.err
    done = call("calibrate", folder / "mirrored.parquet")
    assert done.code == 2 and "left-handed" in done.one_line()
    one = tmp_path / "one.csv"
    one.write_text("time_s,gyro_x,gyro_y,gyro_z\n" + "".join(
        f"{k / 100},{k % 7},{k % 5},{k % 3}\n" for k in range(50)))  # fmt: skip
    assert "channels that are missing" in call("calibrate", one).one_line()
    assert call("calibrate", folder / "array.parquet", "--bandwidth", "80").code == 2


def test_lasting_faults_are_told_from_motion_by_a_healthy_recording(
    folder: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    file, board, page = folder / "array.parquet", tmp_path / "a.yaml", tmp_path / "f.html"
    assert call("calibrate", file, "--out", board).code == 0
    told = ("--calibration", board, "--healthy", file)
    done = call("faults", file, *told)
    assert done.code == 0 and "no sensor is off" in done.out
    bad = tmp_path / "bad.parquet"
    frame = pl.read_parquet(file)
    during = (frame["time_s"] >= 20.0) & (frame["time_s"] < 23.0)
    name = "imu3_gyro_z_rad_s"
    frame.with_columns(pl.col(name) + 0.02 * during.cast(pl.Float64)).write_parquet(bad)
    done = call("faults", bad, *told, "--report", page, "--json", tmp_path / "f.json")
    assert done.code == 1
    log = json.loads((tmp_path / "f.json").read_text())["log"]
    assert {r["name"] for r in log} == {"bad imu3 z"}
    # windows of a second: seen from the first that holds part of it to the last
    assert 19.0 < log[0]["start"] < 20.5 and 22.5 < log[-1]["stop"] < 24.0
    assert log[0]["size"] == pytest.approx(0.02, rel=0.15)
    assert "Lasting faults in motion" in page.read_text()
    done = call("faults", file, "--healthy", file)
    assert done.code == 2 and "without a calibration" in done.one_line()


def test_the_calibration_of_one_imu_is_applied_by_every_verb_that_reads_one(
    tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    rng = np.random.default_rng(8)
    time = np.arange(6000) / 100.0
    frame = {"time_s": time}
    for j, axis in enumerate("xyz"):
        frame[f"gyro_{axis}_rad_s"] = 1e-3 * rng.standard_normal(time.size) + 0.02
        frame[f"accel_{axis}_m_s2"] = 1e-2 * rng.standard_normal(time.size) - 9.8 * (j == 2)
    file, yaml = tmp_path / "still.parquet", tmp_path / "one.yaml"
    pl.DataFrame(frame).write_parquet(file)
    zero, one, none = np.zeros(3), np.eye(3), np.zeros((3, 3))
    ImuCalibration(
        name="one", accel_matrix=one, accel_matrix_sd=none, accel_bias=zero, accel_bias_sd=zero,
        gyro_matrix=2.0 * one, gyro_matrix_sd=none, gyro_bias=np.full(3, 0.02), gyro_bias_sd=zero,
        g_sensitivity=none, g_sensitivity_sd=none, poses=12, turns=11, norm_before=0.1,
        norm_after=0.01, findings=(),
    ).save(yaml)  # fmt: skip
    out = tmp_path / "out.parquet"
    assert call("convert", file, out, "--calibration", yaml).code == 0
    gyro = pl.read_parquet(out)["gyro_x_rad_s"].to_numpy()
    np.testing.assert_allclose(gyro, 2.0 * (frame["gyro_x_rad_s"] - 0.02), atol=1e-12)
    assert "calibrat" in call("read", file, "--calibration", yaml).out
    noise = []
    for more in ((), ("--calibration", yaml)):
        found = tmp_path / f"{len(more)}.json"
        assert call("characterize", file, "--model", "W", "--json", found, *more).code == 0
        noise.append(json.loads(found.read_text()))
    white = [n["channels"]["gyro_x"]["processes"][0]["density"] for n in noise]
    assert white[1] == pytest.approx(2.0 * white[0], rel=1e-6)
    done = call("read", file, "--as", "gnss", "--calibration", yaml)
    assert done.code == 2
