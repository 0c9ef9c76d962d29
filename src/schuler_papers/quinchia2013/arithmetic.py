"""What the paper's own tables say when they are added up again: no simulation at all."""

from __future__ import annotations

import math

import numpy as np

from schuler import GaussMarkov, box_car_gain, paired_statistics, power_spectral_density
from schuler_papers.experiment import Numbers, Results, Size, numbers
from schuler_papers.judging import Found, Value
from schuler_papers.outcome import Proof
from schuler_papers.quinchia2013.sensor import (
    CHANNELS,
    FLICKER_LEVEL,
    PRINTED,
    RATE,
    TABLE_3,
    TABLE_4,
)

# tables 9 and 10: largest and mean horizontal error in m of outages 1 to 7
LARGEST = {
    "15AV": (21.84, 44.84, 49.97, 22.70, 64.46, 6.19, 92.51),
    "18AV": (21.60, 38.04, 40.41, 21.13, 64.17, 5.91, 96.32),
    "18AVWD": (18.42, 34.81, 39.69, 10.81, 53.61, 5.32, 17.20),
    "15AR": (38.72, 122.07, 64.26, 14.72, 65.28, 13.17, 181.38),
    "27AR": (23.94, 71.49, 70.21, 29.26, 64.65, 13.41, 82.74),
}
MEAN = {
    "15AV": (17.11, 14.41, 13.34, 10.85, 44.57, 2.74, 39.40),
    "18AV": (16.82, 14.10, 11.86, 10.44, 44.36, 2.71, 40.85),
    "18AVWD": (12.56, 13.16, 11.80, 7.29, 36.50, 2.25, 8.74),
    "15AR": (20.74, 42.82, 17.48, 6.72, 44.34, 4.12, 49.62),
    "27AR": (19.62, 29.70, 19.02, 9.99, 44.43, 4.18, 32.27),
}
# table 6: largest error without error model, by level of decomposition
TABLE_6 = {
    0: (85.12, 162.98, 189.67, 52.20, 54.03, 232.54, 279.22),
    3: (85.13, 162.67, 189.69, 52.20, 54.01, 232.74, 279.03),
    7: (76.08, 157.73, 188.82, 51.62, 43.99, 217.28, 274.74),
}
OTHERS = ("15AR", "27AR", "15AV", "18AV")


def run(seed: int, size: Size) -> Numbers:
    """Nothing is simulated but a density in both conventions."""
    signal = np.random.default_rng(4).standard_normal(20_000)
    one = power_spectral_density(signal, 1.0, onesided=True).density
    two = power_spectral_density(signal, 1.0, onesided=False).density
    return numbers(sides=float(np.sqrt(np.mean(one / two))))


def percentages(results: Results, size: Size) -> Found:
    """The eight percentages of the text, by both rules."""
    pairs = [
        paired_statistics(table["18AVWD"], table[other])
        for table in (LARGEST, MEAN)
        for other in OTHERS
    ]
    values = {
        "ratios": np.array([[100.0 * p.mean_of_ratios for p in pairs]]),
        "sums": np.array([[100.0 * p.ratio_of_sums for p in pairs]]),
    }
    return Found(values)


def significance(results: Results, size: Size) -> Found:
    """What seven outages can tell."""
    best = paired_statistics(LARGEST["18AVWD"], LARGEST["18AV"])
    early = paired_statistics(LARGEST["18AV"], LARGEST["15AV"])
    orders = [paired_statistics(t["15AR"], t["27AR"]).wilcoxon_p for t in (LARGEST, MEAN)]
    values: dict[str, Value] = {
        "wins": float(best.wins),
        "best": best.wilcoxon_p,
        "early wins": float(early.wins),
        "early": early.sign_p,
        "orders": np.array([orders]),
        "outage of 18AVWD": float(np.argmax(LARGEST["18AVWD"]) + 1),
    }
    return Found(values)


