"""What a model leaves: whiteness, bands, tests; figures 9 to 11, and a real gyro."""

from __future__ import annotations

import numpy as np

from schuler_papers.experiment import Results, Size, estimate, stacked
from schuler_papers.outcome import Band, Curve, Outcome, Panel, Row
from schuler_papers.waegli2010.series import RATE

_ERRATUM_12 = (
    "the standard errors of the table assume a constant variance, which Table 2 of the same "
    "paper denies"
)


def whiteness(results: Results, size: Size) -> Outcome:
    """The residual of the ARMA model is white; the signal is not."""
    inside, plain = stacked(results, "inside"), stacked(results, "inside_plain")
    raw = stacked(results, "raw_correlation")
    slopes = stacked(results, "slopes")
    rows = (
        Row(
            "autocorrelation of the signal at lag 10",
            estimate(raw[:, 9]),
            printed="correlated",
            band=Band(0.3, 1.0, "spec"),
        ),
        Row(
            "share of 100 lags of the residual inside the robust band",
            estimate(inside),
            printed="'distributed randomly'",
            band=Band(0.92, 1.0, "spec"),
        ),
        Row(
            "share inside the plain band ±2/√n",
            estimate(plain),
            printed=0.95,
            band=Band(0.75, 0.93, "spec", "87 % under Table 2", standard_errors=2.0),
            verdict="wrong in the paper",
            reason="under GARCH the plain band is too narrow: 1.3 to 1.6 times",
            erratum="E-000-12",
        ),
        Row(
            "robust over plain band at lag 1",
            estimate(stacked(results, "band")[:, 0] / stacked(results, "plain_band")),
            printed=1.0,
            band=Band(1.2, 1.8, "spec", "1.3 to 1.63"),
            verdict="wrong in the paper",
            reason="as above",
            erratum="E-000-12",
        ),
        Row(
            "slope of the residual's Allan deviation, 0.1 to 30 s",
            estimate(slopes[:, 1]),
            printed=-0.5,
            band=Band(-0.55, -0.45, "spec"),
        ),
        Row(
            "slope of the signal's Allan deviation",
            estimate(slopes[:, 0]),
            band=Band(-0.42, 0.2, "theory", "not white", standard_errors=2.0),
        ),
        Row(
            "robust over plain standard deviation of α₁ of the ARMA part",
            estimate(stacked(results, "arma_robust")[:, 0] / stacked(results, "arma_plain")[:, 0]),
            printed=1.0,
            band=Band(1.1, 6.0, "theory", "GARCH widens it, by its kurtosis of that record"),
            verdict="wrong in the paper",
            reason=_ERRATUM_12,
            erratum="E-000-12",
        ),
    )
    return Outcome(rows, _whiteness_panels(results))


def _whiteness_panels(results: Results) -> tuple[Panel, ...]:
    first = results[0]
    lag = (np.arange(first["correlation"].size) + 1.0) / RATE
    zero = np.zeros(lag.size)
    band, plain = first["band"], float(first["plain_band"])
    tau = first["tau"]
    white = first["allan"][0] * np.sqrt(tau[0] / tau)
    return (
        Panel(
            "Signal",
            "lag, s",
            "autocorrelation",
            (Curve("signal", lag, first["raw_correlation"], "data"),),
            "Autocorrelation of the signal by lag.",
        ),
        Panel(
            "ARMA residual",
            "lag, s",
            "autocorrelation",
            (
                Curve("robust band", lag, zero, "ours", "band", -band, band),
                Curve("plain band", lag, zero + plain, "paper", "dash"),
                Curve("plain band, lower", lag, zero - plain, "paper", "dash"),
                Curve("residual", lag, first["correlation"], "data", "points"),
            ),
            "Autocorrelation of the residual with plain and robust band.",
        ),
        Panel(
            "Allan deviation",
            "cluster time, s",
            "rad/s",
            (
                Curve("signal", tau, first["raw_allan"], "data"),
                Curve("residual", tau, first["allan"], "ours"),
                Curve("slope −1/2", tau, white, "theory", "dash"),
            ),
            "Allan deviation of signal and residual.",
            log_x=True,
            log_y=True,
        ),
    )


