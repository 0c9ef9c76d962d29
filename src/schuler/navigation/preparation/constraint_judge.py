"""How far what is known of a vehicle is to be believed, by the fixes of the drive itself.

GNSS is thinned to one fix in ten and in thirty seconds, which makes an outage between any two. The
fixes that are met after them say under which constraints they were likely: as they are, wider,
without zero velocities, or with none at all.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.vehicle import VehicleConstraint
from schuler.navigation.innovation_likelihood import InnovationSequence, slower_imu, thin
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.vibration import level_at, vibration_level
from schuler.screening.screen import Finding

OUTAGES = (10.0, 30.0)
"""Seconds between fixes."""
FEWEST_FIXES = 10
WIDER = (2.0, 4.0, 8.0)
"""Factors on the deviations of rolling straight ahead that are tried."""
CONVINCING = 8.0
"""Gain of log-likelihood for which constraints are left out; wider ones need no more than none."""
DISHONEST = 2.0
"""Mean clipped square of normalised innovations after outages that is told."""


def judge_constraints(
    imu: ImuRecording, gnss: GnssRecording, plain: RunSetup, aided: RunSetup
) -> RunSetup:
    """Return the setup with constraints as far as the drive believes them, and say so."""
    thinned = [g for g in (thin(gnss, s) for s in OUTAGES) if g.size >= FEWEST_FIXES]
    if aided.vehicle is None or not thinned:
        return aided
    slow = slower_imu(imu)
    level = level_at(slow.time, imu, vibration_level(imu)) if aided.vibration.active else None

    def tried(setup: RunSetup) -> InnovationSequence:
        return innovations(slow, thinned, setup, level)

    now, told, best = aided, "", tried(aided)
    for trial, words in _weaker(plain, aided):
        found = tried(trial)
        kept = trial.vehicle is not None and trial.vehicle.constraints == aided.vehicle.constraints
        if found.log_likelihood > best.log_likelihood + (0.0 if kept else CONVINCING):
            now, best, told = replace(trial, condition=aided.condition), found, words
    return now.telling(*_findings(told, best))


def _weaker(plain: RunSetup, aided: RunSetup) -> Iterator[tuple[RunSetup, str]]:
    """Yield setups whose constraints say less and less, and what to say of them."""
    vehicle = aided.vehicle
    assert vehicle is not None
    rolling, standing = vehicle.first_state >= 0, "zupt" in vehicle.constraints
    for factor in WIDER if rolling else ():
        wider = replace(
            vehicle,
            lateral_sd=vehicle.lateral_sd * factor,
            vertical_sd=vehicle.vertical_sd * factor,
        )
        yield replace(aided, vehicle=wider), f"nhc is believed {factor:g} times less than it was"
    if rolling and standing:
        left = tuple(c for c in vehicle.constraints if c != "zupt")
        only = replace(vehicle, constraints=left)
        yield replace(aided, vehicle=only), "zero velocities (zupt) are switched off"
    if "wheel" in vehicle.constraints:
        return
    if rolling and standing:
        still = VehicleConstraint(("zupt",), np.eye(3), -1, standing=vehicle.standing)
        yield replace(plain, vehicle=still), "nhc is switched off"
    words = " and ".join(vehicle.constraints)
    yield plain, f"{words} {'are' if rolling and standing else 'is'} switched off"


def _findings(told: str, found: InnovationSequence) -> list[Finding]:
    findings = []
    if told:
        findings.append(
            Finding(
                "constraints",
                "warning",
                f"{told}: after outages of {OUTAGES[0]:.0f} and {OUTAGES[1]:.0f} s made on the "
                "drive itself GNSS is more likely that way",
            )
        )
    if found.misfit > DISHONEST:
        findings.append(
            Finding(
                "constraints",
                "warning",
                f"after outages made on the drive itself GNSS is {np.sqrt(found.misfit):.1f} times "
                "as far off as the filter claims",
                value=found.misfit,
                cure="leave out --aid, or check mounting and lever arm",
            )
        )
    return findings
