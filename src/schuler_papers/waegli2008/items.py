"""What came of the rides: Tables 1 to 3, Figs 12 to 17."""

from __future__ import annotations

from typing import cast

import numpy as np

from schuler_papers.experiment import FloatArray, Results, Size, stacked
from schuler_papers.judging import Found, Value
from schuler_papers.outcome import Band, Curve, Panel, Role
from schuler_papers.waegli2008.runs import NUMBERS

COMPONENTS = ("N", "E", "D", "vN", "vE", "vD", "roll", "pitch", "heading")
TABLE_2 = {
    "N": (0.83, 0.03, 0.83, 0.03), "E": (2.40, 0.05, 2.40, 0.04), "D": (0.81, 0.08, 0.81, 0.07),
    "vN": (0.07, 0.05, 0.07, 0.03), "vE": (0.07, 0.07, 0.07, 0.05), "vD": (0.11, 0.10, 0.12, 0.06),
    "roll": (0.69, 1.09, 1.04, 0.83), "pitch": (0.79, 1.05, 0.92, 0.86),
    "heading": (0.42, 0.68, 0.67, 0.62),
}  # fmt: skip
"""m, m/s, deg: synthetic with L1 and L1/L2, extended with L1 and L1/L2."""
TABLE_3 = {
    "N": (-29, -35, -71, -94), "E": (-41, -51, -77, -94), "D": (-5, -19, -27, -82),
    "vN": (-37, -61, -82, -95), "vE": (-50, -67, -81, -93), "vD": (-7, -44, -25, -74),
    "roll": (-57, -67, -80, -87), "pitch": (-28, -41, -59, -80), "heading": (-21, -27, -45, -69),
}  # fmt: skip
"""Percent: root mean square, then maximum, synthetic and extended."""


def _reduction(results: Results, key: str, name: str, what: str = "rms") -> FloatArray:
    """Percent less than the average single IMU, (seeds, 9)."""
    one = stacked(results, f"{key} single {what}")
    return np.asarray(100.0 * (1.0 - stacked(results, f"{key} {name} {what}") / one))


def _columns(parts: list[FloatArray]) -> FloatArray:
    """Join (seeds, lines) arrays to a table, (seeds, lines, columns)."""
    return np.stack(parts, axis=2)


def table_1(results: Results, size: Size) -> Found:
    """Two aligned IMUs on skis against one."""
    cells = [
        -_reduction(results, receiver, name)[:, 6:]
        for receiver in ("L1", "L1L2")
        for name in ("synthetic", "extended")
    ]
    less = np.stack([_reduction(results, r, "synthetic") for r in ("L1", "L1L2")], axis=1)
    values = {
        "table": _columns(cells),
        "attitude": less[:, :, 6:].mean(axis=2),
        "navigation": less[:, :, :6].mean(axis=2),
        "difference": _difference(results),
    }
    return Found(values)


def _difference(results: Results) -> float:
    return float(np.max([r["L1L2 difference"] for r in results]))


def figure_13(results: Results, size: Size) -> Found:
    """The synthetic IMU's bias is the mean of those of the IMUs by themselves."""
    apart = np.array([r["bias_apart_in_sd"].max() for r in results])
    panel = _bias_panel(results, "Gyro bias by itself and fused")
    return Found({"apart": apart}, panels=(panel,))


def _bias_panel(results: Results, title: str) -> Panel:
    first = results[0]
    time = first["bias_time"] - first["bias_time"][0]
    curves = [
        Curve(f"IMU {i + 1} by itself", time, alone[:, 0], role="other", mark="dash")
        for i, alone in enumerate(first["bias_alone"])
    ]
    mean = first["bias_alone"].mean(axis=0)[:, 0]
    curves.append(Curve("their mean", time, mean, role="theory"))
    curves.append(Curve("synthetic IMU", time, first["bias_synthetic"][:, 0]))
    return Panel(
        title,
        "time in s",
        "gyro bias about x of the body in deg/s",
        tuple(curves),
        "The curve of the synthetic IMU lies on the mean of the others.",
    )


def table_2(results: Results, size: Size) -> Found:
    """Absolute accuracy with both receivers."""
    code, phase = (stacked(results, f"{key} synthetic rms") for key in ("L1", "L1L2"))
    cells = [
        stacked(results, f"{key} {name} rms")
        for name in ("synthetic", "extended")
        for key in ("L1", "L1L2")
    ]
    values = {
        "table": _columns(cells),
        "ratio": code[:, :3].mean(axis=1) / phase[:, :3].mean(axis=1),
        "turn": code[:, 6:].mean(axis=1) / phase[:, 6:].mean(axis=1),
    }
    return Found(values)


