"""Sums of independent processes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import ModelError
from schuler.noise._checks import positive, samples
from schuler.noise.base import Process, StateSpace
from schuler.types import FloatArray


def _block_diagonal(blocks: Sequence[FloatArray]) -> FloatArray:
    size = sum(len(b) for b in blocks)
    out, k = np.zeros((size, size)), 0
    for block in blocks:
        out[k : k + len(block), k : k + len(block)] = block
        k += len(block)
    return out


def stack_state_spaces(dt: float, parts: Sequence[StateSpace]) -> StateSpace:
    """Put independent state spaces of one step side by side."""
    drifts = [p.drift for p in parts if p.drift is not None]
    diffusions = [p.diffusion for p in parts if p.diffusion is not None]
    continuous = len(drifts) == len(diffusions) == len(parts)
    return StateSpace(
        dt=positive(dt, "dt"),
        transition=_block_diagonal([p.transition for p in parts]),
        noise_covariance=_block_diagonal([p.noise_covariance for p in parts]),
        output=np.concatenate([np.zeros(0), *(p.output for p in parts)]),
        initial_covariance=_block_diagonal([p.initial_covariance for p in parts]),
        white_density=math.hypot(0.0, *(p.white_density for p in parts)),
        drift=_block_diagonal(drifts) if continuous else None,
        diffusion=_block_diagonal(diffusions) if continuous else None,
        names=tuple(name for p in parts for name in p.names),
    )


@dataclass(frozen=True, slots=True)
class ProcessSum(Process):
    """A sum of independent processes; write `WhiteNoise(...) + GaussMarkov(...)`.

    Parameters
    ----------
    parts : tuple of Process
        Sums among them are opened up. At least one.
    """

    parts: tuple[Process, ...]
    kind: ClassVar[str] = "sum"

    def __post_init__(self) -> None:
        flat = tuple(leaf for part in self.parts for leaf in part.components)
        if not flat:
            raise ModelError("a sum of no processes", expected="at least one process")
        object.__setattr__(self, "parts", flat)

    @property
    def components(self) -> tuple[Process, ...]:
        """The independent parts."""
        return self.parts

    @property
    def names(self) -> tuple[str, ...]:
        """A name for every part: its kind, numbered where a kind occurs more than once."""
        kinds = [p.kind for p in self.parts]
        return tuple(
            kind if kinds.count(kind) == 1 else f"{kind}_{kinds[: k + 1].count(kind)}"
            for k, kind in enumerate(kinds)
        )

    @property
    def parameters(self) -> dict[str, float]:
        """All numbers in SI, keys such as "gauss_markov.sigma" or "gauss_markov_2.sigma"."""
        return {
            f"{name}.{key}": value
            for name, part in zip(self.names, self.parts, strict=True)
            for key, value in part.parameters.items()
        }

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.allan_variance(tau) for p in self.parts))

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.psd(frequency, onesided=onesided) for p in self.parts))

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.sampled_psd(cycles, dt) for p in self.parts))

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Sum of the parts; each must have one."""
        return np.asarray(sum(p.autocovariance(lag) for p in self.parts))

    def state_space(self, dt: float) -> StateSpace:
        """The states of the parts, one after the other."""
        return stack_state_spaces(dt, [p.state_space(dt) for p in self.parts])

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Sum of independent draws, each with a child of `rng`."""
        total = np.zeros(samples(n, dt))
        for part, child in zip(self.parts, rng.spawn(len(self.parts)), strict=True):
            total += part.simulate(n, dt, child)
        return total
