"""Healthy rides of a motorcycle with four IMUs: does any sensor get taken out?

    python -m benchmarks.false_exclusions --hours 10

Rides of half an hour on a tetrahedron of 3 cm, noise of all sensors that swells threefold and of
each by a fifth of its own, turn-on biases and bias instability; default settings.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "arrays"))

import numpy as np
from riding_twins import ride

from schuler.arrays.detection.faults import detect_faults


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=10.0)
    parser.add_argument("--minutes", type=float, default=30.0, help="length of one ride")
    options = parser.parse_args()
    rides = max(1, round(options.hours * 60.0 / options.minutes))
    lines: list[str] = []
    shares = []
    for seed in range(rides):
        array, _ = ride(60.0 * options.minutes, 1000 + seed)
        found = detect_faults(array)
        lines += [f"ride {seed}: {r.text}" for r in found.records]
        shares.append([(s.exceedance(0.05), s.exceedance(0.01)) for s in found.sensors])
        print(f"ride {seed + 1} of {rides}: {len(found.records)} records", flush=True)
    mean = np.mean(shares, axis=0)
    print(f"{rides * options.minutes / 60:.1f} h, {len(lines)} false exclusions")
    print(f"exceedance at 5 % and 1 %: gyros {mean[0].round(4)}, accelerometers {mean[1].round(4)}")
    for text in lines:
        print(text)


if __name__ == "__main__":
    main()
