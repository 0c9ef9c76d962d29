"""Averaged volatilities and GARCH: figures 7, 8 and 14, equations (2) to (4), Table 3."""

from __future__ import annotations

import math

import numpy as np

from schuler_papers.experiment import Results, Size, estimate, stacked
from schuler_papers.outcome import Band, Curve, Estimate, Outcome, Panel, Role, Row
from schuler_papers.waegli2010.fusion import HALF_WINDOWS, WINDOWS

_AXES: tuple[Role, ...] = ("x", "y", "z")


def figure_7(results: Results, size: Size) -> Outcome:
    """Averaged volatility for several windows."""
    scatter = stacked(results, "scatter")
    lags = stacked(results, "lags")
    expectation = stacked(results, "expectation")
    rows = [
        Row(
            f"scatter of the variance for T = {half}, over its law",
            estimate(scatter[:, k] / math.sqrt(2.0 / (3.0 * (2 * half + 1) * 3.0))),
            "'smoothed out'",
            band=Band(0.9, 1.1, "spec", "sqrt(2/(3(2T+1)(n-1)))", standard_errors=2.0),
        )
        for k, half in enumerate(HALF_WINDOWS)
    ]
    rows += [
        Row(
            f"time to see half of a step for T = {half}",
            estimate(lags[:, k]),
            unit="s",
            band=Band(0.3 * half / 100.0, 2.0 * half / 100.0 + 0.1, "theory", "grows with T"),
            verdict="reproduced in kind",
        )
        for k, half in enumerate(HALF_WINDOWS)
    ]
    rows += [
        Row(
            f"mean of (2) over the true variance, T = {half}",
            estimate(expectation[:, k, 0]),
            1.0,
            band=Band(
                0.98 * (1.0 + 0.5 / half) * 0.75,
                1.02 * (1.0 + 0.5 / half) * 0.75,
                "spec",
                "(1 + 1/(2T))(n-1)/n ± 2 %",
            ),
            verdict="wrong in the paper",
            reason="the divisor 6Tn does not count degrees of freedom; 3(2T+1)(n-1) does",
            erratum="E-000-1",
        )
        for k, half in enumerate(WINDOWS)
    ]
    rows += [
        Row(
            "the same with 3(2T+1)(n-1), T = 50",
            estimate(expectation[:, 2, 1]),
            band=Band(0.98, 1.02, "spec"),
            verdict="beyond the paper",
        ),
        Row(
            "largest value of the double mean (3)",
            float(stacked(results, "double_mean").max()),
            "a mean to be removed",
            band=Band(0.0, 1e-14, "spec"),
            verdict="wrong in the paper",
            reason="residuals against their mean sum to zero at every instant",
            erratum="E-000-2",
        ),
    ]
    first = results[0]
    curves = [
        Curve(f"T = {half}", first["step_time"], first["step"][k], role)
        for k, (half, role) in enumerate(zip(HALF_WINDOWS, _AXES, strict=True))
    ]
    curves.append(Curve("truth", first["step_time"], first["step_level"], "theory", "dash"))
    panel = Panel(
        "A step of the noise level, causal windows",
        "s after the step",
        "standard deviation",
        tuple(curves),
        "Averaged volatility after a step for three windows.",
    )
    return Outcome(tuple(rows), (panel,))


def figure_8(results: Results, size: Size) -> Outcome:
    """Residuals against errors."""
    rows = (
        Row("deviation from residuals over that from errors, divisor 6Tn",
            estimate(stacked(results, "deviation_ratio")), "underestimated",
            band=Band(0.856, 0.876, "spec", "sqrt((n-1)/n) = 0.866")),
        Row("the same with the right divisors", estimate(stacked(results, "unbiased_ratio")),
            "'only by a coincidence'", band=Band(0.99, 1.01, "spec"), verdict="beyond the paper",
            reason="no coincidence and no underestimation: the missing degrees of freedom"),
        Row("identity of (4): largest relative difference of both sides, 1000 cases",
            float(stacked(results, "identity").max()), "≥",
            band=Band(0.0, 1e-12, "spec"), erratum="E-000-3",
            reason="the difference is n (mean - reference)², no property of the method"),
        Row("smallest excess of the errors over the residuals",
            float(stacked(results, "smallest_excess").min()), "> 0",
            band=Band(0.0, math.inf, "spec", "strict unless the reference is the mean")),
    )  # fmt: skip
    first = results[0]
    time = np.arange(first["by_paper"].size) * 0.2
    panel = Panel(
        "Noise level of four gyros, T = 50",
        "s",
        "standard deviation, true one = 1",
        (
            Curve("from residuals, as in the paper", time, first["by_paper"], "paper"),
            Curve("from errors", time, first["by_errors"], "data"),
            Curve(
                "residuals, right divisor",
                time,
                first["by_paper"] * math.sqrt(100.0 / 101.0 * 4.0 / 3.0),
                "ours",
            ),
            Curve("truth", time, np.ones(time.size), "theory", "dash"),
        ),
        "Noise level over time from residuals and from errors.",
    )
    return Outcome(rows, (panel,))