def tests(results: Results, size: Size) -> Outcome:
    """What the tests can and cannot say."""
    moments = stacked(results, "moments")
    rows = (
        Row(
            "ARCH-LM on independent noise: share rejected at 5 %",
            estimate(stacked(results, "level")),
            printed=0.05,
            band=Band(0.03, 0.07, "spec", standard_errors=2.5),
        ),
        Row(
            "ARCH-LM on GARCH(0.05, 0.90), 20 000 samples: share rejected",
            estimate(stacked(results, "power")),
            band=Band(0.95, 1.0, "spec"),
        ),
        Row(
            "bilinear noise e_t + 0.6 e_{t-1} e_{t-2}: share that passes Ljung-Box",
            estimate(stacked(results, "white")),
            printed="white = unpredictable",
            band=Band(0.8, 1.0, "theory", "uncorrelated", standard_errors=2.0),
            verdict="wrong in the paper",
            reason="(5), (6) ask for a martingale difference, which no correlation can show",
            erratum="E-000-12",
        ),
        Row(
            "share of its variance that products of its past foresee",
            estimate(stacked(results, "gain")),
            printed=0.0,
            band=Band(0.05, 0.4, "theory", "predictable"),
            verdict="wrong in the paper",
            reason="white, and yet predictable",
            erratum="E-000-12",
        ),
        Row(
            "variance of Z under an order that is too low, ARCH(1)",
            estimate(moments[:, 1]),
            printed=1.0,
            band=Band(0.98, 1.02, "theory", "any fitted constant does that"),
            verdict="wrong in the paper",
            reason="E[Z] = 0 and Var[Z] = 1 select nothing; ARCH-LM does",
            erratum="E-000-8",
        ),
        Row(
            "share of these wrong models that ARCH-LM rejects",
            estimate(stacked(results, "low_order_rejected")),
            band=Band(0.8, 1.0, "theory"),
            verdict="beyond the paper",
        ),
    )
    return Outcome(rows)


def recording(results: Results, size: Size) -> Outcome:
    """ARMA and GARCH of a real gyro at rest."""
    rejected = stacked(results, "lm_before") < 0.001
    rows = (
        Row(
            "autocorrelation of the raw signal at lag 1",
            estimate(stacked(results, "raw_correlation")[:, 0]),
            printed="correlated",
            band=Band(0.05, 0.5, "theory", "the sensor's own filter"),
            verdict="reproduced in kind",
        ),
        Row(
            "share of 100 lags of the ARMA residual inside the robust band",
            estimate(stacked(results, "inside")),
            band=Band(0.90, 1.0, "spec"),
            verdict="reproduced in kind",
        ),
        Row(
            "slope of the residual's Allan deviation, 0.1 to 30 s",
            estimate(stacked(results, "slopes")[:, 1]),
            printed=-0.5,
            band=Band(-0.55, -0.45, "spec"),
            verdict="reproduced in kind",
        ),
        Row(
            "share of six records with changing variance (ARCH-LM, p < 0.001)",
            estimate(rejected),
            printed="all, in a moving vehicle",
            verdict="cannot be expected",
            reason="at rest the variance of this gyro hardly changes; the paper's was on the road",
        ),
    )
    first = results[0]
    time = np.arange(first["volatility"].size) * 100.0 / RATE
    volatility = Panel(
        "GARCH volatility at rest",
        "s",
        "rad/s",
        (Curve("GARCH", time, first["volatility"], "ours"),),
        "Conditional standard deviation of a gyro at rest.",
    )
    return Outcome(rows, (*_whiteness_panels(results), volatility))
