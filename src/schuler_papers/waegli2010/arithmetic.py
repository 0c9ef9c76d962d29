"""What can be computed from the printed numbers of Waegli 2010 alone."""

from __future__ import annotations

import math

import numpy as np

from schuler.noise import GaussMarkov, WhiteNoise
from schuler.noise.arma_exchange import arma_to_gauss_markov_sum
from schuler_papers.experiment import Numbers, Results, Size, numbers
from schuler_papers.outcome import Band, Outcome, Row
from schuler_papers.waegli2010.series import RATE, TABLE_1

SINGLE, SYNTHETIC, WEIGHTED = 0.0201, 0.0103, 0.0088
SIGMAS = np.array([0.0207, 0.0146, 0.0146, 0.0290])
"""rad/s: four sensors that give the tables and the text together."""
TABLE_4 = {"synthetic": (0.0103, 0.0156, 0.0262), "weighted": (0.0088, 0.0104, 0.0112)}


def run(seed: int, size: Size) -> Numbers:
    """Compute what the printed numbers imply."""
    parts = arma_to_gauss_markov_sum(TABLE_1).components
    markov = [p for p in parts if isinstance(p, GaussMarkov)]
    white = next(p for p in parts if isinstance(p, WhiteNoise))
    rounded = np.abs(np.roots([1.0, -1.67, 0.67])).max()
    alpha, beta = 0.0175, 0.982
    node, weight = np.polynomial.hermite_e.hermegauss(80)
    growth = float(weight @ np.log(beta + alpha * node**2) / weight.sum())
    mixing = 0.5 * np.eye(4) + np.full((4, 4), 1.0 / 16.0)
    seen = mixing @ np.array([100.0, 1.0, 1.0, 1.0])
    naive = (1.0 / seen) / (1.0 / seen).sum()
    best = np.array([0.01, 1.0, 1.0, 1.0]) / 3.01
    truth = np.array([100.0, 1.0, 1.0, 1.0])
    t = np.array(TABLE_4["synthetic"])
    excess = t[1:] ** 2 - t[0] ** 2
    return numbers(
        poles=np.sort(np.abs(TABLE_1.poles)),
        rounded_root=rounded,
        times=[m.correlation_time for m in markov],
        variances=[white.density**2 * RATE, *(m.sigma**2 for m in markov)],
        growth=growth,
        sd_text=math.sqrt(1.3e-7 / (1.0 - alpha - 0.982)),
        sd_table=math.sqrt(1.3e-7 / (1.0 - alpha - 0.98)),
        shrunk=seen[0] / seen[1],
        variance_naive=naive**2 @ truth,
        variance_best=best**2 @ truth,
        variance_equal=truth.sum() / 16.0,
        best_reduction=1.0 - 1.0 / (SIGMAS.mean() * math.sqrt((SIGMAS**-2.0).sum())),
        excess_ratio=excess[1] / excess[0],
        norm_bias=math.sqrt(8.0 / math.pi),
        rms_over_mean=math.sqrt(np.mean(SIGMAS**2)) / SIGMAS.mean(),
    )


def _of(results: Results, name: str) -> float:
    return float(results[0][name])


def percentages(results: Results, size: Size) -> Outcome:
    """Percentages of the text, and mean square against standard deviation."""
    rows = (
        Row("noise reduction of the synthetic IMU, %", 100.0 * (1.0 - SYNTHETIC / SINGLE), 48.6,
            band=Band(48.1, 49.2, "theory", "two roundings of the fourth digit"),
            reason="48.8 from the rounded values"),
        Row("further reduction by weights, %", 100.0 * (1.0 - WEIGHTED / SYNTHETIC), 14.6,
            band=Band(14.5, 14.7, "theory")),
        Row("overall reduction, %", 100.0 * (1.0 - WEIGHTED / SINGLE), 56.2,
            band=Band(56.1, 56.3, "theory")),
        Row("ratio of the mean square errors, %", 100.0 * 7.90 / 11.26, 70.2,
            band=Band(70.1, 70.3, "theory")),
        Row("bias that mean square and standard deviation of the synthetic IMU imply",
            math.sqrt(11.26e-5 - SYNTHETIC**2), "not mentioned", unit="rad/s",
            band=Band(2.5e-3, 2.6e-3, "spec"), verdict="reproduced in kind", erratum="E-000-4",
            reason="mean square and variance differ by the bias; they must not be interchanged"),
        Row("bias that they imply for the weighted one", math.sqrt(7.90e-5 - WEIGHTED**2),
            "not mentioned", unit="rad/s", band=Band(1.2e-3, 1.3e-3, "spec"),
            verdict="reproduced in kind", erratum="E-000-4"),
    )  # fmt: skip
    return Outcome(rows)


def more_than_half(results: Results, size: Size) -> Outcome:
    """A reduction above one half is no contradiction."""
    rows = (
        Row(
            "reduction by optimal weights of sensors of 0.0207, 0.0146, 0.0146, 0.0290 rad/s",
            _of(results, "best_reduction"),
            printed=0.562,
            band=Band(0.54, 0.58, "spec"),
            verdict="reproduced",
            reason="the half is a bound for equal sensors with equal weights only",
            erratum="E-000-5",
        ),
    )
    return Outcome(rows)


