"""`schuler characterize --method`: the same numbers in terminal, JSON, page and noise model."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from outcome import ACCEL_N, GYRO_N, Outcome

from schuler.noise import NoiseModel


def test_methods_are_compared_everywhere(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    report, result, model = (tmp_path / n for n in ("r.html", "r.json", "n.yaml"))
    outcome = call(
        "characterize", recordings / "static.parquet", "--method", "gmwm", "--method", "psd",
        "--method", "ar", "--report", report, "--json", result, "--noise-out", model,
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    found = json.loads(result.read_text())
    saved = NoiseModel.load(model)
    assert found["method"] == "gmwm"
    assert "gmwm" in saved.source or "wavelet" in saved.source
    for channel, answer in found["channels"].items():
        truth = GYRO_N if channel.startswith("gyro") else ACCEL_N
        density = answer["parameters"]["white_noise.density"]
        assert abs(density["value"] - truth) < 5.0 * density["standard_error"], channel
        assert density["standard_error"] < 0.03 * truth
        methods = found["methods"][channel]["methods"]
        assert set(methods) == {"gmwm", "psd", "ar"}
        assert methods["psd"]["parameters"]["white_noise.density"]["value"] == pytest.approx(
            truth, rel=0.03
        )
        # the samples of white noise have the variance N² rate
        assert methods["ar"]["parameters"]["innovation_variance"]["value"] == pytest.approx(
            truth**2 * 50.0, rel=0.05
        )
        assert saved.process(channel).parameters["white_noise.density"] == pytest.approx(
            density["value"], rel=1e-6
        )
    page = report.read_text(encoding="utf-8")
    assert "Methods side by side" in page
    assert "What the models leave" in page
    for shown in ("gmwm", "psd", "white noise N", "AR("):
        assert shown in outcome.out
    assert str(report) in outcome.out


def test_allan_alone_is_the_usual_way(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    path = recordings / "static.parquet"
    first, second = tmp_path / "a.json", tmp_path / "b.json"
    assert call("characterize", path, "--json", first).code == 0
    assert call("characterize", path, "--method", "allan", "--json", second).code == 0
    usual, named = (json.loads(p.read_text()) for p in (first, second))
    assert usual["channels"] == named["channels"]
    assert set(usual) == set(named)


def test_one_method_makes_json_on_standard_output(
    recordings: Path, call: Callable[..., Outcome]
) -> None:
    outcome = call("characterize", recordings / "static.parquet", "--method", "ml", "--json", "-")
    assert outcome.code == 0
    found = json.loads(outcome.out)
    assert found["method"] == "ml"
    assert found["rate_hz"] == pytest.approx(50.0)
    assert "white noise N" in outcome.err


def test_what_cannot_be_is_refused_before_the_work(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    unknown = call("characterize", recordings / "static.parquet", "--method", "magic")
    assert unknown.code == 2
    assert "allan, slope, psd" in unknown.one_line()
    without = call(
        "characterize", recordings / "static.parquet", "--method", "ar",
        "--noise-out", tmp_path / "n.yaml",
    )  # fmt: skip
    assert without.code == 2
    assert "noise model by method 'ar'" in without.one_line()
    assert not list(tmp_path.iterdir())
