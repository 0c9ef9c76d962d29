"""The verb `navigate_array`: several IMUs and one GNSS receiver, by any of the mechanizations.

S002 section III and spec 7.4 to 7.6: a single IMU; the synthetic IMU, fused before the filter; the
extended one, whose filter knows the errors of every sensor; the geometrically constrained one, in
which every IMU has a solution and the body ties them; and redundancy at system level.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Unpack, get_args

from schuler.data import GnssRecording, NavigationSolution
from schuler.data.array import ImuArray
from schuler.errors import InputError
from schuler.keywords import refuse_unknown
from schuler.navigation.aiding.options import CLAIMED, USUAL_ERRORS
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_preparation import PreparedArray, prepare_array
from schuler.navigation.mechanizations.array_solution import solution_at_lever_arm
from schuler.navigation.mechanizations.array_weights import FilterWeights, check_weights
from schuler.navigation.mechanizations.constrained import run_constrained
from schuler.navigation.mechanizations.single_imu import single_setup
from schuler.navigation.mechanizations.stacked import RigidBody, StackedRun
from schuler.navigation.mechanizations.system_level import Vote, run_system
from schuler.navigation.navigate import check_smoothing, withhold
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.run import run
from schuler.navigation.settings import NavigationSettings, RunOptions, navigation_settings
from schuler.noise.noise_model import NoiseModel

Mechanization = Literal["single", "synthetic", "extended", "constrained", "system"]
MECHANIZATIONS: tuple[Mechanization, ...] = get_args(Mechanization)


@dataclass(frozen=True, slots=True, eq=False)
class ArrayNavigation:
    """A solution for the origin of the body, and what only arrays have."""

    mechanization: Mechanization  # one of `MECHANIZATIONS`
    solution: NavigationSolution  # for the origin of the body, in its axes
    prepared: PreparedArray  # the array as it was used
    states: int  # states of the filter, or of all filters
    cpu_seconds: float  # of the run itself, in all threads
    # sensor error states of the filter; None where each IMU has its own.
    model: SensorErrorModel | None = None
    stack: StackedRun | None = None  # solutions of all IMUs, where one filter has several
    vote: Vote | None = None  # who was outvoted when, at system level


def navigate_array(
    array: ImuArray,
    gnss: GnssRecording,
    noise_models: NoiseModel | Sequence[NoiseModel] | None = None,
    *,
    mechanization: Mechanization = "extended",
    parity: bool = True,
    imu: int = 0,
    rigid: RigidBody | None = None,
    faults: bool = True,
    weights: FilterWeights = "auto",
    **options: Unpack[RunOptions],
) -> ArrayNavigation:
    """Estimate the trajectory of a body that carries several IMUs and a GNSS antenna.

    Parameters
    ----------
    array : ImuArray
        Two IMUs or more, calibrated to each other, missing values as NaN.
    gnss : GnssRecording
        As for `navigate`.
    noise_models : NoiseModel, sequence of NoiseModel, or None
        One for all IMUs or one for each, in their own axes; None: a generic one, tuned.
    mechanization : {"single", "synthetic", "extended", "constrained", "system"}
        How the IMUs are used.
    parity : bool
        Whether the extended filter also takes the parity vector once a second, and what each gyro
        shows at rest, as measurements of the biases (spec 7.5); without them nothing tells the
        sensors apart, and the filter equals the synthetic one for equal sensors.
    imu : int
        Which one is used by "single".
    rigid : RigidBody or None
        How rigid the body is, for "constrained".
    faults : bool
        Whether sensors that contradict the others are taken out, from the onset of the fault until
        they behave again; "single" takes its IMU as it is.
    weights : {"auto", "constant", "averaged_volatility", "ewma", "garch"}
        How sensors are weighted and believed in the "extended" filter, and in the "synthetic" one
        where it is asked for: by the noise models; by one variance for all that follows the noise;
        by a variance for every axis that does. "auto" follows every axis where healthy sensors
        differ by noise alone (all together with two IMUs), and keeps the noise models otherwise.
    **options
        outages, smooth, lag, progress and all others as for `navigate`; the body takes the place
        of the IMU, and its origin that of the lever arm. The "constrained" filter is causal and
        uses GNSS alone.

    Returns
    -------
    ArrayNavigation
        Its `solution` is for the origin of the body.

    Raises
    ------
    InputError
        One IMU only, a copy, sensors that are silent, a mechanization that does not exist or
        cannot do what is asked.
    NavigationError
        As `navigate`.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, place = np.random.default_rng(1), schuler.tetrahedron_mounting(0.05)
    >>> ride = schuler.motorcycle(120.0)
    >>> noise = schuler.NoiseModel.isotropic(schuler.WhiteNoise(1e-3), schuler.WhiteNoise(3e-3))
    >>> parts = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(parts, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.1, velocity_sd=0.05, rng=rng)
    >>> solution = schuler.navigate_array(array, gnss, noise, time_offset=0.0, tune_noise=False)
    >>> solution.solution.trajectory.time.size > 1_000
    True
    """
    refuse_unknown(navigate_array, options, RunOptions)
    outages, progress = options.pop("outages", ()), options.pop("progress", None)
    smooth, lag = options.pop("smooth", False), options.pop("lag", 5.0)
    check_smoothing(smooth)
    settings = navigation_settings(navigate_array, options)
    check_mechanization(mechanization, settings, smooth=bool(smooth))
    weights = weights_for(mechanization, weights)
    used = withhold(gnss, outages) if outages else gnss
    prepared = prepare_array(
        array,
        used,
        noise_models,
        settings,
        progress,
        faults=faults and mechanization != "single",
        weights=weights,
    )
    if progress is not None:
        progress(f"filtering, {mechanization}")
    result = run_mechanization(
        prepared,
        used,
        mechanization,
        parity=parity,
        imu=imu,
        rigid=rigid,
        smooth=smooth is True,
        lag=lag if smooth == "fixed-lag" else None,
    )
    result.solution.settings["outages"] = [list(w) for w in outages]
    return result


def check_mechanization(name: str, settings: NavigationSettings, *, smooth: bool) -> None:
    """Raise when a mechanization does not exist or cannot do what is asked."""
    if name not in MECHANIZATIONS:
        raise InputError(f"mechanization '{name}'", expected=" or ".join(MECHANIZATIONS))
    if name != "constrained":
        return
    told = settings.measurements
    asked = {
        "smoothing (smooth, --smooth, --lag)": smooth,
        "vehicle constraints (aiding, --aid)": bool(settings.constraints),
        "weights of GNSS (measurements.weighting, --update, --adaptive)": told.weighting != CLAIMED,
        "slow errors of GNSS (measurements.correlated, --gnss-correlated)": told.correlated
        not in (None, USUAL_ERRORS),
        "other sensors (measurements.sources, --heading-file, --barometer, --magnetometer)": bool(
            told.sources
        ),
    }
    for what, given in asked.items():
        if given:
            raise InputError(
                f"{what} with the constrained mechanization",
                expected="a causal solution with GNSS alone",
                cure="take the extended, synthetic, system or single mechanization "
                "(--mechanization extended)",
            )


def weights_for(mechanization: Mechanization, weights: FilterWeights) -> FilterWeights:
    """Weights that a mechanization can use; raise for those that it cannot."""
    check_weights(weights)
    if mechanization == "extended":
        return weights
    if weights in ("auto", "constant"):
        return "constant"
    if mechanization != "synthetic":
        raise InputError(
            f"weights '{weights}' (--weights) with the {mechanization} mechanization",
            expected="the extended or the synthetic one, which weigh sensors",
            cure="take --mechanization extended",
        )
    return weights


def run_mechanization(
    prepared: PreparedArray,
    gnss: GnssRecording,
    mechanization: Mechanization,
    *,
    parity: bool = True,
    imu: int = 0,
    rigid: RigidBody | None = None,
    smooth: bool = False,
    lag: float | None = None,
) -> ArrayNavigation:
    """Run one mechanization on a prepared array. Parameters as for `navigate_array`."""
    check_mechanization(mechanization, prepared.settings, smooth=smooth or lag is not None)
    told = _settings(prepared, mechanization)
    if mechanization == "system":
        system = run_system(prepared.filled(), gnss, smooth=smooth, lag=lag)
        _tell(system.solution, prepared, told)
        return ArrayNavigation(
            mechanization, system.solution, prepared, system.states, system.cpu_seconds,
            vote=system.vote,
        )  # fmt: skip
    begin = time.thread_time()
    if mechanization == "constrained":
        solution, stack = run_constrained(prepared.filled(), gnss, rigid)
        _tell(solution, prepared, told)
        return ArrayNavigation(
            mechanization, solution, prepared, len(stack.covariance), time.thread_time() - begin,
            stack=stack,
        )  # fmt: skip
    recording, place = prepared.recording, prepared.fusion.centre
    if mechanization == "single":
        recording, own = single_setup(prepared, gnss, imu)
        place = prepared.array.mounting.position[imu]
        told["imu_used"] = prepared.array.names[imu]
    elif mechanization == "synthetic":
        own = prepared.synthetic_setup()
    else:
        own = prepared.extended_setup(parity=parity)
        told["parity_update"] = parity
    done = run(recording, gnss, own, smooth=smooth, lag=lag)
    solution = solution_at_lever_arm(done.smoothed or done.lagged or done.causal, -place)
    _tell(solution, prepared, told)
    states, cpu = 9 + own.model.size, time.thread_time() - begin
    return ArrayNavigation(mechanization, solution, prepared, states, cpu, own.model)


def _tell(solution: NavigationSolution, prepared: PreparedArray, told: dict[str, Any]) -> None:
    """Write into a solution what was done with the array."""
    solution.settings.update(told)
    end = float(solution.trajectory.time[-1])
    solution.settings["sensor_faults"] = prepared.faults.to_dict()
    solution.settings["findings"] = [
        *(f.to_dict() for f in prepared.faults.findings(end)),
        *solution.settings["findings"],
    ]


def _settings(prepared: PreparedArray, mechanization: Mechanization) -> dict[str, Any]:
    setup: RunSetup = prepared.setup
    return {
        "mechanization": mechanization,
        "imus": list(prepared.array.names),
        "array_notes": list(prepared.notes),
        "alignment": setup.alignment.method,
        "time_offset_position_s": setup.offsets.position,
        "time_offset_velocity_s": setup.offsets.velocity,
        "lever_arm_m": prepared.lever_arm.tolist(),
    }
