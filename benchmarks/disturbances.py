"""Lines, outliers, knocks and temperature against known truth, over many seeds.

    python -m benchmarks.disturbances line wander dirty temperature --count 24 --first 8200000

The generator is that of `benchmarks.identification`, independent of `schuler.simulate`.
"""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter
from collections.abc import Callable

import numpy as np

from benchmarks.identification import (
    CASES,
    LETTERS,
    PER_HOUR,
    PER_HOUR_15,
    PER_ROOT_HOUR,
    flicker,
    markov,
    walk,
    white,
)
from schuler.data.imu import ImuRecording
from schuler.estimation.characterization import characterize_imu
from schuler.estimation.identification import Identification
from schuler.estimation.identify import identify
from schuler.screening.screen import repair_until_clean, screen

One = dict[str, float | str]


def letters(found: Identification) -> str:
    return "+".join(LETTERS[p.kind] for p in found.process.parts if p.kind != "sinusoid")


def of(found: Identification, key: str, truth: float) -> One:
    """Ratio to truth, and whether the 95 % interval holds it."""
    value, error = found.parameters.get(key), found.standard_errors.get(key, math.nan)
    if value is None:
        return {}
    held = abs(math.log(value / truth)) < 1.96 * error / value
    return {f"{key} ratio": value / truth, f"{key} held": float(held)}


WHITE = "white_noise.density"


def line(seed: int, method: str, *, wander: bool = False) -> One:
    """50 Hz of 1.4 sigma, seen at 2 Hz by 52 samples a second; or a line that wanders."""
    rng, rate, density = np.random.default_rng([seed, 1]), 52.0, 1e-3
    n, dt = round(1200 * rate), 1.0 / rate
    x = white(n, dt, density, rng) + markov(n, dt, 2e-3, 20.0, rng)
    amplitude = 1.4 * density / math.sqrt(dt)
    frequency = 17.3 + markov(n, dt, 0.05, 60.0, rng) if wander else np.full(n, 50.0)
    phase = 2.0 * math.pi * np.cumsum(frequency) * dt + rng.uniform(0.0, 6.0)
    found = identify(x + amplitude * np.sin(phase), rate, method=method)
    out: One = {"structure": letters(found), "lines": len(found.lines)}
    out |= of(found, WHITE, density)
    if found.lines:
        seen = found.lines[0]
        place = 17.3 if wander else 2.0
        out["frequency held"] = float(abs(seen.frequency - place) < 3.0 * seen.frequency_error)
        close = 0.1 * amplitude if wander else 3.0 * seen.amplitude_error
        out["amplitude held"] = float(abs(seen.amplitude - amplitude) < close)
    return out


