"""An export that cannot be written names the reason and takes nothing with it."""

from __future__ import annotations

from pathlib import Path

from schuler.cli.methods import add_kalibr
from schuler.cli.outputs import Outputs
from schuler.data import CHANNELS
from schuler.noise import NoiseModel, Quantization, WhiteNoise


def test_a_kalibr_file_that_cannot_be_written_says_why(tmp_path: Path) -> None:
    json, kalibr = tmp_path / "o.json", tmp_path / "k.yaml"
    outputs = Outputs(None, json, None, kalibr, inputs=())
    outputs.text(json, lambda: "{}")
    model = NoiseModel(dict.fromkeys(CHANNELS, Quantization(1e-6)), rate=100.0)
    refused = add_kalibr(outputs, kalibr, model, 100.0, "/imu0")
    assert "k.yaml was not written" in refused
    assert "no white noise" in refused
    assert outputs.commit() == (json,)
    assert json.exists()
    assert not kalibr.exists()
    good = NoiseModel(dict.fromkeys(CHANNELS, WhiteNoise(1e-3)), rate=100.0)
    assert add_kalibr(Outputs(kalibr, inputs=()), kalibr, good, 100.0, "/imu0") == ""
