"""What the paper's own tables say when they are added up again: no simulation at all."""

from __future__ import annotations

import math

import numpy as np

from schuler.curves.spectrum import power_spectral_density
from schuler.data import CHANNELS
from schuler.evaluation.paired import paired_statistics
from schuler.noise import GaussMarkov
from schuler.noise.gauss_markov import FLICKER_LEVEL
from schuler.simulation.stamps import box_car_gain
from schuler_papers.experiment import Numbers, Results, Size, numbers
from schuler_papers.outcome import Band, Outcome, Row
from schuler_papers.quinchia2013.sensor import NAMES, PRINTED, RATE, TABLE_3, TABLE_4, TRUE_B

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
PERCENTAGES = {
    ("max", "15AR"): (50.95, 64.0),
    ("max", "27AR"): (48.20, 49.4),
    ("max", "15AV"): (31.89, 40.5),
    ("max", "18AV"): (26.06, 37.5),
    ("mean", "15AR"): (39.75, 50.3),
    ("mean", "27AR"): (41.94, 42.0),
    ("mean", "15AV"): (27.67, 35.2),
    ("mean", "18AV"): (25.13, 34.6),
}


def run(seed: int, size: Size) -> Numbers:
    """Nothing is simulated but a density in both conventions."""
    signal = np.random.default_rng(4).standard_normal(20_000)
    one = power_spectral_density(signal, 1.0, onesided=True).density
    two = power_spectral_density(signal, 1.0, onesided=False).density
    return numbers(sides=float(np.sqrt(np.mean(one / two))))


def percentages(results: Results, size: Size) -> Outcome:
    """The eight percentages of the text, by both rules."""
    rows = []
    for (figure, other), (printed, of_sums) in PERCENTAGES.items():
        table = LARGEST if figure == "max" else MEAN
        pair = paired_statistics(table["18AVWD"], table[other])
        rows += [
            Row(
                f"18AVWD over {other}, {figure} error, mean of ratios",
                100.0 * pair.mean_of_ratios,
                printed,
                unit="%",
                band=Band(printed - 0.05, printed + 0.05, "spec"),
            ),
            Row(
                f"18AVWD over {other}, {figure} error, ratio of sums",
                100.0 * pair.ratio_of_sums,
                None,
                "wrong in the paper",
                "%",
                Band(of_sums - 0.06, of_sums + 0.06, "spec"),
                "table 6's 4.3 % is a ratio of sums: two definitions in one paper",
                "E-004-17",
            ),
        ]
    return Outcome(tuple(rows))


def significance(results: Results, size: Size) -> Outcome:
    """What seven outages can tell."""
    best = paired_statistics(LARGEST["18AVWD"], LARGEST["18AV"])
    early = paired_statistics(LARGEST["18AV"], LARGEST["15AV"])
    rows = [
        Row("outages that 18AVWD wins against 18AV", float(best.wins), 7.0),
        Row(
            "their two-sided Wilcoxon p, as small as seven cases allow",
            best.wilcoxon_p,
            None,
            "beyond the paper",
            band=Band(0.0156, 0.0157, "theory", "2/2^7"),
        ),
        Row(
            "18AV better than 15AV: two-sided sign test p",
            early.sign_p,
            "most situations",
            "wrong in the paper",
            band=Band(0.1249, 0.1251, "theory"),
            reason="six of seven, four of them by less than 7 %: chance is not excluded",
            erratum="E-004-15",
        ),
    ]
    for name, table, p in (("largest", LARGEST, 0.375), ("mean", MEAN, 0.8125)):
        pair = paired_statistics(table["15AR"], table["27AR"])
        rows.append(
            Row(
                f"15AR against 27AR, {name} error: Wilcoxon p",
                pair.wilcoxon_p,
                None,
                "beyond the paper",
                band=Band(p - 1e-6, p + 1e-6, "theory", "undecided"),
            )
        )
    rows.append(
        Row(
            "outage whose largest errors the conclusions compare (18AVWD, then the others)",
            "5, then 7",
            "53.61 against 92.51, 96.32, 181.38, 82.74 m",
            "wrong in the paper",
            reason="maxima of different outages; in outage 7 18AVWD has 17.20 m",
            erratum="E-004-15",
        )
    )
    return Outcome(tuple(rows))


