"""What can be computed from the printed numbers alone."""

from __future__ import annotations

import math

import numpy as np

from schuler.denoising.wavelet import level_for_band
from schuler.evaluation.position_error import (
    position_error_of_accel_bias,
    position_error_of_gyro_bias,
    position_sd_of_white_acceleration,
    schuler_factor,
)
from schuler.noise import WhiteNoise
from schuler.units import STANDARD_GRAVITY, scale
from schuler_papers.experiment import Numbers, Results, Size, numbers
from schuler_papers.outcome import Band, Curve, Estimate, Outcome, Panel, Row
from schuler_papers.tamazin2013.predictors import DEG_H

HOUR = 3600.0
POSITIONS = {
    "accelerometer": (
        ("Yule-Walker (1)", 5e-9, 458.0),
        ("covariance (1)", 3e-11, 35.0),
        ("FOS, degree 1 (1)", 1e-11, 20.0),
        ("FOS, degree 2 (1)", 1e-11, 20.0),
        ("Yule-Walker (10)", 5e-9, 458.0),
        ("covariance (10)", 2e-12, 9.0),
        ("FOS, degree 1 (10)", 3e-14, 1.0),
        ("FOS, degree 2 (10)", 2e-16, 0.09),
    ),
    "gyro": (
        ("Yule-Walker (1)", 7e-6, 978.0),
        ("covariance (1)", 5e-6, 826.0),
        ("FOS, degree 1 (1)", 1e-6, 369.0),
        ("FOS, degree 2 (1)", 1e-6, 369.0),
        ("Yule-Walker (10)", 2e-6, 523.0),
        ("covariance (10)", 2e-7, 165.0),
        ("FOS, degree 1 (10)", 4e-10, 7.0),
        ("FOS, degree 2 (10)", 3e-11, 2.0),
    ),
}
EQUATION_29 = (2.25, -1.2, -0.67, 1.02, -0.26, -0.51, 0.62, -0.32, 0.08)
"""Coefficients of y[n-1] .. y[n-9]."""


def run(seed: int, size: Size) -> Numbers:
    """Compute what the printed numbers imply."""
    accel = [
        position_error_of_accel_bias(math.sqrt(m), HOUR) for _, m, _ in POSITIONS["accelerometer"]
    ]
    gyro = [
        position_error_of_gyro_bias(math.sqrt(m) * DEG_H, HOUR) for _, m, _ in POSITIONS["gyro"]
    ]
    weights = np.array(EQUATION_29)
    roots = np.roots(np.concatenate([[1.0], -weights]))
    step_accel = 4.0 * STANDARD_GRAVITY / 2**16
    step_gyro = 200.0 * scale("deg/s", "angular rate") / 2**16 / DEG_H
    return numbers(
        accel_positions=accel,
        gyro_positions=gyro,
        white_position=position_sd_of_white_acceleration(math.sqrt(5e-9), 1.0 / 200.0, HOUR),
        accel_share=schuler_factor("accel", HOUR),
        gyro_share=schuler_factor("gyro", HOUR),
        weight_sum=weights.sum(),
        weight_squares=weights @ weights,
        largest_root=np.abs(roots).max(),
        noise_gain=1.0 + weights @ weights,
        band_of_4_levels=200.0 / 2**5,
        levels_of_band=level_for_band(12.5, 200.0),
        accel_resolution=step_accel**2 / 12.0,
        gyro_resolution=step_gyro**2 / 12.0,
        gyro_floor=WhiteNoise(100.0 * DEG_H).innovation_variance(1.0 / 200.0) / DEG_H**2,
    )


def _one(results: Results, name: str) -> float:
    return float(results[0][name])


def positions(results: Results, size: Size) -> Outcome:
    """The position columns of both tables."""
    rows = []
    panels = []
    for sensor, key in (("accelerometer", "accel"), ("gyro", "gyro")):
        ours = results[0][f"{key}_positions"]
        for (name, _, printed), value in zip(POSITIONS[sensor], ours, strict=True):
            digits = 2 if printed < 0.1 else 0
            unit = 10.0**-digits
            rows.append(
                Row(
                    f"{sensor}, {name}",
                    float(value),
                    printed=printed,
                    unit="m",
                    band=Band(printed - 0.5 * unit, printed + unit, "spec", "rounded or cut off"),
                )
            )
        law = "t²/2 times the root of the error" if key == "accel" else "g t³/6 times the root"
        places = np.arange(8.0)
        values = np.array([p for _, _, p in POSITIONS[sensor]])
        panels.append(
            Panel(
                f"{sensor}: {law}",
                "",
                "position error after 1 h, m",
                (
                    Curve("ours", places, ours, "ours", "points"),
                    Curve("printed", places, values, "printed", "points"),
                ),
                "Position errors printed and recomputed.",
                log_y=True,
                categories=tuple(name for name, _, _ in POSITIONS[sensor]),
            )
        )
    note = (
        "The column takes the root of a one-step prediction error for a constant bias on a flat "
        "earth. That error is white, and Schuler's pendulum bounds what a constant does."
    )
    return Outcome(tuple(rows), tuple(panels), (note,))


