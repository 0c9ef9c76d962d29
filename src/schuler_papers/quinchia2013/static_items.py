"""What is read off the static record: tables 2 to 5, figures 10 to 17."""

from __future__ import annotations

import math

import numpy as np

from schuler import Process, denoise, fit_ar
from schuler_papers.experiment import FloatArray, Results, Size, generator, stacked
from schuler_papers.judging import Found, Value
from schuler_papers.outcome import Curve, Panel, Proof, Role
from schuler_papers.quinchia2013.arithmetic import crossing
from schuler_papers.quinchia2013.sensor import (
    HOURS,
    NAMES,
    PAPER,
    RATE,
    TRUE,
    TRUE_B,
    process,
    scales,
)
from schuler_papers.quinchia2013.static import ACCELS, GYROS, LEVELS_OF_FIGURE_17

IN_ORDER = (*ACCELS, *GYROS)
AXIS_ROLES: dict[str, Role] = {"x": "x", "y": "y", "z": "z"}


def _of_all(results: Results, name: str) -> FloatArray:
    """One result of all channels, accelerometers first, (seeds, 6, ...)."""
    return np.stack([stacked(results, f"{c}:{name}") for c in IN_ORDER], axis=1)


def table_2(results: Results, size: Size) -> Found:
    """AR models after de-noising: the fingerprint of the low-pass."""
    one, three = _of_all(results, "ar1"), _of_all(results, "ar3")
    table = np.concatenate([one, three], axis=2)
    return Found({"table": table, "ratio": one[:, :, 1] / three[:, :, 3]})


def caption_of_table_2(results: Results, size: Size) -> Found:
    """Six levels or seven: the ratio of the variances tells."""
    channels = ("gyro_x", "gyro_y", "gyro_z", "accel_x")
    ratios = [
        stacked(results, f"{c}:ar1")[:, 1] / stacked(results, f"{c}:ar3")[:, 3] for c in channels
    ]
    six, soft = stacked(results, "six levels"), _by_soft_thresholds()
    proof = Proof(
        "six levels give at most a ratio of 130, with all details removed or by soft SURE; the "
        "printed ones are 370 to 428",
        max(float(six.mean()), soft), 1.0, 150.0, "counter-experiment",
    )  # fmt: skip
    values: dict[str, Value] = {
        "seven": np.stack(ratios, axis=1), "six levels": six, "soft": soft,
    }  # fmt: skip
    return Found(values, proofs={"six": proof})


def _by_soft_thresholds() -> float:
    """The ratio of the variances of AR(1) and AR(3) of white noise as the paper's words have it."""
    white = generator(0, PAPER, "soft thresholds").standard_normal(50_000)
    quiet = denoise(white, level=6).signal
    one, three = (fit_ar(quiet, p, method="burg").innovation_variance for p in (1, 3))
    return float(one / three)


