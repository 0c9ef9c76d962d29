"""Figures 1 to 4: three ways to use four IMUs, run on one ride, and the tetrahedron.

Data flow of the figures:

* synthetic (Fig. 1): IMUs -> fusion -> one strapdown -> one filter with GNSS;
* extended (Fig. 2): IMUs -> fusion inside the strapdown, biases of every sensor as states of the
  filter, corrected before the fusion; the parity vector is a measurement of them;
* constrained (Fig. 3): one strapdown an IMU, GNSS used once, and the rigid body as constraint.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from schuler import (
    GaussMarkov,
    ImuArray,
    MeasurementOptions,
    NoiseModel,
    RandomWalk,
    WhiteNoise,
    judge_window,
    motorcycle,
    navigate_array,
    simulate_array,
    simulate_gnss,
    tetrahedron_mounting,
)
from schuler_papers.experiment import (
    FloatArray,
    Numbers,
    Results,
    Size,
    generator,
    numbers,
    stacked,
)
from schuler_papers.judging import Found
from schuler_papers.outcome import Curve, Estimate, Panel
from schuler_papers.waegli2010.series import PAPER

Mechanization = Literal["single", "system", "synthetic", "extended", "constrained"]
NAMES: tuple[Mechanization, ...] = ("single", "system", "synthetic", "extended", "constrained")
RATE = 50.0
STANDSTILL = 40.0
OUTAGE = 15.0
QUALITIES = ((1.0, 1.0), (1.0, 1.0), (2.0, 1.0), (4.0, 3.0))
"""Factors of bias and white noise of the four IMUs."""


def _mems(bias: float, white: float) -> NoiseModel:
    accel = WhiteNoise(3e-3 * white) + GaussMarkov(5e-3 * bias, 60.0) + RandomWalk(1e-4)
    gyro = WhiteNoise(1e-3 * white) + GaussMarkov(3e-4 * bias, 60.0) + RandomWalk(2e-6)
    return NoiseModel.isotropic(gyro, accel)


def run(seed: int, size: Size) -> Numbers:
    """Ride a motorcycle with four IMUs of unequal quality through outages, in five ways."""
    rng = generator(seed, PAPER, "systems")
    starts = (100.0,) if size == "quick" else (100.0, 160.0, 220.0)
    profile = motorcycle(starts[-1] + OUTAGE + 20.0, rng, standstill=STANDSTILL)
    mounting = tetrahedron_mounting(0.05)
    models = [_mems(*quality) for quality in QUALITIES]
    recordings = simulate_array(profile, mounting.rotation, mounting.position, models, RATE, rng)
    array = ImuArray.from_recordings(recordings, mounting)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.05, velocity_sd=0.03, rng=rng)
    exact = simulate_gnss(profile, 1.0, position_sd=1e-6, velocity_sd=1e-6, rng=rng)
    windows = [(start, OUTAGE) for start in starts]
    errors = np.empty((len(NAMES), len(windows)))
    claimed = np.empty_like(errors)
    for i, name in enumerate(NAMES):
        found = navigate_array(
            array,
            gnss,
            models,
            mechanization=name,
            outages=windows,
            time_offset=0.0,
            imu=seed % 4,
            # the filters of the figures: noise as known, errors of GNSS white
            weights="constant",
            measurements=MeasurementOptions(correlated=None),
        )
        for k, window in enumerate(windows):
            judged = judge_window(
                found.solution,
                exact,
                window,
                lever_arm=np.zeros(3),
                time_offset=0.0,
                sd_factor=1.0,
            )
            errors[i, k], claimed[i, k] = judged.max_m, judged.claimed_sd_m
    axes = np.concatenate([c.T for c in tetrahedron_mounting().rotation])
    return numbers(
        errors=errors,
        claimed=claimed,
        tetrahedron=np.abs(axes.T @ axes - 4.0 * np.eye(3)).max(),
        mechanizations=len(NAMES),
    )


def figures_1_to_3(results: Results, size: Size) -> Found:
    """Three mechanizations, and redundancy at system level."""
    errors, claimed = stacked(results, "errors"), stacked(results, "claimed")
    squares = (errors**2).mean(axis=2)
    rms = np.sqrt(squares.mean(axis=0))
    honest = rms / np.sqrt((claimed**2).mean(axis=(0, 2)))
    values: dict[str, Estimate | float] = {
        "mechanizations": float((np.isfinite(errors).all(axis=(0, 2))).sum())
    }
    for first, second in (
        ("system", "single"), ("synthetic", "system"),
        ("extended", "synthetic"), ("constrained", "extended"),
    ):  # fmt: skip
        values[f"{first} over {second}"] = _ratio(
            squares[:, NAMES.index(first)], squares[:, NAMES.index(second)]
        )
    values |= {f"honest {name}": float(honest[i]) for i, name in enumerate(NAMES)}
    places = np.arange(float(len(NAMES)))
    error = rms / math.sqrt(2.0 * max(errors.shape[0] * errors.shape[2] - 1, 1))
    panel = Panel(
        f"Largest error in {OUTAGE:g} s without GNSS, rms of {errors[:, 0].size} rides",
        "",
        "m",
        (
            Curve("error", places, rms, "ours", "points", rms - error, rms + error),
            Curve("claimed", places, rms / honest, "theory", "points"),
        ),
        "Errors at the end of outages by mechanization.",
        categories=NAMES,
    )
    return Found(values, panels=(panel,))


def _ratio(a: FloatArray, b: FloatArray) -> Estimate:
    """Ratio of root mean squares with its error from leaving one seed out."""
    whole = math.sqrt(a.sum() / b.sum())
    seeds = a.size
    if seeds < 2:
        return Estimate(whole)
    left = np.sqrt((a.sum() - a) / (b.sum() - b))
    error = math.sqrt((seeds - 1) / seeds * ((left - left.mean()) ** 2).sum())
    return Estimate(whole, error)
