"""Noise models: what they refuse, and YAML that a person can write."""

from __future__ import annotations

import math
import pickle
from pathlib import Path

import numpy as np
import pytest

from schuler.errors import InputError, ModelError, SchulerError, UnitError
from schuler.noise import (
    ARMA,
    Autoregressive,
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Quantization,
    RandomWalk,
    RateRamp,
    Sinusoid,
    TurnOnBias,
    WhiteNoise,
)

MODEL = NoiseModel(
    processes={
        "accel_z": WhiteNoise(7.5e-4)
        + Quantization(1e-5)
        + BiasInstability(1.3e-3, 1.0, 1000.0, 2)
        + RateRamp(-2e-8)
        + TurnOnBias(0.05)
        + Sinusoid(0.01, 0.55, 0.3),
        "gyro_x": WhiteNoise(6.1e-4)
        + GaussMarkov(2e-4, 600.0)
        + GaussMarkov(1e-4, 6.0)
        + RandomWalk(1e-7, initial_sd=1e-3),
    },
    standard_errors={"gyro_x": {"white_noise.density": 1.1e-6, "gauss_markov_2.sigma": 2e-5}},
    rate=100.0,
    source='bench "A": #7',
    limits={"accel_z": {"random_walk.density": 3e-6}},
)


@pytest.mark.parametrize("units", ["datasheet", "si"])
def test_model_comes_back_from_its_file(tmp_path: Path, units: str) -> None:
    path = tmp_path / "noise.yaml"
    MODEL.save(path, units=units)  # type: ignore[arg-type]
    back = NoiseModel.load(path)
    assert back.channels == ("gyro_x", "accel_z")
    assert back.source == MODEL.source
    assert back.rate == 100.0
    for channel in MODEL.channels:
        found, wanted = back.process(channel).parameters, MODEL.process(channel).parameters
        assert found == pytest.approx(wanted, rel=1e-8)
    # errors are written with three digits
    for channel, errors in MODEL.standard_errors.items():
        assert back.standard_errors[channel] == pytest.approx(dict(errors), rel=1e-2)
    assert back.limits["accel_z"] == pytest.approx(dict(MODEL.limits["accel_z"]), rel=1e-8)


def test_datasheet_units_are_what_a_datasheet_says(tmp_path: Path) -> None:
    path = tmp_path / "noise.yaml"
    path.write_text(
        "channels:\n"
        "  gyro_y:\n"
        "    - white_noise: {density: 0.24 deg/sqrt(h)}\n"
        "    - random_walk: {density: 25 deg/h^1.5}\n"
        "    - bias_instability: {level: 38 deg/h, shortest: 1 s, longest: 1 h}\n"
        "  accel_x:\n"
        "    - white_noise: {density: 0.045 ± 0.001 m/s/sqrt(h)}\n"
        "    - gauss_markov: {sigma: 0.2 mg, correlation_time: 7}\n"
    )
    model = NoiseModel.load(path)
    gyro, accel = model.process("gyro_y").parameters, model.process("accel_x").parameters
    assert gyro["white_noise.density"] == pytest.approx(0.24 * math.pi / 180 / 60)
    assert gyro["random_walk.density"] == pytest.approx(25 * math.pi / 180 / 216000)
    assert gyro["bias_instability.level"] == pytest.approx(38 * math.pi / 180 / 3600)
    assert gyro["bias_instability.longest"] == 3600.0
    assert accel["white_noise.density"] == pytest.approx(0.045 / 60)
    assert model.standard_errors["accel_x"]["white_noise.density"] == pytest.approx(0.001 / 60)
    assert accel["gauss_markov.sigma"] == pytest.approx(0.2e-3 * 9.80665)
    assert accel["gauss_markov.correlation_time"] == 7.0


def _channel(entry: str, channel: str = "gyro_x") -> str:
    return f"channels:\n  {channel}:\n    - {entry}\n"


