"""What can be computed from the printed numbers alone."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from schuler import (
    WhiteNoise,
    level_for_band,
    position_error_of_accel_bias,
    position_sd_of_white_acceleration,
    schuler_factor,
)
from schuler_papers.experiment import Numbers, Results, Size, numbers
from schuler_papers.judging import Found, plain
from schuler_papers.outcome import Curve, Panel, Proof
from schuler_papers.tamazin2013.predictors import DEG_H

HOUR = 3600.0
EQUATION_29 = (2.25, -1.2, -0.67, 1.02, -0.26, -0.51, 0.62, -0.32, 0.08)
"""Coefficients of y[n-1] .. y[n-9]."""
DIGITS = np.array([0.01, 0.1, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01])
"""Last digits as printed."""


def run(seed: int, size: Size) -> Numbers:
    """Compute what the printed numbers imply."""
    weights = np.array(EQUATION_29)
    near = np.random.default_rng(29).uniform(-0.5, 0.5, (4000, 9)) * DIGITS
    return numbers(
        white_position=position_sd_of_white_acceleration(math.sqrt(5e-9), 1.0 / 200.0, HOUR),
        accel_share=schuler_factor("accel", HOUR),
        gyro_share=schuler_factor("gyro", HOUR),
        weight_sum=weights.sum(),
        largest_root=_largest_root(weights),
        least_root=min(_largest_root(weights + shift) for shift in near),
        noise_gain=1.0 + weights @ weights,
        band_of_4_levels=200.0 / 2**5,
        levels_of_band=level_for_band(12.5, 200.0),
        gyro_floor=WhiteNoise(100.0 * DEG_H).innovation_variance(1.0 / 200.0) / DEG_H**2,
    )


def _largest_root(weights: np.ndarray) -> float:
    return float(np.abs(np.roots(np.concatenate([[1.0], -weights]))).max())


def interpretation(results: Results, size: Size) -> Found:
    """What the position column should have been."""
    one = results[0]
    proofs = {
        "pendulum": Proof(
            "2 (1 - cos x)/x² with x = t sqrt(g/R) is an eighth after an hour",
            float(one["accel_share"]), 0.0, 0.5,
        ),
    }  # fmt: skip
    time = np.linspace(60.0, HOUR, 60)
    flat = np.array([position_error_of_accel_bias(math.sqrt(5e-9), float(t)) for t in time])
    swing = flat * np.array([schuler_factor("accel", float(t)) for t in time])
    white = np.array(
        [position_sd_of_white_acceleration(math.sqrt(5e-9), 0.005, float(t)) for t in time]
    )
    panel = Panel(
        "What 5·10⁻⁹ (m/s²)² does in an hour",
        "min",
        "position error, m",
        (
            Curve("constant, flat earth (the paper)", time / 60.0, flat, "paper"),
            Curve("constant, with Schuler's pendulum", time / 60.0, swing, "theory"),
            Curve("white, as a prediction error is", time / 60.0, white, "ours"),
            Curve("printed", np.array([60.0]), np.array([458.0]), "printed", "points"),
        ),
        "Position error over an hour under three readings of the same number.",
        log_y=True,
    )
    return Found(plain(results, size).values, proofs=proofs, panels=(panel,))


def printed_model(results: Results, size: Size) -> Found:
    """Equation (29) taken at its word, and within the rounding of its digits."""
    unstable = Proof(
        "no model within the rounding of the printed digits has all poles inside the unit circle",
        float(results[0]["least_root"]), 1.0, 2.0,
    )  # fmt: skip
    impulse = np.zeros(80)
    impulse[0] = 1.0
    response = lfilter([1.0], np.concatenate([[1.0], -np.array(EQUATION_29)]), impulse)
    panel = Panel(
        "Equation (29) answers one impulse",
        "sample",
        "output",
        (Curve("as printed", np.arange(80.0), np.abs(response), "paper"),),
        "The impulse response of the printed model grows by 10 % a sample.",
        log_y=True,
    )
    return Found(plain(results, size).values, proofs={"unstable": unstable}, panels=(panel,))