def table_6_sums(results: Results, size: Size) -> Outcome:
    """Table 6 added up."""
    sums = {level: sum(values) for level, values in TABLE_6.items()}
    pair = paired_statistics(TABLE_6[7], TABLE_6[0])
    rows = [
        Row(
            f"sum of largest errors, {level} levels",
            sums[level],
            None,
            unit="m",
            band=Band(wanted - 0.06, wanted + 0.06, "spec"),
        )
        for level, wanted in ((0, 1055.8), (3, 1055.5), (7, 1010.3))
    ]
    rows += [
        Row(
            "gain of seven levels, ratio of sums",
            100.0 * pair.ratio_of_sums,
            4.3,
            unit="%",
            band=Band(4.30, 4.32, "spec"),
        ),
        Row(
            "gain of seven levels, mean of ratios",
            100.0 * pair.mean_of_ratios,
            None,
            "wrong in the paper",
            "%",
            Band(5.9, 6.1, "spec"),
            "the text's other percentages are means of ratios",
            "E-004-17",
        ),
    ]
    return Outcome(tuple(rows))


def tables_3_and_4(results: Results, size: Size) -> Outcome:
    """'Most within the confidence interval': 9 of 15."""
    rows, inside, total = [], 0, 0
    for channel in CHANNELS:
        for k, letter in enumerate("NBK"):
            allan, psd = TABLE_4[channel][k], TABLE_3[channel][k]
            if allan is None or psd is None:
                continue
            off = (psd - allan[0]) / allan[1]
            total += 1
            inside += abs(off) <= 1.0
            if abs(off) > 1.0:
                rows.append(
                    Row(
                        f"{NAMES[channel]}, {letter}: spectrum less Allan in printed errors",
                        off,
                        "within",
                        "wrong in the paper",
                        reason="outside the printed interval",
                        erratum="E-004-16",
                    )
                )
    head = Row(
        "parameters of the spectrum within the printed interval, of 15",
        float(inside),
        "most",
        "wrong in the paper",
        band=Band(9.0, 9.0, "spec"),
        reason="nine of fifteen, and none of the three accelerometer B",
        erratum="E-004-16",
    )
    assert total == 15
    return Outcome((head, *rows))


def small_sums(results: Results, size: Size) -> Outcome:
    """(15)-(18), band limits, the filter of the device, one- and two-sided."""
    gain = float(box_car_gain(20.0, 15, 1000.0))
    rows = [
        Row(
            "(18): 29.57/0.664",
            29.57 / 0.664,
            44.533,
            unit="deg/h",
            band=Band(44.52, 44.54, "spec"),
        ),
        Row(
            "(15): 360 000 points, clusters of 60 000",
            100.0 / math.sqrt(2.0 * (6.0 - 1.0)),
            32.0,
            unit="%",
            band=Band(31.0, 32.5, "spec"),
            reason="for clusters that do not overlap; the estimator (13) overlaps",
            erratum="E-004-4",
        ),
        Row(
            "attenuation of fifteen taps at 20 Hz",
            100.0 * (1.0 - gain),
            14.16,
            unit="%",
            band=Band(14.1, 14.2, "spec"),
        ),
        *(
            Row(
                f"band of {level} levels at 100 Hz",
                RATE / 2.0 ** (level + 1),
                printed,
                unit="Hz",
                band=Band(0.99 * printed, 1.01 * printed, "theory"),
            )
            for level, printed in ((3, 6.25), (6, 0.78), (7, 0.39), (8, 0.1953))
        ),
        Row(
            "N read off a one-sided density taken for two-sided",
            float(results[0]["sides"]),
            None,
            "wrong in the paper",
            band=Band(1.4142, 1.4143, "theory", "sqrt(2)"),
            reason="figures 12 to 14 are one-sided, (14) wants two-sided; not said",
            erratum="E-004-12",
        ),
        Row(
            "bias stability of table 1 over that of its class",
            0.5 / 0.005,
            "0.5 g of 5 g",
            "wrong in the paper",
            reason="0.5 g is 100 times what the class has; probably 0.005 g",
            erratum="E-004-13",
        ),
    ]
    return Outcome(tuple(rows))


