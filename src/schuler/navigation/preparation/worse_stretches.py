"""Stretches in which GNSS positions are worse than the receiver says, by the rest of the drive.

Between houses a receiver may wander by tens of metres for minutes and claim one metre. A robust
filter believes some of that; its claim believes all. Where innovations of a stretch are many times
what they are elsewhere, and fit once positions there are believed less, they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.schedule import POSITION, VELOCITY
from schuler.navigation.innovation_likelihood import InnovationSequence, slower_imu, thin
from schuler.navigation.preparation.gaps import WorseStretch
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.vibration import level_at, vibration_level
from schuler.screening.screen import Finding
from schuler.types import BoolArray, FloatArray

BLOCK = 10.0
"""Seconds over which normalised squares are averaged."""
BAD, FITTING = 4.0, 3.0
"""Such means over that of the usual block, at which a stretch is bad and at which it fits."""
CLIPPED = 100.0
"""Largest square that counts: single wild fixes are another matter."""
FEWEST_BLOCKS, FEWEST_USUAL = 2, 6
LEAST_USUAL = 0.1
ROUNDS = 5
LEAST_GAIN = 30.0
"""Nats that wider claims have to gain."""


@dataclass(frozen=True, slots=True, eq=False)
class _Blocks:
    """Means of the squares of positions and velocities by block, NaN where there are none."""

    position: FloatArray
    velocity: FloatArray

    @classmethod
    def of(cls, found: InnovationSequence, fixes: GnssRecording) -> _Blocks:
        kind = found.key // 3 // fixes.size
        block = ((found.time - fixes.time[0]) // BLOCK).astype(np.int64).clip(0)
        square = np.minimum(found.value**2 / found.variance, CLIPPED)
        count = int((fixes.time[-1] - fixes.time[0]) // BLOCK) + 1
        means = []
        for one in (POSITION, VELOCITY):
            here = (kind == one) & (block < count)
            number = np.bincount(block[here], minlength=count)
            total = np.bincount(block[here], square[here], minlength=count)
            means.append(np.where(number > 0, total / np.maximum(number, 1), np.nan))
        return cls(*means)

    @property
    def usual(self) -> float:
        """Of positions: less than one where noise was tuned to what is bad elsewhere."""
        return max(float(np.nanmedian(self.position)), LEAST_USUAL)

    def bad(self, least: float = 0.0) -> BoolArray:
        """Blocks whose positions are far worse than those of the usual block."""
        return np.asarray(self.position > max(BAD * self.usual, least))

    def fits(self, where: BoolArray) -> bool:
        """Whether positions and velocities of some blocks are as good as elsewhere."""
        for means in (self.position, self.velocity):
            inside, outside = means[where], means[~where]
            if np.isfinite(inside).any() and np.isfinite(outside).any():
                usual = max(float(np.nanmedian(outside)), 1.0)
                if float(np.nanmean(inside)) > FITTING * usual:
                    return False
        return True


def find_worse_stretches(
    imu: ImuRecording, gnss: GnssRecording, setup: RunSetup
) -> tuple[WorseStretch, ...]:
    """Return where positions are worse than claimed, and how bad they are; nothing if unsure.

    A stretch to the end of the drive does not count: an IMU that was knocked looks like that.
    """
    slow, fixes = slower_imu(imu), setup.condition.usable(thin(gnss, 1.0))
    level = level_at(slow.time, imu, vibration_level(imu)) if setup.vibration.active else None

    def judged(stretches: tuple[WorseStretch, ...]) -> tuple[_Blocks, float]:
        told = replace(setup, condition=replace(setup.condition, worse=stretches))
        found = innovations(slow, [fixes], told, level)
        return _Blocks.of(found, fixes), found.log_likelihood

    blocks, before = judged(())
    bad = _lasting(blocks.bad(BAD))
    seen, after, factor = blocks, before, np.ones(bad.size)
    stretches: tuple[WorseStretch, ...] = ()
    for _ in range(ROUNDS if bad.any() else 0):
        # what a filter that believes the first does to the others hides them at first
        bad = _lasting(bad | seen.bad())
        if not (bad & seen.bad()).any() or (~bad).sum() < FEWEST_USUAL or bad[-1]:
            break
        for a, b in _runs(bad):
            factor[a:b] = factor[a:b].max() * _share(seen, a, b)
        stretches = tuple(_stretch(a, b, fixes, factor[a]) for a, b in _runs(bad))
        seen, after = judged(stretches)
    if not stretches or bad[-1] or after - before < LEAST_GAIN or not seen.fits(bad):
        return ()
    return stretches


def findings_on(stretches: tuple[WorseStretch, ...]) -> tuple[Finding, ...]:
    """Say what was believed less."""
    return tuple(
        Finding(
            "worse GNSS",
            "warning",
            f"GNSS positions from {s.begin:.0f} to {s.end:.0f} s are far worse than the receiver "
            f"says: taken for no better than {s.sd[0]:.1f} m",
            (),
            ((s.begin, s.end),),
            float(s.sd[0]),
        )
        for s in stretches
    )


def _lasting(bad: BoolArray) -> BoolArray:
    """Fill single blocks between bad ones, and drop what is short."""
    filled = bad.copy()
    filled[1:-1] |= bad[:-2] & bad[2:]
    for a, b in _runs(filled):
        if b - a < FEWEST_BLOCKS:
            filled[a:b] = False
    return filled


def _runs(bad: BoolArray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[0], bad.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _share(blocks: _Blocks, a: int, b: int) -> float:
    """Factor on the standard deviations that these squares ask for."""
    asked = float(np.nanmean(blocks.position[a:b])) / blocks.usual
    return float(np.sqrt(max(asked, 1.0)))


def _stretch(a: int, b: int, fixes: GnssRecording, factor: float) -> WorseStretch:
    begin, end = fixes.time[0] + BLOCK * a, fixes.time[0] + BLOCK * b
    inside = (fixes.time >= begin) & (fixes.time <= end)
    assert fixes.position_sd is not None
    claimed: FloatArray = np.median(fixes.position_sd[inside], axis=0)
    return WorseStretch(float(begin), float(end), factor * claimed)
