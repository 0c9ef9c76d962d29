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
3.4 (scoring); White, Estimation, Inference and Specification Analysis, section 8.3 (the sandwich,
for innovations that are used once more in every thinning); spec 7.9.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import EstimationError
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.innovation_likelihood import slower_imu, thin
from schuler.navigation.preparation.setup import (
    NoiseFactors,
    ParameterSpread,
    RunSetup,
    TimeOffsets,
)
from schuler.navigation.tuning.gnss_errors import FLOOR, WHITE, split_errors, with_split
from schuler.navigation.tuning.linear_drive import DriveLikelihood
from schuler.navigation.tuning.scoring import LONGEST_SEARCH
from schuler.navigation.tuning.vibration import VibrationResponse, level_at, vibration_level
from schuler.types import FloatArray

# GNSS is thinned to one epoch in this many seconds; 0: every epoch
THINNING = (0.0, 2.0, 5.0, 10.0)
# what is known of a vehicle carries it longer
VEHICLE_THINNING = (0.0, 5.0, 10.0, 30.0)
# prior: a factor of this many nepers is one standard deviation away from the base
PRIOR_SD = 1.5
VEHICLE_PRIOR_SD = 0.7
# while tuning, constraints of a vehicle come at this interval (s)
SPARSE_INTERVAL = 0.5
# one unit of the search in time offset (s)
OFFSET_UNIT = 0.01
ARM = ("arm x", "arm y", "arm z")
# of an antenna about where it was told or found to be, m
ARM_PRIOR_SD = 1.0
# least factor on a receiver's standard deviations of position: innovations cannot see errors that
# change slowly, so a smaller one would claim what nobody knows
LEAST_POSITION_FACTOR = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Tuning:
    """Outcome of `tune`."""

    setup: RunSetup  # ready to run
    # by parameter, in nepers, exponents, and units of the search for offsets
    values: dict[str, float]
    log_likelihood: float  # sum over the thinned runs, prior included
    gain: float  # by how much it rose above the start
    evaluations: int  # how many sets of parameters were tried
    converged: bool  # whether the search ended by itself
    # by parameter, in nepers, offsets in s, from the scatter of the scores over pieces of the
    # drive: that innovations appear in several thinnings, and are not quite white, is in it
    standard_errors: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Sought:
    """What `tune` looks for, and from where."""

    # factors on the noise: of every channel, of accelerometers and gyros, or none
    noise: Literal["channels", "sensors"] | None
    offsets: bool  # time offsets of GNSS
    # first, fixed: values to begin with, and values that are held
    first: Mapping[str, float] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    prior_sd: float = PRIOR_SD  # of a factor, nepers
    longest: int = LONGEST_SEARCH  # most steps
    until: float = np.inf  # time up to which the drive is looked at, s

    def names(self, start: RunSetup, gnss: GnssRecording) -> tuple[str, ...]:
        """Return the free parameters."""
        names: list[str] = []
        if self.noise is not None:
            by_channel = self.noise == "channels"
            names += (
                [f"white {c}" for c in range(6)] if by_channel else ["white accel", "white gyro"]
            )
            for sensor, channels in (("accel", (0, 1, 2)), ("gyro", (3, 4, 5))):
                if _driven(start.model, channels):
                    names.append(f"drive {sensor}")
            names += ["vibration accel", "vibration gyro"] if by_channel else []
            names += ["sd position" if split_errors(start) is None else WHITE]
            names += ["sd velocity"] if gnss.velocity is not None else []
            if start.vehicle is not None and start.vehicle.first_state >= 0:
                names += ["sd lateral", "sd vertical"]
        if self.offsets:
            names += ["offset position"]
            names += ["offset velocity"] if gnss.velocity is not None else []
        # found with noise that forgives everything: the noise of the drive tells it better
        names += ARM if start.arm_covariance is not None else ()
        return tuple(n for n in names if n not in self.fixed)


