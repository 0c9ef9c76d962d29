"""Figures 5 and 6 of S004: one process after the other, and all of them together."""

from __future__ import annotations

import math

import numpy as np
import pytest

from schuler.curves.allan import allan_deviation
from schuler.curves.spectrum import power_spectral_density
from schuler.noise import (
    BiasInstability,
    Process,
    Quantization,
    RandomWalk,
    RateRamp,
    WhiteNoise,
)
from schuler.units import parse

# process, slope of the Allan deviation, cluster times in s
LAWS: list[tuple[Process, float, float, float]] = [
    (Quantization(1.0), -1.0, 0.1, 300.0),
    (WhiteNoise(1.0), -0.5, 0.1, 300.0),
    (BiasInstability(1.0, 0.01, 1e6, 2), 0.0, 0.5, 300.0),
    (RandomWalk(1.0), 0.5, 1.0, 200.0),
    (RateRamp(1.0), 1.0, 0.1, 2000.0),
]


@pytest.mark.parametrize(
    ("process", "slope", "low", "high"), LAWS, ids=lambda v: getattr(v, "kind", "")
)
def test_allan_slopes_of_power_laws(
    process: Process, slope: float, low: float, high: float
) -> None:
    signal = process.simulate(400_000, 0.1, np.random.default_rng(1))
    curve = allan_deviation(signal, 10.0)
    use = (curve.tau >= low) & (curve.tau <= high)
    weight = np.sqrt(np.minimum(curve.degrees_of_freedom[use], 1000.0))
    found = np.polyfit(np.log(curve.tau[use]), np.log(curve.deviation[use]), 1, w=weight)[0]
    assert found == pytest.approx(slope, abs=0.05)


def test_all_processes_together_rule_one_after_the_other() -> None:
    """Every process has its interval of the Allan curve, and all but the ramp of the spectrum."""
    parts: list[Process] = [
        Quantization(0.02),
        WhiteNoise(0.01),
        BiasInstability(0.01, 0.1, 1e5),
        RandomWalk(4e-4),
        RateRamp(8e-6),
    ]
    total = parts[0] + parts[1] + parts[2] + parts[3] + parts[4]
    signal = total.simulate(1_000_000, 0.1, np.random.default_rng(2))
    curve = allan_deviation(signal, 10.0)
    theory = np.sqrt(total.allan_variance(curve.tau))
    inside = (curve.lower <= theory) & (theory <= curve.upper)
    assert np.mean(inside[curve.tau > 0.5]) > 0.8
    slope = np.gradient(np.log(curve.deviation), np.log(curve.tau))
    nominal = {0.1: -1.0, 10_000.0: 1.0}
    for tau, value in nominal.items():
        near = np.abs(np.log10(curve.tau / tau)) < 0.2
        assert np.mean(slope[near]) == pytest.approx(value, abs=0.3)
    assert np.abs(slope[(curve.tau > 5.0) & (curve.tau < 60.0)]).min() < 0.1
    spectrum = power_spectral_density(signal, 10.0, onesided=False)
    noise = sum(p.sampled_psd(spectrum.frequency * 0.1, 0.1) * 0.1 for p in parts[:4])
    steady = spectrum.frequency > 1e-3  # below it the ramp leaks in
    within = (spectrum.lower <= noise) & (noise <= spectrum.upper)
    assert np.mean(within[steady]) > 0.85


@pytest.mark.parametrize(
    ("density", "printed"),
    [("0.045 m/s/sqrt(h)", 0.0061), ("2.42 deg/sqrt(h)", 0.0057)],
)
def test_table_5_sample_deviation_through_the_box_car(density: str, printed: float) -> None:
    # 15 taps at 1 kHz, every tenth kept: one-sided noise bandwidth 33.3 Hz
    kind = "gyro white noise" if "deg" in density else "accel white noise"
    fast = WhiteNoise(parse(density, kind)).simulate(1_000_000, 1e-3, np.random.default_rng(3))
    sums = np.cumsum(fast)
    box = (sums[15:] - sums[:-15])[::10] / 15.0
    assert np.std(box) == pytest.approx(printed, rel=0.02)
    assert np.std(box) == pytest.approx(
        parse(density, kind) * math.sqrt(2.0 * 1000.0 / 30.0), rel=0.02
    )