def rounded_text(results: Results, size: Size) -> Outcome:
    """Table 1's model and its rounding in the text."""
    poles = results[0]["poles"]
    times, variances = results[0]["times"], results[0]["variances"]
    rows = (
        Row("largest pole of the text's 1.67, -0.67", _of(results, "rounded_root"),
            "stationary", band=Band(1.0 - 1e-9, 1.0 + 1e-9, "theory", "they sum to one"),
            verdict="wrong in the paper", reason="a unit root: never rebuild a model from rounded "
            "coefficients", erratum="E-000-10"),
        Row("largest pole of the table's coefficients", float(poles[1]),
            band=Band(0.984, 0.985, "spec"), verdict="beyond the paper"),
        Row("the model is white noise and two Gauss-Markov noises: slow correlation time",
            float(times[0]), unit="s", band=Band(0.62, 0.64, "spec"), verdict="beyond the paper",
            reason="states of a navigation filter, not a black box"),
        Row("fast correlation time", float(times[1]), unit="s", band=Band(0.025, 0.027, "spec"),
            verdict="beyond the paper"),
        Row("variance of its white part, in innovation variances", float(variances[0]),
            band=Band(0.23, 0.25, "spec"), verdict="beyond the paper"),
        Row("variance of its slow part", float(variances[1]), band=Band(1.68, 1.70, "spec"),
            verdict="beyond the paper"),
    )  # fmt: skip
    return Outcome(rows)


def volatility_text(results: Results, size: Size) -> Outcome:
    """The variance equation as quoted, and its third digit."""
    rows = (
        Row("E ln(β + α Z²) without α₀", _of(results, "growth"), "a volatility model",
            band=Band(-8.1e-4, -7.7e-4, "spec"), verdict="wrong in the paper",
            reason="negative: the quoted equation, without α₀, dies out", erratum="E-000-9"),
        Row("standard deviation with β = 0.982, as in the text", _of(results, "sd_text"),
            0.0201, unit="rad/s", band=Band(0.016, 0.0163, "spec"), verdict="reproduced in kind",
            erratum="E-000-9"),
        Row("standard deviation with β = 0.98, as in the table", _of(results, "sd_table"),
            0.0201, unit="rad/s", band=Band(0.0071, 0.0073, "spec"), verdict="wrong in the paper",
            reason="the third digit of β changes the variance five times; only 0.982 is near the "
            "sensor's noise", erratum="E-000-9"),
    )  # fmt: skip
    return Outcome(rows)


def mixing(results: Results, size: Size) -> Outcome:
    """What residuals against the mean of all sensors show of one of them."""
    rows = (
        Row("a sensor of 100 times the variance of its three peers is seen as",
            _of(results, "shrunk"), 100.0, band=Band(8.1, 8.3, "spec", "(1 - 2/n) I + 11ᵀ/n²"),
            verdict="wrong in the paper", reason="Var(x_i) mixes the variances of all sensors",
            erratum="E-000-11"),
        Row("variance with weights from these residuals", _of(results, "variance_naive"),
            band=Band(0.46, 0.47, "spec"), verdict="reproduced in kind", erratum="E-000-11"),
        Row("variance with equal weights", _of(results, "variance_equal"),
            band=Band(6.43, 6.45, "spec"), verdict="reproduced in kind"),
        Row("variance with the true weights, which the cornered hat finds",
            _of(results, "variance_best"), band=Band(0.331, 0.333, "spec"),
            verdict="beyond the paper"),
        Row("correlation between sensors that a ratio of 0.512 instead of 0.500 would mean",
            (0.512**2 * 4.0 - 1.0) / 3.0, "'independence is reasonable'",
            band=Band(0.016, 0.018, "spec"), verdict="wrong in the paper",
            reason="or none at all, with unequal sensors (next row): nothing was tested",
            erratum="E-000-11"),
        Row("root mean square over mean of the four noise levels", _of(results, "rms_over_mean"),
            0.512 / 0.5, band=Band(1.03, 1.06, "spec", "1.044"), verdict="reproduced in kind",
            erratum="E-000-11"),
    )  # fmt: skip
    return Outcome(rows)


def conclusions(results: Results, size: Size) -> Outcome:
    """'Up to 100 %', equation (13), and norms."""
    synthetic, weighted = TABLE_4["synthetic"][2], TABLE_4["weighted"][2]
    rows = (
        Row("reduction by weights at a = 10, %", 100.0 * (1.0 - weighted / synthetic), 100.0,
            band=Band(56.0, 58.0, "spec", "57"), verdict="wrong in the paper",
            reason="57 % reduction or 134 % gain; neither is 100", erratum="E-000-13"),
        Row("gain at a = 10, %", 100.0 * (synthetic / weighted - 1.0), 100.0,
            band=Band(133.0, 135.0, "spec", "134"), verdict="wrong in the paper",
            reason="as above", erratum="E-000-13"),
        Row("excess variance of Table 4 at a = 10 over that at a = 5",
            _of(results, "excess_ratio"), "(13) has no a", band=Band(4.1, 4.4, "spec", "4.23"),
            verdict="wrong in the paper", reason="near 4: a scales the amplitude; as variance it "
            "would be 2. The index l₁ is 1₁", erratum="E-000-14"),
        Row("mean of the norm of three components of a gyro at rest, in σ",
            _of(results, "norm_bias"), "an error of zero mean",
            band=Band(1.59, 1.60, "theory", "sqrt(8/π)"), verdict="wrong in the paper",
            reason="a norm at rest is biased, and averaging norms does not remove it: compare "
            "components", erratum="E-000-16"),
    )  # fmt: skip
    notes = (
        "E-000-7: the sentence after (12) needs σ² = Var, not σ⁻², and the conditional mean "
        "given the past. E-000-15: Tables 1 (x) and 2 (z) are of different series.",
    )
    return Outcome(rows, (), notes)
