"""Moments at which an IMU became another one: knocked, slipped in its mount, or switched over.

Its biases or its axes are new, and what the filter has learnt of them is wrong. Innovations of
velocities grow there and stay large. A filter that starts anew, sensors and all, tells whether
that was it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.aiding.schedule import VELOCITY
from schuler.navigation.innovation_likelihood import InnovationSequence, slower_imu, thin
from schuler.navigation.preparation.alignment import align
from schuler.navigation.preparation.gaps import Restart
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.vibration import level_at, vibration_level
from schuler.screening.screen import Finding
from schuler.types import FloatArray

BEFORE, AFTER = 40.0, (5.0, 10.0, 40.0)
"""Seconds before and after a moment that are compared: noise tuned to a knock soon forgives it."""
LARGER = 4.0
"""Times that their mean squares grow."""
CLIPPED = 100.0
MARGIN = 40.0
"""Seconds from the ends of a drive, and between two knocks."""
UNSURE = 2.0
"""Seconds before a knock was noticed that are not used."""
LEAST_GAIN = 40.0
"""Nats that a new start has to gain: it has some fifteen states to forget."""
LEAST_PROMISE = 25.0
"""And with noise that was tuned to the knock."""


def squares_of(imu: ImuRecording, gnss: GnssRecording, setup: RunSetup) -> InnovationSequence:
    """Innovations of a drive with one fix a second, in order of time."""
    slow, fixes = slower_imu(imu), setup.condition.usable(thin(gnss, 1.0))
    level = level_at(slow.time, imu, vibration_level(imu)) if setup.vibration.active else None
    found = innovations(slow, [fixes], setup, level)
    return found.select(np.argsort(found.time, kind="stable"))


def moment_of_knock(
    found: InnovationSequence, gnss: GnssRecording, setup: RunSetup
) -> float | None:
    """Return from when on velocities fit far worse than before; None where they never do."""
    size = setup.condition.usable(thin(gnss, 1.0)).size
    own = found.select(found.key // 3 // size == VELOCITY)
    if own.value.size < 60:
        return None
    square = np.minimum(own.value**2 / own.variance, CLIPPED)
    total = np.concatenate([[0.0], np.cumsum(square)])
    first, last = np.searchsorted(own.time, [own.time[0] + MARGIN, own.time[-1] - MARGIN])
    moments = np.arange(first, last)
    moments = moments[np.diff(own.time[moments], prepend=-np.inf) > 0.0]
    if not moments.size:
        return None
    before = np.searchsorted(own.time, own.time[moments] - BEFORE)
    usual = np.maximum((total[moments] - total[before]) / np.maximum(moments - before, 1), 0.5)
    most, moment = 0.0, None
    for seconds in AFTER:
        behind = np.searchsorted(own.time, own.time[moments] + seconds)
        now = (total[behind] - total[moments]) / np.maximum(behind - moments, 1)
        ratio = np.maximum(now / usual, 1.0)
        # a change of variance by this ratio, in nats
        gain = 0.5 * (behind - moments) * (ratio - 1.0 - np.log(ratio))
        gain[(ratio < LARGER) | (now < LARGER)] = 0.0
        best = int(np.argmax(gain))
        if gain[best] > max(most, LEAST_GAIN):
            most = float(gain[best])
            moment = _change(own.time, square, float(own.time[moments[best]]), seconds)
    return moment


def _change(time: FloatArray, square: FloatArray, about: float, seconds: float) -> float:
    """The likeliest moment of a change of variance, between 10 s before and some after."""
    first, last = np.searchsorted(time, [about - 10.0, about + seconds])
    time, total = time[first:last], np.concatenate([[0.0], np.cumsum(square[first:last])])
    places = np.arange(3, time.size - 2)
    before = np.maximum(total[places] / places, 0.5)
    behind = (total[-1] - total[places]) / (time.size - places)
    cost = places * np.log(before) + (time.size - places) * np.log(behind)
    return float(time[places[int(np.argmin(cost))]])


def begun_anew(
    imu: ImuRecording, gnss: GnssRecording, setup: RunSetup, moment: float
) -> RunSetup | None:
    """Return a setup that begins anew at a moment, with noise as it is; None if it cannot."""
    try:
        start = align(
            imu.between(moment, np.inf),
            setup.condition.usable(gnss),
            velocity_offset=setup.offsets.velocity,
            mounting=setup.settings.mounting,
            lever_arm=setup.lever_arm,
        )
    except NavigationError:
        return None
    restarts = [*setup.condition.restarts, Restart(moment - UNSURE, moment, start, knocked=True)]
    condition = replace(setup.condition, restarts=tuple(sorted(restarts, key=lambda r: r.time)))
    return replace(setup, condition=condition)


def explains(
    before: InnovationSequence, after: InnovationSequence, least: float = LEAST_GAIN
) -> bool:
    """Whether a new start made the innovations far more likely."""
    _, one, other = np.intersect1d(before.key, after.key, return_indices=True)
    gain = after.select(other).log_likelihood - before.select(one).log_likelihood
    return bool(gain > least)


def finding_on(moment: float) -> Finding:
    """Say what happened."""
    return Finding(
        "knock",
        "warning",
        f"from about {moment:.0f} s on the IMU has other biases or other axes than before (a "
        "knock, a mount that slipped?): nothing that was learnt of it before holds there",
        (),
        ((moment, moment),),
        cure="fix the IMU so that it cannot move; results before and after are those of two drives",
    )
