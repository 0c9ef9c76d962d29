"""E-003-1 again, with the low-pass inside the sensor as a parameter.

The floor of Kolmogorov belongs to the spectrum of the data. Raw data of a sensor that filters
before it delivers are not white, and a search may foresee them.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, lfilter

from schuler import denoise, fast_orthogonal_search, fit_ar_orders
from schuler_papers.experiment import (
    FloatArray,
    Numbers,
    Results,
    Size,
    generator,
    numbers,
    stacked,
)
from schuler_papers.judging import Found, Value
from schuler_papers.outcome import Curve, Panel, Role
from schuler_papers.tamazin2013.predictors import ACCELEROMETER, GYRO, PAPER, RATE

FILTERS = ((2, 30.0), (2, 20.0), (2, 12.5), (4, 12.5))
"""Order and cut-off in Hz of a Butterworth low-pass."""
ORDERS = np.array([1, 2, 3, 4, 6, 8, 10])
TRAINING = 36_000
SETTLED = 2000
_ROLES: tuple[Role, ...] = ("x", "y", "z", "ours")


def run(seed: int, size: Size) -> Numbers:
    """Search raw data of sensors with several filters, by order."""
    rng = generator(seed, PAPER, "band-limited")
    samples = 120_000 if size == "quick" else 720_000
    found: Numbers = {}
    for sensor in (ACCELEROMETER, GYRO):
        white = sensor.process.simulate(samples, 1.0 / RATE, rng) / sensor.unit
        filters = FILTERS if sensor is ACCELEROMETER else FILTERS[-1:]
        kept = [_errors(_filtered(white, *f)) for f in filters]
        for k, what in enumerate(("fos", "covariance", "smooth")):
            found[f"{sensor.name}_{what}"] = np.array([errors[k] for errors in kept])
    step = ACCELEROMETER.step
    white = ACCELEROMETER.process.simulate(samples, 1.0 / RATE, rng)
    rounded = np.round(_filtered(white, *FILTERS[-1]) / step) * step
    fos, _, smooth = _errors(rounded, orders=ORDERS[-1:])
    gyro_step = GYRO.step / GYRO.unit
    return found | numbers(rounded=fos / smooth, steps=[step**2 / 12.0, gyro_step**2 / 12.0])


def _filtered(white: FloatArray, order: int, cut: float) -> FloatArray:
    b, a = butter(order, 2.0 * cut / RATE)
    return np.asarray(lfilter(b, a, white))[SETTLED:]


def _errors(raw: FloatArray, orders: FloatArray = ORDERS) -> tuple[FloatArray, ...]:
    """Held-out error of FOS and covariance on raw data, of covariance on de-noised data."""
    quiet = denoise(raw, wavelet="db4", level=4, details="zero").signal
    found = []
    for signal, search in ((raw, True), (raw, False), (quiet, False)):
        mean = signal[:TRAINING].mean()
        train, unseen = signal[:TRAINING] - mean, signal[2 * TRAINING :] - mean
        if search:
            errors = [_searched(train, unseen, int(order)) for order in orders]
        else:
            errors = [_fitted(train, unseen, int(order)) for order in orders]
        found.append(np.array(errors))
    return tuple(found)


def _searched(train: FloatArray, unseen: FloatArray, order: int) -> float:
    fit = fast_orthogonal_search(train, order, 1, order, stopping=None, held_out=unseen)
    return float(fit.mean_square_error)


def _fitted(train: FloatArray, unseen: FloatArray, order: int) -> float:
    fits = fit_ar_orders(train, order, "covariance", remove_mean=False)
    residuals = lfilter([1.0, *fits.polynomial(order)], [1.0], unseen)[order:]
    return float(residuals @ residuals / residuals.size)


def judge(results: Results, size: Size) -> Found:
    """How the claim hangs on the filter."""
    fos = {s: stacked(results, f"{s}_fos") for s in ("accelerometer", "gyro")}
    smooth = {s: stacked(results, f"{s}_smooth") for s in fos}
    raw = stacked(results, "accelerometer_covariance")
    steps = results[0]["steps"]
    values: dict[str, Value] = {
        "fall": np.stack([f[:, -1, -1] / f[:, -1, 0] for f in fos.values()], axis=1),
        "advantage": np.stack([fos[s][:, -1, -1] / smooth[s][:, -1, -1] for s in fos], axis=1),
        "ratio by filter": fos["accelerometer"][:, :, -1] / smooth["accelerometer"][:, :, -1],
        "fair by filter": fos["accelerometer"][:, :, -1] / raw[:, :, -1],
        "rounded": stacked(results, "rounded")[:, 0],
        "rounding alone accel": float(steps[0]),
        "rounding alone gyro": float(steps[1]),
    }
    drawn = fos["accelerometer"].mean(axis=0)
    curves = [
        Curve(f"FOS, raw, order {order} at {cut:g} Hz", ORDERS, errors, role)
        for (order, cut), errors, role in zip(FILTERS, drawn, _ROLES, strict=True)
    ]
    quiet = smooth["accelerometer"][:, -1].mean(axis=0)
    curves.append(Curve("covariance, de-noised", ORDERS, quiet, "theory", "dash"))
    panel = Panel(
        "Accelerometer with a low-pass inside",
        "order",
        "one-step error, (m/s²)²",
        tuple(curves),
        "The sharper the filter, the further the error on raw data falls with the order.",
        log_y=True,
    )
    return Found(values, panels=(panel,))
