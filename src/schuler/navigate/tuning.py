"""Noise and time offsets from the drive itself, by the likelihood of the innovations.

A static log says nothing of vibration, and a receiver's clock and filters have delays of their
own. All of it shows in the innovations of a filter run: the best values are those under which
they were most likely. At the full rate of GNSS the likelihood hardly feels what carries a filter
through an outage, so the same drive is filtered again with GNSS thinned to one fix in 2, 5 and
10 s, and the likelihoods are added.

The maximum is found by Fisher scoring on the scalar innovations and their variances, which also
tells how well each parameter is known. Innovations beyond four standard deviations count with a
Cauchy tail, so that a few bad fixes do not pass for noise.

References: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation,
section 5.4; Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, section
3.4 (scoring); spec 7.9.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import EstimationError
from schuler.navigate.alignment import Alignment
from schuler.navigate.condition import SOUND, DriveCondition
from schuler.navigate.likelihood import InnovationSequence, innovations, slower_imu, thin
from schuler.navigate.sensor_states import SensorErrorModel
from schuler.navigate.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigate.vibration import VibrationResponse, level_at, vibration_level

FloatArray = NDArray[np.float64]

# GNSS is thinned to one epoch in this many seconds; 0: every epoch
THINNING = (0.0, 2.0, 5.0, 10.0)
# prior: a factor of this many nepers is one standard deviation away from the base
PRIOR_SD = 1.5
# one unit of the search in time offset (s)
OFFSET_UNIT = 0.01
# step of the numerical derivatives, in nepers and offset units
DERIVATIVE_STEP = 1e-2
# the search ends when a step promises less than this gain of log-likelihood
TOLERANCE = 0.05
LONGEST_SEARCH = 30
# least factor on a receiver's standard deviations of position: innovations cannot see errors that
# change slowly, so a smaller one would claim what nobody knows
LEAST_POSITION_FACTOR = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Tuning:
    """Outcome of `tune`.

    Parameters
    ----------
    setup : RunSetup
        Ready to run.
    log_likelihood : float
        Sum over the thinned runs, prior included.
    gain : float
        By how much it rose above the start.
    evaluations : int
        How often the whole drive was filtered with all thinnings.
    converged : bool
        Whether the search ended by itself.
    standard_errors : dict of str to float
        By parameter, in nepers, offsets in s; they take innovations as independent between the
        thinnings and are therefore somewhat small.
    """

    setup: RunSetup
    log_likelihood: float
    gain: float
    evaluations: int
    converged: bool
    standard_errors: dict[str, float]


def tune(
    imu: ImuRecording,
    gnss: GnssRecording,
    base: SensorErrorModel,
    *,
    offsets: TimeOffsets,
    alignment: Alignment,
    lever_arm: FloatArray,
    condition: DriveCondition = SOUND,
    tune_noise: bool,
    tune_offsets: bool,
    progress: Callable[[str], None] | None = None,
) -> Tuning:
    """Find noise factors and time offsets under which the innovations were most likely.

    Parameters
    ----------
    imu : ImuRecording
        The drive, all six channels.
    gnss : GnssRecording
        Only epochs that may be looked at: withheld windows must be gone already.
    base : SensorErrorModel
        Where the noise starts, and the centre of its prior.
    offsets : TimeOffsets
        Where the offsets start.
    alignment : Alignment
        Of the first sample.
    lever_arm : (3,) ndarray
        Antenna from IMU, body frame, m.
    tune_noise, tune_offsets : bool
        What to find.
    progress : callable or None
        Called with a line of text now and then.

    Returns
    -------
    Tuning
        The setup found.

    Raises
    ------
    EstimationError
        Too few epochs, or a likelihood that cannot be evaluated.
    """
    if gnss.size < 20:
        raise EstimationError(
            f"only {gnss.size} GNSS epochs to tune with",
            expected="at least 20",
            cure="give a noise model and time offsets",
        )
    slow = slower_imu(imu)
    level = level_at(slow.time, imu, vibration_level(imu)) if tune_noise else None
    thinned = [thin(gnss, interval) for interval in THINNING]
    thinned = [g for g in thinned if g.size >= 10]
    start = RunSetup(base, NoiseFactors.none(), offsets, alignment, lever_arm, condition=condition)
    names = _free_parameters(gnss, tune_noise, tune_offsets)
    prior, floor = np.array([_prior_and_floor(n) for n in names]).T
    calls = 0

    def evaluate(x: FloatArray) -> InnovationSequence:
        nonlocal calls
        calls += 1
        if progress is not None and calls % 10 == 0:
            progress(f"tuning: the drive filtered {calls} times")
        setup = _setup_at(dict(zip(names, x, strict=True)), start, base)
        return innovations(slow, thinned, setup, level)

    x, best, gain, converged, information = _score(evaluate, prior, floor)
    sd = np.sqrt(np.diag(np.linalg.pinv(information)))
    unit = np.array([OFFSET_UNIT if "offset" in n else 1.0 for n in names])
    return Tuning(
        setup=_setup_at(dict(zip(names, x, strict=True)), start, base),
        log_likelihood=best,
        gain=gain,
        evaluations=calls,
        converged=converged,
        standard_errors=dict(zip(names, (sd * unit).tolist(), strict=True)),
    )


def _score(
    evaluate: Callable[[FloatArray], InnovationSequence], prior: FloatArray, floor: FloatArray
) -> tuple[FloatArray, float, float, bool, FloatArray]:
    """Fisher scoring with a damped step, above a floor. Harvey, section 3.4.

    Returns the parameters, the penalised log-likelihood, its gain, whether the search ended by
    itself, and the information matrix.
    """
    count = prior.size
    x = np.zeros(count)

    def value(sequence: InnovationSequence, at: FloatArray) -> float:
        return sequence.log_likelihood - 0.5 * float(at @ (prior * at))

    now = evaluate(x)
    best = first = value(now, x)
    if not np.isfinite(best):
        raise EstimationError(
            "the likelihood of the drive cannot be evaluated",
            cure="check units, axes and time of IMU and GNSS",
        )
    damping = 0.0
    information = np.diag(prior)
    for _ in range(LONGEST_SEARCH):
        gradient, information = _derivatives(evaluate, x, now, prior)
        # what would leave through the floor stays out of this step
        free = (x > floor) | (gradient > 0.0)
        while True:
            damped = information + damping * np.diag(np.diag(information) + 1e-12)
            step = np.zeros(count)
            step[free] = np.linalg.solve(damped[np.ix_(free, free)], gradient[free])
            step = np.maximum(np.clip(step, -2.0, 2.0), floor - x)
            if 0.5 * float(gradient @ step) < TOLERANCE:
                return x, best, best - first, True, information
            trial = evaluate(x + step)
            there = value(trial, x + step)
            if np.isfinite(there) and there > best:
                break
            damping = max(4.0 * damping, 0.1)
            if damping > 1e6:
                return x, best, best - first, False, information
        damping = 0.0 if damping < 0.2 else 0.25 * damping
        small = there - best < TOLERANCE
        x, now, best = x + step, trial, there
        if small:
            return x, best, best - first, True, information
    return x, best, best - first, False, information


def _derivatives(
    evaluate: Callable[[FloatArray], InnovationSequence],
    x: FloatArray,
    now: InnovationSequence,
    prior: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Gradient and expected information of the penalised log-likelihood."""
    count = x.size
    root = np.sqrt(now.variance)
    z = now.value / root
    weight = now.weight
    gradient = -prior * x
    shift = np.empty((z.size, count))
    spread = np.empty((z.size, count))
    for k in range(count):
        moved = x.copy()
        moved[k] += DERIVATIVE_STEP
        there = evaluate(moved)
        shift[:, k] = (there.value - now.value) / root / DERIVATIVE_STEP
        spread[:, k] = np.log(there.variance / now.variance) / DERIVATIVE_STEP
    gradient -= shift.T @ (weight * z) + 0.5 * spread.T @ (1.0 - weight * z**2)
    information = shift.T @ shift + 0.5 * spread.T @ spread + np.diag(prior)
    return gradient, information


