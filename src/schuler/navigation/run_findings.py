"""What the innovations of a run show that a user should know, and what they depend on.

With a model that is right, innovations are white and depend on nothing. What they still show of
the turns, the speed and the attitude of the body is the print of a cause: an antenna elsewhere
moves with the attitude, a clock that is late with the velocity, a gyro's scale with the turns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import Innovations
from schuler.navigation.aiding.schedule import KIND_NAMES, VEHICLE_VELOCITY, ZERO_VELOCITY
from schuler.navigation.engine import SampleOutputs
from schuler.screening.screen import Finding
from schuler.types import FloatArray, IntArray

CONSTRAINTS = KIND_NAMES[VEHICLE_VELOCITY : ZERO_VELOCITY + 1]
"""Kinds of which more than a few refusals are told."""
TOGETHER = 5.0
"""Refusals no further apart belong together, s."""
MOST_INTERVALS = 20
FEW = 0.05
"""Share of refused measurements that good runs have as well: fixes are not always what they say."""
IN_A_ROW = 10
"""Refusals within seconds of each other that are no chance: GNSS and filter disagree for long."""
MANY = 0.3
"""Share of refused measurements at which a solution is not to be believed."""
DISHONEST = 1.5
"""Normalised innovation squared over its degrees at which the filter's claims are doubted."""
MODEST = 0.85
"""The same, below which a receiver's errors are not the white noise that they are taken for."""
LAGS = 30
"""Epochs over which innovations of white errors have nothing in common."""
FEWEST_EPOCHS = 60
SURE = 4.0
"""Standard errors at which innovations are not white, or not as large as claimed."""


def findings_of_run(innovations: Innovations, *, split: bool = False) -> tuple[Finding, ...]:
    """Say which measurements were refused, and whether the filter is honest.

    `split`: whether errors of GNSS that last are states of the filter already.
    """
    kinds = [k for k in innovations.kinds if k.startswith("GNSS")]
    found = [f for k in kinds for f in _refusals(innovations.of_kind(k), k)]
    for kind in (k for k in innovations.kinds if k in CONSTRAINTS):
        part = innovations.of_kind(kind)
        found += [f for f in _refusals(part, kind) if part.accepted.mean() < 1.0 - FEW]
    gnss = innovations.gnss
    asked = int((gnss.degrees > 0).sum())
    refused = int((~gnss.accepted & (gnss.degrees > 0)).sum())
    if refused > MANY * max(asked, 1):
        found.append(
            Finding(
                "claims",
                "error",
                f"the solution is not to be believed: {refused} of {asked} GNSS measurements do "
                "not fit it",
                value=refused / asked,
                cure="check axes, units, lever arm and time offset; a noise model of a static log "
                "may need --tune-noise",
            )
        )
    elif gnss.mean_nis > DISHONEST:
        found.append(
            Finding(
                "claims",
                "warning",
                f"innovations of GNSS are {np.sqrt(gnss.mean_nis):.1f} times as large as the "
                "filter claims: it is surer of itself than it should be",
                value=gnss.mean_nis,
                cure="let the drive tune the noise (--tune-noise), and check lever arm, time "
                "offset, axes and units",
            )
        )
    else:
        found += _lasting_errors(innovations, split)
    return tuple(found)