def table_6_sums(results: Results, size: Size) -> Found:
    """Table 6 added up."""
    pair = paired_statistics(TABLE_6[7], TABLE_6[0])
    values: dict[str, Value] = {
        "sums": np.array([[sum(values) for values in TABLE_6.values()]]),
        "by sums": 100.0 * pair.ratio_of_sums,
        "by ratios": 100.0 * pair.mean_of_ratios,
    }
    return Found(values)


def tables_3_and_4(results: Results, size: Size) -> Found:
    """How many values of the spectrum lie within the errors of Allan variance, rounding allowed."""
    off, inside = {}, 0
    for channel in CHANNELS:
        for k, letter in enumerate("NBK"):
            allan, psd = TABLE_4[channel][k], TABLE_3[channel][k]
            if allan is None or psd is None:
                continue
            half = 0.0005 if letter == "N" else 0.0
            inside += abs(psd - allan[0]) <= allan[1] + half + 1e-12
            off[channel, letter] = (psd - allan[0]) / allan[1]
    shown = [off[c, "B"] for c in ("accel_x", "accel_y", "accel_z")]
    shown += [off[c, "N"] for c in ("gyro_x", "gyro_z")]
    return Found({"inside": float(inside), "apart": np.array([shown])})


def small_sums(results: Results, size: Size) -> Found:
    """(15)-(18), band limits, the filter of the device, one- and two-sided."""
    values: dict[str, Value] = {
        "gyro": 29.57 / 0.664,
        "clusters": 100.0 / math.sqrt(2.0 * (6.0 - 1.0)),
        "taps": 100.0 * (1.0 - float(box_car_gain(20.0, 15, 1000.0))),
        "limits": np.array([[RATE / 2.0 ** (level + 1) for level in (3, 6, 7, 8)]]),
        "sides": float(results[0]["sides"]),
        "class": 0.5 / 0.005,
    }
    return Found(values)


def crossing(channel: str) -> float:
    """Return the crossing of printed N and K over the level read as B."""
    r = PRINTED[channel]
    minimum = math.sqrt(2.0 * r.white_noise * r.random_walk / math.sqrt(3.0))
    return minimum / (FLICKER_LEVEL * r.bias_instability)


def crossings(results: Results, size: Size) -> Found:
    """How much of each accelerometer's plateau is the crossing of N and K."""
    share = [100.0 * crossing(c) for c in ("accel_x", "accel_y", "accel_z")]
    return Found({"crossing": np.array([share])})


def plateau(results: Results, size: Size) -> Found:
    """(29): the plateau as sigma, its time as correlation time."""
    level, time = 1.0, 100.0
    tau = np.geomspace(10.0, 2000.0, 20_000)
    printed = GaussMarkov(FLICKER_LEVEL * level, time)
    right = GaussMarkov.through_plateau(level, time)
    found = {}
    for name, process in (("printed", printed), ("right", right)):
        curve = np.sqrt(process.allan_variance(tau))
        height = float(curve.max()) / (FLICKER_LEVEL * level)
        found[name] = np.array([[height, float(tau[curve.argmax()]) / time]])
    density = math.sqrt(
        (right.sigma**2 / right.correlation_time) / (printed.sigma**2 / printed.correlation_time)
    )
    proof = Proof(
        "the Allan deviation of Gauss-Markov noise peaks at 0.617 sigma and 1.893 Tc",
        float(found["printed"][0, 0]), 0.61, 0.62,
    )  # fmt: skip
    return Found({**found, "density": density}, proofs={"plateau": proof})


def words(results: Results, size: Size) -> Found:
    """Ambiguities that no number settles."""
    values: dict[str, Value] = {
        "T": "cluster time",
        "reference": "the truth",
        "beta": "one-step variance at 100 Hz",
        "diagrams": "configuration, strapdown, filter bank and closed loop, tested block by block",
    }
    return Found(values)
