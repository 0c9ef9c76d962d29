"""Real sensors at rest: spectrum and Allan curve tell the same story."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from schuler.curves.autocorrelation import autocorrelation
from schuler.estimation.comparison.pairs import compare_parameters
from schuler.estimation.gauss_markov_correlation import fit_gauss_markov
from schuler.estimation.identify import identify
from schuler.estimation.spectrum.fit import identify_spectrum
from schuler.io import read_imu


@pytest.mark.parametrize("run", [1, 4])
def test_spectrum_and_allan_agree_on_a_gyro(data_folder: Path, run: int) -> None:
    imu = read_imu(data_folder / "adis16405-static" / f"imu{run}.parquet")
    signal = imu.gyro[:, 0]
    rate = (imu.time.size - 1) / (imu.time[-1] - imu.time[0])
    allan = identify(signal, rate)
    spectrum = identify_spectrum(signal, rate, allan.process)
    table = compare_parameters(spectrum, allan)
    assert table.outside(2.5) == ()
    # the sensor's own low-pass correlates neighbouring samples, which no process describes
    assert "fast part left out" in spectrum.flags
    assert not fit_gauss_markov(autocorrelation(signal, rate, 60.0)).exponential
    density = spectrum.parameters["white_noise.density"]
    assert spectrum.slopes.white_noise is not None
    assert spectrum.slopes.white_noise.value == pytest.approx(density, rel=0.15)
    assert np.isfinite(spectrum.ratio).all()
