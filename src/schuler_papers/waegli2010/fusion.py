"""Figures 5 to 8, 13, 14, Tables 3 and 4, equations (1) to (4) and (12): four IMUs as one.

Gyros at rest, 100 Hz, errors per component: a norm at rest is biased (E-000-16).
"""

from __future__ import annotations

import math
import time

import numpy as np

from schuler.arrays.redundant import redundant_sensors
from schuler.arrays.synthesis.conditional import conditional_noise
from schuler.arrays.synthesis.cornered_hat import cornered_hat
from schuler.arrays.synthesis.synthetic import SyntheticImu, Weights, synthesize
from schuler.arrays.synthesis.volatility import window_volatility
from schuler.arrays.tracking import OnlineSettings
from schuler.data import ImuArray, Mounting
from schuler.estimation.garch.conditional_variance import ewma_variance, simulate_garch
from schuler.types import FloatArray
from schuler_papers.experiment import Numbers, Size, generator, numbers
from schuler_papers.waegli2010.arithmetic import SIGMAS
from schuler_papers.waegli2010.series import PAPER, TABLE_2

RATE = 100.0
LEARNING = 20.0
BIAS = 0.0102
"""rad/s, of the fourth sensor: mean square and deviation of the paper then agree."""
TABLE_4_SIGMAS = np.array([0.0136, 0.0155, 0.0207, 0.0290])
"""rad/s: mean square, optimum and the excess of Table 4 together (16 x excess / a² mean sin²)."""
FACTORS = (0.0, 5.0, 10.0)
SHOWN = 300
"""Samples that are drawn."""
HALF_WINDOWS = (5, 25, 125)
WINDOWS = (5, 25, 50, 125)


def gyros_at_rest(noise: FloatArray) -> ImuArray:
    """Return an array of aligned IMUs whose gyros measured noise alone."""
    n, k = noise.shape[:2]
    stamps = np.arange(n) / RATE
    return ImuArray(stamps, noise, np.full(noise.shape, np.nan), Mounting.aligned(k))


def _settings(*, keep_biases: bool = False) -> OnlineSettings:
    return OnlineSettings(learning=LEARNING, keep_biases=keep_biases)