def parameters(results: Results, method: str) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return N, B, K of every channel with errors, (seeds, 2, p), and the true values."""
    found = {}
    for channel in IN_ORDER:
        values = stacked(results, f"{channel}:{method}")
        r = TRUE[channel]
        truth = np.array([r.white_noise, r.bias_instability, r.random_walk]) / scales(channel)
        found[channel] = (values, truth[: values.shape[2]])
    return found


def _crossing_proofs() -> dict[str, Proof]:
    return {
        f"crossing {NAMES[c]}": Proof(
            "the slopes of the printed N and K alone put a minimum at more than a third of what "
            "is read as B",
            crossing(c), 0.33, 1.0,
        )
        for c in ACCELS
    }  # fmt: skip


def table_3(results: Results, size: Size) -> Found:
    """Parameters by the spectrum."""
    found = parameters(results, "psd")
    values = {
        kind: np.stack([found[c][0][:, 0] for c in channels], axis=1)
        for kind, channels in (("accel", ACCELS), ("gyro", GYROS))
    }
    panels = (
        _spectra(results, ACCELS, "Accelerometers"),
        _spectra(results, ("accel_z",), "Accelerometer z with its parts"),
        _spectra(results, GYROS, "Gyros"),
    )
    # what the fit has to give back is the twin's truth, not the print
    wide = 1.0 if size == "full" else 2.0
    bands = {}
    for kind, channels in (("accel", ACCELS), ("gyro", GYROS)):
        truth = np.array([found[c][1] for c in channels])
        slack = np.array([0.02, 0.2 * wide, 0.2 * wide])[: truth.shape[1]]
        bands[kind] = np.array([truth * (1.0 - slack), truth * (1.0 + slack)])
    return Found(values, bands, _crossing_proofs(), panels=panels)


def table_4(results: Results, size: Size) -> Found:
    """Parameters by the Allan variance, and what reading a minimum makes of them."""
    read = _of_all(results, "read")
    joint = parameters(results, "allan")
    ratio = {c: values[:, 0] / truth for c, (values, truth) in joint.items()}
    wide = 1.0 if size == "full" else 2.0
    slack = np.array([0.005, 0.1 * wide])
    values = {
        "read accel": read[:, :3][:, :, [0, 2, 6]],
        "read gyro": read[:, 3:][:, :, [0, 1]],
        "over truth": np.stack([ratio[c][:, :2] for c in IN_ORDER], axis=1),
        "walk over truth": np.stack([ratio[c][:, 2] for c in ACCELS], axis=1),
        "over": read[:, 0, 2] / TRUE_B["accel_x"],
    }
    panels = (
        _deviations(results, ACCELS, "Accelerometers"),
        _deviations(results, ("accel_z",), "Accelerometer z with its parts"),
        _deviations(results, GYROS, "Gyros"),
    )
    bands = {"over truth": np.array([[1.0 - slack] * 6, [1.0 + slack] * 6])}
    return Found(values, bands, _crossing_proofs(), panels=panels)


def agreement(results: Results, size: Size) -> Found:
    """Spectrum against Allan variance, in their combined errors."""
    allan, psd = parameters(results, "allan"), parameters(results, "psd")
    apart = {}
    for c in IN_ORDER:
        a, p = allan[c][0], psd[c][0]
        combined = np.hypot(a[:, 1], p[:, 1])
        apart[c] = np.sqrt(np.nanmean(((a[:, 0] - p[:, 0]) / combined) ** 2, axis=0))
    values = {
        "apart": np.array([[apart[c][:2] for c in IN_ORDER]]),
        "walk apart": np.array([[apart[c][2] for c in ACCELS]]),
    }
    return Found(values)


def table_5(results: Results, size: Size) -> Found:
    """Flat parts: where white noise and random walk cross, or the plateau of the gyros."""
    read = _of_all(results, "read")
    return Found({"table": np.sqrt(read[:, :, 3] * read[:, :, 4])[:, None]})


def standard_deviations(results: Results, size: Size) -> Found:
    """White noise through fifteen taps at 1 kHz, as the device filters."""
    law = np.array([TRUE[c].white_noise for c in IN_ORDER]) * math.sqrt(1000.0 / 15.0)
    sd = _of_all(results, "sd")[:, None]
    return Found({"table": sd}, {"table": np.array([0.99 * law, 1.01 * law])[:, None]})


def figures_10_and_11(results: Results, size: Size) -> Found:
    """Autocorrelations, raw and de-noised."""
    values = {
        "neighbours": _of_all(results, "white")[:, :, 1],
        "crossing": _of_all(results, "zero"),
        "slow": stacked(results, "accel_y:after")[:, -200:].mean(axis=1),
        "fast": stacked(results, "accel_x:white")[:, 3:].mean(axis=1),
    }
    panels = []
    for title, channels in (("Figure 10", ACCELS), ("Figure 11", GYROS)):
        for what, lag in (("raw", "lag"), ("after", "lag_after")):
            curves = tuple(
                Curve(
                    NAMES[c],
                    results[0][lag],
                    stacked(results, f"{c}:{what}").mean(axis=0),
                    AXIS_ROLES[c[-1]],
                )
                for c in channels
            )
            words = "raw" if what == "raw" else "after six levels"
            panels.append(
                Panel(f"{title}, {words}", "lag, s", "autocorrelation", curves, "By lag.")
            )
    return Found(values, panels=tuple(panels))


def figure_17(results: Results, size: Size) -> Found:
    """Allan deviation after de-noising."""
    tau, raw = results[0]["17:tau"], stacked(results, "17:raw")
    found: dict[str, list[FloatArray]] = {"long": [], "short": []}
    curves = [Curve("raw", tau, raw.mean(axis=0), "data")]
    roles: tuple[Role, ...] = ("ours", "better")
    for level, role in zip(LEVELS_OF_FIGURE_17, roles, strict=True):
        quiet = stacked(results, f"17:{level}")
        step = 2.0**level / RATE
        ends = {
            "long": (tau >= 5.0 * step) & (tau <= 40.0 * step),
            "short": (tau > 0.2 * step) & (tau < 0.5 * step),
        }
        for name, inside in ends.items():
            found[name].append((quiet / raw)[:, inside].mean(axis=1))
        curves.append(Curve(f"{level} levels", tau, quiet.mean(axis=0), role))
    panel = Panel(
        "Accelerometer z after de-noising",
        "cluster time, s",
        "Allan deviation, m/s²",
        tuple(curves),
        "De-noised curves fall short of the raw one below 2^L samples and join it above.",
        log_x=True,
        log_y=True,
    )
    values: dict[str, Value] = {name: np.stack(v, axis=1) for name, v in found.items()}
    return Found(values, panels=(panel,))


def _deviations(results: Results, channels: tuple[str, ...], title: str) -> Panel:
    curves = []
    for c in channels:
        tau = results[0][f"{c}:tau"]
        mean = stacked(results, f"{c}:deviation").mean(axis=0)
        curves.append(Curve(NAMES[c], tau, mean, AXIS_ROLES[c[-1]]))
    if len(channels) == 1:
        tau = results[0][f"{channels[0]}:tau"]
        curves += [
            Curve(_words(p), tau, np.sqrt(p.allan_variance(tau)), "theory", "dash")
            for p in process(channels[0]).parts
        ]
    unit = "m/s²" if channels[0] in ACCELS else "rad/s"
    return Panel(
        title,
        "cluster time, s",
        f"Allan deviation, {unit}",
        tuple(curves),
        f"{HOURS['full']:g} h in the full size.",
        log_x=True,
        log_y=True,
    )


def _spectra(results: Results, channels: tuple[str, ...], title: str) -> Panel:
    curves = []
    for c in channels:
        frequency = results[0][f"{c}:frequency"]
        mean = stacked(results, f"{c}:density").mean(axis=0)
        curves.append(Curve(NAMES[c], frequency, mean, AXIS_ROLES[c[-1]]))
    if len(channels) == 1:
        frequency = results[0][f"{channels[0]}:frequency"]
        curves += [
            Curve(_words(p), frequency, p.psd(frequency, onesided=True), "theory", "dash")
            for p in process(channels[0]).parts
        ]
    return Panel(
        title,
        "frequency, Hz",
        "one-sided density",
        tuple(curves),
        "Averaged over frequencies.",
        log_x=True,
        log_y=True,
    )


def _words(part: Process) -> str:
    return part.kind.replace("_", " ")
