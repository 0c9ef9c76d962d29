"""Noise, faults, misalignment and observability of Waegli 2008."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.stats import chi2, norm

from schuler import (
    GaussMarkov,
    Geometry,
    Mounting,
    NoiseModel,
    Segment,
    WhiteNoise,
    array_error_model,
    chi_square_power,
    chi_square_threshold,
    dcm_from_euler,
    observability,
    optimize_cone,
    tetrahedron_mounting,
)
from schuler_papers.experiment import FloatArray, Numbers, Results, Size, numbers, stacked
from schuler_papers.judging import Found, Value, plain
from schuler_papers.outcome import Curve, Panel, Proof, Role
from schuler_papers.waegli2008.items import TABLE_2, TABLE_3
from schuler_papers.waegli2008.rides import GYRO_SD, RATE, mti
from schuler_papers.waegli2008.sensors import FALSE_ALARM, FREEDOM, PRINTED_THRESHOLD


def figure_5(results: Results, size: Size) -> Found:
    """Noise of one gyro and of the best estimate of four; gain and reduction."""
    one, four = stacked(results, "single"), stacked(results, "synthetic")
    more = {"gain": 100.0 * (one / four - 1.0), "reduction": 100.0 * (1.0 - four / one)}
    first = results[0]
    time, (*alone, fused, true) = first["rate_time"], first["rates"]
    curves = [Curve(f"IMU {k + 1}", time, rate, "other") for k, rate in enumerate(alone)]
    panel = Panel(
        "Rate about z on a motorcycle",
        "s",
        "deg/s",
        (
            *curves,
            Curve("best estimate of four", time, fused, "ours"),
            Curve("reference", time, true, "theory"),
        ),
        "The best estimate scatters half as far around the reference as each IMU.",
    )
    return Found({"single": one, "synthetic": four, **more}, panels=(panel,))


def figure_6(results: Results, size: Size) -> Found:
    """Tell whether the difference is normal."""
    first = results[0]
    normal = norm.ppf(first["quantiles"]) * GYRO_SD
    panel = Panel(
        "Quantiles of the noise against those of a normal law",
        "normal quantile in rad/s",
        "quantile of the noise in rad/s",
        (
            Curve("Gaussian noise", normal, first["gaussian"], mark="points"),
            Curve("Student's t, 6 degrees", normal, first["tails"], role="other", mark="points"),
            Curve("equal", normal, normal, role="theory", mark="dash"),
        ),
        "Gaussian noise follows the line, that with tails leaves it at both ends.",
    )
    values = {
        "gaussian": (stacked(results, "gaussian_p") > 0.01).astype(float),
        "tails": (stacked(results, "tails_p") < 0.01).astype(float),
    }
    return Found(values, panels=(panel,))


def thresholds(results: Results, size: Size) -> Found:
    """The threshold and what it would need."""
    device = np.radians(0.1) * np.sqrt(100.0)
    power = np.mean(stacked(results, "power"), axis=0)
    values = {
        **plain(results, size).values,
        "threshold": chi_square_threshold(GYRO_SD, FALSE_ALARM, FREEDOM),
        "dense threshold": chi_square_threshold(0.1, FALSE_ALARM, FREEDOM),
        "device threshold": 3.0 * chi_square_threshold(device, FALSE_ALARM, FREEDOM),
        "printed alarms": float(chi2.sf(PRINTED_THRESHOLD / GYRO_SD**2, FREEDOM)),
        "law": float(stacked(results, "law_p").min()),
        "power gap": float(np.abs(power - results[0]["theory"]).max()),
    }
    first = results[0]
    panel = Panel(
        "Share of biased sensors that are found",
        "bias of one gyro in σ",
        "share found at 5 % false alarms",
        (
            Curve("20 000 draws", first["sizes"], power, mark="points"),
            Curve("non-central chi-square", first["sizes"], first["theory"], role="theory"),
        ),
        "The points lie on the curve: 17, 38, 66, 88 and 97 % for 2 to 6 σ.",
    )  # fmt: skip
    return Found(values, panels=(panel,))


def figure_7(results: Results, size: Size) -> Found:
    """Tails of the noise called faults."""
    gauss = np.mean(stacked(results, "gaussian"), axis=0)
    tails = np.mean(stacked(results, "tails"), axis=0)
    healthy = 0.35 * gauss[0] / (1.0 - gauss[0])
    values = {
        "share": 100.0 * gauss[0],
        "missed at printed": 100.0 * gauss[4],
        "best": tails[1],
        "missed": 100.0 * tails[2],
        "false per fault": 100.0 * tails[3],
        "sum of probabilities": 0.76 + healthy,
    }
    first = results[0]
    panel = Panel(
        "Misses and false alarms over 'faults', Gaussian noise",
        "threshold in rad²/s²",
        "share of the faults",
        (
            Curve("sum of errors", first["grid"], np.minimum(first["curve"], 3.0)),
            Curve("never alarm", first["grid"], np.ones(first["grid"].size), role="theory",
                  mark="dash"),
        ),
        "Hardly below one anywhere: labelling tails as faults is no experiment with faults.",
    )  # fmt: skip
    return Found(values, panels=(_decisions(first, tails[1]), panel))


def _decisions(first: Numbers, threshold: float) -> Panel:
    """The decision variable epoch by epoch, and what a threshold makes of it."""
    value, fault = first["shown_statistic"], first["shown_fault"] > 0.5
    time, alarm = np.arange(value.size) / RATE, value >= threshold
    kinds = {"fault found": fault & alarm, "fault missed": fault & ~alarm,
             "false alarm": alarm & ~fault}  # fmt: skip
    roles: tuple[Role, ...] = ("better", "printed", "paper")
    return Panel(
        "Decision variable and the best threshold, noise with tails",
        "s",
        "D in rad²/s²",
        (
            Curve("D", time, value, "other"),
            Curve("threshold", time, np.full(value.size, threshold), "theory", "dash"),
            *(
                Curve(name, time[at], value[at], role, "points")
                for (name, at), role in zip(kinds.items(), roles, strict=True)
            ),
        ),
        "Most of what is called a fault stays below the threshold.",
    )


def equation_12(results: Results, size: Size) -> Found:
    """Relative attitude from rates."""
    first = results[0]
    change = float(first["euler_turned"] - first["euler_once"])
    values = {
        "rms": float(np.sqrt(np.mean(stacked(results, "rates") ** 2))),
        "once": float(first["euler_once"]),
        "change": change,
    }
    turn = Proof(
        "an attitude is the same after a full turn of heading, the printed model is not",
        change, 1.0, 180.0,
    )  # fmt: skip
    return Found(values, proofs={"full turn": turn})


def run_ranks(seed: int, size: Size) -> Numbers:
    """Ranks of the observability matrix. Eq (13)."""
    turning = (
        Segment(np.array([0.0, 0.0, -9.81]), dcm_from_euler(0.0, 0.0, 0.3)),
        Segment(np.array([3.0, 1.0, -9.81]), dcm_from_euler(0.5, 0.1, 1.0)),
        Segment(np.array([-1.0, 4.0, -8.81]), dcm_from_euler(-0.4, 0.2, 2.5)),
    )
    noise, none = _two_times(), {"turn_on_accel": 0.0, "turn_on_gyro": 0.0}
    model, _ = array_error_model([noise], Mounting.aligned(1), **none)
    wide, rows = array_error_model([noise] * 4, tetrahedron_mounting(), **none)
    ranks = []
    for segments in (turning, turning[:1] * 3):
        ranks += [
            observability(model, segments).rank,
            observability(wide, segments).rank,
            observability(wide, segments, rows=rows).rank,
        ]
    order = tetrahedron_mounting().rotation
    return numbers(
        ranks=ranks, printed_order=np.abs(order[1] @ order[2] - order[2] @ order[1]).max()
    )


def _two_times() -> NoiseModel:
    """Return the sensor's model with a correlation time for each kind, so that they part."""
    model = mti()
    processes = {
        channel: WhiteNoise(process.components[0].parameters["density"])
        + GaussMarkov(process.components[1].parameters["sigma"], 60.0 if "gyro" in channel else 150)
        for channel, process in model.processes.items()
    }
    return replace(model, processes=processes)


