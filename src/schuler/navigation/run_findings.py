"""What the innovations of a run show that a user should know."""

from __future__ import annotations

import numpy as np

from schuler.data import Innovations
from schuler.screening.screen import Finding

TOGETHER = 5.0
"""Refusals no further apart belong together, s."""
MOST_INTERVALS = 20
FEW = 0.05
"""Share of refused measurements that good runs have as well: fixes are not always what they say."""
MANY = 0.3
"""Share of refused measurements at which a solution is not to be believed."""
DISHONEST = 3.0
"""Normalised innovation squared over its degrees at which the filter's claims are doubted."""


def findings_of_run(innovations: Innovations) -> tuple[Finding, ...]:
    """Say which measurements were refused, and whether the filter is honest."""
    kinds = [k for k in innovations.kinds if k.startswith("GNSS")]
    found = [f for k in kinds for f in _refusals(innovations.of_kind(k), k)]
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
    return tuple(found)


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
    return [
        Finding(
            "refused",
            "info" if count <= FEW * of else "warning",
            text,
            (),
            tuple((float(part.time[g[0]]), float(part.time[g[-1]])) for g in groups)[
                :MOST_INTERVALS
            ],
            most,
        )
    ]