def _free_parameters(gnss: GnssRecording, tune_noise: bool, tune_offsets: bool) -> tuple[str, ...]:
    names: list[str] = []
    if tune_noise:
        names += [f"white {c}" for c in range(6)]
        names += ["drive accel", "drive gyro", "vibration accel", "vibration gyro"]
        names += ["sd position"]
        names += ["sd velocity"] if gnss.velocity is not None else []
    if tune_offsets:
        names += ["offset position"]
        names += ["offset velocity"] if gnss.velocity is not None else []
    return tuple(names)


def _prior_and_floor(name: str) -> tuple[float, float]:
    """Inverse variance of the prior about zero, and the least value, of a parameter."""
    if "offset" in name:
        return 0.0, -np.inf
    if "vibration" in name:
        return 1.0, 0.0
    if name == "sd position":
        return PRIOR_SD**-2, float(np.log(LEAST_POSITION_FACTOR))
    return PRIOR_SD**-2, -8.0


def _setup_at(x: dict[str, float], start: RunSetup, base: SensorErrorModel) -> RunSetup:
    factors = NoiseFactors(
        white=np.exp([x.get(f"white {c}", 0.0) for c in range(6)]),
        drive_accel=float(np.exp(x.get("drive accel", 0.0))),
        drive_gyro=float(np.exp(x.get("drive gyro", 0.0))),
        position_sd=float(np.exp(x.get("sd position", 0.0))),
        velocity_sd=float(np.exp(x.get("sd velocity", 0.0))),
    )
    position = start.offsets.position + OFFSET_UNIT * x.get("offset position", 0.0)
    velocity = start.offsets.velocity + OFFSET_UNIT * x.get("offset velocity", 0.0)
    return replace(
        start,
        model=factors.applied(base),
        factors=factors,
        vibration=VibrationResponse(
            float(x.get("vibration accel", 0.0)), float(x.get("vibration gyro", 0.0))
        ),
        offsets=TimeOffsets(float(position), float(velocity)),
    )
