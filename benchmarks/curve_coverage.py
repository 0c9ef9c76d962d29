"""Share of 95 % intervals of Allan and Hadamard deviations that hold the truth, at long times.

python -m benchmarks.curve_coverage 300 4100000
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.identification import flicker, quantised, walk, white
from schuler.curves.allan import allan_deviation
from schuler.types import FloatArray

SAMPLES = 8100
SHARES = (20, 9, 5, 3.13, 2.1)


def truth(name: str, m: FloatArray, kind: str) -> FloatArray:
    """Variance of samples one second apart (Hadamard: exact where it is plain)."""
    n2 = 1.0 / m
    k2 = (2 * m**2 + 1) / (6 * m) if kind == "overlapping" else m / 6.0 + 0.0 * m
    b2 = np.full(m.size, 2 * np.log(2) / np.pi if kind == "overlapping" else 0.0)
    if kind == "hadamard":
        # (9 ln 3 / 2 - 4 ln 2 ... )/pi of third differences: 1/2 ln(256/27) 2/pi/... by Riley
        b2 = np.full(m.size, 0.5 * np.log(256.0 / 27.0) / np.pi)
    q2 = 3.0 / m**2 if kind == "overlapping" else 10.0 / 3.0 / m**2
    return {
        "white": n2,
        "walk": k2,
        "flicker": b2,
        "mix": n2 + 3e-6 * k2,
        "nb": n2 + 2e-3 * b2,
        "quantised": q2,
        "qn": q2 + 1e-2 * n2,
    }[name]


def signal(name: str, rng: np.random.Generator) -> FloatArray:
    n = SAMPLES
    if name == "white":
        return white(n, 1.0, 1.0, rng)
    if name == "walk":
        return walk(n, 1.0, 1.0, rng)
    if name == "flicker":
        return flicker(n, 1.0, rng)
    if name == "mix":
        return white(n, 1.0, 1.0, rng) + walk(n, 1.0, 3e-6**0.5, rng)
    if name in ("quantised", "qn"):
        return quantised(n, 1.0, 1.0, rng) + (name == "qn") * white(n, 1.0, 0.1, rng)
    return white(n, 1.0, 1.0, rng) + flicker(n, 2e-3**0.5, rng)


def main(count: int, first: int) -> None:
    factors = np.unique([round(SAMPLES / s) for s in SHARES])
    for kind in ("overlapping", "hadamard"):
        for name in ("white", "walk", "flicker", "mix", "nb", "quantised", "qn"):
            held: dict[int, list[bool]] = {}
            for seed in range(first, first + count):
                x = signal(name, np.random.default_rng(seed))
                # a whole curve: the slope at long times comes from its neighbours
                taus = np.unique(np.round(np.geomspace(1, SAMPLES / 2.1, 70)))
                curve = allan_deviation(x, 1.0, np.union1d(taus, factors), kind)  # type: ignore[arg-type]
                real = np.sqrt(truth(name, curve.factors.astype(float), kind))
                inside = (curve.lower <= real) & (real <= curve.upper)
                for m, ok in zip(curve.factors.tolist(), inside.tolist(), strict=True):
                    if m in factors:
                        held.setdefault(m, []).append(ok)
            shares = {
                f"T/{SAMPLES / m:.3g}": round(100 * float(np.mean(v))) for m, v in held.items()
            }
            print(kind, name, shares, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