def table_3(results: Results, size: Size) -> Found:
    """Reduction against the average single IMU, root mean square and maximum."""
    cells = [
        -_reduction(results, "L1L2", name, what)
        for what in ("rms", "largest")
        for name in ("synthetic", "extended")
    ]
    less = -cells[0]
    difference = _difference(results)
    values: dict[str, Value] = {
        "table": _columns(cells),
        "attitude": less[:, 6:].mean(axis=1),
        "navigation": less[:, :6].mean(axis=1),
        "largest": 1.0 + cells[3][:, 6:].mean(axis=1) / 100.0,
        "difference": difference,
    }
    return Found(values, panels=(_reductions(less),))


def _reductions(less: FloatArray) -> Panel:
    x, mean, spread = np.arange(9.0), less.mean(axis=0), _spread(less)
    printed = -np.array([TABLE_3[c] for c in COMPONENTS], dtype=np.float64)
    return Panel(
        "Less error with four IMUs than with one",
        "component",
        "reduction in %",
        (
            Curve("printed, synthetic", x, printed[:, 0], role="printed", mark="points"),
            Curve("printed, extended", x, printed[:, 1], role="paper", mark="points"),
            Curve("ours, both", x, mean, "ours", "points", mean - spread, mean + spread),
            Curve("bound", x, np.full(9, 50.0), role="theory", mark="dash"),
        ),
        "Ours lie below one half in all components; four of the printed ones lie above.",
        categories=COMPONENTS,
    )


def _spread(values: FloatArray) -> FloatArray:
    count = values.shape[0]
    if count < 2:
        return np.zeros(values.shape[1])
    return np.asarray(2.0 * values.std(axis=0, ddof=1) / np.sqrt(count))


def figure_15(results: Results, size: Size) -> Found:
    """Peaks of the attitude error are flattened."""
    largest = [stacked(results, f"L1L2 {name} largest")[:, 6:] for name in ("extended", "single")]
    first = results[0]
    time = first["attitude_time"] - first["attitude_time"][0]
    panels = tuple(
        Panel(
            f"Error of {COMPONENTS[6 + i]}",
            "time in s",
            "deg",
            (
                Curve("one IMU", time, first["attitude_single"][:, i], role="other"),
                Curve("extended, four IMUs", time, first["attitude_extended"][:, i]),
            ),
            "The curve of four IMUs has lower peaks.",
        )
        for i in range(3)
    )
    return Found({"ratio": (largest[0] / largest[1]).mean(axis=1)}, panels=panels)


def figure_16(results: Results, size: Size) -> Found:
    """Biases of single sensors in the extended filter."""
    truth = stacked(results, "without_seen_truth")
    values: dict[str, Value] = {
        "unseen": float((stacked(results, "without_unseen_rms") / truth).max()),
        "seen": stacked(results, "without_seen_error") / truth,
        "without": np.mean(stacked(results, "without_error_in_sd") < 3.0, axis=1),
        "with": np.mean(stacked(results, "with_error_in_sd") < 3.0, axis=1),
    }
    first = results[0]
    x = np.arange(12.0)
    names = tuple(f"{i + 1} {a}" for i in range(4) for a in "xyz")
    panel = Panel(
        "Gyro biases of four IMUs",
        "IMU and axis",
        "deg/s",
        (
            Curve("truth", x, first["gyro_truth"], role="theory", mark="points"),
            Curve("extended without parity", x, first["without_gyro"], role="paper", mark="points"),
            Curve("extended with parity", x, first["with_gyro"], mark="points"),
        ),
        "With parity the estimates lie on the truth, without it they do not.",
        categories=names,
    )
    return Found(values, panels=(panel,))