def whiteness(part: Innovations) -> float:
    """Sum of the horizontal autocorrelations over `LAGS` epochs, in its standard errors.

    About a standard normal where the innovations of a filter are white, as those of one whose
    model is right are (Bar-Shalom, section 5.4).
    """
    used = part.accepted & np.isfinite(part.sd[:, :2]).all(axis=1)
    x = part.value[used, :2] / part.sd[used, :2]
    lags = min(LAGS, len(x) // 4)
    power = float(np.sum(x * x))
    if len(x) < FEWEST_EPOCHS or power <= 0.0:
        return 0.0
    total = sum(float(np.sum(x[k:] * x[:-k])) for k in range(1, lags + 1)) / power
    return total * float(np.sqrt(x.size / lags))


def _lasting_errors(innovations: Innovations, split: bool) -> list[Finding]:
    """Errors of GNSS that last show as innovations that are alike, and smaller than claimed."""
    if "GNSS position" not in innovations.kinds:
        return []
    part = innovations.of_kind("GNSS position")
    nis, degrees, alike = part.mean_nis, int(part.degrees.sum()), whiteness(part)
    small = nis < MODEST and (1.0 - nis) > SURE * np.sqrt(2.0 / max(degrees, 1))
    if degrees < 3 * FEWEST_EPOCHS or not (small or alike > SURE):
        return []
    seen = f"normalised squares of {nis:.2f}, where 1 is expected"
    if alike > SURE:
        seen = f"alike over {LAGS} epochs by {alike:.0f} standard errors, " + seen
    cure = "let part of what the receiver claims last (--gnss-correlated auto)"
    if split and alike <= SURE:
        text = f"innovations of GNSS positions are smaller than they should be ({seen}): "
        text += "the receiver smooths its fixes, or claims too much"
        return [Finding("lasting errors", "info", text, value=nis)]
    if split:
        cure = "check lever arm, time offset and axes; --tune-noise where the IMU shakes"
    return [
        Finding(
            "lasting errors",
            "warning",
            f"innovations of GNSS positions are not those of white noise ({seen}): errors that "
            "last are taken for noise, and the claimed position is too sure",
            value=alike,
            cure=cure,
        )
    ]


def _refusals(part: Innovations, kind: str) -> list[Finding]:
    """One line on the refusals of a kind."""
    asked = part.degrees > 0
    refused = np.flatnonzero(~part.accepted & asked)
    if not refused.size:
        return []
    apart = np.flatnonzero(np.diff(part.time[refused]) > TOGETHER) + 1
    groups = np.split(refused, apart)
    longest = max(groups, key=len)
    most = float(np.nanmax(np.abs(part.value[refused])))
    unit = "m/s" if "velocity" in kind else "m"
    name = kind.replace("velocity", "velocities") if "velocity" in kind else f"{kind}s"
    count, of = refused.size, int(asked.sum())
    text = f"{count} of {of} {name} refused, up to {most:.3g} {unit} from what was expected"
    if count == 1:
        text += f" (at {part.time[refused[0]]:.2f} s)"
    elif len(groups) == 1:
        text += f" (from {part.time[refused[0]]:.2f} to {part.time[refused[-1]]:.2f} s)"
    else:
        text += f" (most of them, {longest.size}, from {part.time[longest[0]]:.2f} s on)"
    cure = "look at these times: GNSS is wrong there, or the filter is, by what it is aided with"
    return [
        Finding(
            "refused",
            "info" if count <= FEW * of and longest.size < IN_A_ROW else "warning",
            text,
            (),
            tuple((float(part.time[g[0]]), float(part.time[g[-1]])) for g in groups)[
                :MOST_INTERVALS
            ],
            most,
            cure="" if longest.size < IN_A_ROW else cure,
        )
    ]


SURE_CAUSE = 6.0
"""Standard errors; they are for white innovations, which those of real drives never quite are."""
LEAST_ARM = 0.1
LEAST_LAG = 0.01
LEAST_SHARE = 0.02
"""Sizes in m, s, and share of the variance below which nothing is said."""
FEWEST_FIXES = 60


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
    if used.sum() < FEWEST_FIXES:
        return _turning(innovations, time, samples)
    stamp, value, sd = part.time[used], part.value[used], part.sd[used]
    at = np.clip(np.searchsorted(time, stamp), 0, time.size - 1)
    # the filter follows what stays: only changes since the fix before show
    turned, fresh = _felt(samples.rotation, at), np.diff(stamp) < 10.0
    value, sd = value[1:][fresh], sd[1:][fresh]
    arm = regression(value, sd, turned[fresh])
    lag = regression(value, sd, _felt(samples.velocity, at)[fresh][..., None])
    found = []
    size = float(np.linalg.norm(arm.size))
    if arm.deviations > SURE_CAUSE and size > LEAST_ARM and arm.share > LEAST_SHARE:
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
    if (
        lag.deviations > SURE_CAUSE
        and abs(late) > LEAST_LAG
        and lag.share > max(LEAST_SHARE, arm.share)
    ):
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


def _felt(values: FloatArray, at: IntArray) -> FloatArray:
    """Changes that the IMU felt between fixes.

    Not what the filter corrected at the fix: that is in proportion to its innovation.
    """
    return np.asarray(values[np.maximum(at[1:] - 1, at[:-1])] - values[at[:-1]])


def _turning(
    innovations: Innovations, time: FloatArray, samples: SampleOutputs
) -> tuple[Finding, ...]:
    """Say whether velocities go astray after turns, as with a wrong scale of the gyros."""
    if "GNSS velocity" not in innovations.kinds or not samples.position.size:
        return ()
    part = innovations.of_kind("GNSS velocity")
    used = part.accepted & np.isfinite(part.sd[:, :2]).all(axis=1)
    if used.sum() < FEWEST_FIXES:
        return ()
    stamp, value, sd = part.time[used], part.value[used, :2], part.sd[used, :2]
    at = np.clip(np.searchsorted(time, stamp), 0, time.size - 1)
    forward = samples.rotation
    heading = np.unwrap(np.arctan2(forward[:, 1, 0], forward[:, 0, 0]))
    speed = samples.velocity[at][:, :2]
    turned = _felt(heading, at)
    fresh = np.diff(stamp) < 10.0
    # a heading that is wrong by a share of the turn turns the velocity
    across = np.stack([-speed[1:, 1], speed[1:, 0]], axis=1) * turned[:, None]
    seen = regression(value[1:][fresh], sd[1:][fresh], across[fresh][..., None])
    scale = float(seen.size[0])
    if not (seen.deviations > SURE_CAUSE and abs(scale) > LEAST_SHARE and seen.share > LEAST_SHARE):
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
