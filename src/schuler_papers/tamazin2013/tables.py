"""Tables 1 and 2, figures 6 and 7, equation (29)."""

from __future__ import annotations

import math

import numpy as np

from schuler import position_error_of_accel_bias, position_error_of_gyro_bias
from schuler_papers.experiment import FloatArray, Results, Size, stacked
from schuler_papers.judging import Found, plain
from schuler_papers.outcome import Curve, Mark, Panel, Role, rounding
from schuler_papers.tamazin2013.predictors import DEG_H, METHODS, ORDERS, SECOND_DEGREE_LAGS

HOUR = 3600.0
PRINTED = {
    "accelerometer": {
        "yule-walker": (5e-9, 5e-9),
        "covariance": (3e-11, 2e-12),
        "FOS, degree 1": (1e-11, 3e-14),
        "FOS, degree 2": (1e-11, 2e-16),
    },
    "gyro": {
        "yule-walker": (7e-6, 2e-6),
        "covariance": (5e-6, 2e-7),
        "FOS, degree 1": (1e-6, 4e-10),
        "FOS, degree 2": (1e-6, 3e-11),
    },
}
TIMES = {
    "accelerometer": (0.69, 0.45, 0.45, 0.30, 0.60),
    "gyro": (0.44, 0.28, 0.28, 0.18, 0.6),
}
"""s, order 10: Yule-Walker, covariance, Burg, FOS of degree 1 and 2."""
UNITS = {"accelerometer": "(m/s²)²", "gyro": "(deg/h)²"}


def table_1(results: Results, size: Size) -> Found:
    """Errors of the accelerometer's predictors at orders 1 and 10."""
    return _table("accelerometer", results)


def table_2(results: Results, size: Size) -> Found:
    """Errors of the gyro's predictors at orders 1 and 10."""
    return _table("gyro", results)


def _table(name: str, results: Results) -> Found:
    smooth, raw = stacked(results, "smooth_linear"), stacked(results, "raw_linear")
    ends = raw[:, :, [0, 9]]
    every = np.concatenate([ends, stacked(results, "raw_quadratic")[:, None, [0, -1]]], 1)
    covariance, own = smooth[:, 1], smooth[:, 0]
    products = stacked(results, "smooth_quadratic") / covariance[:, SECOND_DEGREE_LAGS - 1]
    same = (smooth[:, -1] / covariance)[:, [0, 9]]
    values = {
        "table": _cells(name, results),
        "spread": every.max(axis=1) / every.min(axis=1) - 1.0,
        "floor": every.min(axis=(1, 2)) / stacked(results, "true_floor"),
        "fall": covariance[:, 0] / covariance[:, 9],
        "over covariance": own[:, 9] / covariance[:, 9],
        "same data": same,
        "products": products[:, -1],
    }
    bands = {"table": _position_bands(name)}
    return Found(values, bands, panels=(times(name, results),))


def _cells(name: str, results: Results) -> FloatArray:
    """Errors as the paper has them (FOS raw, others de-noised), position law, CPU time."""
    smooth, raw = stacked(results, "smooth_linear"), stacked(results, "raw_linear")
    quadratic = stacked(results, "raw_quadratic")
    lines = []
    for k, order in enumerate((0, 9)):
        seconds = stacked(results, "seconds" if order else "seconds_1")
        for method, column in zip(PRINTED[name], (0, 1, 3, 4), strict=True):
            if method == "FOS, degree 2":
                error = quadratic[:, -1 if order else 0]
            else:
                kind = raw if method.startswith("FOS") else smooth
                error = kind[:, METHODS.index(method), order]
            position = np.full(error.size, _position(name, PRINTED[name][method][k]))
            lines.append(np.stack([error, position, seconds[:, column]], axis=1))
    return np.stack(lines, axis=1)


def _position_bands(name: str) -> FloatArray:
    """What the law makes of the printed errors within their rounding, (2, 8, 3); others NaN."""
    bands = np.full((2, 8, 3), math.nan)
    for line, (k, method) in enumerate((k, m) for k in (0, 1) for m in PRINTED[name]):
        printed = PRINTED[name][method][k]
        for end, sign in enumerate((-1.0, 1.0)):
            bands[end, line, 1] = _position(name, printed + sign * rounding(printed))
    return bands


def _position(name: str, mean_square: float) -> float:
    if name == "gyro":
        return position_error_of_gyro_bias(math.sqrt(mean_square) * DEG_H, HOUR)
    return position_error_of_accel_bias(math.sqrt(mean_square), HOUR)


def times(name: str, results: Results) -> Panel:
    """CPU time by method, printed and ours."""
    seconds = stacked(results, "seconds").min(axis=0)
    names = ("Yule-Walker", "covariance", "Burg", "FOS, degree 1", "FOS, degree 2")
    places = np.arange(5.0)
    return Panel(
        "CPU time of order 10, ours all on 3 min",
        "",
        "s",
        (
            Curve("printed (60 min, FOS 3 min)", places, TIMES[name], "printed", "points"),
            Curve("ours", places, seconds, "ours", "points"),
        ),
        "Time of a fit by method, printed and ours.",
        log_y=True,
        categories=names,
    )


def figure_6(results: Results, size: Size) -> Found:
    """Error by order for the accelerometer."""
    return _by_order("accelerometer", results)


def figure_7(results: Results, size: Size) -> Found:
    """Error by order for the gyro."""
    return _by_order("gyro", results)


def _by_order(name: str, results: Results) -> Found:
    smooth, raw = stacked(results, "smooth_linear"), stacked(results, "raw_linear")
    values = {
        "high order": smooth[:, 1, 9] / smooth[:, 1, 2],
        "raw fall": raw[:, -1, 9] / raw[:, -1, 0],
        "gap": stacked(results, "true_floor") / smooth[:, 1, 9],
    }
    panels = (
        _order_panel(name, results, "smooth", "de-noised, 4 levels"),
        _order_panel(name, results, "raw", "raw"),
    )
    return Found(values, panels=panels)


def _order_panel(name: str, results: Results, kind: str, title: str) -> Panel:
    drawn: dict[str, tuple[Role, Mark]] = {
        "yule-walker": ("paper", "line"),
        "covariance": ("ours", "line"),
        "FOS, degree 1": ("z", "dash"),
    }
    linear = stacked(results, f"{kind}_linear").mean(axis=0)
    curves = [
        Curve(method, ORDERS, linear[METHODS.index(method)], role, mark)
        for method, (role, mark) in drawn.items()
    ]
    quadratic = stacked(results, f"{kind}_quadratic").mean(axis=0)
    curves.append(Curve("FOS, degree 2", SECOND_DEGREE_LAGS, quadratic, "better", "points"))
    if kind == "raw":
        floor = np.full(ORDERS.size, float(stacked(results, "true_floor").mean()))
        curves.append(Curve("innovation variance", ORDERS, floor, "theory", "dash"))
    curves += [
        Curve(f"printed: {method}", np.array([1.0, 10.0]), values, "printed", "points")
        for method, values in PRINTED[name].items()
        if method.startswith("FOS") == (kind == "raw")
    ]
    return Panel(
        title,
        "order or largest lag",
        f"one-step error, {UNITS[name]}",
        tuple(curves),
        f"Held-out one-step error by order on {title} data, with the printed points.",
        log_y=True,
    )


def equation_29(results: Results, size: Size) -> Found:
    """The shape of the printed nine-term model."""
    values = plain(results, size).values
    on_raw = stacked(results, "smooth_model_on_raw") / stacked(results, "true_floor")
    return Found({**values, "on raw": on_raw})
