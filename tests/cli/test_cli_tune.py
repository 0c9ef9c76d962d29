"""`schuler tune`: the factors of a drive beside the numbers of the bench."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from outcome import ACCEL_N, GYRO_N, Outcome

from schuler.noise import NoiseModel


def test_tune_tells_the_factors_and_writes_the_model(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    # the drive's gyros are five times as loud as this model says, its accelerometers as loud
    bench = tmp_path / "bench.yaml"
    model = NoiseModel.load(recordings / "noise.yaml")
    quiet = {
        c: type(p.components[0])(p.components[0].density / (5.0 if c[0] == "g" else 1.0))  # type: ignore[attr-defined,call-arg]
        for c, p in model.processes.items()
    }
    NoiseModel(quiet, rate=50.0).save(bench)
    target, page, tuned = tmp_path / "t.json", tmp_path / "t.html", tmp_path / "tuned.yaml"
    files = ["--imu", recordings / "imu.parquet", "--gnss", recordings / "gnss.parquet"]
    outputs = ["--json", target, "--report", page, "--noise-out", tuned]
    done = call("tune", *files, "--noise", bench, "--time-offset", "0", *outputs)
    assert done.code == 0, done.err
    assert "gyro white noise" in done.out
    told = json.loads(target.read_text())
    by_name = {f"{i['sensor']} {i['kind']}": i for i in told["inflations"]}
    # no walk in the model, none in the answer
    assert sorted(by_name) == ["accelerometer white noise", "gyro white noise"]
    gyro = by_name["gyro white noise"]
    low, high = gyro["interval_95"]
    assert low < gyro["factor"] < high
    # two and a half minutes of driving: within three standard deviations, and not one
    assert abs(math.log(gyro["factor"] / 5.0)) < 1.53 * math.log(high / gyro["factor"])
    assert gyro["factor"] > 1.5
    assert gyro["static_density"] == pytest.approx([GYRO_N / 5.0] * 3)
    losses = {p["factor"]: p["log_likelihood_lost"] for p in gyro["profile"]}
    assert losses[100.0] > 50.0
    assert min(losses, key=losses.__getitem__) in (3.0, 10.0)
    loud = NoiseModel.load(tuned).process("gyro_x").components[0]
    assert loud.density == pytest.approx(gyro["tuned_density"][0])  # type: ignore[attr-defined]
    low, high = by_name["accelerometer white noise"]["interval_95"]
    assert low < 3.0
    assert high > 0.33
    assert by_name["accelerometer white noise"]["static_density"] == pytest.approx([ACCEL_N] * 3)
    assert "Static numbers and what the drive needs" in page.read_text()


def test_tune_needs_a_noise_model(recordings: Path, call: Callable[..., Outcome]) -> None:
    files = ["--imu", recordings / "imu.parquet", "--gnss", recordings / "gnss.parquet"]
    done = call("tune", *files)
    assert done.code == 2
    assert "--noise" in done.one_line()
