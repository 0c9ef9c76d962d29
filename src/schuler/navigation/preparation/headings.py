"""Heading at the start by hypotheses: one filter for every heading, judged by its innovations.

Where a vehicle hardly accelerates, velocity changes and tilt, biases and heading explain the same
data, and only a filter that knows how large each may be can tell them apart. So the first stretch
of a run is filtered again and again, each time from another heading that is taken for true, with
everything else uncertain. The likelihoods of the innovations are the likelihood of the heading,
without any linearisation in it; its mean and standard deviation over the circle are the answer,
however wide, and two headings that explain the data alike show as a large deviation.

Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, section
11.6.2 (static multiple models).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.kernels.navigation.filter_data import AidingOutputs, NodeOutputs, SampleOutputs
from schuler.navigation.aiding.gnss import GnssVelocity
from schuler.navigation.aiding.schedule import AidingSchedule, merge_schedules
from schuler.navigation.engine import InitialState, diverged, gate_thresholds
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.innovation_likelihood import InnovationSequence, slower_imu, thin
from schuler.navigation.stepping import FilterStepper, kernel_samples, kernel_schedule
from schuler.types import FloatArray

_NO_NODES = 1e9  # seconds between them


class RepeatedRuns:
    """A filter over one recording, without a gate, to be started again and again.

    Parameters
    ----------
    imu : ImuRecording
        Filtered from its first to its last sample.
    model : SensorErrorModel
        Of its sensors.
    schedule : AidingSchedule
        Without measurements of a user's own, whose models are asked on the way.
    """

    def __init__(
        self, imu: ImuRecording, model: SensorErrorModel, schedule: AidingSchedule
    ) -> None:
        self._imu, self._updates = imu, schedule.size
        states = 9 + model.size
        nothing = InitialState(
            np.zeros(3), np.zeros(3), np.eye(3), np.zeros(model.size), np.zeros((states, states))
        )
        self._stepper = FilterStepper(
            nothing, model, gate=gate_thresholds(0.0), node_interval=_NO_NODES
        )
        self._filter = self._stepper.filter(
            kernel_samples(imu, None),
            kernel_schedule(schedule, model.size),
            SampleOutputs.empty(0),
            AidingOutputs.empty(schedule.size, 0, states),
            NodeOutputs.empty(schedule.size + 3, 0, states, self._stepper.width),
        )

    def innovations(self, start: InitialState) -> InnovationSequence:
        """Filter from a start.

        Raises NavigationError where the state stops being finite.
        """
        self._stepper.restart(start)
        bad = self._stepper.advance(self._filter, 0, self._imu.size, self._updates, True)
        if bad >= 0:
            raise diverged(self._imu, bad)
        return InnovationSequence.of_scalars(self._filter.aiding.scalar)


COARSE = 24
"""Headings around the circle."""
FINE = 8
"""Headings on either side of the best one, at every refinement."""
PEAK = 1.0
"""Refining ends when neighbours of the best heading are this close in log-likelihood."""
LEVELS = 6
RECORD = 20.0
"""Samples a second that are filtered."""
SPACING = 1.0
"""Seconds between fixes: those of one second share their errors."""
UNKNOWN_SD = 0.3
"""Of a velocity whose deviation the receiver does not tell, m/s."""


@dataclass(frozen=True, slots=True, eq=False)
class HeadingPosterior:
    """What the innovations tell of the heading of the levelled frame at the first sample."""

    mean: float  # circular mean, rad
    sd: float  # root of the mean square deviation from it, rad; 1.8 where nothing is known.
    # heading, log_likelihood: (k,) what was tried, in order of heading, and how well it did
    heading: FloatArray
    log_likelihood: FloatArray
    misfit: float  # mean square of the normalised innovations of the best one


def judge_headings(
    imu: ImuRecording,
    gnss: GnssRecording,
    model: SensorErrorModel,
    start: Callable[[float], InitialState],
    *,
    lever_arm: FloatArray,
    velocity_offset: float = 0.0,
    velocity_sd: FloatArray | None = None,
) -> HeadingPosterior:
    """Filter a stretch from every heading and return what the likelihoods say."""
    slow, schedule = decimated_inputs(imu, gnss, lever_arm, velocity_offset, velocity_sd)
    runs = RepeatedRuns(slow, model, schedule)
    tried: dict[float, float] = {}
    misfits: dict[float, float] = {}

    def judge(heading: float) -> None:
        if heading in tried:
            return
        found = runs.innovations(start(heading))
        tried[heading], misfits[heading] = found.log_likelihood, found.misfit

    step = 2.0 * np.pi / COARSE
    for k in range(COARSE):
        judge(-np.pi + k * step)
    for _ in range(LEVELS):
        best = max(tried, key=lambda h: tried[h])
        worth = max(misfits[best], 1.0)
        near = sorted(tried, key=lambda h: abs(_wrapped(h - best)))[1:3]
        if all(tried[best] - tried[h] < PEAK * worth for h in near):
            break
        step /= FINE / 2
        for k in range(-FINE, FINE + 1):
            if k:
                judge(_wrapped(best + k * step))
    best = max(tried, key=lambda h: tried[h])
    heading = np.array(sorted(tried))
    value = np.array([tried[h] for h in heading])
    misfit = misfits[best]
    mean, sd = _moments(heading, (value - value.max()) / max(misfit, 1.0))
    return HeadingPosterior(mean, sd, heading, value, misfit)


def decimated_inputs(
    imu: ImuRecording,
    gnss: GnssRecording,
    lever_arm: FloatArray,
    velocity_offset: float,
    velocity_sd: FloatArray | None,
) -> tuple[ImuRecording, AidingSchedule]:
    """Return the stretch at a low rate, and one velocity a second."""
    assert gnss.velocity_sd is not None
    sd = np.where(np.isnan(gnss.velocity_sd), UNKNOWN_SD, gnss.velocity_sd)
    if velocity_sd is not None:
        sd = np.hypot(sd, velocity_sd[:, None])
    slow, few = slower_imu(imu, RECORD), thin(replace(gnss, velocity_sd=sd), SPACING)
    velocity = GnssVelocity(few, lever_arm, velocity_offset)
    return slow, merge_schedules([velocity.rows()], float(slow.time[0]), float(slow.time[-1]))


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _moments(heading: FloatArray, log_likelihood: FloatArray) -> tuple[float, float]:
    """Circular mean and root mean square deviation, by trapezoids around the circle.

    Between two headings the logarithm is taken as linear: its integral is exact then.
    """
    around = np.append(heading, heading[0] + 2.0 * np.pi)
    fine = []
    weight = []
    values = np.append(log_likelihood, log_likelihood[0])
    share = (np.arange(20) + 0.5) / 20
    for a, b, la, lb in zip(around[:-1], around[1:], values[:-1], values[1:], strict=True):
        fine.append(a + share * (b - a))
        weight.append(np.exp(la + share * (lb - la)) * (b - a) / 20)
    angle, mass = np.concatenate(fine), np.concatenate(weight)
    mean = float(np.angle(np.sum(mass * np.exp(1j * angle))))
    off = (angle - mean + np.pi) % (2.0 * np.pi) - np.pi
    mean = _wrapped(mean + float(np.sum(mass * off) / mass.sum()))
    off = (angle - mean + np.pi) % (2.0 * np.pi) - np.pi
    return mean, float(np.sqrt(np.sum(mass * off**2) / mass.sum()))