def tune(
    imu: ImuRecording,
    gnss: GnssRecording,
    start: RunSetup,
    sought: Sought,
    progress: Callable[[str], None] | None = None,
) -> Tuning:
    """Find noise factors and time offsets under which the innovations were most likely."""
    if gnss.size < 20:
        raise EstimationError(
            f"only {gnss.size} GNSS epochs to tune with",
            expected="at least 20",
            cure="give a noise model and time offsets",
        )
    slow = slower_imu(imu).between(-np.inf, sought.until)
    level = level_at(slow.time, imu, vibration_level(imu)) if sought.noise == "channels" else None
    rolling = start.vehicle is not None and start.vehicle.first_state >= 0
    thinned = [thin(gnss, interval) for interval in (VEHICLE_THINNING if rolling else THINNING)]
    thinned = [g for g in thinned if g.size >= 10]
    held, names = dict(sought.fixed), sought.names(start, gnss)
    prior, floor = np.array([_prior_and_floor(n, sought.prior_sd) for n in names]).T
    calls = 0

    def at(x: FloatArray) -> RunSetup:
        nonlocal calls
        calls += 1
        if progress is not None and calls % 50 == 0:
            progress(f"tuning: {calls} sets of parameters tried")
        return _sparser(setup_at(held | dict(zip(names, x, strict=True)), start))

    split = split_errors(start)
    begun = {WHITE: 0.0 if split is None else float(np.log(split.white))} | dict(sought.first)
    begin = np.array([begun.get(n, 0.0) for n in names])
    begin = np.maximum(begin, floor)
    shifts = np.array(["offset" in n for n in names])
    drive = DriveLikelihood(slow, thinned, at, shifts, level)
    found = drive.maximise(begin, prior, floor, sought.longest)
    unit = np.where(shifts, OFFSET_UNIT, 1.0)
    values = dict(zip(names, found.x.tolist(), strict=True))
    setup = setup_at(held | values, start)
    if not held:
        setup = replace(setup, spread=ParameterSpread(names, found.covariance))
    if ARM[0] in names:
        place = names.index(ARM[0])
        setup = replace(setup, arm_covariance=found.covariance[place:, place:])
    return Tuning(
        setup=setup,
        values=held | values,
        log_likelihood=found.log_likelihood,
        gain=found.gain,
        evaluations=calls,
        converged=found.converged,
        standard_errors=dict(zip(names, (found.sd * unit).tolist(), strict=True)),
    )


def _driven(model: SensorErrorModel, channels: tuple[int, ...]) -> bool:
    """Whether any state of these channels has noise of its own."""
    of_blocks = [c for b in model.blocks for c in model.channel[b.first : b.first + b.size]]
    own = np.isin(model.channel, channels) & (model.diffusion[:, 0] > 0.0)
    return bool(np.any(own) or np.any(np.isin(of_blocks, channels)))


def _sparser(setup: RunSetup) -> RunSetup:
    """Fewer constraints of a vehicle, each worth as many more: the same in a second."""
    vehicle = setup.vehicle
    if vehicle is None or vehicle.interval >= SPARSE_INTERVAL:
        return setup
    share = float(np.sqrt(vehicle.interval / SPARSE_INTERVAL))
    return replace(
        setup,
        vehicle=replace(
            vehicle,
            lateral_sd=vehicle.lateral_sd * share,
            vertical_sd=vehicle.vertical_sd * share,
            interval=SPARSE_INTERVAL,
        ),
    )


def _prior_and_floor(name: str, prior_sd: float) -> tuple[float, float]:
    """Inverse variance of the prior about zero, and the least value, of a parameter."""
    if "offset" in name:
        return 0.0, -np.inf
    if name in ARM:
        return ARM_PRIOR_SD**-2, -np.inf
    if "vibration" in name:
        return 1.0, 0.0
    if name == WHITE:
        return prior_sd**-2, FLOOR[WHITE]
    if name == "sd position":
        return prior_sd**-2, float(np.log(LEAST_POSITION_FACTOR))
    if name in ("sd lateral", "sd vertical"):
        return VEHICLE_PRIOR_SD**-2, -3.0
    return prior_sd**-2, -8.0


def setup_at(x: Mapping[str, float], start: RunSetup) -> RunSetup:
    """A setup with parameters moved: nepers, exponents, and units of the search for offsets."""

    def factor(name: str) -> float:
        return float(np.exp(x.get(name, 0.0)))

    sensors = np.repeat([factor("white accel"), factor("white gyro")], 3)
    factors = NoiseFactors(
        white=np.array([factor(f"white {c}") for c in range(6)]) * sensors,
        drive_accel=factor("drive accel"),
        drive_gyro=factor("drive gyro"),
        position_sd=start.factors.position_sd * factor("sd position"),
        velocity_sd=start.factors.velocity_sd * factor("sd velocity"),
    )
    vehicle = start.vehicle
    if vehicle is not None:
        vehicle = replace(
            vehicle,
            lateral_sd=vehicle.lateral_sd * factor("sd lateral"),
            vertical_sd=vehicle.vertical_sd * factor("sd vertical"),
        )
    position = start.offsets.position + OFFSET_UNIT * x.get("offset position", 0.0)
    velocity = start.offsets.velocity + OFFSET_UNIT * x.get("offset velocity", 0.0)
    done = replace(
        start,
        model=factors.applied(start.model),
        factors=factors,
        vibration=VibrationResponse(
            start.vibration.accel + x.get("vibration accel", 0.0),
            start.vibration.gyro + x.get("vibration gyro", 0.0),
        ),
        offsets=TimeOffsets(float(position), float(velocity)),
        lever_arm=start.lever_arm + [x.get(n, 0.0) for n in ARM],
        vehicle=vehicle,
    )
    return with_split(done, x)
