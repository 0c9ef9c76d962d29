"""Figures 1 to 4: three ways to use four IMUs, run on one ride, and the tetrahedron.

Data flow of the figures:

* synthetic (Fig. 1): IMUs -> fusion -> one strapdown -> one filter with GNSS;
* extended (Fig. 2): IMUs -> fusion inside the strapdown, biases of every sensor as states of the
  filter, corrected before the fusion; the parity vector is a measurement of them;
* constrained (Fig. 3): one strapdown an IMU, GNSS used once, and the rigid body as constraint.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.arrays.geometry import tetrahedron, tetrahedron_mounting
from schuler.data import CHANNELS
from schuler.data.array import ImuArray
from schuler.evaluation.outage_windows import judge_window
from schuler.navigation.mechanizations.navigate_array import (
    MECHANIZATIONS,
    Mechanization,
    navigate_array,
)
from schuler.noise import GaussMarkov, RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.simulation import motorcycle, simulate_array, simulate_gnss
from schuler_papers.experiment import (
    Numbers,
    Results,
    Size,
    generator,
    numbers,
    stacked,
)
from schuler_papers.outcome import Band, Curve, Estimate, Outcome, Panel, Row
from schuler_papers.waegli2010.series import PAPER

NAMES: tuple[Mechanization, ...] = ("single", "system", "synthetic", "extended", "constrained")
RATE = 50.0
STANDSTILL = 40.0
OUTAGE = 15.0
QUALITIES = ((1.0, 1.0), (1.0, 1.0), (2.0, 1.0), (4.0, 3.0))
"""Factors of bias and white noise of the four IMUs."""


def _mems(bias: float, white: float) -> NoiseModel:
    accel = WhiteNoise(3e-3 * white) + GaussMarkov(5e-3 * bias, 60.0) + RandomWalk(1e-4)
    gyro = WhiteNoise(1e-3 * white) + GaussMarkov(3e-4 * bias, 60.0) + RandomWalk(2e-6)
    return NoiseModel({c: gyro if c.startswith("gyro") else accel for c in CHANNELS}, source="twin")


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
            array, gnss, models, mechanization=name, outages=windows, time_offset=0.0, imu=seed % 4
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
    axes = tetrahedron().axes
    return numbers(
        errors=errors,
        claimed=claimed,
        tetrahedron=np.abs(axes.T @ axes - 4.0 * np.eye(3)).max(),
        mechanizations=len(set(NAMES) & set(MECHANIZATIONS)),
    )


def figures_1_to_3(results: Results, size: Size) -> Outcome:
    """Three mechanizations, and redundancy at system level."""
    errors = stacked(results, "errors")
    claimed = stacked(results, "claimed")
    seeds = errors.shape[0]
    squares = (errors**2).mean(axis=2)
    rms = np.sqrt(squares.mean(axis=0))

    def ratio(first: str, second: str) -> Estimate:
        """Ratio of root mean squares with its error from leaving one seed out."""
        a, b = squares[:, NAMES.index(first)], squares[:, NAMES.index(second)]
        whole = math.sqrt(a.sum() / b.sum())
        if seeds < 2:
            return Estimate(whole)
        left = np.sqrt((a.sum() - a) / (b.sum() - b))
        return Estimate(
            whole, float(math.sqrt((seeds - 1) / seeds * ((left - left.mean()) ** 2).sum()))
        )

    honest = rms / np.sqrt((claimed**2).mean(axis=(0, 2)))
    rows = (
        Row("configurations that run on one ride through one door",
            float(results[0]["mechanizations"]), 3.0, band=Band(5.0, 5.0, "spec")),
        Row("error at the end of outages: system level over a single IMU",
            ratio("system", "single"), "robust, not economical, sub-optimal",
            band=Band(0.0, 1.0, "spec", "beats single", standard_errors=2.0)),
        Row("synthetic IMU over system level", ratio("synthetic", "system"),
            "system level is sub-optimal",
            band=Band(0.0, 1.0, "spec", "sensor level wins", standard_errors=2.0)),
        Row("extended with parity over synthetic", ratio("extended", "synthetic"),
            "the synthetic IMU is sub-optimal",
            band=Band(0.0, 1.0, "spec", "never worse", standard_errors=2.0)),
        Row("constrained over extended", ratio("constrained", "extended"), "optimal as well",
            band=Band(0.85, 1.15, "spec", "GNSS used once", standard_errors=2.0)),
        *(
            Row(f"real over claimed error, {name}", float(honest[i]),
                verdict="beyond the paper", band=Band(0.4, 2.0, "theory", "an honest filter"),
                reason="largest horizontal error of an outage over the claimed one at its end")
            for i, name in enumerate(NAMES)
        ),
    )  # fmt: skip
    places = np.arange(float(len(NAMES)))
    error = rms / math.sqrt(2.0 * max(seeds * errors.shape[2] - 1, 1))
    panel = Panel(
        f"Largest error in {OUTAGE:g} s without GNSS, root mean square of {errors[:, 0].size}",
        "",
        "m",
        (
            Curve("error", places, rms, "ours", "points", rms - error, rms + error),
            Curve("claimed", places, rms / honest, "theory", "points"),
        ),
        "Errors at the end of outages by mechanization.",
        categories=NAMES,
    )
    note = (
        "Unequal IMUs: two alike, one with twice and one with four times their biases and three "
        "times their noise. With equal ones synthetic and extended are the same filter."
    )
    return Outcome(rows, (panel,), (note,))


def figure_4(results: Results, size: Size) -> Outcome:
    """The tetrahedron of four triads."""
    rows = (
        Row(
            "largest element of AᵀA - 4 I of the tetrahedron",
            float(results[0]["tetrahedron"]),
            printed="photograph",
            band=Band(0.0, 1e-12, "spec"),
            reason="four full triads give 4 I however they are turned: skewing gains isolation of "
            "faults, not noise",
        ),
    )
    return Outcome(rows)
