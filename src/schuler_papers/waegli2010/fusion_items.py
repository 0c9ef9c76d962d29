"""What comes out of four IMUs, beside figures 5 to 8, 13, 14 and Tables 3 and 4."""

from __future__ import annotations

import numpy as np

from schuler_papers.experiment import Results, Size, estimate, stacked
from schuler_papers.outcome import Band, Curve, Outcome, Panel, Role, Row
from schuler_papers.waegli2010.arithmetic import TABLE_4
from schuler_papers.waegli2010.fusion import BIAS, FACTORS, RATE

_METHODS: tuple[Role, ...] = ("paper", "z", "ours", "theory")
SENSORS = ("MTi 1", "MTi 2", "MTi 3", "MTi 14")


def figure_5(results: Results, size: Size) -> Outcome:
    """Noise of one gyro and of the mean of four."""
    equal, singles = stacked(results, "equal"), stacked(results, "singles")
    same = 1.0 - stacked(results, "same_equal") / stacked(results, "same_single")
    oracle = stacked(results, "oracle_variance")
    best = 1.0 / np.sum(np.array([0.0207, 0.0146, 0.0146, 0.0290]) ** -2.0)
    rows = (
        Row("noise of the synthetic IMU, equal weights", estimate(equal), 0.0103, unit="rad/s",
            band=Band(0.0103 * 0.99, 0.0103 * 1.01, "spec", "1 %")),
        Row("mean noise of the four gyros", estimate(singles.mean(axis=1)), 0.0201, unit="rad/s",
            band=Band(0.0195, 0.0203, "theory", "0.0197 by design"), verdict="reproduced"),
        Row("reduction, four unequal gyros", estimate(1.0 - equal / singles.mean(axis=1)), 0.486,
            band=Band(0.46, 0.50, "spec")),
        Row("reduction, four equal gyros", estimate(same), 0.5,
            band=Band(0.495, 0.505, "spec", "1 - 1/√4")),
        Row("variance with optimal weights over 1/Σσ⁻²", estimate(oracle / best), 1.0,
            band=Band(0.99, 1.01, "spec", "equation (1)", standard_errors=2.0)),
        Row("mean correlation of residuals", estimate(stacked(results, "residual_correlation")),
            "'independence is reasonable'",
            band=Band(-0.36, -0.27, "theory", "-1/(n-1) by construction"),
            verdict="wrong in the paper", erratum="E-000-11",
            reason="residuals against a mean are correlated by construction; they cannot show "
            "independence of the sensors"),
    )  # fmt: skip
    note = (
        "Reduction is 1 - σ/mean(σᵢ), gain is its reciprocal less one: 50 % reduction is 100 % "
        "gain, and the two papers of these authors use one name for both."
    )
    return Outcome(rows, (_traces(results),), (note,))


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


def figure_6(results: Results, size: Size) -> Outcome:
    """A biased, noisy sensor in the mean of all."""
    bias = stacked(results, "equal_bias")
    hat, singles = stacked(results, "hat"), stacked(results, "singles")
    rows = (
        Row("bias of the synthetic IMU from b₄ = 0.0102 rad/s", estimate(bias), 2.55e-3,
            unit="rad/s", band=Band(0.95 * BIAS / 4.0, 1.05 * BIAS / 4.0, "spec", "b/4 ± 5 %")),
        Row("noise of MTi 14 over the mean of the others",
            estimate(singles[:, 3] / singles[:, :3].mean(axis=1)), "significantly different",
            band=Band(1.5, 2.0, "theory", "by design")),
        *(
            Row(f"noise of {name} from the residuals alone, cornered hat over truth",
                estimate(hat[:, k] / singles[:, k]), verdict="beyond the paper",
                band=Band(0.97, 1.03, "theory", standard_errors=2.0),
                reason="no reference instrument is needed")
            for k, name in enumerate(SENSORS)
        ),
        Row("mean norm of a synthetic IMU at rest, in its σ",
            estimate(stacked(results, "norm_of_mean")), "a residual of the norm",
            band=Band(1.55, 1.75, "theory", "sqrt(8/π) = 1.596, and the bias"),
            verdict="wrong in the paper", reason="a norm at rest is biased by 1.6 σ; averaging "
            "norms does not remove it", erratum="E-000-16"),
    )  # fmt: skip
    return Outcome(rows, (_boxes(results),))


def figure_13(results: Results, size: Size) -> Outcome:
    """Weights from variances."""
    equal, singles = stacked(results, "equal"), stacked(results, "singles")
    ewma, garch = stacked(results, "ewma"), stacked(results, "garch")
    oracle = stacked(results, "oracle")
    squares = stacked(results, "weighted_square"), stacked(results, "equal_square")
    mean = singles.mean(axis=1)
    rows = (
        Row("noise of the weighted synthetic IMU, GARCH", estimate(garch), 0.0088, unit="rad/s",
            band=Band(0.0087, 0.0092, "spec", "oracle 0.0088, on line 0.0090")),
        Row("noise with exponential weights, nothing fitted", estimate(ewma), unit="rad/s",
            band=Band(0.0087, 0.0092, "spec"), verdict="beyond the paper"),
        Row("weighted over equal weights", estimate(ewma / equal), 0.0088 / 0.0103,
            band=Band(0.84, 0.90, "spec")),
        Row("overall reduction", estimate(1.0 - garch / mean), 0.562,
            band=Band(0.54, 0.58, "spec")),
        Row("mean square error on the biased axis, equal weights", estimate(squares[1]), 11.26e-5,
            unit="(rad/s)²", band=Band(10.9e-5, 11.6e-5, "theory", "σ² + (b/4)²")),
        Row("mean square error, weighted", estimate(squares[0]), 7.90e-5, unit="(rad/s)²",
            band=Band(7.5e-5, 8.3e-5, "theory", "with the bias, weighted")),
        Row("ratio of the mean square errors", estimate(squares[0] / squares[1]), 0.702,
            band=Band(0.65, 0.78, "spec")),
        Row("weights from the past over the best possible", estimate(ewma / oracle),
            band=Band(1.0, 1.03, "spec", "3 %", standard_errors=2.0),
            verdict="beyond the paper", reason="nothing is known beforehand, nothing looks ahead"),
    )  # fmt: skip
    note = (
        "(12) needs the conditional mean and σ² = Var given the past (E-000-7); a model fitted on "
        "the whole record, as in the paper, looks ahead."
    )
    return Outcome(rows, (_boxes(results, 4), _traces(results)), (note,))


