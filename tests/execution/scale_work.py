"""Pieces of work for the tests; other processes import them by name."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def noise(seed: int) -> dict[str, NDArray[np.float64]]:
    """A few numbers of a seed."""
    return {"mean": np.asarray(np.random.default_rng(seed).normal(size=100).mean())}


def noise_after(seed: int, seconds: float, folder: str) -> dict[str, NDArray[np.float64]]:
    """The same, slowly, with a trace of the process that did it."""
    (Path(folder) / f"{os.getpid()}-{seed}").touch()
    time.sleep(seconds)
    return noise(seed)


def die_once(seed: int, folder: str) -> dict[str, NDArray[np.float64]]:
    """The same, but the first process that tries seed 3 is gone."""
    trace = Path(folder) / "died"
    if seed == 3 and not trace.exists():
        trace.touch()
        os._exit(9)
    return noise(seed)


def threads(_seed: int) -> dict[str, NDArray[np.float64]]:
    """How many threads linear algebra was told to take."""
    return {"threads": np.asarray(float(os.environ["OPENBLAS_NUM_THREADS"]))}


def refuse(seed: int) -> dict[str, NDArray[np.float64]]:
    """A piece of work that cannot be done."""
    raise ValueError(f"seed {seed} is refused")
