"""Clocks of IMU and receiver that run at different speeds, by the innovations of a whole drive.

A quartz of a few cents is off by some ten parts in a million: after half an hour its stamps are
late by as many hundredths of a second, which a car on its way turns into a metre. One time offset
for the whole drive leaves a position error along the way that grows from its middle to both ends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.innovation_likelihood import slower_imu, thin
from schuler.navigation.preparation.setup import RunSetup, TimeOffsets
from schuler.navigation.run_findings import FEWEST_FIXES, SURE_CAUSE, Dependence, regression
from schuler.navigation.tuning.likelihood import innovations
from schuler.screening.screen import Finding
from schuler.types import FloatArray

INTERVAL = 2.0
"""Seconds between fixes that judge: what stamps do adds up over them."""
STEP = 0.01
"""Of the offset, s."""
LEAST_LATE = 0.003
"""Seconds at the ends of a drive below which stamps are left alone."""
MOST = 1e-3
"""Share that no clock is off by."""
GRID, MARGIN = 10.0, 30.0
"""Seconds between moments that are tried for a jump, and from the ends of a drive."""
LEAST_JUMP, PLAINER = 0.02, 1.15
"""Seconds, and how much more of the innovations a jump has to explain than a drift."""


@dataclass(frozen=True, slots=True)
class ClockDrift:
    """How much the clock of an IMU loses against that of GNSS."""

    share: float  # seconds a second; positive: the stamps of the IMU fall behind.
    about: float  # IMU time that stays as it is, s

    def corrected(self, imu: ImuRecording) -> ImuRecording:
        """Return a recording on a clock as fast as that of GNSS."""
        return replace(imu, time=imu.time + self.share * (imu.time - self.about))

    def finding(self, imu: ImuRecording) -> Finding:
        """Say what was put right."""
        reach = abs(self.share) * max(self.about - imu.time[0], imu.time[-1] - self.about)
        slow = "slower" if self.share > 0.0 else "faster"
        return Finding(
            "clock drift",
            "warning",
            f"the clock of the IMU is {1e6 * abs(self.share):.0f} parts in a million {slow} than "
            f"that of GNSS: its stamps are put right, by up to {1e3 * reach:.0f} ms at the ends",
            value=self.share,
        )


def find_clock_drift(imu: ImuRecording, gnss: GnssRecording, setup: RunSetup) -> ClockDrift | None:
    """Return the drift that the innovations of a drive show, where they are sure of one.

    What a time offset does to each innovation is told by a second run with another one; a drift
    does so in proportion to the time from the middle. Raises where stamps jump instead.
    """
    slow, fixes = slower_imu(imu), [thin(gnss, INTERVAL)]
    if fixes[0].size < FEWEST_FIXES:
        return None
    base = innovations(slow, fixes, setup)
    known = setup.offsets
    late = TimeOffsets(known.position + STEP, known.velocity + STEP)
    moved = innovations(slow, fixes, replace(setup, offsets=late))
    # a fix near a break may be met by one of them only
    _, one, other = np.intersect1d(base.key, moved.key, return_indices=True)
    seen = _Seen(
        base.value[one],
        np.sqrt(base.variance[one]),
        base.time[one],
        (moved.value[other] - base.value[one]) / STEP,
    )
    about = float(0.5 * (gnss.time[0] + gnss.time[-1]))
    drift = seen.regression(seen.time - about)
    share = float(drift.size[0])
    reach = abs(share) * float(gnss.time[-1] - about)
    if drift.deviations < SURE_CAUSE or reach < LEAST_LATE:
        return None
    _require_no_jump(seen, gnss, drift.share)
    return None if abs(share) > MOST else ClockDrift(share, about)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Innovations (k,), their standard deviations and times, and what a second of offset does."""

    value: FloatArray
    sd: FloatArray
    time: FloatArray
    effect: FloatArray

    def regression(self, shape: FloatArray) -> Dependence:
        """How they hang on an offset that changes like this; what a constant one does is none."""
        shown, weight = self.effect * shape, self.effect / self.sd**2
        constant = float((weight * shown).sum() / max((weight * self.effect).sum(), 1e-12))
        shown = shown - constant * self.effect
        return regression(self.value[:, None], self.sd[:, None], shown[:, None, None])


def _require_no_jump(seen: _Seen, gnss: GnssRecording, share: float) -> None:
    """Stop where a jump of the stamps explains far more than a drift (its share) does."""
    moments = np.arange(gnss.time[0] + MARGIN, gnss.time[-1] - MARGIN, GRID)
    if not moments.size:
        return
    found = [seen.regression((seen.time > t).astype(np.float64)) for t in moments]
    best = int(np.argmax([one.share for one in found]))
    jump, moment = float(found[best].size[0]), float(moments[best])
    if found[best].share < PLAINER * share or abs(jump) < LEAST_JUMP:
        return
    raise NavigationError(
        f"the clocks of IMU and GNSS jump against each other by {abs(jump):.2f} s at about "
        f"{moment:.0f} s, by the innovations before and after it",
        expected="one time axis for the whole drive",
        cure=f"put the stamps right, or cut both recordings at {moment:.0f} s and navigate the "
        "parts by themselves",
        where=gnss.name,
    )
