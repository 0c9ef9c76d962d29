"""What can be computed from the printed numbers of Waegli 2010 alone."""

from __future__ import annotations

import math

import numpy as np

from schuler import GaussMarkov, WhiteNoise, arma_to_gauss_markov_sum
from schuler_papers.experiment import Numbers, Results, Size, numbers
from schuler_papers.judging import Found, plain
from schuler_papers.outcome import Proof
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
    alpha, beta = 0.0175, 0.982
    node, weight = np.polynomial.hermite_e.hermegauss(80)
    growth = float(weight @ np.log(beta + alpha * node**2) / weight.sum())
    synthetic, weighted = TABLE_4["synthetic"], TABLE_4["weighted"]
    excess = np.array(synthetic[1:]) ** 2 - synthetic[0] ** 2
    return numbers(
        reductions=100.0
        * np.array([1.0 - SYNTHETIC / SINGLE, 1.0 - WEIGHTED / SYNTHETIC, 1.0 - WEIGHTED / SINGLE]),
        square_ratio=100.0 * 7.90 / 11.26,
        implied_bias=[math.sqrt(11.26e-5 - SYNTHETIC**2), math.sqrt(7.90e-5 - WEIGHTED**2)],
        poles=np.sort(np.abs(TABLE_1.poles)),
        rounded_root=np.abs(np.roots([1.0, -1.67, 0.67])).max(),
        times=[m.correlation_time for m in markov],
        variances=[white.density**2 * RATE, *(m.sigma**2 for m in markov)],
        growth=growth,
        sd_text=math.sqrt(1.3e-7 / (1.0 - alpha - 0.982)),
        sd_table=math.sqrt(1.3e-7 / (1.0 - alpha - 0.98)),
        best_reduction=1.0 - 1.0 / (SIGMAS.mean() * math.sqrt((SIGMAS**-2.0).sum())),
        excess_ratio=excess[1] / excess[0],
        norm_bias=math.sqrt(8.0 / math.pi),
        rms_over_mean=math.sqrt(np.mean(SIGMAS**2)) / SIGMAS.mean(),
        shared=(0.512**2 * 4.0 - 1.0) / 3.0,
        conclusion=[
            100.0 * (1.0 - weighted[2] / synthetic[2]),
            100.0 * (synthetic[2] / weighted[2] - 1.0),
        ],
        **_mixing(),
    )


def _mixing() -> Numbers:
    """Residuals of one sensor in four of 100 times the variance of its peers."""
    mixing = 0.5 * np.eye(4) + np.full((4, 4), 1.0 / 16.0)
    truth = np.array([100.0, 1.0, 1.0, 1.0])
    seen = mixing @ truth
    naive = (1.0 / seen) / (1.0 / seen).sum()
    best = np.array([0.01, 1.0, 1.0, 1.0]) / 3.01
    return numbers(
        shrunk=seen[0] / seen[1],
        variance_naive=naive**2 @ truth,
        variance_best=best**2 @ truth,
        variance_equal=truth.sum() / 16.0,
    )


def judge(results: Results, size: Size) -> Found:
    """Join the numbers with what makes printed statements impossible."""
    found = plain(results, size)
    one = results[0]
    proofs = {
        "dies out": Proof(
            "E ln(β + α Z²) < 0: without α₀ the variance tends to zero (Nelson 1990)",
            float(one["growth"]), -1.0, 0.0,
        ),
        "mixing": Proof(
            "(1 - 2/n) I + 11ᵀ/n² shows a ratio of 100 as 8",
            float(one["shrunk"]), 8.1, 8.3,
        ),
    }  # fmt: skip
    return Found(found.values, proofs=proofs)
