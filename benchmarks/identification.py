"""Structure, bias and coverage of identified noise against known truth, over many seeds.

    python -m benchmarks.identification allan 24 8100000 mild phone wgk ...

The generator is independent of `schuler.simulate`: exact fractional-difference flicker, AR(1)
recursions, cumulative sums. A line for every class: how often the structure is right, how often a
random walk is invented, lines that are not there, and for every parameter mean ratio to truth, its
scatter, the claimed error and the share of 95 % intervals that hold the truth, or of the limits
where the term is not in the answer. Every class has seeds of its own.
"""

from __future__ import annotations

import json
import math
import sys
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import lfilter

from schuler.estimation.identify import identify
from schuler.types import FloatArray

DEG = math.pi / 180.0
PER_ROOT_HOUR, PER_HOUR, PER_HOUR_15 = DEG / 60.0, DEG / 3600.0, DEG / 216000.0


def white(n: int, dt: float, density: float, rng: np.random.Generator) -> FloatArray:
    return rng.standard_normal(n) * density / math.sqrt(dt)


def walk(n: int, dt: float, density: float, rng: np.random.Generator) -> FloatArray:
    return np.cumsum(rng.standard_normal(n)) * density * math.sqrt(dt)


def markov(n: int, dt: float, sigma: float, tc: float, rng: np.random.Generator) -> FloatArray:
    phi = math.exp(-dt / tc)
    drive = rng.standard_normal(n) * sigma * math.sqrt(1.0 - phi * phi)
    drive[0] = sigma * rng.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -phi], drive))


def flicker(n: int, level: float, rng: np.random.Generator) -> FloatArray:
    """Fractional differences of order -1/2, far from their start (Kasdin and Walter)."""
    total = 3 * n
    k = np.arange(1, total)
    response = np.concatenate([[1.0], np.cumprod((k - 0.5) / k)])
    size = next_fast_len(2 * total, real=True)
    drive = rfft(rng.standard_normal(total), size)
    return np.asarray(level * irfft(drive * rfft(response, size), size)[2 * n : 3 * n])


def quantised(n: int, dt: float, q: float, rng: np.random.Generator) -> FloatArray:
    return np.diff(rng.standard_normal(n + 1)) * q / dt


@dataclass(frozen=True)
class Case:
    """A class of sensors: rate, length, truth by parameter."""

    rate: float
    hours: float
    truth: dict[str, float]
    structure: str

    def signal(self, rng: np.random.Generator) -> FloatArray:
        n, dt, t = round(self.rate * self.hours * 3600.0), 1.0 / self.rate, self.truth
        x = white(n, dt, t["N"], rng)
        if "B" in t:
            x += flicker(n, t["B"], rng)
        for k in ("", "2"):
            if "sigma" + k in t:
                x += markov(n, dt, t["sigma" + k], t["T" + k], rng)
        if "K" in t:
            x += walk(n, dt, t["K"], rng)
        if "Q" in t:
            x += quantised(n, dt, t["Q"], rng)
        return x


