"""Whether an IMU felt what GNSS saw: a slip of axes stops a drive, a wrong start is left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.engine import InitialState
from schuler.navigation.error_models.sensor_states import SensorErrorModel
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
