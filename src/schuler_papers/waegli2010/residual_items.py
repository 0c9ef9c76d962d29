"""What a model leaves: whiteness, bands, tests; figures 9 to 11, and a real gyro."""

from __future__ import annotations

import numpy as np

from schuler_papers.experiment import Results, Size, stacked
from schuler_papers.judging import Found, plain
from schuler_papers.outcome import Curve, Panel, Proof, Role
from schuler_papers.waegli2010.series import RATE, SHOWN

DATA: Role = "data"
OURS: Role = "ours"


def whiteness(results: Results, size: Size) -> Found:
    """The residual of the ARMA model is white; the signal is not."""
    ratio = stacked(results, "band")[:, 0] / stacked(results, "plain_band")
    values = {
        **plain(results, size).values,
        "raw lag 10": stacked(results, "raw_correlation")[:, 9],
        "band ratio": ratio,
        "error ratio": stacked(results, "arma_robust")[:, 0] / stacked(results, "arma_plain")[:, 0],
    }
    return Found(values, panels=_whiteness_panels(results))


def _whiteness_panels(results: Results) -> tuple[Panel, ...]:
    first = results[0]
    lag = (np.arange(first["correlation"].size) + 1.0) / RATE
    zero = np.zeros(lag.size)
    band, plain = first["band"], float(first["plain_band"])
    tau = first["tau"]
    white = first["allan"][0] * np.sqrt(tau[0] / tau)
    time = np.arange(first["series"].shape[1]) * (SHOWN.step / RATE)
    series = (
        Panel(
            title,
            "s",
            "rad/s",
            (Curve("series", time, values, role),),
            words,
        )
        for title, values, role, words in (
            ("Signal of the gyro", first["series"][0], DATA, "It wanders: neighbours are alike."),
            ("ARMA residual of the gyro", first["series"][1], OURS, "Nothing slow is left."),
        )
    )
    return (
        *series,
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


def tests(results: Results, size: Size) -> Found:
    """What the tests can and cannot say."""
    gain = float(stacked(results, "gain").mean())
    proofs = {
        "foreseen": Proof(
            "bilinear noise is white, and products of its past foresee a share of it",
            gain, 0.05, 0.4, "counter-experiment",
        ),
    }  # fmt: skip
    return Found(plain(results, size).values, proofs=proofs)


def recording(results: Results, size: Size) -> Found:
    """ARMA and GARCH of a real gyro at rest."""
    values = {
        **plain(results, size).values,
        "raw lag 1": stacked(results, "raw_correlation")[:, 0],
        "rejected": (stacked(results, "lm_before") < 0.001).astype(float),
    }
    first = results[0]
    time = np.arange(first["volatility"].size) * 100.0 / RATE
    volatility = Panel(
        "GARCH volatility at rest",
        "s",
        "rad/s",
        (Curve("GARCH", time, first["volatility"], "ours"),),
        "Conditional standard deviation of a gyro at rest.",
    )
    return Found(values, panels=(*_whiteness_panels(results), volatility))
