"""What comes out of four IMUs: figures 5, 6 and 13, Table 4."""

from __future__ import annotations

import numpy as np

from schuler_papers.experiment import Results, Size, stacked
from schuler_papers.judging import Found, plain
from schuler_papers.outcome import Curve, Panel, Role
from schuler_papers.waegli2010.arithmetic import SIGMAS, TABLE_4
from schuler_papers.waegli2010.fusion import BIAS, FACTORS, RATE

_METHODS: tuple[Role, ...] = ("paper", "z", "ours", "theory")
SENSORS = ("MTi 1", "MTi 2", "MTi 3", "MTi 14")


def figure_5(results: Results, size: Size) -> Found:
    """Noise of one gyro and of the mean of four."""
    equal, mean = stacked(results, "equal"), stacked(results, "singles").mean(axis=1)
    correlation = stacked(results, "residual_correlation")
    values = {
        "equal": equal,
        "mean single": mean,
        "reduction": 1.0 - equal / mean,
        "same": 1.0 - stacked(results, "same_equal") / stacked(results, "same_single"),
        "optimum": stacked(results, "oracle_variance") * np.sum(SIGMAS**-2.0),
        "residual_correlation": correlation,
    }
    return Found(values, panels=(_traces(results),))


def _traces(results: Results) -> Panel:
    shown = results[0]["shown"]
    stamps = np.arange(shown.shape[1]) / RATE
    return Panel(
        "Three seconds of one gyro and of synthetic ones",
        "s",
        "error on y, rad/s",
        (
            Curve("MTi 1", stamps, shown[0], "data"),
            Curve("synthetic", stamps, shown[1], "ours"),
            Curve("weighted", stamps, shown[2], "better"),
        ),
        "Errors over three seconds.",
    )


def _boxes(results: Results, first: int = 0) -> Panel:
    """Boxes of the errors, from the gyros on or of the synthetic IMUs alone."""
    quantiles = stacked(results, "quantiles").mean(axis=0)[first:]
    places = np.arange(float(quantiles.shape[0]))
    names = (*SENSORS, "synthetic", "weighted")[first:]
    middle = quantiles[:, 2]
    return Panel(
        "Errors on x, the biased axis",
        "",
        "rad/s",
        (
            Curve("1 to 99 %", places, middle, "data", "points", quantiles[:, 0], quantiles[:, 4]),
            Curve(
                "quartiles",
                places + 0.08,
                middle,
                "ours",
                "points",
                quantiles[:, 1],
                quantiles[:, 3],
            ),
            Curve("no error", places, np.zeros(places.size), "theory", "dash"),
        ),
        "Quantiles of the errors.",
        categories=names,
    )


def figure_6(results: Results, size: Size) -> Found:
    """A biased, noisy sensor in the mean of all."""
    singles = stacked(results, "singles")
    values = {
        "bias": stacked(results, "equal_bias"),
        "noise ratio": singles[:, 3] / singles[:, :3].mean(axis=1),
        "hat": stacked(results, "hat") / singles,
        "norm_of_mean": stacked(results, "norm_of_mean"),
    }
    own = np.array([0.95 * BIAS / 4.0, 1.05 * BIAS / 4.0])
    return Found(values, {"bias": own}, panels=(_boxes(results),))


def figure_13(results: Results, size: Size) -> Found:
    """Weights from variances."""
    equal, ewma = stacked(results, "equal"), stacked(results, "ewma")
    mean = stacked(results, "singles").mean(axis=1)
    values = {
        **plain(results, size).values,
        "ewma over equal": ewma / equal,
        "overall": 1.0 - stacked(results, "garch") / mean,
        "square ratio": stacked(results, "weighted_square") / stacked(results, "equal_square"),
        "ewma over oracle": ewma / stacked(results, "oracle"),
    }
    return Found(values, panels=(_boxes(results, 4), _traces(results)))


def weights(results: Results, size: Size) -> Found:
    """Weights from residuals, and from unmixed variances."""
    oracle = stacked(results, "oracle")
    over_best = {name: stacked(results, name) / oracle for name in ("naive", "hat", "equal")}
    values = {**plain(results, size).values, **over_best}
    return Found(values)


def table_4(results: Results, size: Size) -> Found:
    """One axis gets noisier."""
    names = {"equal": "equal weights", "garch": "GARCH weights", "ewma": "exponential weights",
             "oracle": "best weights"}  # fmt: skip
    found = {name: stacked(results, name) for name in names}
    values = {
        "table": np.stack([found["equal"], found["garch"]], axis=1),
        "equal growth": found["equal"][:, 2] / found["equal"][:, 0],
        "ewma growth": found["ewma"][:, 2] / found["ewma"][:, 0],
        "ewma over oracle": found["ewma"][:, 2] / found["oracle"][:, 2],
        "others": np.stack([found["ewma"], found["oracle"]], axis=1),
    }
    places = np.array(FACTORS)
    curves = [
        Curve(words, places, found[name].mean(axis=0), role)
        for (name, words), role in zip(names.items(), _METHODS, strict=True)
    ]
    curves += [
        Curve(f"printed: {name}", places, TABLE_4[name], "printed", "points") for name in TABLE_4
    ]
    panel = Panel(
        "Noise of the synthetic rate when one sensor gets noisier",
        "a",
        "rad/s",
        tuple(curves),
        "Noise of synthetic IMUs by the size of the disturbance.",
    )
    return Found(values, panels=(panel,))
