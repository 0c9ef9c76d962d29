"""The claims of the paper one by one, and the same comparison on a real sensor."""

from __future__ import annotations

import numpy as np

from schuler_papers.experiment import Results, Size, stacked
from schuler_papers.judging import Found, Value, plain
from schuler_papers.outcome import Curve, Panel, Role
from schuler_papers.tamazin2013.predictors import ORDERS
from schuler_papers.tamazin2013.tables import times


def central_claim(results: Results, size: Size) -> Found:
    """FOS on raw data against covariance on de-noised data, of a sensor without a filter."""
    fos = stacked(results, "raw_quadratic")[:, -1]
    best = stacked(results, "second_kalman")
    others = [stacked(results, f"second_{n}") for n in ("fast_ar", "zero", "last", "slow_ar")]
    values = {
        "fos over covariance": fos / stacked(results, "smooth_linear")[:, 1, 9],
        "protocol": stacked(results, "protocol_error") / stacked(results, "true_floor"),
        "protocol_degree": stacked(results, "protocol_degree"),
        "density": 1e-3 * stacked(results, "quiet_density") / 9.80665e-6,
        "next second": np.stack([o / best for o in others], axis=1),
    }
    return Found(values)


def offset_left_in(results: Results, size: Size) -> Found:
    """Why Yule-Walker has the same error at orders 1 and 10."""
    own = stacked(results, "offset_yule_walker")
    plain_fit = stacked(results, "offset_covariance")
    floor = stacked(results, "offset_floor")
    values = {
        "offset_hour": stacked(results, "offset_hour"),
        "yule-walker": own[:, [0, 9]],
        "covariance": plain_fit[:, [0, 9]],
        "over floor": own[:, 9] / floor,
    }
    panel = Panel(
        "A record as quiet as the paper's, its mean left in",
        "order",
        "error, (m/s²)²",
        (
            Curve("Yule-Walker", ORDERS, own.mean(axis=0), "x"),
            Curve("covariance", ORDERS, plain_fit.mean(axis=0), "ours"),
            Curve("(y₁² + y_N²)/N", ORDERS, np.full(10, floor.mean()), "theory", "dash"),
            Curve("printed: Yule-Walker", np.array([1.0, 10.0]), (5e-9, 5e-9), "printed", "points"),
            Curve(
                "printed: covariance", np.array([1.0, 10.0]), (3e-11, 2e-12), "printed", "points"
            ),
        ),
        "Errors by order of Yule-Walker and covariance on a record with an offset.",
        log_y=True,
    )
    return Found(values, panels=(panel,))


def time_column(results: Results, size: Size) -> Found:
    """CPU time on the same samples."""
    seconds = stacked(results, "seconds")
    values: dict[str, Value] = {
        "fos over covariance": seconds[:, 3] / seconds[:, 1],
        "orders": 3e-11 / 1e-11,
    }
    return Found(values, panels=(times("accelerometer", results),))


def recording(results: Results, size: Size) -> Found:
    """The same comparison on six real recordings."""
    raw, smooth = stacked(results, "raw_linear"), stacked(results, "smooth_linear")
    quadratic = stacked(results, "raw_quadratic")[:, -1:]
    every = np.concatenate([raw[:, :, 9], quadratic], axis=1)
    values = {
        **plain(results, size).values,
        "spread": every.max(axis=1) / every.min(axis=1) - 1.0,
        "floor": every.min(axis=1) / stacked(results, "raw_floor"),
        "fall": smooth[:, 1, 0] / smooth[:, 1, 9],
        "fos": quadratic[:, 0] / smooth[:, 1, 9],
    }
    curves = []
    kinds: tuple[tuple[str, Role], ...] = (("raw", "data"), ("smooth", "ours"))
    for kind, role in kinds:
        linear = stacked(results, f"{kind}_linear").mean(axis=0)
        curves.append(Curve(f"covariance, {kind}", ORDERS, linear[1], role))
        curves.append(Curve(f"FOS, {kind}", ORDERS, linear[-1], "better", "dash"))
    panel = Panel(
        "ADIS16405, accelerometer y",
        "order",
        "one-step error, (m/s²)²",
        tuple(curves),
        "Held-out one-step error by order on real data, raw and de-noised.",
        log_y=True,
    )
    return Found(values, panels=(panel,))