def crossings(results: Results, size: Size) -> Outcome:
    """How much of each accelerometer's plateau is the crossing of N and K."""
    rows = []
    for channel, share in (("accel_x", 86.0), ("accel_y", 38.0), ("accel_z", 70.0)):
        r = PRINTED[channel]
        minimum = math.sqrt(2.0 * r.white_noise * r.random_walk / math.sqrt(3.0))
        level = FLICKER_LEVEL * r.bias_instability
        rows.append(
            Row(
                f"{NAMES[channel]}: crossing of N and K over the level read as B",
                100.0 * minimum / level,
                100.0,
                "wrong in the paper",
                "%",
                Band(share - 1.0, share + 1.0, "spec"),
                f"the true B is {TRUE_B[channel]:g} m/s/h",
                "E-004-9",
            )
        )
    return Outcome(tuple(rows))


def plateau(results: Results, size: Size) -> Outcome:
    """(29): the plateau as sigma, its time as correlation time."""
    level, time = 1.0, 100.0
    tau = np.geomspace(10.0, 2000.0, 20_000)
    printed = GaussMarkov(FLICKER_LEVEL * level, time)
    right = GaussMarkov.through_plateau(level, time)
    rows = []
    for name, process, height, place, verdict in (
        ("(29)", printed, 0.617, 1.893, "wrong in the paper"),
        ("1.076 B and T/1.893", right, 1.0, 1.0, "beyond the paper"),
    ):
        curve = np.sqrt(process.allan_variance(tau))
        wrong = verdict == "wrong in the paper"
        for what, value, wanted in (
            ("peak over the plateau", float(curve.max()) / (FLICKER_LEVEL * level), height),
            ("time of the peak over that of the plateau", float(tau[curve.argmax()]) / time, place),
        ):
            rows.append(
                Row(
                    f"{name}: {what}",
                    value,
                    1.0 if wrong else None,
                    "wrong in the paper" if wrong else "beyond the paper",
                    band=Band(wanted - 0.003, wanted + 0.003, "theory"),
                    reason="a Gauss-Markov peak is 0.617 sigma at 1.893 Tc" if wrong else "",
                    erratum="E-004-7" if wrong else "",
                )
            )
    density = math.sqrt(
        (right.sigma**2 / right.correlation_time) / (printed.sigma**2 / printed.correlation_time)
    )
    rows.append(
        Row(
            "driving density needed over that of (29)",
            density,
            1.0,
            "wrong in the paper",
            band=Band(2.2, 2.26, "spec", "2.24"),
            reason="a filter that is told (29) is overconfident",
            erratum="E-004-7",
        )
    )
    return Outcome(tuple(rows))


def words(results: Results, size: Size) -> Outcome:
    """Ambiguities that no number settles."""
    rows = (
        Row(
            "T",
            "cluster time",
            "correlation time, cluster time",
            "wrong in the paper",
            reason="two names for one symbol, and Tc of table 5 is a cluster time",
            erratum="E-004-5",
        ),
        Row(
            "reference of tables 9 and 10",
            "the truth",
            "the filter's own solution without outages",
            "wrong in the paper",
            reason="errors that both share cancel, and the reference is metres wrong itself",
            erratum="E-004-18",
        ),
        Row(
            "beta_0²",
            "one-step variance at 100 Hz",
            "1e-10 to 1e-13",
            "reproduced in kind",
            reason="no random-walk density: that takes the gain of the other poles and the rate",
            erratum="E-004-19",
        ),
        Row(
            "figures 1-3, 7-9, 19",
            "configuration, strapdown, filter bank and closed loop, tested block by block",
            "photographs and block diagrams",
            "reproduced in kind",
            reason="the working components are these diagrams",
        ),
    )
    return Outcome(rows)