def weights(results: Results, size: Size) -> Outcome:
    """Weights from residuals, and from unmixed variances."""
    oracle = stacked(results, "oracle")
    rows = (
        Row("variance ratio 100 of a bad sensor as its residuals show it",
            estimate(stacked(results, "ratio_seen")), 100.0,
            band=Band(7.5, 8.8, "spec", "8.1", standard_errors=2.0), verdict="wrong in the paper",
            reason="residuals mix the variances of all sensors", erratum="E-000-11"),
        Row("the same ratio by the cornered hat", estimate(stacked(results, "ratio_unmixed")),
            band=Band(80.0, 125.0, "theory", standard_errors=2.0), verdict="beyond the paper"),
        Row("variance with the paper's weights over the best",
            estimate(stacked(results, "naive") / oracle), 1.0,
            band=Band(1.33, 1.45, "spec", "0.463 against 0.332", standard_errors=2.0),
            verdict="wrong in the paper", reason="weights from residuals are too equal",
            erratum="E-000-11"),
        Row("variance with cornered-hat weights over the best",
            estimate(stacked(results, "hat") / oracle),
            band=Band(1.0, 1.06, "spec", "3 % of the deviation", standard_errors=2.0),
            verdict="beyond the paper", reason="weights found on 20 s, judged on what follows"),
        Row("variance with equal weights over the best",
            estimate(stacked(results, "equal") / oracle),
            band=Band(18.5, 20.5, "spec", "6.44 against 0.332", standard_errors=2.0),
            verdict="beyond the paper"),
    )  # fmt: skip
    return Outcome(rows)


def table_4(results: Results, size: Size) -> Outcome:
    """One axis gets noisier."""
    names = {"equal": "equal weights", "garch": "GARCH weights", "ewma": "exponential weights",
             "oracle": "best weights"}  # fmt: skip
    values = {name: stacked(results, name) for name in names}
    rows = [
        Row(
            f"synthetic IMU, equal weights, a = {a:g}",
            estimate(values["equal"][:, k]),
            TABLE_4["synthetic"][k],
            unit="rad/s",
            band=Band(
                0.96 * TABLE_4["synthetic"][k], 1.04 * TABLE_4["synthetic"][k], "spec", "4 %"
            ),
        )
        for k, a in enumerate(FACTORS)
    ]
    rows += [
        Row(
            f"weighted synthetic IMU ({words}), a = {a:g}",
            estimate(values[name][:, k]),
            TABLE_4["weighted"][k],
            unit="rad/s",
            band=Band(0.94 * TABLE_4["weighted"][k], 1.10 * TABLE_4["weighted"][k], "theory",
                      "near the best weights") if name == "ewma" else None,
            verdict="reproduced" if name == "ewma" else "reproduced in kind",
        )
        for name, words in names.items()
        if name != "equal"
        for k, a in enumerate(FACTORS)
    ]  # fmt: skip
    growth = values["ewma"][:, 2] / values["ewma"][:, 0]
    rows += [
        Row("equal weights: a = 10 over a = 0",
            estimate(values["equal"][:, 2] / values["equal"][:, 0]), 2.54,
            band=Band(2.35, 2.65, "spec", "2.5 ± 0.15")),
        Row("exponential weights: a = 10 over a = 0", estimate(growth), 1.27,
            band=Band(1.0, 1.3, "spec", standard_errors=2.0)),
        Row("exponential weights over the best, a = 10",
            estimate(values["ewma"][:, 2] / values["oracle"][:, 2]),
            band=Band(1.0, 1.06, "theory", "what following costs", standard_errors=2.0),
            verdict="beyond the paper"),
    ]  # fmt: skip
    places = np.array(FACTORS)
    curves = [
        Curve(words, places, values[name].mean(axis=0), role)
        for (name, words), role in zip(names.items(), _METHODS, strict=True)
    ]
    curves += [
        Curve("printed: synthetic", places, TABLE_4["synthetic"], "printed", "points"),
        Curve("printed: weighted", places, TABLE_4["weighted"], "printed", "points"),
    ]
    panel = Panel(
        "Noise of the synthetic rate when one sensor gets noisier",
        "a",
        "rad/s",
        tuple(curves),
        "Noise of synthetic IMUs by the size of the disturbance.",
    )
    note = (
        "The excess of Table 4 gives the noise of the disturbed gyro, 0.0136 rad/s: one of the "
        "better ones. With it both rows of the table follow, the weighted one from the best "
        "possible weights. (13) lacks the factor a (E-000-14)."
    )
    return Outcome(tuple(rows), (panel,), (note,))
