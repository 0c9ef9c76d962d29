"""Whether the drive bears out its start and what is known of the vehicle.

An IMU that did not feel what GNSS saw stops a drive (a slip of axes); a wrong start is left out.
Constraints are judged by outages: GNSS is thinned to one fix in ten and in thirty seconds, and the
fixes met after them say whether constraints were likely as they are, wider, without zero
velocities, or not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.aiding.vehicle import VehicleConstraint
from schuler.navigation.engine import InitialState
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.innovation_likelihood import InnovationSequence, slower_imu, thin
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.diagnosis import (
    BAD,
    CLEARLY,
    DOUBTFUL,
    LONGEST,
    Trial,
    find_slip,
    poor_gyros,
    try_drive,
)
from schuler.navigation.preparation.later_start import later_start, turned_start
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.vibration import level_at, vibration_level
from schuler.screening.screen import Finding


def require_fit(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    align_one: Callable[[ImuRecording, float, bool, float], Alignment],
) -> tuple[ImuRecording, RunSetup]:
    """Stop when the IMU cannot have felt what GNSS saw and a slip explains it; say it if none.

    A start that later motion contradicts is left out.
    """
    if gnss.velocity is None:
        return imu, setup
    part = imu.between(float(imu.time[0]), float(imu.time[0]) + LONGEST)
    restarts = [r for r in setup.restarts(gnss) if r[0] < part.time[-1] - 1.0]
    offset = setup.offsets.velocity

    def tried(
        recording: ImuRecording,
        alignment: Alignment,
        later: Sequence[tuple[float, InitialState]],
        known: SensorErrorModel = setup.model,
    ) -> Trial:
        state = replace(setup, alignment=alignment).initial_state(recording, gnss)
        return try_drive(
            recording,
            gnss,
            state,
            later,
            gyro_bias=alignment.gyro_bias,
            lever_arm=setup.lever_arm,
            velocity_offset=offset,
            known=known,
        )

    trial = tried(part, setup.alignment, restarts)
    if trial.misfit < DOUBTFUL:
        return imu, setup
    first = part.between(float(part.time[0]), setup.condition.first_break)
    here = tried(first, setup.alignment, ())
    later = later_start(
        first,
        gnss,
        setup,
        here,
        lambda other: align_one(other, offset, False, 1.0),
        lambda other, start: tried(other, start, ()),
    )
    if later is not None:
        begun = replace(setup.telling(later.finding), alignment=later.alignment)
        return imu.between(later.moment, np.inf), begun
    if setup.settings.heading is None:
        turned = turned_start(setup.alignment, here, lambda other: tried(first, other, ()))
        if turned is not None:
            return imu, replace(setup.telling(turned[1]), alignment=turned[0])
    _require_no_slip(
        imu.name,
        first,
        here,
        lambda other, worst: tried(other, align_one(other, offset, True, worst), ()),
        lambda: tried(first, setup.alignment, (), poor_gyros(setup.model)),
    )
    if trial.misfit < BAD:
        return imu, setup
    return imu, setup.telling(_disagreement(trial.misfit))


def _require_no_slip(
    name: str,
    first: ImuRecording,
    here: Trial,
    again: Callable[[ImuRecording, float], Trial],
    poor: Callable[[], Trial],
) -> None:
    """Stop where the usual slip of axes or units explains the drive; `again` takes a worst fit."""
    # a start that leaves twice what the whole drive may leave is not worth a longer look
    hopeless = max(1.0, 2.0 * CLEARLY * here.misfit)
    slip = find_slip(first, here, lambda other: again(other, hopeless), poor)
    if slip is not None:
        raise NavigationError(
            f"the IMU did not feel what GNSS saw; it would have if {slip.name}",
            expected="right-handed axes, rates in rad/s and specific force in m/s^2",
            cure=slip.cure,
            where=name,
        )


def _disagreement(misfit: float) -> Finding:
    return Finding(
        "disagreement",
        "warning",
        "IMU and GNSS do not fit each other, even with forgiving noise (innovations "
        f"{np.sqrt(misfit):.1f} times what they should be)",
        value=misfit,
        cure="check time offset, lever arm, axes and units",
    )


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
