"""Where an autoregressive fit misleads: said in plain words, from the data at hand."""

from __future__ import annotations

import numpy as np

from schuler.estimation.autoregressive.estimators import Orders, covariance
from schuler.estimation.autoregressive.result import Caution, poles_of
from schuler.estimation.signals import Series
from schuler.types import FloatArray

_UNIT_ROOT = 14.1
"""N (1 - pole) that a random walk stays below in 95 % of records (Dickey-Fuller with mean)."""
_END_SHARE = 0.1
_OUTLIER_SHARE = 0.1
_COARSE_SHARE = 0.01
_VARIANCE_RATIO = 4.0


def find_cautions(
    series: Series,
    orders: Orders,
    reflection: FloatArray,
    requested: int,
    method: str,
    mean_square: float,
) -> tuple[Caution, ...]:
    """Look for everything that would mislead the user of a fit."""
    order = reflection.size
    a = orders.coefficients[order - 1, :order] if order else np.zeros(0)
    found = []
    if order < requested:
        found.append(
            Caution(
                "order reduced",
                f"order {requested} was asked for, but {order} past samples already predict the "
                "next one to rounding: higher orders are not determined",
            )
        )
    if mean_square <= _rounding_floor(series) / _COARSE_SHARE:
        found.append(
            Caution(
                "rounding",
                "the one-step error is as small as the rounding of the samples; its size says "
                "nothing about the sensor",
            )
        )
    found += _about_poles(a, reflection, series.values.size, method)
    if method == "yule-walker" and order:
        found += _about_yule_walker(series, float(orders.error[order]), a, mean_square)
    found += _about_residuals(series, a)
    return tuple(found)


def _rounding_floor(series: Series) -> float:
    return series.rounding + float(np.finfo(np.float64).eps) ** 2


def _about_poles(a: FloatArray, reflection: FloatArray, samples: int, method: str) -> list[Caution]:
    if a.size == 0:
        return []
    modulus = float(np.abs(poles_of(a)[0]))
    if modulus >= 1.0 or (np.abs(reflection) >= 1.0).any():
        cure = (
            "the poles lie so close together that rounding moves them out: use a lower order"
            if method in ("burg", "yule-walker")
            else "'burg' and 'yule-walker' are always stable"
        )
        text = (
            f"the largest pole has modulus {modulus:.6f}: the model is unstable and predicts only "
            f"one step; {cure}"
        )
        return [Caution("unstable", text)]
    if samples * (1.0 - modulus) < _UNIT_ROOT:
        text = (
            f"the largest pole has modulus {modulus:.8f}: in {samples} samples that cannot be "
            "told from a random walk, a trend or an undamped oscillation"
        )
        return [Caution("near unit root", text)]
    return []


def _about_yule_walker(
    series: Series, own: float, a: FloatArray, mean_square: float
) -> list[Caution]:
    found, y = [], series.values
    floor = float(y[0] ** 2 + y[-1] ** 2) / y.size
    if floor > _END_SHARE * own:
        cause = "an offset left in the signal" if series.offset != series.mean else "its slow part"
        found.append(
            Caution(
                "yule-walker end effect",
                f"Yule-Walker sees the record begin and end with a jump from zero ({cause}): "
                f"(y1² + yN²)/N = {floor * series.scale**2:.3g} is {100.0 * floor / own:.0f} % of "
                "its innovation variance, and no order removes that; the error on the samples "
                f"themselves is {mean_square * series.scale**2:.3g}; use 'burg' or 'covariance'",
            )
        )
    least = covariance(y, a.size, 0.0)
    if least.error.size == a.size + 1 and least.error[-1] > 0.0:
        excess = mean_square / float(least.error[-1]) - 1.0
        if excess * y.size > max(a.size, 4):
            found.append(
                Caution(
                    "yule-walker bias",
                    "the triangular window of the biased autocorrelation blurs a peaked spectrum: "
                    f"the one-step error is {100.0 * excess:.3g} % above that of least squares, "
                    "and the coefficients are off by more than their standard errors; "
                    "use 'burg' or 'covariance'",
                )
            )
    return found


def _about_residuals(series: Series, a: FloatArray) -> list[Caution]:
    from schuler.kernels.noise.autoregressive import one_step_residuals

    y = series.values
    residuals = np.empty(y.size - a.size)
    one_step_residuals(y, a, a.size, residuals)
    np.square(residuals, out=residuals)
    total = float(residuals.sum())
    found = []
    row = int(residuals.argmax())
    # of n Gaussian samples the largest has a share of about 2 ln(n)/n
    if residuals.size >= 200 and residuals[row] > _OUTLIER_SHARE * total:
        found.append(
            Caution(
                "outlier",
                f"one sample (row {row + a.size}) makes {100.0 * residuals[row] / total:.0f} % of "
                "the squared one-step errors: remove or repair it and fit again",
            )
        )
    elif residuals.size >= 1000 and total > 0.0:
        parts = np.array([part.mean() for part in np.array_split(residuals, 10)])
        ratio = float(parts.max() / max(parts.min(), 1e-300))
        if ratio > _VARIANCE_RATIO:
            found.append(
                Caution(
                    "variance changes",
                    "the one-step error variance changes by a factor of "
                    f"{min(ratio, 1e6):.3g} between tenths of the record: one model does not "
                    "serve all of it",
                )
            )
    return found
