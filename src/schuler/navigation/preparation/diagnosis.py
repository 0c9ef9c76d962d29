"""Why an IMU does not fit GNSS: the same drive with axes turned round, exchanged or rescaled.

A trial run with forgiving noise must explain the velocities of GNSS. Where it does not, the usual
slips are tried one after the other, each with an alignment of its own; the one that makes the
innovations far more likely is named.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from schuler.data import CHANNELS, GnssRecording, ImuRecording
from schuler.errors import InputError, SchulerError
from schuler.navigation.engine import InitialState, gate_thresholds
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.innovation_likelihood import InnovationSequence
from schuler.navigation.preparation.headings import decimated_inputs
from schuler.navigation.preparation.moving_start import inflated_model, velocity_doubt
from schuler.navigation.segments import run_in_segments
from schuler.types import FloatArray

DOUBTFUL = 0.8
"""Mean square of the clipped normalised innovations of a trial that calls for a diagnosis. The
noise is forgiving: good drives leave 0.05 to 0.5."""
BAD = 2.0
"""Mean square from which IMU and GNSS do not fit each other, whatever the reason."""
CLEARLY = 0.6
"""A slip is named when it leaves at most this share of the misfit, ..."""
CONVINCING = 100.0
"""... and makes the innovations more likely by so many units of log-likelihood."""
POOR_WALK = 1e-3
"""Density of a gyro bias that wanders by a degree a second in five minutes, rad/s²/sqrt(Hz)."""
# rates (rad/s) of machines that spin, not of vehicles that are on their way
FAST_TURN = 2.0
LONGEST = 600.0
"""Seconds of the drive that are tried."""


@dataclass(frozen=True, slots=True)
class Slip:
    """Something that people do to recordings, undone."""

    name: str  # for people, as a statement
    cure: str  # what to do about it
    # takes a recording and returns what it would be without the slip
    undo: Callable[[ImuRecording], ImuRecording]


@dataclass(frozen=True, slots=True)
class Trial:
    """How well a drive explains GNSS: mean clipped square, and robust log-likelihood."""

    misfit: float
    log_likelihood: float


def try_drive(
    imu: ImuRecording,
    gnss: GnssRecording,
    start: InitialState,
    restarts: Sequence[tuple[float, InitialState]] = (),
    *,
    gyro_bias: FloatArray,
    lever_arm: FloatArray,
    velocity_offset: float,
    known: SensorErrorModel,
) -> Trial:
    """Filter a drive with forgiving noise and say how its velocities fit GNSS."""
    doubt = velocity_doubt(gnss, lever_arm)
    slow, schedule = decimated_inputs(imu, gnss, lever_arm, velocity_offset, doubt)
    model = inflated_model(known)
    bias = np.zeros(model.size)
    bias[[model.constant_states(3 + axis)[0] for axis in range(3)]] = gyro_bias

    def own(state: InitialState) -> InitialState:
        covariance = np.zeros((9 + model.size, 9 + model.size))
        covariance[:9, :9] = state.covariance[:9, :9]
        covariance[9:, 9:] = model.initial_covariance
        return replace(state, sensor_state=bias.copy(), covariance=covariance)

    done = run_in_segments(
        slow,
        own(start),
        [(t, own(s)) for t, s in restarts],
        model,
        schedule,
        gate=gate_thresholds(0.0),
        keep_samples=False,
        keep_nodes=False,
        node_interval=1e9,
    )
    found = InnovationSequence.of_run(done)
    return Trial(found.misfit if found.value.size else 0.0, found.log_likelihood)


def find_slip(
    imu: ImuRecording,
    found: Trial,
    again: Callable[[ImuRecording], Trial],
    poor: Callable[[], Trial],
) -> Slip | None:
    """Try the usual slips and return the one that explains the drive.

    Not where gyros that drift a lot (`poor`, the same drive with such) explain it as well.
    """
    best: tuple[Trial, Slip] | None = None
    for slip in SLIPS:
        try:
            trial = again(slip.undo(imu))
        except SchulerError:
            continue
        least = found.log_likelihood + CONVINCING if best is None else best[0].log_likelihood
        if trial.misfit < CLEARLY * found.misfit and trial.log_likelihood > least:
            best = trial, slip
    return None if best is None or poor().misfit < best[0].misfit else best[1]


def poor_gyros(model: SensorErrorModel) -> SensorErrorModel:
    """Return a model whose gyro biases wander as those of the cheapest sensors do."""
    diffusion, gyros = model.diffusion.copy(), np.isin(model.channel, (3, 4, 5))
    diffusion[gyros, 0] = np.maximum(diffusion[gyros, 0], POOR_WALK**2)
    return replace(model, diffusion=diffusion)


def turns_too_fast(imu: ImuRecording) -> bool:
    """Whether the gyros spend a twentieth of the time beyond what carries a GNSS antenna along."""
    rate = np.linalg.norm(imu.gyro - np.median(imu.gyro, axis=0), axis=1)
    return bool(np.quantile(rate, 0.95) > FAST_TURN)


def flipped(imu: ImuRecording, channels: tuple[str, ...]) -> ImuRecording:
    """Return a recording with the sign of some channels turned."""
    sign = np.array(
        [-1.0 if any(c == n or c.startswith(f"{n}_") for n in channels) else 1.0 for c in CHANNELS]
    )
    return replace(
        imu,
        gyro=imu.gyro * sign[:3],
        accel=imu.accel * sign[3:],
        history=(*imu.history, f"sign turned of {', '.join(channels)}"),
    )


def check_flip(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of channels whose sign is to be turned."""
    known = (*CHANNELS, "gyro", "accel")
    for name in names:
        if name not in known:
            raise InputError(f"no channel '{name}' to flip", expected=f"one of {', '.join(known)}")
    return names


def _flip(*channels: str) -> Slip:
    one = len(channels) == 1
    names = channels[0] if one else f"{', '.join(channels[:-1])} and {channels[-1]}"
    flags = " ".join(f"--flip {c}" for c in channels)
    return Slip(
        f"{names} {'has' if one and '_' in names else 'have'} the wrong sign",
        f"turn {'it' if one and '_' in names else 'them'} with {flags}",
        lambda imu: flipped(imu, channels),
    )


def _exchange(i: int, j: int) -> Slip:
    order = [0, 1, 2]
    order[i], order[j] = order[j], order[i]
    a, b = "xyz"[i], "xyz"[j]
    return Slip(
        f"the {a} and {b} axes are exchanged, so that the axes are left-handed",
        f"name the columns anew with --imu-column gyro_{a}=..., and so on",
        lambda imu: replace(imu, gyro=imu.gyro[:, order], accel=imu.accel[:, order]),
    )


def _scaled(gyro: float, text: str, cure: str) -> Slip:
    return Slip(text, cure, lambda imu: replace(imu, gyro=gyro * imu.gyro))


GYROS_IN_DEGREES = _scaled(np.pi / 180.0, "the gyros are in deg/s", "say so with --gyro-unit deg/s")
SLIPS: tuple[Slip, ...] = (
    *(_flip(c) for c in CHANNELS),
    _flip("gyro"),
    _flip("accel"),
    *(_flip(f"gyro_{a}", f"accel_{a}") for a in "xyz"),
    *(_exchange(i, j) for i, j in ((0, 1), (0, 2), (1, 2))),
    GYROS_IN_DEGREES,
    _scaled(180.0 / np.pi, "the gyros were converted to rad/s twice", "--gyro-unit rad/s"),
)
"""Of all kinds that were met in recordings."""