def figure_17(results: Results, size: Size) -> Found:
    """Correlations between the biases are those of the geometry."""
    apart = np.eye(12) == 0.0
    theory = np.abs(results[0]["correlation_theory"])[apart]
    found = np.mean([np.abs(r["correlation_gyro"])[apart] for r in results], axis=0)
    values: dict[str, Value] = {
        "difference": np.array(
            [np.abs(r["correlation_gyro"] - r["correlation_theory"])[apart].max() for r in results]
        ),
        "size": float(found[theory > 0.05].mean()),
    }
    first = results[0]
    panel = Panel(
        "Correlation of the biases of the gyros",
        "correlation by geometry",
        "correlation in the filter",
        (
            Curve("pairs", first["correlation_theory"][apart], first["correlation_gyro"][apart],
                  mark="points"),
            Curve("equal", np.array([-0.4, 0.4]), np.array([-0.4, 0.4]), role="theory",
                  mark="dash"),
        ),
        "All pairs lie on the line of equal values.",
    )  # fmt: skip
    return Found(values, panels=(panel,))


def levels(results: Results, size: Size) -> Found:
    """Redundancy at system level against that of sensors; all architectures."""
    names = ("single", "system", "synthetic", "extended", "constrained")
    error = {n: stacked(results, f"L1L2 {n} rms")[:, 6:].mean(axis=1) for n in names}
    values = {
        "levels": np.stack(list(error.values()), axis=1),
        "single less system": error["single"] - error["system"],
        "system less sensor": error["system"] - error["synthetic"],
        "tied": error["constrained"] / error["extended"],
    }
    bands = {
        name: _significant(values[name], size)
        for name in ("single less system", "system less sensor")
    }
    return Found(values, bands)


def _significant(difference: FloatArray, size: Size) -> Band:
    """More than two standard errors of the paired difference; with few seeds the sign must do."""
    if size == "quick" or difference.size < 4:
        return Band(0.0, np.inf, "spec", "the sign; more than two standard errors in the full run")
    error = difference.std(ddof=1) / np.sqrt(difference.size)
    return Band(2.0 * float(error), np.inf, "spec", "two standard errors of the paired difference")


def unequal(results: Results, size: Size) -> Found:
    """One IMU with biases ten times as large: what the parity update is worth."""
    base = stacked(results, "without synthetic rms")
    gain = 100.0 * (1.0 - stacked(results, "with extended rms") / base)[:, 6:].mean(axis=1)
    values: dict[str, Value] = {
        "attitude": gain,
        "same": float(np.max(np.abs(stacked(results, "without extended rms") / base - 1.0))),
    }
    single = stacked(results, "without single rms")
    roles = cast("tuple[Role, ...]", ("paper", "better"))
    x = np.arange(9.0)
    panel = Panel(
        "One IMU in four with large biases",
        "component",
        "error over that of the average single IMU",
        tuple(
            Curve(words, x, np.mean(stacked(results, key) / single, axis=0), role, "points")
            for words, key, role in zip(
                ("synthetic", "extended with parity"),
                ("without synthetic rms", "with extended rms"),
                roles,
                strict=True,
            )
        ),
        "With parity the errors are smaller in every component of the attitude.",
        categories=COMPONENTS,
    )
    return Found(values, {"attitude": _significant(gain, size)}, panels=(panel,))


def number(results: Results, size: Size) -> Found:
    """Attitude error by the number of IMUs, over that of one."""
    attitude = np.sqrt((stacked(results, "errors")[:, :, 6:] ** 2).mean(axis=2))
    over = attitude[:, 1:] / attitude[:, :1]
    law, mean = 1.0 / np.sqrt(np.array(NUMBERS, dtype=np.float64)), over.mean(axis=0)
    spread = _spread(over)
    places = np.arange(4.0)
    ones = np.concatenate([[1.0], mean])
    slack = np.concatenate([[0.0], spread])
    panel = Panel(
        "Attitude error by the number of IMUs",
        "IMUs",
        "over that of one IMU",
        (
            Curve("ours", places, ones, "ours", "points", ones - slack, ones + slack),
            Curve("1/√n", places, law, role="theory", mark="dash"),
        ),
        "Ours falls, but not as fast as the noise: GNSS and the compass are one.",
        categories=tuple(map(str, NUMBERS)),
    )
    bands = {"over": np.array([law[1:], np.ones(3)])}
    return Found({"over": over, "eight": over[:, 2] / over[:, 1]}, bands, panels=(panel,))


def faulty(results: Results, size: Size) -> Found:
    """Heading after a gyro has failed, over that of the healthy array."""
    heading = stacked(results, "errors")[:, :, 8]
    return Found({"watched": heading[:, 1] / heading[:, 0], "blind": heading[:, 2] / heading[:, 0]})
