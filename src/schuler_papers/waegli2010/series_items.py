"""What comes out of the series of one gyro, beside Tables 1 and 2 and figure 12."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import norm

from schuler_papers.experiment import FloatArray, Results, Size, stacked
from schuler_papers.judging import Found, Value, plain
from schuler_papers.outcome import Curve, Estimate, Panel, Proof, Role
from schuler_papers.waegli2010.arithmetic import run as printed_numbers
from schuler_papers.waegli2010.series import PRINTED_ERRORS, RATE, SAMPLES, TABLE_2, TRUTH

NAMES = ("α₁", "α₂", "β₁", "β₂")


def table_1(results: Results, size: Size) -> Found:
    """Recover Table 1 from data drawn from it."""
    values, errors = stacked(results, "values"), stacked(results, "errors")
    lengths = SAMPLES * (errors.mean(axis=0) / PRINTED_ERRORS) ** 2
    length = float(np.median(lengths))
    constant = [stacked(results, name)[:, None] for name in ("constant", "constant_error")]
    whole = np.concatenate([values, constant[0]], axis=1)
    own = np.concatenate([errors, constant[1]], axis=1) * math.sqrt(SAMPLES / length)
    found: dict[str, FloatArray | float] = {
        "table": _student(whole, own, whole / own),
        "length": length / RATE,
        "constant": (stacked(results, "constant_p") > 0.05).astype(float),
        "smallest t": float(np.abs(stacked(results, "t_values")).min()),
        "ljung": (stacked(results, "ljung_box_p") > 0.01).astype(float),
    }
    return Found(found, panels=(_coefficients(values, errors),))


def _student(values: FloatArray, errors: FloatArray, t: FloatArray) -> FloatArray:
    """Columns of both tables, (seeds, parameters, 4): the last is the two-sided p of t."""
    return np.stack([values, errors, t, 2.0 * norm.sf(np.abs(t))], axis=2)


def _coefficients(values: FloatArray, errors: FloatArray) -> Panel:
    places, mean = np.arange(4.0), values.mean(axis=0)
    claimed, printed = 1.96 * errors.mean(axis=0), 2.0 * PRINTED_ERRORS
    drawn: tuple[tuple[str, float, FloatArray, Role, FloatArray], ...] = (
        ("printed", -0.08, TRUTH, "printed", printed),
        ("ours, ten minutes", 0.08, mean, "ours", claimed),
    )
    curves = tuple(
        Curve(name, places + shift, middle, role, "points", middle - slack, middle + slack)
        for name, shift, middle, role, slack in drawn
    )
    return Panel(
        "Coefficients: printed ± 2 standard deviations, and ours",
        "",
        "coefficient",
        curves,
        "The four coefficients with their errors.",
        categories=NAMES,
    )


def asymptotics(results: Results, size: Size) -> Found:
    """Coverage of the intervals, and the length of the parameter vector."""
    inside = stacked(results, "inside")
    entries = float(stacked(results, "entries")[0])
    count = Proof(
        "an ARMA(2,2) with constant and innovation variance has six parameters: the covariance "
        "of the fit has as many rows",
        entries, 6.0, 6.0,
    )  # fmt: skip
    scatter = math.sqrt(0.05 * 0.95 / inside.shape[0])
    values: dict[str, Value] = {
        "coverage": Estimate(float(inside.mean()), scatter),
        "entries": entries,
    }
    return Found(values, proofs={"count": count})


def order(results: Results, size: Size) -> Found:
    """The order that AIC picks."""
    chosen = {name: stacked(results, name) for name in ("aic", "bic")}
    values = {
        name: (np.abs(c - 2.0).max(axis=1) <= 1.0).astype(float) for name, c in chosen.items()
    }
    return Found(values | {"exact": (chosen["bic"] == 2.0).all(axis=1).astype(float)})


def table_2(results: Results, size: Size) -> Found:
    """Recover Table 2 from data drawn from it."""
    values, errors = stacked(results, "values"), stacked(results, "errors")
    short, t = stacked(results, "short_errors"), stacked(results, "short_t")
    found = {
        **plain(results, size).values,
        "table": _student(values, short, t),
        "alpha0": (stacked(results, "short_alpha0_p") > 0.05).astype(float),
        "lm before": float(stacked(results, "lm_before").max()),
        "lm after": (stacked(results, "lm_after") > 0.01).astype(float),
        "entries": float(stacked(results, "entries")[0]),
    }
    growth = float(printed_numbers(0, size)["growth"])
    proof = Proof("E ln(β + α Z²) < 0: without α₀ the variance tends to zero", growth, -1.0, 0.0)
    ours = np.abs(values[:, 1:].mean(axis=0) - np.array(TABLE_2[1:])) / errors[:, 1:].mean(axis=0)
    note = (
        "Data drawn from the table with its β₁ taken from the text, 0.982: with 0.98 the sensor "
        f"would have 0.007 rad/s instead of 0.016. Our fits are {ours[0]:.1f} and {ours[1]:.1f} "
        "of their own standard errors from the truth."
    )
    return Found(found, proofs={"dies out": proof}, notes=(note,))


def volatility(results: Results, size: Size) -> Found:
    """GARCH volatility against the true one."""
    loss = stacked(results, "loss")
    values = {
        "log_correlation": stacked(results, "log_correlation"),
        "constant less garch": loss[:, 1] - loss[:, 0],
        "ewma less garch": loss[:, 2] - loss[:, 0],
    }
    first = results[0]
    time = np.arange(first["volatility"].size) * 100.0 / RATE
    panel = Panel(
        "Volatility of one gyro",
        "s",
        "rad/s",
        (
            Curve("true", time, first["true_volatility"], "theory"),
            Curve("GARCH, from the past alone", time, first["volatility"], "ours", "dash"),
        ),
        "Conditional standard deviation over time, true and by GARCH.",
    )
    return Found(values, panels=(panel,))