BAD = {
    "white_noise: {density: 7 deg/h}": (UnitError, "gyro_x.white_noise.density"),
    "white_noise: {density: 70 ug/sqrt(Hz)}": (UnitError, "gyro_x.white_noise.density"),
    "white_noise: {density: -1 deg/sqrt(h)}": (InputError, "gyro_x.white_noise"),
    "white_noise: {density: .nan}": (InputError, "not finite"),
    "white_noise: {density: .inf}": (InputError, "not finite"),
    "white_noise: {density: }": (InputError, "no number"),
    "white_noise: {density: true}": (InputError, "no number"),
    "white_noise: {densty: 1}": (InputError, "'densty' is not known"),
    "white_noise: {}": (InputError, "'density' is missing"),
    "white_noise:": (InputError, "gyro_x.white_noise"),
    "pink_noise: {level: 1}": (InputError, "'pink_noise' is not known"),
    "gauss_markov: {sigma: 1 deg/s}": (InputError, "'correlation_time' is missing"),
    "gauss_markov: {sigma: 1 deg/s, correlation_time: 0 s}": (InputError, "gyro_x.gauss_markov"),
    "white_noise: {density: 1 +- -2 deg/sqrt(h)}": (InputError, "negative"),
    "just text": (InputError, "gyro_x"),
}


@pytest.mark.parametrize("entry", BAD)
def test_bad_entries_are_named_with_file_and_key_in_one_line(tmp_path: Path, entry: str) -> None:
    path = tmp_path / "noise.yaml"
    path.write_text(_channel(entry))
    kind, words = BAD[entry]
    with pytest.raises(SchulerError) as caught:
        NoiseModel.load(path)
    assert isinstance(caught.value, kind)
    text = str(caught.value)
    assert text.startswith(str(path))
    assert words in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "nothing"),
        ("channels: [", "line"),
        ("channels:\n", "channels"),
        ("rate: 100 Hz\n", "'channels' is missing"),
        (_channel("white_noise: {density: 1}") + "rte: 100\n", "'rte' is not known"),
        (_channel("white_noise: {density: 1}", "gyro_w"), "'gyro_w' is not a channel"),
        (_channel("white_noise: {density: 1}") + "rate: 0 Hz\n", "rate"),
        (_channel("white_noise: {density: 1}") + "rate: 100 s\n", "rate"),
        ("channels:\n  gyro_x: []\n", "no list of processes"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "noise.yaml"
    path.write_text(content)
    with pytest.raises(SchulerError) as caught:
        NoiseModel.load(path)
    assert str(path) in str(caught.value)
    assert words in str(caught.value)


def test_missing_and_binary_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        NoiseModel.load(tmp_path / "nothing.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="is not text"):
        NoiseModel.load(tmp_path / "binary.yaml")


def test_models_that_cannot_be_are_refused() -> None:
    with pytest.raises(ModelError, match="no channel"):
        NoiseModel({})
    with pytest.raises(ModelError, match="gyro_q"):
        NoiseModel({"gyro_q": WhiteNoise(1.0)})
    with pytest.raises(ModelError, match="no such term"):
        NoiseModel({"gyro_x": WhiteNoise(1.0)}, {"gyro_x": {"random_walk.density": 1.0}})
    with pytest.raises(ModelError, match="no channel 'gyro_y'"):
        NoiseModel({"gyro_x": WhiteNoise(1.0)}).process("gyro_y")


def test_model_travels_between_processes() -> None:
    back = pickle.loads(pickle.dumps(MODEL))
    assert back.process("gyro_x") == MODEL.process("gyro_x")


def test_time_series_models_keep_every_digit(tmp_path: Path) -> None:
    near_unit_root = tuple(np.poly([0.9991, 0.9993, 0.57])[1:].tolist())
    model = NoiseModel(
        {
            "gyro_x": WhiteNoise(1e-3) + Autoregressive(near_unit_root, 2.7e-13, 0.01),
            "accel_x": ARMA((1.666, -0.671), (-1.086, 0.160), 1e-6, 0.005),
        },
        rate=100.0,
    )
    file = tmp_path / "noise.yaml"
    model.save(file)
    read = NoiseModel.load(file)
    series = read.process("gyro_x").parts[1]
    assert isinstance(series, Autoregressive)
    assert series.coefficients == near_unit_root
    assert (series.driving_variance, series.interval) == (2.7e-13, 0.01)
    other = read.process("accel_x").parts[0]
    assert isinstance(other, ARMA)
    assert (other.phi, other.theta) == ((1.666, -0.671), (-1.086, 0.160))
    assert other.interval == 0.005
    bad = file.read_text(encoding="utf-8").replace("phi: [1.666, -0.671]", "phi: 1.666")
    file.write_text(bad, encoding="utf-8")
    with pytest.raises(SchulerError, match=r"noise.yaml.*arma.phi.*list"):
        NoiseModel.load(file)
