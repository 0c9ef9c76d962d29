"""`schuler outages --models`: names in, comparison out, and every mistake in one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from outcome import Outcome


def drive(folder: Path, *, noise: bool = True) -> list[str]:
    options = ["--time-offset", "0", "--window", "100:30"]
    if noise:
        options += ["--noise", str(folder / "noise.yaml")]
    for kind in ("imu", "gnss"):
        options += ["--" + kind, str(folder / f"{kind}.parquet")]
    return options


def test_models_go_through_the_same_outage(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    target, page = tmp_path / "o.json", tmp_path / "o.html"
    done = call(
        "outages", *drive(recordings), "--models", "own,15AV,18AV+turn-on,15AR",
        "--json", target, "--report", page,
    )  # fmt: skip
    assert done.code == 0, done.err
    found = json.loads(target.read_text())
    models = found["comparison"]["models"]
    assert {k: m["states"] for k, m in models.items()} == {
        "own": 15, "15AV": 15, "18AV+turn-on": 21, "15AR": 15,
    }  # fmt: skip
    assert found["model"] == "own"
    assert found["causal"] == models["own"]["causal"]
    # white noise only: the constants of the own model and of the others are all it needs
    assert models["own"]["causal"]["mean_of_max_m"] < 20.0
    for name in models:
        assert name in done.out
        assert name in page.read_text()
    # what navigation without --models finds with the same noise
    call("outages", *drive(recordings), "--json", target)
    alone = json.loads(target.read_text())
    assert alone["causal"] == found["causal"]
    assert call("outages", *drive(recordings), "--models", "own", "--limit", "1e-6").code == 1


def test_a_static_log_stands_in_for_the_noise_model(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    target = tmp_path / "o.json"
    static = ["--static", recordings / "static.parquet"]
    done = call(
        "outages", *drive(recordings, noise=False), "--models", "15AR,18AVWD",
        "--denoising", "causal", *static, "--json", target,
    )  # fmt: skip
    assert done.code == 0, done.err
    models = json.loads(target.read_text())["comparison"]["models"]
    # N of the simulated sensor, found in its ten minutes of rest
    white = models["15AR"]["processes"]["gyro_x"][0]
    assert white["kind"] == "white_noise"
    assert white["density"] == pytest.approx(1e-4, rel=0.02)
    assert models["18AVWD"]["denoising"]["form"] == "causal"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--models", "15AV,99AV"], "99AV"),
        (["--models", "15AV,15av"], "each once"),
        (["--models", "15AV+wings"], "wings"),
        (["--static", "x.parquet"], "--static without --models"),
        (["--models", "15AV", "--tune-noise"], "one of them"),
    ],
)
def test_mistakes_are_told_in_one_line(
    recordings: Path, call: Callable[..., Outcome], options: list[str], words: str
) -> None:
    done = call("outages", *drive(recordings), *options)
    assert done.code == 2
    assert words in done.one_line()


def test_models_of_an_unknown_sensor_are_refused(
    recordings: Path, call: Callable[..., Outcome]
) -> None:
    done = call("outages", *drive(recordings, noise=False), "--models", "15AV")
    assert done.code == 2
    assert "--static" in done.one_line()


def test_a_lag_is_judged_between_filter_and_smoother(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    target, page = tmp_path / "o.json", tmp_path / "o.html"
    done = call("outages", *drive(recordings), "--lag", "4", "--json", target, "--report", page)
    assert done.code == 0, done.err
    found = json.loads(target.read_text())
    assert found["fixed_lag"]["lag_s"] == 4.0
    assert "lag of 4" in done.out
    assert "lag of 4" in page.read_text()
    assert call("outages", *drive(recordings), "--lag", "0").code == 2
    both = call("outages", *drive(recordings), "--lag", "4", "--models", "own")
    assert "one of them" in both.one_line()