def _implied_single() -> FloatArray:
    """Error of one IMU that Tables 2 and 3 imply for roll, pitch and heading."""
    single = [
        0.5 * (TABLE_2[c][1] / (1.0 + TABLE_3[c][0] / 100.0)
               + TABLE_2[c][3] / (1.0 + TABLE_3[c][1] / 100.0))
        for c in ("roll", "pitch", "heading")
    ]  # fmt: skip
    return np.array([single])


def arithmetic(results: Results, size: Size) -> Found:
    """What follows from the printed numbers alone, and from geometry."""
    means = -np.array(list(TABLE_3.values()), dtype=np.float64).mean(axis=0)
    worst = max(TABLE_2[c][1] for c in ("roll", "pitch", "heading"))
    axes = np.concatenate([c.T for c in tetrahedron_mounting().rotation])
    skew = float(np.abs(axes.T @ axes - 4.0 * np.eye(3)).max())
    aligned = Geometry.from_mounting(Mounting.aligned(2))
    power = float(chi_square_power(aligned, 0, 5.0, FALSE_ALARM))
    order = float(results[0]["printed_order"])
    values: dict[str, Value] = {
        "means": means[None],
        "factor": 1.0 / (1.0 - means[3] / 100.0),
        "single": _implied_single(),
        "worst attitude": worst,
        "misread": 2.0 * GYRO_SD,
        "inverse": GYRO_SD / np.sqrt(4.0),
        "skew": skew,
        "two triads": power,
        "order": order,
        "cone": float(np.degrees(optimize_cone(6).parameters[0])),
    }
    proofs = {
        "worst attitude": Proof("Table 2 prints an attitude above 1 deg", worst, 1.005, np.inf),
        "two triads": Proof(
            "two aligned triads have three redundant axes, and a step of 5 σ raises an alarm",
            power, 2.0 * FALSE_ALARM, 1.0, "counter-experiment",
        ),
        "order": Proof("the rotations of the tetrahedron do not commute", order, 0.1, 2.0),
    }  # fmt: skip
    return Found(values, proofs=proofs)
