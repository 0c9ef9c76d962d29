"""What the outages came to: orders, honesty, percentages, tracks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

import numpy as np

from schuler import PairedStatistics, SensorDenoising, paired_statistics
from schuler_papers.experiment import FloatArray, Results, Size, stacked
from schuler_papers.judging import Found, Value
from schuler_papers.outcome import Band, Curve, Digits, Estimate, Panel, Role
from schuler_papers.quinchia2013.arithmetic import LARGEST, MEAN, OTHERS, TABLE_6
from schuler_papers.quinchia2013.outages import (
    LONG,
    PIECES,
    STRAIGHT,
    STRAIGHT_STARRED,
    drives,
    path_of,
)
from schuler_papers.quinchia2013.sensor import CHANNELS, MODELS, RATE, fitted, process

THEIRS = MODELS[:5]
OURS = MODELS[5:]
SHORT = tuple(k for k, p in enumerate(PIECES) if p.duration == 30.0)
ROLES: tuple[Role, ...] = ("x", "z", "y", "paper", "other", "theory", "theory")
MARKS: tuple[Literal["line", "dash"], ...] = (*("line",) * 5, "dash", "line")
"""How each model is drawn."""


def case(results: Results, name: str, figure: str, windows: tuple[int, ...]) -> FloatArray:
    """Return a figure of a model, mean over windows, by repetition."""
    return np.asarray(stacked(results, f"{name}:{figure}")[:, list(windows)].mean(axis=1))


def pair(
    results: Results, a: str, b: str, figure: str = "end", windows: tuple[int, ...] = LONG
) -> PairedStatistics:
    """Compare two models seed by seed."""
    return paired_statistics(case(results, a, figure, windows), case(results, b, figure, windows))


def ratio(results: Results, name: str, windows: tuple[int, ...]) -> Estimate:
    """Return claimed over real error at the ends, both root mean squares, with its error."""
    real = (stacked(results, f"{name}:end")[:, list(windows)] ** 2).mean(axis=1)
    claimed = (stacked(results, f"{name}:claimed")[:, list(windows)] ** 2).mean(axis=1)
    value = math.sqrt(claimed.mean() / real.mean())
    n = real.size
    if n < 2:
        return Estimate(value)
    left = np.sqrt((claimed.sum() - claimed) / (real.sum() - real))
    return Estimate(value, float(math.sqrt((n - 1) / n * ((left - left.mean()) ** 2).sum())))


def ordering(results: Results, size: Size) -> Found:
    """AV below AR(1) below AR(3) in the 60 s error, in paired standard errors."""
    paper = (("15AV", "15AR"), ("18AV", "15AR"), ("18AVWD", "15AR"), ("15AR", "27AR"))
    ours = (("18AV", "15AV"), ("18AV+turn-on", "18AV"), ("flicker4", "18AV"))
    apart = np.array([[pair(results, a, b).standard_errors_apart for a, b in paper]])
    differences = {
        name: np.stack(
            [case(results, a, "end", LONG) - case(results, b, "end", LONG) for a, b in pairs],
            axis=1,
        )
        for name, pairs in (("difference", paper), ("more", ours))
    }
    return Found({**differences, "apart": apart})


def honesty(results: Results, size: Size) -> Found:
    """Claimed against real: (29) makes filters overconfident, four Gauss-Markovs do not."""
    loose = 0.0 if size == "full" else 0.25
    # three seeds of the quick size say little
    few = 1.0 if size == "full" else 2.5
    note = "0.49, 0.51, 0.51 in 50 draws; 0.57 of a single channel in the spec"
    overconfident = Band(0.42 - loose, 0.62 + loose, "frozen", note, few)
    honest = {
        **dict.fromkeys(("15AV", "18AV", "18AVWD"), overconfident),
        "flicker4": Band(0.90 - loose, 1.0 + loose, "spec", "0.9 to 1.0", few),
        "27AR": Band(0.0, 0.35, "spec", "68/424", few),
    }
    values: dict[str, Value] = {}
    for name in MODELS:
        values[f"long {name}"] = ratio(results, name, LONG)
        values[f"short {name}"] = ratio(results, name, SHORT)
        values[f"nis {name}"] = stacked(results, f"{name}:nis").mean(axis=1)
    return Found(values, {f"long {name}": band for name, band in honest.items()})


def mechanism(results: Results, size: Size) -> Found:
    """E-004-11: the spectrum of the fitted AR models against the true bias."""
    white, *slow = process("gyro_x").parts
    third = fitted(size)[3]["gyro_x"]

    def density(one: object, frequency: float) -> float:
        return float(one.psd(frequency, onesided=False))  # type: ignore[attr-defined]

    bias = sum(density(p, 1e-3) for p in slow)
    values: dict[str, Value] = {
        "over white": np.array([[density(third, f) / density(white, f) for f in (1e-2, 1e-3)]]),
        "slow": bias / density(white, 1e-3),
        "held": density(third, 1e-3) / bias,
    }
    return Found(values)


def denoising(results: Results, size: Size) -> Found:
    """18AVWD against 18AV: nothing on the straight, and what in turns."""
    turning = tuple(k for k in range(len(PIECES)) if k not in STRAIGHT)
    values: dict[str, Value] = {}
    for windows, words in ((STRAIGHT, "straight"), (turning, "turning")):
        one, two = (stacked(results, f"{n}:end")[:, list(windows)] for n in ("18AVWD", "18AV"))
        values[words] = 100.0 * (math.sqrt(float((one**2).mean() / (two**2).mean())) - 1.0)
    best = pair(results, "18AVWD", "18AV", "max", tuple(range(7)))
    floor = float(stacked(results, "floor")[0, 6])
    values |= {
        "gain": 100.0 * best.mean_of_ratios,
        "luck": 100.0 * (1.0 - math.exp(-(LARGEST["18AVWD"][6] ** 2) / floor**2)),
    }
    return Found(values)


def _table(results: Results, outages: tuple[int, ...]) -> Found:
    """Mean and largest errors of every model in some of the outages."""
    cells, printed = [], []
    for name in THEIRS:
        for figure, table in (("mean", MEAN), ("max", LARGEST)):
            cells.append(stacked(results, f"{name}:{figure}")[:, list(outages)])
            printed.append([Digits(f"{table[name][k]:.2f}") for k in outages])
    ours = [
        [stacked(results, f"{name}:{figure}")[:, k] for figure in ("max", "mean")]
        for k in outages
        for name in OURS
    ]
    more = np.array(ours).reshape(len(outages), len(OURS), 2, -1)
    return Found(
        {"table": np.stack(cells, axis=2), "ours": np.moveaxis(more, -1, 0)},
        printed={"table": [list(line) for line in zip(*printed, strict=True)]},
    )


def table_9(results: Results, size: Size) -> Found:
    """First trajectory."""
    return _table(results, (0, 1, 2))


def table_10(results: Results, size: Size) -> Found:
    """Second trajectory."""
    return _table(results, (3, 4, 5, 6))


def figure_26(results: Results, size: Size) -> Found:
    """Largest and mean error of all outages, and the percentages on the twin."""
    every = tuple(range(7))
    gains = [100.0 * pair(results, "18AVWD", other, "max", every).ratio_of_sums for other in OTHERS]
    panels = []
    for figure, table, title in (("max", LARGEST, "Largest"), ("mean", MEAN, "Mean")):
        panels += _by_outage(results, figure, table, title)
    return Found({"gain": np.array([gains])}, panels=tuple(panels))


def _by_outage(
    results: Results, figure: str, table: Mapping[str, tuple[float, ...]], title: str
) -> list[Panel]:
    outage, roles = np.arange(7.0), (*ROLES[:5], "data", "theory")
    curves = []
    for role, name in zip(roles, MODELS, strict=True):
        values = stacked(results, f"{name}:{figure}")
        mean = values.mean(axis=0)
        error = values.std(axis=0) / math.sqrt(max(len(results) - 1, 1))
        curves.append(Curve(name, outage, mean, role, "points", mean - error, mean + error))
    printed = [
        Curve(name, outage, np.array(table[name]), role, "points")
        for role, name in zip(ROLES, THEIRS, strict=False)
    ]
    return [
        Panel(
            f"{title} horizontal error, {whose}",
            "outage",
            "m",
            tuple(drawn),
            words,
            log_y=True,
            categories=tuple(str(k + 1) for k in range(7)),
        )
        for whose, drawn, words in (
            ("twin", curves, "Mean over the seeds with its standard error."),
            ("printed", printed, "Tables 9 and 10."),
        )
    ]


def _figure(results: Results, size: Size, outage: int, label: str) -> Found:
    floor = float(stacked(results, "floor")[0, outage])
    ratios = [stacked(results, f"{name}:end")[:, outage] ** 2 / floor**2 for name in MODELS]
    notes = (
        f"{label} shows one draw; tables have the mean.",
        f"White noise alone: {floor:.1f} m.",
    )
    panels = (_tracks(results, outage), _growth(results, outage))
    return Found({"over floor": np.stack(ratios, axis=1)}, panels=panels, notes=notes)


def _tracks(results: Results, outage: int) -> Panel:
    track = results[0]
    reference = track["reference:track"][outage]
    shown = int(np.isfinite(reference[:, 0]).sum())
    curves = [Curve("truth", reference[:shown, 0], reference[:shown, 1], "data")]
    for role, mark, name in zip(ROLES, MARKS, MODELS, strict=True):
        path = track[f"{name}:track"][outage][:shown]
        curves.append(Curve(name, path[:, 0], path[:, 1], role, mark))
    return Panel(
        f"Outage {outage + 1}, first seed",
        "east, m",
        "north, m",
        tuple(curves),
        "Tracks of all models part from the truth.",
    )


def _growth(results: Results, outage: int) -> Panel:
    shown = int(np.isfinite(results[0]["reference:track"][outage][:, 0]).sum())
    time = np.arange(float(shown))
    curves = []
    for role, mark, name in zip(ROLES, MARKS, MODELS, strict=True):
        error = stacked(results, f"{name}:error")[:, outage, :shown]
        curves.append(Curve(name, time, np.sqrt((error**2).mean(axis=0)), role, mark))
    return Panel(
        f"Outage {outage + 1}, rms of {len(results)} seeds",
        "time since GNSS was lost, s",
        "horizontal error, m",
        tuple(curves),
        "Errors grow with the power 5/2 of time and faster.",
    )


def figure_21(results: Results, size: Size) -> Found:
    """Outage 1."""
    return _figure(results, size, 0, "Figure 21")


def figure_22(results: Results, size: Size) -> Found:
    """Outage 2."""
    return _figure(results, size, 1, "Figure 22")


def figure_24(results: Results, size: Size) -> Found:
    """Outage 5."""
    return _figure(results, size, 4, "Figure 24")


def figure_25(results: Results, size: Size) -> Found:
    """Outage 7."""
    return _figure(results, size, 6, "Figure 25")


def _driven(starred: bool, labels: tuple[str, str]) -> tuple[FloatArray, tuple[Panel, ...]]:
    """Mean speeds in the outages, and both drives from above."""
    speeds: list[float] = []
    panels = []
    for number, label in enumerate(labels):
        track, speed = path_of(number, starred)
        curves = [Curve("drive", track[:, 0], track[:, 1], "data")]
        for start, seconds in drives(starred)[number][1]:
            a, b = round(start / 2.0), round((start + seconds) / 2.0) + 1
            speeds.append(float(speed[a:b].mean()))
            name = f"outage {len(speeds)}{'*' if starred else ''}"
            curves.append(Curve(name, track[a:b, 0], track[a:b, 1], "printed"))
        words = "The drive and its outages."
        panels.append(Panel(label, "east, m", "north, m", tuple(curves), words))
    return np.array([speeds]), tuple(panels)


def trajectories(results: Results, size: Size) -> Found:
    """Figures 20 and 23: the drives and where GNSS is taken away."""
    speeds, panels = _driven(False, ("Figure 20", "Figure 23"))
    minutes = np.array([[profile.duration / 60.0 for profile, _ in drives()]])
    return Found({"minutes": minutes, "speeds": speeds}, panels=panels)


def table_6(results: Results, size: Size) -> Found:
    """Largest errors without an error model, at 0, 3 and 7 levels, on table 6's own outages."""
    every = {level: stacked(results, f"LOD {level}:max") for level in TABLE_6}
    straight = list(STRAIGHT_STARRED)
    speeds, panels = _driven(True, ("Figure 18 (a)", "Figure 18 (b)"))
    table = np.stack(list(every.values()), axis=2)
    values = {
        "table": table,
        "speeds": speeds,
        "sums": table.sum(axis=1),
        "three": every[3].sum(axis=1) / every[0].sum(axis=1),
        "straight": every[7][:, straight].sum(axis=1) / every[0][:, straight].sum(axis=1),
        "seven": every[7].sum(axis=1) / every[0].sum(axis=1),
    }
    return Found(values, panels=panels)


def table_7(results: Results, size: Size) -> Found:
    """The levels that are used, and the band that they leave."""
    levels = SensorDenoising.table_7().levels
    used = np.array([float(levels[c]) for c in (*CHANNELS[3:], *CHANNELS[:3])])
    return Found({"table": np.stack([used, RATE / 2.0 ** (used + 1.0)], axis=1)[None]})
