"""An export that cannot be written names the reason and takes nothing with it."""

from __future__ import annotations

from pathlib import Path

import pytest

from schuler.cli.job import Job, Result
from schuler.cli.options.files import ModelFiles, Written
from schuler.data import CHANNELS
from schuler.noise import NoiseModel, Quantization, WhiteNoise


def test_a_kalibr_file_that_cannot_be_written_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    json, kalibr, noise = (tmp_path / n for n in ("o.json", "k.yaml", "n.yaml"))
    files = ModelFiles(noise_out=noise, kalibr=kalibr)
    model = NoiseModel(dict.fromkeys(CHANNELS, Quantization(1e-6)), rate=100.0)
    texts, refused = files.texts(model, 100.0)
    assert refused[0].startswith("k.yaml was not written")
    assert "no white noise" in refused[0]
    job = Job(Written(json=json), noise, kalibr)
    assert job.finish(Result(texts=texts, refused=refused)) == 1
    assert "k.yaml was not written" in capsys.readouterr().err
    assert json.exists() and noise.exists() and not kalibr.exists()
    good = NoiseModel(dict.fromkeys(CHANNELS, WhiteNoise(1e-3)), rate=100.0)
    texts, refused = files.texts(good, 100.0)
    assert refused == () and [path for path, _ in texts] == [noise, kalibr]
