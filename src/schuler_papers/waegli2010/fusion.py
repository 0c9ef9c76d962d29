"""Figures 5, 6 and 13, Table 4, equations (1) and (12): four IMUs as one.

Gyros at rest, 100 Hz, errors per component: a norm at rest is biased (E-000-16).
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from schuler import ImuArray, Mounting, OnlineSettings, cornered_hat, synthesize
from schuler_papers.experiment import FloatArray, Numbers, Size, generator, numbers
from schuler_papers.waegli2010.arithmetic import SIGMAS
from schuler_papers.waegli2010.series import PAPER

Weights = Literal["equal", "ewma", "garch"]

RATE = 100.0
LEARNING = 20.0
BIAS = 0.0102
"""rad/s, of the fourth sensor: mean square and deviation of the paper then agree."""
TABLE_4_SIGMAS = np.array([0.0136, 0.0155, 0.0207, 0.0290])
"""rad/s: mean square, optimum and the excess of Table 4 together (16 x excess / a² mean sin²)."""
FACTORS = (0.0, 5.0, 10.0)
SHOWN = 300
"""Samples that are drawn."""


def gyros_at_rest(noise: FloatArray) -> ImuArray:
    """Return an array of aligned IMUs whose gyros measured noise alone."""
    n, k = noise.shape[:2]
    stamps = np.arange(n) / RATE
    return ImuArray(stamps, noise, np.full(noise.shape, np.nan), Mounting.aligned(k))


def online_settings(*, keep_biases: bool = False) -> OnlineSettings:
    """How weights follow the noise in these experiments."""
    return OnlineSettings(learning=LEARNING, keep_biases=keep_biases)


def fused_rate(noise: FloatArray, weights: Weights, *, keep_biases: bool = False) -> FloatArray:
    """The synthetic rate after the beginning that is learnt from."""
    found = synthesize(
        gyros_at_rest(noise), weights, settings=online_settings(keep_biases=keep_biases)
    )
    return np.asarray(found.sensor("gyro").vectors[round(LEARNING * RATE) :])


def run_noise(seed: int, size: Size) -> Numbers:
    """Fuse four gyros of unequal noise, one of them biased, with equal and with other weights."""
    rng = generator(seed, PAPER, "noise")
    n = 20_000 if size == "quick" else 60_000
    unit = rng.standard_normal((n, 4, 3))
    noise = SIGMAS[:, None] * unit
    noise[:, 3, 0] += BIAS
    start = round(LEARNING * RATE)
    equal = fused_rate(noise, "equal", keep_biases=True)
    same = fused_rate(0.0201 * unit, "equal", keep_biases=True)
    constant = synthesize(
        gyros_at_rest(noise),
        covariance={"gyro": np.repeat(SIGMAS**2, 3)},
        settings=online_settings(keep_biases=True),
    )
    oracle = constant.sensor("gyro").vectors[start:]
    weighings: tuple[Weights, ...] = ("ewma", "garch")
    online = {w: fused_rate(noise, w, keep_biases=True) for w in weighings}
    corrected = fused_rate(noise, "ewma")
    singles = noise[start:]

    def deviation(x: FloatArray) -> float:
        return float(math.sqrt(np.mean(x.var(axis=0))))

    def mean_square(x: FloatArray) -> float:
        return float(np.mean(x[:, 0] ** 2))

    quantiles = (0.01, 0.25, 0.5, 0.75, 0.99)
    shown = [*(singles[:, i, 0] for i in range(4)), equal[:, 0], online["ewma"][:, 0]]
    hat = cornered_hat(noise[:, :, 1])
    moments = hat.correlation[np.triu_indices(4, 1)]
    return numbers(
        singles=[deviation(singles[:, i]) for i in range(4)],
        equal=deviation(equal),
        same_equal=deviation(same),
        same_single=deviation(0.0201 * unit[start:].reshape(-1, 12)),
        oracle=deviation(oracle),
        ewma=deviation(online["ewma"]),
        garch=deviation(online["garch"]),
        corrected=deviation(corrected),
        equal_bias=equal[:, 0].mean(),
        weighted_bias=online["ewma"][:, 0].mean(),
        equal_square=mean_square(equal),
        weighted_square=mean_square(online["ewma"]),
        oracle_variance=oracle[:, 1:].var(),
        quantiles=[np.quantile(x, quantiles) for x in shown],
        hat=hat.deviations,
        hat_seen=np.sqrt(hat.residual_variances),
        residual_correlation=moments.mean(),
        shown=np.stack([singles[:SHOWN, 0, 1], equal[:SHOWN, 1], online["ewma"][:SHOWN, 1]]),
        norm_of_mean=np.linalg.norm(equal, axis=1).mean() / equal[:, 1:].std(),
    )


def run_weights(seed: int, size: Size) -> Numbers:
    """Weights when one sensor is 10 times as noisy: seen in the residuals, and unmixed."""
    rng = generator(seed, PAPER, "weights")
    n = 20_000 if size == "quick" else 60_000
    sigma = np.array([10.0, 1.0, 1.0, 1.0])
    noise = sigma[:, None] * rng.standard_normal((n, 4, 3))
    array = gyros_at_rest(noise)
    hats = [cornered_hat(noise[:2000, :, j]) for j in range(3)]
    after = noise[2000:]

    def variance(covariance: FloatArray) -> float:
        found = synthesize(array, covariance={"gyro": covariance}, settings=online_settings())
        return float(found.sensor("gyro").vectors[2000:].var())

    # axes run x, y, z of each IMU
    seen = np.stack([h.residual_variances for h in hats], axis=1).ravel()
    unmixed = np.stack([h.variances for h in hats], axis=1).ravel()
    return numbers(
        ratio_seen=np.mean(
            [h.residual_variances[0] / h.residual_variances[1:].mean() for h in hats]
        ),
        ratio_unmixed=np.mean([h.variances[0] / h.variances[1:].mean() for h in hats]),
        naive=variance(seen),
        hat=variance(unmixed),
        oracle=variance(np.repeat(sigma**2, 3)),
        equal=float(after.mean(axis=1).var()),
    )


def run_table_4(seed: int, size: Size) -> Numbers:
    """Disturb one axis by a sin(6 pi t/t_max) N(0, s_1²) and fuse with several weights."""
    rng = generator(seed, PAPER, "table-4")
    n = 20_000 if size == "quick" else 60_000
    noise = TABLE_4_SIGMAS[:, None] * rng.standard_normal((n, 4, 3))
    wave = np.sin(6.0 * np.pi * np.arange(n) / (n - 1))
    more = TABLE_4_SIGMAS[0] * rng.standard_normal(n)
    methods: tuple[Weights, ...] = ("equal", "ewma", "garch")
    start = round(LEARNING * RATE)
    found: dict[str, list[float]] = {name: [] for name in (*methods, "oracle")}
    for a in FACTORS:
        disturbed = noise.copy()
        disturbed[:, 0, 0] += a * wave * more
        for name in methods:
            found[name].append(float(fused_rate(disturbed, name)[:, 0].std()))
        variance = np.tile(TABLE_4_SIGMAS**2, (n, 1))
        variance[:, 0] *= 1.0 + (a * wave) ** 2
        weight = (1.0 / variance) / (1.0 / variance).sum(axis=1, keepdims=True)
        fused = (weight * disturbed[:, :, 0]).sum(axis=1)
        found["oracle"].append(float(fused[start:].std()))
    return numbers(**found)