N3 = 0.3 * PER_ROOT_HOUR
CASES: dict[str, Case] = {
    "mild": Case(50.0, 2.0, {"N": N3, "B": 12 * PER_HOUR, "K": 3 * PER_HOUR_15}, "W+B"),
    "phone": Case(400.0, 0.25, {"N": 0.6 * PER_ROOT_HOUR, "B": 100 * PER_HOUR}, "W+B"),
    "wbg": Case(
        20.0, 4.0, {"N": N3, "B": 12 * PER_HOUR, "sigma": 60 * PER_HOUR, "T": 10.0}, "W+G+B"
    ),
    "wbk": Case(10.0, 12.0, {"N": N3, "B": 12 * PER_HOUR, "K": 40 * PER_HOUR_15}, "W+B+K"),
    "wgk": Case(
        10.0, 4.0, {"N": N3, "sigma": 40 * PER_HOUR, "T": 30.0, "K": 40 * PER_HOUR_15}, "W+G+K"
    ),
    "wg": Case(50.0, 1.0, {"N": N3, "sigma": 40 * PER_HOUR, "T": 100.0}, "W+G"),
    "short": Case(100.0, 5.0 / 60.0, {"N": N3, "sigma": 200 * PER_HOUR, "T": 5.0}, "W+G"),
    "wk": Case(50.0, 2.0, {"N": N3, "K": 30 * PER_HOUR_15}, "W+K"),
    "fog": Case(
        100.0, 2.0, {"N": 0.003 * PER_ROOT_HOUR, "Q": 1e-7, "K": 0.003 * PER_HOUR_15}, "W+Q"
    ),
    "white": Case(100.0, 1.0, {"N": N3}, "W"),
    "fast3": Case(100.0, 0.5, {"N": 0.02, "sigma": 1.0, "T": 0.03}, "W+G"),
    "fast5": Case(100.0, 0.5, {"N": 0.02, "sigma": 1.0, "T": 0.05}, "W+G"),
    "fast10": Case(100.0, 0.5, {"N": 0.02, "sigma": 1.0, "T": 0.1}, "W+G"),
}
NAMES = {
    "N": "white_noise.density",
    "B": "bias_instability.level",
    "K": "random_walk.density",
    "Q": "quantization.step_density",
    "sigma": "gauss_markov.sigma",
    "T": "gauss_markov.correlation_time",
}
LETTERS = {
    "white_noise": "W",
    "quantization": "Q",
    "gauss_markov": "G",
    "bias_instability": "B",
    "random_walk": "K",
    "rate_ramp": "R",
    "sinusoid": "S",
}


@dataclass(frozen=True)
class One:
    structure: str
    values: dict[str, float]
    errors: dict[str, float]
    limits: dict[str, float]
    lines: int
    seconds: float


def runs(
    case: Case, method: str, seeds: range, find: Callable[..., object] = identify
) -> Iterator[One]:
    for seed in seeds:
        x = case.signal(np.random.default_rng([seed, zlib.crc32(repr(case).encode())]))
        begun = time.process_time()
        found = find(x, case.rate, method=method)
        seconds = time.process_time() - begun
        letters = "+".join(LETTERS.get(p.kind, "?") for p in found.process.parts)
        yield One(
            letters,
            found.parameters,
            found.standard_errors,
            found.limits,
            len(found.lines),
            seconds,
        )


def summary(case: Case, found: list[One]) -> dict[str, object]:
    """Right structures, false walks, and ratio, scatter, claim and coverage by parameter."""
    counts = Counter(one.structure for one in found)
    out: dict[str, object] = {
        "right": counts[case.structure] / len(found),
        "structures": dict(counts.most_common()),
        "walks": sum("K" in one.structure for one in found),
        "lines": sum(one.lines for one in found),
        "cpu_s": float(np.median([one.seconds for one in found])),
    }
    for short, truth in case.truth.items():
        key = NAMES[short]
        pairs = [(o.values[key] / truth, o.errors[key] / truth) for o in found if key in o.values]
        if pairs:
            ratio, error = np.array(pairs).T
            held = np.mean(np.abs(np.log(ratio)) < 1.96 * error / ratio)
            out[short] = {
                "ratio": round(float(ratio.mean()), 4),
                "sd": round(float(ratio.std()), 4),
                "se": round(float(error.mean()), 4),
                "coverage": round(float(held), 3),
                "n": len(pairs),
            }
        limits = [o.limits[key] / truth for o in found if key not in o.values and key in o.limits]
        if limits:
            out[f"limit of {short}"] = {
                "held": round(float(np.mean(np.array(limits) >= 1.0)), 3),
                "ratio": round(float(np.median(limits)), 2),
                "n": len(limits),
            }
    return out


def main(method: str, count: int, first: int, names: list[str]) -> None:
    for name in names or CASES:
        found = list(runs(CASES[name], method, range(first, first + count)))
        print(name, json.dumps(summary(CASES[name], found)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4:])
