"""Six static records of a real sensor: table 2 again, from another device."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from schuler import allan_deviation, denoise, fit_ar, read_imu
from schuler_papers.experiment import FloatArray, Numbers, Results, Size, numbers, stacked
from schuler_papers.judging import Found

AXES = ("x", "y", "z")
FOLDER = "adis16405-static"
LEVEL = 7


def run(seed: int, size: Size, folder: Path) -> Numbers:
    """De-noise the gyros of one record with seven levels and fit AR(1) and AR(3)."""
    imu = read_imu(folder / FOLDER / f"imu{seed % 6 + 1}.parquet")
    found: dict[str, FloatArray | float] = {}
    for k, axis in enumerate(AXES):
        signal = imu.gyro[:, k] - imu.gyro[:, k].mean()
        quiet = denoise(signal, level=LEVEL, details="zero").signal
        three, one = fit_ar(quiet, 3, method="burg"), fit_ar(quiet, 1, method="burg")
        found[f"{axis}:ar3"] = three.coefficients
        found[f"{axis}:ratio"] = one.innovation_variance / three.innovation_variance
        curves = [allan_deviation(s, imu.rate, taus=[0.2, 10.0]).deviation for s in (quiet, signal)]
        found[f"{axis}:allan"] = curves[0] / curves[1]
    return numbers(**found)


def table_2(results: Results, size: Size) -> Found:
    """The triplet of table 2 out of another sensor."""
    allan = np.stack([stacked(results, f"{a}:allan") for a in AXES], axis=1)
    values = {
        "ar3": np.stack([stacked(results, f"{a}:ar3") for a in AXES], axis=1),
        "ratio": np.stack([stacked(results, f"{a}:ratio") for a in AXES], axis=1),
        "long": allan[:, :, 1],
        "short": allan[:, :, 0],
    }
    return Found(values)
