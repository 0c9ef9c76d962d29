"""What a filter gains that follows the noise of its sensors, on a twin with GARCH noise.

Noise of every channel: GARCH(1, 1) with alpha 0.01 and beta 0.9898 at 100 Hz (its deviation
changes by a third over tens of seconds), four outages of 30 s, GNSS of 1 m and 0.05 m/s. The same
draws for a filter with the constant density, with the average of the last second, with the GARCH
recursion, and with the true variance that nobody knows. `python -m benchmarks.changing_noise
[SEEDS]`; 20 seeds by default. Differences to the constant density, paired, with standard errors.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

from schuler.data import CHANNELS
from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.evaluation.outage_twin import OutageTwin, draw_outage_twin, outage_twin
from schuler.evaluation.outage_windows import judge_window
from schuler.navigation.error_models.changing_noise import (
    ChangingNoise,
    VarianceRecursion,
    averaged_noise,
)
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigation.run import run
from schuler.noise import NoiseModel, RandomWalk, TurnOnBias, WhiteNoise
from schuler.simulation.motions.set_pieces import SetPiece, car_with_set_pieces

RATE = 100.0
ALPHA, BETA = 0.01, 0.9898
WHITE = {"accel": 2e-3, "gyro": 3e-4}
WALK = {"accel": 2e-4, "gyro": 3e-6}
TURN_ON = {"accel": 0.02, "gyro": 5e-4}
PIECES = (
    SetPiece(30.0, 12.0, share=0.15),
    SetPiece(30.0, 12.0, share=0.1),
    SetPiece(30.0, 9.0, float(np.pi / 2), share=0.1),
    SetPiece(30.0, 14.0, share=0.08),
)
FIGURES = (
    "error at the end, m",
    "minus log density of that error",
    "GNSS log likelihood a fix",
    "velocity rms, mm/s",
    "inside 2 sigma",
)


def kind(channel: str) -> str:
    return channel[:-2]


def make_twin() -> OutageTwin:
    slow = NoiseModel(
        {c: RandomWalk(WALK[kind(c)]) + TurnOnBias(TURN_ON[kind(c)]) for c in CHANNELS}
    )
    profile, windows = car_with_set_pieces(600.0, PIECES, 0, standstill=30.0)
    return outage_twin(profile, slow, [(a - 1.0, b) for a, b in windows])


def one(twin: OutageTwin, seed: int) -> dict[str, list[float]]:
    rng = np.random.default_rng([3, seed])
    drawn = draw_outage_twin(twin, rng)
    order = (*CHANNELS[3:], *CHANNELS[:3])
    density = np.array([WHITE[kind(c)] for c in order])
    noise, truth = {}, np.empty((drawn.imu.size, 6))
    for k, c in enumerate(order):
        constant = density[k] ** 2 * RATE
        weight = 1.0 - ALPHA - BETA
        noise[c], variance = simulate_garch(drawn.imu.size, weight * constant, ALPHA, BETA, rng)
        truth[:, k] = variance / constant
    imu = replace(
        drawn.imu,
        gyro=drawn.imu.gyro + np.stack([noise[c] for c in CHANNELS[:3]], axis=-1),
        accel=drawn.imu.accel + np.stack([noise[c] for c in CHANNELS[3:]], axis=-1),
    )
    told = NoiseModel({c: WhiteNoise(WHITE[kind(c)]) + RandomWalk(WALK[kind(c)]) for c in CHANNELS})
    model = sensor_error_model(told, turn_on_accel=TURN_ON["accel"], turn_on_gyro=TURN_ON["gyro"])
    setup = RunSetup(model, NoiseFactors.none(), TimeOffsets(), drawn.alignment, np.zeros(3))
    recursion = VarianceRecursion(ALPHA, BETA)
    usual = {c: float(d**2) * RATE for c, d in zip(order, density, strict=True)}
    ways = {
        "constant density": None,
        "average of the last second": averaged_noise(1.0 / RATE, reference=usual).white_scale(imu),
        "GARCH, one step ahead": ChangingNoise(
            dict.fromkeys(CHANNELS, recursion), usual
        ).white_scale(imu),
        "true variance": truth,
    }
    settled = slice(6000, None, 100)
    velocity = twin.profile.trajectory(imu.time[settled]).velocity
    found = {}
    for name, scale in ways.items():
        done = run(imu, drawn.gnss, setup, false_alarm=0.0, white_scale=scale).causal
        windows = [
            judge_window(done, twin.truth, w, lever_arm=np.zeros(3), time_offset=0.0, sd_factor=1.0)
            for w in twin.windows
        ]
        error = np.array([w.error_ned[-1, :2] for w in windows])
        claimed = np.array([w.covariance[-1] for w in windows])
        square = np.einsum("ki,ki->k", error, np.linalg.solve(claimed, error[..., None])[..., 0])
        surprise = 0.5 * (square + np.log(np.linalg.det(claimed))) + np.log(2.0 * np.pi)
        off = np.linalg.norm(done.trajectory.velocity[settled] - velocity, axis=1)
        found[name] = [
            float(np.hypot(*error.T).mean()),
            float(surprise.mean()),
            done.log_likelihood / drawn.gnss.size,
            1e3 * float(np.sqrt(np.mean(off**2))),
            float(np.mean([w.within_2_sigma for w in windows])),
        ]
    return found


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    twin = make_twin()
    start = time.process_time()
    draws = [one(twin, seed) for seed in range(seeds)]
    print(f"{seeds} draws of 600 s, {time.process_time() - start:.1f} CPU s")
    base = np.array([d["constant density"] for d in draws])
    for name in draws[0]:
        values = np.array([d[name] for d in draws])
        change = values - base
        error = change.std(axis=0, ddof=1) / np.sqrt(seeds)
        print(name)
        for k, figure in enumerate(FIGURES):
            line = f"  {figure:34s}{values[:, k].mean():9.3f}"
            if name != "constant density":
                line += f"   {change[:, k].mean():+8.4f} +- {error[k]:.4f}"
            print(line)


if __name__ == "__main__":
    main()
