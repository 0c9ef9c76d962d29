"""What the paper leaves to later work, on a twin: volatility through the navigation filter."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from schuler import (
    ErrorModel,
    NoiseModel,
    OutageTwin,
    RandomWalk,
    SetPiece,
    TurnOnBias,
    WhiteNoise,
    car_with_set_pieces,
    draw_outage_twin,
    error_model,
    fit_dcc,
    outage_twin,
    run_outages,
    simulate_garch,
)
from schuler_papers.experiment import (
    Numbers,
    Results,
    Size,
    estimate,
    generator,
    numbers,
    stacked,
)
from schuler_papers.judging import Found
from schuler_papers.waegli2010.series import PAPER, RATE

GARCH = (0.01, 0.9898)
"""alpha and beta: the deviation changes by a third over tens of seconds."""
# densities of white noise and random walk, turn-on bias: gyro, accelerometer
WHITE, WALK, TURN_ON = (3e-4, 2e-3), (3e-6, 2e-4), (5e-4, 0.02)
LOADINGS = np.array([0.3, 0.6, 1.2, 2.4])
"""Of the common noise in each of four sensors, in deviations of their own noise."""
PIECES = tuple(SetPiece(30.0, v, turn) for v, turn in ((12.0, 0.0), (9.0, 1.5), (14.0, 0.0)))


@functools.cache
def twin() -> OutageTwin:
    """Return a drive of ten minutes with three outages and the slow errors of its sensor."""
    slow = [RandomWalk(k) + TurnOnBias(b) for k, b in zip(WALK, TURN_ON, strict=True)]
    profile, windows = car_with_set_pieces(600.0, PIECES, 0, standstill=30.0)
    return outage_twin(
        profile,
        NoiseModel.isotropic(*slow),
        [(start - 1.0, seconds) for start, seconds in windows],
        turn_on_gyro=TURN_ON[0],
        turn_on_accel=TURN_ON[1],
    )


def models() -> tuple[ErrorModel, ...]:
    """Return the same densities, constant and following the last second."""
    told = NoiseModel.isotropic(
        *(WhiteNoise(n) + RandomWalk(k) for n, k in zip(WHITE, WALK, strict=True))
    )
    return tuple(error_model(name, {}, noise_model=told) for name in ("own", "own+averaged"))


def run(seed: int, size: Size) -> Numbers:
    """Drive once with noise of changing variance, through a filter that follows it or does not."""
    rng = generator(seed, PAPER, "wishes")
    drawn = draw_outage_twin(twin(), rng)
    alpha, beta = GARCH

    def noise(density: float) -> np.ndarray:
        constant = (1.0 - alpha - beta) * density**2 * RATE
        one = [simulate_garch(drawn.imu.size, constant, alpha, beta, rng)[0] for _ in range(3)]
        return np.stack(one, axis=-1)

    gyro, accel = (noise(n) for n in WHITE)
    imu = replace(drawn.imu, gyro=drawn.imu.gyro + gyro, accel=drawn.imu.accel + accel)
    done = run_outages(twin(), models(), replace(drawn, imu=imu))
    ends = [[w.end_m for w in statistics.windows] for statistics, _ in done.values()]
    # how surprising the error at the end is to the filter: minus the log density, but for constants
    surprise = [
        [np.log(w.end_claimed_sd_m**2) + w.end_m**2 / w.end_claimed_sd_m**2 for w in s.windows]
        for s, _ in done.values()
    ]
    return numbers(ends=ends, surprise=surprise)


def judge(results: Results, size: Size) -> Found:
    """What following the noise is worth, in pairs."""
    ends = stacked(results, "ends").mean(axis=2)
    surprise = stacked(results, "surprise").mean(axis=2)
    gain = 100.0 * (1.0 - ends[:, 1] / ends[:, 0])
    return Found({"gain": estimate(gain), "surprise": surprise[:, 0] - surprise[:, 1]})


def run_together(seed: int, size: Size) -> Numbers:
    """Four noises with a common part that comes and goes: weights from their whole covariance."""
    rng = generator(seed, PAPER, "together")
    n = 8_000
    common, _ = simulate_garch(n, 0.02, 0.05, 0.93, rng)
    noise = rng.standard_normal((n, 4)) + common[:, None] * LOADINGS
    learning, after = noise[: n // 2], noise[n // 2 :]
    fit = fit_dcc(learning)
    alone = 1.0 / np.stack(
        [g.conditional_variance(after[:, i]) for i, g in enumerate(fit.garches)], axis=1
    )
    ways = {
        "equal": np.full(4, 0.25),
        "alone": alone / alone.sum(axis=1, keepdims=True),
        "together": fit.weights(after),
    }
    return numbers(**{name: np.var((w * after).sum(axis=1)) for name, w in ways.items()})


def together(results: Results, size: Size) -> Found:
    """Variance of the weighted mean over that with weights from each noise by itself."""
    alone = stacked(results, "alone")
    return Found({name: stacked(results, name) / alone for name in ("equal", "together")})
