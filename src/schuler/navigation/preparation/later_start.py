"""A start that later motion contradicts, taken back.

Fixes that are wrong while a drive begins give it a wrong heading of which the filter is sure: it
stays wrong for the whole drive. Where a trial of the drive disagrees with GNSS, the attitude is
found once more in later motion. If the first one, carried there by the gyros, is another, and the
drive fits GNSS from there on, it begins there, and it is said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.diagnosis import CLEARLY, DOUBTFUL, Trial
from schuler.navigation.preparation.moving_start import attitude_history, really_moves
from schuler.navigation.preparation.setup import RunSetup
from schuler.rotations import dcm_from_euler
from schuler.screening.screen import Finding

LATER = (40.0, 120.0)
"""Seconds of motion after which the attitude is looked for once more."""
LEFT = 60.0
"""Seconds that the drive goes on after that at least."""
ANOTHER = np.radians(15.0)
"""Difference of headings beyond which a start is another one, and in standard deviations."""
DEVIATIONS = 4.0
CONVINCING = 60.0
"""Gain of log-likelihood of the whole drive at which its heading is believed."""
TURNED_SD = np.radians(10.0)


@dataclass(frozen=True, slots=True, eq=False)
class LaterStart:
    """Where a drive begins instead, with what attitude, and what to say of it."""

    moment: float
    alignment: Alignment
    finding: Finding


def later_start(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    found: Trial,
    align_one: Callable[[ImuRecording], Alignment],
    tried: Callable[[ImuRecording, Alignment], Trial],
) -> LaterStart | None:
    """Return a start that later motion tells where it contradicts the first one."""
    if setup.settings.heading is not None or gnss.velocity is None:
        return None
    offset = setup.offsets.velocity
    moving = gnss.time[really_moves(gnss)] + offset
    moving = moving[moving > imu.time[0]]
    for moment in (moving[:1] + np.array(LATER)).tolist() if moving.size else ():
        if moment > imu.time[-1] - LEFT:
            break
        part = imu.between(moment, np.inf)
        try:
            other = align_one(part)
        except NavigationError:
            continue
        change, sd = _contradiction(imu, setup.alignment, float(part.time[0]), other)
        if abs(change) < max(ANOTHER, DEVIATIONS * sd):
            continue
        if tried(part, other).misfit < min(DOUBTFUL, CLEARLY * found.misfit):
            finding = Finding(
                "start",
                "warning",
                f"what follows contradicts the heading found at the start, by "
                f"{np.degrees(abs(change)):.0f} deg: the first "
                f"{part.time[0] - imu.time[0]:.0f} s are left out",
                value=change,
                cure="look at the first fixes: they show another motion than the IMU felt",
            )
            return LaterStart(moment, other, finding)
    return None


def _contradiction(
    imu: ImuRecording, start: Alignment, moment: float, other: Alignment
) -> tuple[float, float]:
    """Heading by later motion over that which the gyros carry from the start, and its sd."""
    before = imu.between(-np.inf, moment)
    step = np.diff(before.time, prepend=before.time[0])[:, None]
    turned = attitude_history((before.gyro - start.gyro_bias) * step)
    turn = other.rotation @ (start.rotation @ turned[-1]).T
    drift = (start.gyro_bias_sd or 0.0) * before.duration
    sd = float(np.sqrt(start.heading_sd**2 + other.heading_sd**2 + drift**2))
    return float(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])), sd


def turned_start(
    alignment: Alignment, found: Trial, tried: Callable[[Alignment], Trial]
) -> tuple[Alignment, Finding] | None:
    """Return the start with the heading that the whole drive tells, where it is another one.

    The motion that tells a heading first may be too short for it, with fixes seconds apart.
    """

    def turned(angle: float) -> Alignment:
        rotation = dcm_from_euler(0.0, 0.0, angle) @ alignment.rotation
        return replace(alignment, rotation=rotation)

    coarse = np.radians(np.arange(30.0, 360.0, 30.0))
    best = max(coarse.tolist(), key=lambda a: tried(turned(a)).log_likelihood)
    fine = best + np.radians(np.arange(-15.0, 16.0, 5.0))
    best = max(fine.tolist(), key=lambda a: tried(turned(a)).log_likelihood)
    trial = tried(turned(best))
    gain = trial.log_likelihood - found.log_likelihood
    if trial.misfit > DOUBTFUL or trial.misfit > CLEARLY * found.misfit or gain < CONVINCING:
        return None
    angle = float(np.degrees(np.arctan2(np.sin(best), np.cos(best))))
    finding = Finding(
        "start",
        "warning",
        f"the heading that the first motion told is off by {abs(angle):.0f} deg, as the rest of "
        "the drive tells: turned by as much",
        value=angle,
        cure="give the heading with --heading if you know it",
    )
    return replace(turned(best), heading_sd=TURNED_SD, method="by the whole drive"), finding
