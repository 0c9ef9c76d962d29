"""What innovations of GNSS depend on, and so what is wrong with the run: arm, clock, scale.

With a model that is right, innovations are white and depend on nothing. What they still show of
the turns, the speed and the attitude of the body is the print of a cause: an antenna elsewhere
moves with the attitude, a clock that is late with the velocity, a gyro's scale with the turns.
Each is told by a regression on what it would do, in its standard errors, and with its size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import Innovations
from schuler.navigation.engine import SampleOutputs
from schuler.screening.screen import Finding
from schuler.types import FloatArray

SURE = 6.0
"""Standard errors; they are for white innovations, which those of real drives never quite are."""
LEAST_ARM = 0.1
LEAST_LAG = 0.01
LEAST_SHARE = 0.02
"""Sizes in m, s, and share of the variance below which nothing is said."""
FEWEST = 60


@dataclass(frozen=True, slots=True)
class Dependence:
    """A regression of innovations on what a cause would do."""

    size: FloatArray  # (p,): of the cause
    deviations: float  # root of its chi-square, corrected for its degrees
    share: float  # of the variance of the innovations that it explains


def regression(value: FloatArray, sd: FloatArray, effect: FloatArray) -> Dependence:
    """Regress innovations (k, c) with deviations (k, c) on effects (k, c, p)."""
    y = (value / sd).ravel()
    a = (effect / sd[..., None]).reshape(y.size, -1)
    normal = a.T @ a + 1e-12 * np.eye(a.shape[1])
    size: FloatArray = np.asarray(np.linalg.solve(normal, a.T @ y), dtype=np.float64)
    gain, whole, degrees = float(size @ normal @ size), float(y @ y), a.shape[1]
    left = max((whole - gain) / max(y.size - degrees, 1), 1e-12)
    sure = (gain / left - degrees) / np.sqrt(2.0 * degrees)
    return Dependence(size, float(np.sqrt(max(sure, 0.0) * np.sqrt(2.0))), gain / max(whole, 1e-12))


def causes(
    innovations: Innovations, time: FloatArray, samples: SampleOutputs
) -> tuple[Finding, ...]:
    """Say what innovations of positions depend on. time (n,) of the samples."""
    if "GNSS position" not in innovations.kinds or not samples.position.size:
        return ()
    part = innovations.of_kind("GNSS position")
    used = part.accepted & np.isfinite(part.sd).all(axis=1)
    if used.sum() < FEWEST:
        return _turning(innovations, time, samples)
    stamp, value, sd = part.time[used], part.value[used], part.sd[used]
    at = np.clip(np.searchsorted(time, stamp), 0, time.size - 1)
    rotation, velocity = samples.rotation[at], samples.velocity[at]
    # the filter follows what stays: only changes since the fix before show
    turned, fresh = np.diff(rotation, axis=0), np.diff(stamp) < 10.0
    value, sd = value[1:][fresh], sd[1:][fresh]
    arm = regression(value, sd, turned[fresh])
    lag = regression(value, sd, np.diff(velocity, axis=0)[fresh][..., None])
    found = []
    size = float(np.linalg.norm(arm.size))
    if arm.deviations > SURE and size > LEAST_ARM and arm.share > LEAST_SHARE:
        found.append(
            Finding(
                "lever arm",
                "warning",
                f"innovations of GNSS positions turn with the vehicle ({arm.deviations:.0f} "
                f"standard errors), as if the antenna were {size:.2f} m elsewhere: positions are "
                "claimed to no better than that",
                value=size,
                cure="let the drive find it (--lever-arm estimate), or measure it",
            )
        )
    late = float(lag.size[0])
    if lag.deviations > SURE and abs(late) > LEAST_LAG and lag.share > max(LEAST_SHARE, arm.share):
        found.append(
            Finding(
                "time offset",
                "warning",
                f"innovations of GNSS positions follow changes of velocity ({lag.deviations:.0f} "
                f"standard errors), as if stamps were off by {late:+.3f} s more",
                value=late,
                cure="leave out --time-offset: the drive finds it",
            )
        )
    return tuple(found) or _turning(innovations, time, samples)


def _turning(
    innovations: Innovations, time: FloatArray, samples: SampleOutputs
) -> tuple[Finding, ...]:
    """Say whether velocities go astray after turns, as with a wrong scale of the gyros."""
    if "GNSS velocity" not in innovations.kinds or not samples.position.size:
        return ()
    part = innovations.of_kind("GNSS velocity")
    used = part.accepted & np.isfinite(part.sd[:, :2]).all(axis=1)
    if used.sum() < FEWEST:
        return ()
    stamp, value, sd = part.time[used], part.value[used, :2], part.sd[used, :2]
    at = np.clip(np.searchsorted(time, stamp), 0, time.size - 1)
    forward = samples.rotation[at]
    heading = np.unwrap(np.arctan2(forward[:, 1, 0], forward[:, 0, 0]))
    speed = samples.velocity[at][:, :2]
    turned = np.diff(heading)
    fresh = np.diff(stamp) < 10.0
    # a heading that is wrong by a share of the turn turns the velocity
    across = np.stack([-speed[1:, 1], speed[1:, 0]], axis=1) * turned[:, None]
    seen = regression(value[1:][fresh], sd[1:][fresh], across[fresh][..., None])
    scale = float(seen.size[0])
    if not (seen.deviations > SURE and abs(scale) > LEAST_SHARE and seen.share > LEAST_SHARE):
        return ()
    return (
        Finding(
            "gyro scale",
            "warning",
            f"velocities go astray in turns ({seen.deviations:.0f} standard errors), as if gyros "
            f"were wrong by {100.0 * scale:+.1f} % of what they measure",
            value=scale,
            cure="calibrate the gyros (schuler calibrate), or check axes and mounting",
        ),
    )