def interpretation(results: Results, size: Size) -> Outcome:
    """What the position column should have been."""
    share = _one(results, "accel_share")
    rows = (
        Row(
            "accelerometer, Yule-Walker: white error of 5·10⁻⁹ (m/s²)² for an hour",
            _one(results, "white_position"),
            printed=458.0,
            unit="m",
            band=Band(0.61, 0.63, "spec"),
            verdict="wrong in the paper",
            reason="a one-step prediction error is white: sigma sqrt(dt t³/3), not sigma t²/2",
            erratum="E-003-5",
        ),
        Row(
            "share of the flat-earth law after an hour, accelerometer",
            share,
            printed=1.0,
            band=Band(0.1245, 0.1255, "spec", "0.1246"),
            verdict="wrong in the paper",
            reason="a level platform swings back with Schuler's period of 84 min",
            erratum="E-003-5",
        ),
        Row(
            "share of the flat-earth law after an hour, gyro",
            _one(results, "gyro_share"),
            printed=1.0,
            band=Band(0.365, 0.367, "spec"),
            verdict="wrong in the paper",
            reason="as above",
            erratum="E-003-5",
        ),
    )
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
    return Outcome(rows, (panel,))


def gyro_unit(results: Results, size: Size) -> Outcome:
    """The unit of Table 2."""
    rows = (
        Row(
            "innovation variance of a gyro of 100 deg/h/√Hz at 200 Hz",
            _one(results, "gyro_floor"),
            printed=3e-11,
            unit="(deg/h)²",
            band=Band(1.99e6, 2.01e6, "theory", "N²/dt"),
            verdict="wrong in the paper",
            reason="(deg/h)² is off by 12 to 17 orders; (deg/s)² would be nearer, but then the "
            "position column is off by 3600",
            erratum="E-003-4",
        ),
        Row(
            "rounding alone, gyro of ±100 deg/s in 16 bits",
            _one(results, "gyro_resolution"),
            printed=3e-11,
            unit="(deg/h)²",
            band=Band(9.0, 11.0, "spec", "10"),
            verdict="wrong in the paper",
            reason="a raw sample cannot be foreseen better than it is rounded",
            erratum="E-003-1",
        ),
        Row(
            "rounding alone, accelerometer of ±2 g in 16 bits",
            _one(results, "accel_resolution"),
            printed=2e-16,
            unit="(m/s²)²",
            band=Band(2.9e-8, 3.1e-8, "spec", "3.0e-8"),
            verdict="wrong in the paper",
            reason="as above; the range is assumed, the paper gives none",
            erratum="E-003-1",
        ),
    )
    return Outcome(rows)


def printed_model(results: Results, size: Size) -> Outcome:
    """Equation (29) taken at its word."""
    because = "a model with a pole outside the unit circle grows without bound"
    rows = (
        Row(
            "largest root",
            _one(results, "largest_root"),
            printed="a model for filters",
            band=Band(1.103, 1.105, "spec"),
            verdict="wrong in the paper",
            reason=because,
            erratum="E-003-10",
        ),
        Row(
            "sum of the coefficients",
            _one(results, "weight_sum"),
            printed=1.01,
            band=Band(1.009, 1.011, "spec"),
        ),
        Row(
            "white noise of the sensor is amplified by",
            _one(results, "noise_gain"),
            printed="no denoising needed",
            band=Band(9.7, 9.9, "spec", "1 + 8.81"),
            verdict="wrong in the paper",
            reason="1 plus the sum of squares: the predictor's error on white noise",
            erratum="E-003-10",
        ),
    )
    from scipy.signal import lfilter

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
    return Outcome(rows, (panel,))


def band_limit(results: Results, size: Size) -> Outcome:
    """What four levels at 200 Hz leave."""
    rows = (
        Row(
            "band that 4 levels leave at 200 Hz",
            _one(results, "band_of_4_levels"),
            printed=12.5,
            unit="Hz",
            band=Band(6.25, 6.25, "theory", "fs/2⁵"),
            verdict="wrong in the paper",
            reason="12.5 Hz is what 3 levels leave",
            erratum="E-003-8",
        ),
        Row(
            "levels that leave 12.5 Hz",
            Estimate(_one(results, "levels_of_band")),
            printed=4.0,
            band=Band(3.0, 3.0, "theory"),
            verdict="wrong in the paper",
            reason="as above",
            erratum="E-003-8",
        ),
    )
    return Outcome(rows)