METHODS = ("GARCH", "averaged volatility", "exponential weights")


def table_3(results: Results, size: Size) -> Outcome:
    """The comparison of the two methods, measured."""
    seconds = stacked(results, "seconds")
    ratio = stacked(results, "mean_ratio")
    correlation = stacked(results, "correlation")
    outlier, fused = stacked(results, "outlier"), stacked(results, "fused_outlier")
    rows = (
        *(
            Row(f"{name}: mean variance over the true one of the sensor that varies",
                estimate(ratio[:, k]), ("+", "−", None)[k], verdict="reproduced in kind",
                band=(Band(0.7, 1.3, "theory", "per sensor", standard_errors=2.0), None, None)[k])
            for k, name in enumerate(METHODS)
        ),
        *(
            Row(f"{name}: correlation of the log variance with the truth",
                estimate(correlation[:, k]), ("finer", "coarser", None)[k],
                verdict="reproduced in kind")
            for k, name in enumerate(METHODS)
        ),
        Row("CPU time, GARCH of all axes over averaged volatility",
            Estimate(float(np.median(seconds[:, 0] / seconds[:, 1]))), "higher effort",
            band=Band(2.0, math.inf, "theory"), verdict="reproduced"),
        Row("averaged volatility with 1 % of outliers of 10 σ on one axis, over that without",
            estimate(outlier[:, 0]), "non-robust", band=Band(1.01, 3.0, "theory"),
            verdict="reproduced"),
        Row("GARCH variance of that axis with outliers, over that without",
            estimate(outlier[:, 1]), "non-robust", band=Band(1.1, 5.0, "theory"),
            verdict="reproduced"),
        Row("synthetic rate with outliers over without, equal weights", estimate(fused[:, 0]),
            verdict="beyond the paper"),
        Row("the same with exponential weights of clipped squares", estimate(fused[:, 1]),
            verdict="beyond the paper",
            reason="an outlier still enters with its weight: `schuler faults` takes it out"),
    )  # fmt: skip
    return Outcome(rows)


def figure_14(results: Results, size: Size) -> Outcome:
    """GARCH against averaged volatility when one sensor varies."""
    correlation, loss = stacked(results, "correlation"), stacked(results, "loss")
    rows = (
        Row("correlation of the log variance with the true one, GARCH",
            estimate(correlation[:, 0]), "finer resolution",
            band=Band(0.9, 1.0, "spec"), verdict="reproduced"),
        Row("the same, averaged volatility", estimate(correlation[:, 1]), "overestimated",
            band=Band(0.0, 0.9, "theory", "it pools four sensors"), verdict="reproduced"),
        Row("QLIKE loss: averaged volatility less GARCH", estimate(loss[:, 1] - loss[:, 0]),
            band=Band(0.0, math.inf, "spec", "GARCH lower"), verdict="reproduced"),
        Row("QLIKE loss: exponential weights less GARCH", estimate(loss[:, 2] - loss[:, 0]),
            band=Band(0.0, math.inf, "theory"), verdict="beyond the paper",
            reason="they are fed with raw residuals here; unmixed ones follow as well"),
    )  # fmt: skip
    first = results[0]
    panel = Panel(
        "Noise of the gyro that varies",
        "s",
        "rad/s",
        (
            Curve("true", first["time"], first["true"], "theory"),
            Curve("GARCH, unmixed", first["time"], first["garch"], "ours"),
            Curve("averaged volatility", first["time"], first["averaged"], "paper"),
        ),
        "Standard deviation over time by two methods, and the true one.",
    )
    return Outcome(rows, (panel,))