def _fused(noise: FloatArray, weights: Weights, *, keep_biases: bool = False) -> FloatArray:
    """The synthetic rate after the beginning that is learnt from."""
    found: SyntheticImu = synthesize(
        gyros_at_rest(noise), weights, settings=_settings(keep_biases=keep_biases)
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
    equal = _fused(noise, "equal", keep_biases=True)
    same = _fused(0.0201 * unit, "equal", keep_biases=True)
    constant = synthesize(
        gyros_at_rest(noise),
        covariance={"gyro": np.repeat(SIGMAS**2, 3)},
        settings=_settings(keep_biases=True),
    )
    oracle = constant.sensor("gyro").vectors[start:]
    online = {w: _fused(noise, w, keep_biases=True) for w in ("ewma", "garch")}
    corrected = _fused(noise, "ewma")
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
        found = synthesize(array, covariance={"gyro": covariance}, settings=_settings())
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


def run_volatility(seed: int, size: Size) -> Numbers:
    """Averaged volatilities of constant noise and of a step, against residuals and errors."""
    rng = generator(seed, PAPER, "volatility")
    n = 20_000 if size == "quick" else 60_000
    vectors = rng.standard_normal((n, 4, 3))
    expectation = []
    for half in WINDOWS:
        inner = slice(half, n - half)
        found = {d: window_volatility(vectors, half, divisor=d) for d in ("paper", "unbiased")}
        expectation.append([found[d].variance[inner].mean() for d in ("paper", "unbiased")])
    scatter = [
        window_volatility(vectors, half).variance[half : n - half : 2 * half + 1].std()
        for half in HALF_WINDOWS
    ]
    # the same window over the errors, whose mean square the paper takes for the reference
    half = 50
    window = 2 * half + 1
    squares = (vectors**2).sum(axis=(1, 2))
    errors = np.convolve(squares, np.ones(window), "valid") / (3.0 * 4.0 * (window - 1.0))
    inner = slice(half, n - half)
    by_paper = window_volatility(vectors, half, divisor="paper").variance[inner]
    unbiased = window_volatility(vectors, half).variance[inner]
    honest = errors * (window - 1.0) / window
    level = np.where(np.arange(n) < n // 2, 1.0, 3.0)
    step = vectors * level[:, None, None]
    lags = []
    for half_window in HALF_WINDOWS:
        moving = window_volatility(step, half_window, causal=True).variance
        lags.append(np.argmax(moving[n // 2 - 1 :] > 5.0) / RATE)
    near = slice(n // 2 - 300, n // 2 + 600)
    shown = [np.sqrt(window_volatility(step, h, causal=True).variance[near]) for h in HALF_WINDOWS]
    residual = vectors - vectors.mean(axis=1, keepdims=True)
    identity = []
    for _ in range(1000):
        values, reference = rng.standard_normal(4), rng.standard_normal()
        x = values - values.mean()
        left = ((values - reference) ** 2).sum()
        right = (x**2).sum() + 4.0 * (values.mean() - reference) ** 2
        identity.append((abs(left - right) / left, left - (x**2).sum()))
    return numbers(
        expectation=expectation,
        scatter=scatter,
        deviation_ratio=np.sqrt(by_paper.mean() / errors.mean()),
        unbiased_ratio=np.sqrt(unbiased.mean() / honest.mean()),
        lags=lags,
        step=shown,
        step_time=(np.arange(near.start, near.stop) - n // 2) / RATE,
        step_level=level[near],
        double_mean=np.abs(residual.mean(axis=1)).max(),
        identity=np.max([i[0] for i in identity]),
        smallest_excess=np.min([i[1] for i in identity]),
        by_paper=np.sqrt(by_paper[: 60 * 20 : 20]),
        by_errors=np.sqrt(errors[: 60 * 20 : 20]),
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
            found[name].append(float(_fused(disturbed, name)[:, 0].std()))
        variance = np.tile(TABLE_4_SIGMAS**2, (n, 1))
        variance[:, 0] *= 1.0 + (a * wave) ** 2
        weight = (1.0 / variance) / (1.0 / variance).sum(axis=1, keepdims=True)
        fused = (weight * disturbed[:, :, 0]).sum(axis=1)
        found["oracle"].append(float(fused[start:].std()))
    return numbers(**found)


def run_one_varies(seed: int, size: Size) -> Numbers:
    """Let one gyro of four vary by Table 2's GARCH, and see whose variance each method shows."""
    rng = generator(seed, PAPER, "one-varies")
    n = 20_000 if size == "quick" else 60_000
    noise = 0.0146 * rng.standard_normal((n, 4, 3))
    noise[:, 0, 0], true = simulate_garch(n, *TABLE_2, rng)
    learning = n // 4
    sensors = redundant_sensors(gyros_at_rest(noise), "gyro")
    begin = time.process_time()
    garch = conditional_noise(sensors, learning, OnlineSettings()).variance[:, 0]
    garch_seconds = time.process_time() - begin
    begin = time.process_time()
    averaged = window_volatility(noise, 50, causal=True).variance
    averaged_seconds = time.process_time() - begin
    begin = time.process_time()
    ewma = ewma_variance(noise[:, 0, 0] - noise[:, :, 0].mean(axis=1), before=float(true[0]))
    ewma_seconds = time.process_time() - begin
    after = slice(learning, None)
    squares = noise[after, 0, 0] ** 2
    named = {"garch": garch[after], "averaged": averaged[after], "ewma": ewma[after]}

    def correlation(variance: FloatArray) -> float:
        return float(np.corrcoef(np.log(variance), np.log(true[after]))[0, 1])

    def loss(variance: FloatArray) -> float:
        return float(np.mean(np.log(variance) + squares / variance))

    dirty = noise.copy()
    hit = rng.random(n) < 0.01
    dirty[hit, 0, 0] *= 10.0
    worse = [
        _fused(dirty, weights)[:, 0].std() / _fused(noise, weights)[:, 0].std()
        for weights in ("equal", "ewma")
    ]
    outlier = [
        window_volatility(dirty, 50, causal=True).variance[after].mean() / averaged[after].mean(),
        conditional_noise(
            redundant_sensors(gyros_at_rest(dirty), "gyro"), learning, OnlineSettings()
        )
        .variance[after, 0]
        .mean()
        / garch[after].mean(),
    ]
    thin = slice(learning, None, 50)
    return numbers(
        correlation=[correlation(v) for v in named.values()],
        loss=[loss(v) for v in named.values()],
        mean_ratio=[v.mean() / true[after].mean() for v in named.values()],
        seconds=[garch_seconds, averaged_seconds, ewma_seconds],
        outlier=outlier,
        fused_outlier=worse,
        time=np.arange(n)[thin] / RATE,
        true=np.sqrt(true[thin]),
        garch=np.sqrt(garch[thin]),
        averaged=np.sqrt(averaged[thin]),
    )