def dirty(seed: int, method: str, *, share: float = 0.01) -> One:
    """An hour at 100 Hz, a share of the samples 15 sigma off, three knocks of 500 sigma."""
    case, rng = CASES["wg"], np.random.default_rng([seed, 2])
    x = case.signal(rng)
    n, sd = x.size, case.truth["N"] * math.sqrt(case.rate)
    x += (rng.random(n) < share) * rng.standard_normal(n) * 15.0 * sd
    rows = np.sort(rng.choice(np.arange(1, 9), 3, replace=False)) * (n // 10)
    for row in rows:
        x[row : row + 10] += 500.0 * sd * rng.standard_normal(10)
    gyro = np.column_stack([x, rng.standard_normal((n, 2)) * sd])
    accel = rng.standard_normal((n, 3)) * 1e-3 + np.array([0.0, 0.0, 9.81])
    imu = ImuRecording(time=np.arange(n) / case.rate, gyro=gyro, accel=accel, name="made")
    seen = screen(imu)
    knocks = [i for f in seen.of_kind("knock") for i in f.intervals]
    hit = sum(any(a <= r / case.rate <= b for a, b in knocks) for r in rows)
    clean = repair_until_clean(imu, seen)
    found = characterize_imu(clean).channels["gyro_x"]
    out: One = {"structure": letters(found), "knocks found": hit / 3.0}
    out["cut too much"] = float(len(knocks) - hit)
    out["robust said"] = float(any("robust" in f for f in found.flags))
    return out | of(found, WHITE, case.truth["N"])


def temperature(
    seed: int, method: str, *, slope: float = 20.0, kind: str = "K", step: float = 0.0
) -> One:
    """12 h at 5 Hz: a day, a warm-up and weather, in deg/h a kelvin and its square; W, K or B."""
    rng, rate, n = np.random.default_rng([seed, 3]), 5.0, 216_000
    dt, density = 1.0 / rate, 0.2 * PER_ROOT_HOUR
    t = np.arange(n) * dt
    degrees = 4.0 * np.sin(2.0 * math.pi * t / 86_400.0 + rng.uniform(0.0, 6.0))
    degrees += 6.0 * (1.0 - np.exp(-t / 1800.0)) + markov(n, dt, 0.4, 1200.0, rng)
    u = degrees - degrees.mean()
    x = white(n, dt, density, rng) + slope * PER_HOUR * u
    x += PER_HOUR * u**2 if slope > 10.0 else 0.0
    size, key = (PER_HOUR_15, "random_walk.density")
    if kind == "B":
        size, key = 6.0 * PER_HOUR, "bias_instability.level"
        x += flicker(n, size, rng)
    else:
        x += walk(n, dt, size, rng)
    read = 20.0 + degrees + 0.03 * rng.standard_normal(n)
    if step:
        read = step * np.round(read / step)
    found = identify(x, rate, method=method, columns={"temperature": read})
    out: One = {"structure": letters(found), "terms": "+".join(e.term for e in found.effects)}
    linear = [e for e in found.effects if e.term == "linear"]
    if linear and slope > 0.0:
        e = linear[0]
        # about the reference of the fit, which is the mean of the column
        z = (e.coefficient - slope * PER_HOUR) / e.standard_error
        out["slope within 2 se"], out["z"] = float(abs(z) < 2.0), z
    return out | of(found, WHITE, density) | of(found, key, size)


def summary(found: list[One]) -> dict[str, object]:
    """Counts of words, means of numbers."""
    keys = list(dict.fromkeys(k for one in found for k in one))
    out: dict[str, object] = {"n": len(found)}
    for key in keys:
        values = [one[key] for one in found if key in one]
        if isinstance(values[0], str):
            out[key] = dict(Counter(values).most_common())
            continue
        numbers = np.array(values, dtype=np.float64)
        out[key] = round(float(numbers.mean()), 4)
        if key.endswith("ratio"):
            out[f"{key} range"] = [round(float(numbers.min()), 4), round(float(numbers.max()), 4)]
    return out


WHAT: dict[str, tuple[Callable[..., One], dict[str, object]]] = {
    "line": (line, {}),
    "wander": (line, {"wander": True}),
    "clean": (dirty, {"share": 0.0}),
    "dirty0.1": (dirty, {"share": 0.001}),
    "dirty1": (dirty, {"share": 0.01}),
    "dirty3": (dirty, {"share": 0.03}),
    "irrelevant": (temperature, {"slope": 0.0}),
    "temperature5": (temperature, {"slope": 5.0}),
    "temperature20": (temperature, {"slope": 20.0}),
    "temperature20B": (temperature, {"slope": 20.0, "kind": "B"}),
    "irrelevant-step0.5": (temperature, {"slope": 0.0, "step": 0.5}),
    "temperature5-step0.5": (temperature, {"slope": 5.0, "step": 0.5}),
    "temperature20-step1": (temperature, {"slope": 20.0, "step": 1.0}),
}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("what", nargs="*", default=list(WHAT))
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--first", type=int, default=8_200_000)
    parser.add_argument("--method", default="allan")
    given = parser.parse_args()
    for name in given.what:
        run, options = WHAT[name]
        seeds = range(given.first, given.first + given.count)
        print(
            name, json.dumps(summary([run(s, given.method, **options) for s in seeds])), flush=True
        )


if __name__ == "__main__":
    main()
