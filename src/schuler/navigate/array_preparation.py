"""Before the first run with an array: what is known of one fused IMU, for every mechanization.

Alignment, offsets of time and tuning are those of `prepare` on the fused recording; what they say
of the constant parts of the gyros is said of every sensor by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.data.array import ImuArray
from schuler.errors import NavigationError
from schuler.navigate.alignment import Alignment
from schuler.navigate.array_model import (
    Fusion,
    bias_state,
    fused_noise_model,
    fusion_of,
    noise_models_of,
    sensor_directions,
    without_idle_states,
)
from schuler.navigate.array_recording import complete_array, fused_recording
from schuler.navigate.error_model import sensor_error_model
from schuler.navigate.generic import TURN_ON_ACCEL, TURN_ON_GYRO, generic_noise_model
from schuler.navigate.preparation import Progress, prepare
from schuler.navigate.sensor_states import SensorErrorModel
from schuler.navigate.setup import RunSetup, SensorStart
from schuler.processes.noise_model import NoiseModel

FloatArray = NDArray[np.float64]

EARTH_RATE = 7.3e-5
"""The earth's rate about an unknown north stays in the mean of gyros at rest, rad/s."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedArray:
    """An array and what every mechanization needs to know of it.

    Parameters
    ----------
    array : ImuArray
        Complete, cut to where it can be used.
    recording : ImuRecording
        The fused IMU, same stamps.
    fusion : Fusion
        How the sensors are added up.
    models : tuple of SensorErrorModel
        One for each IMU, in its own axes, as the noise models say.
    noise_models : tuple of NoiseModel
        One for each IMU.
    setup : RunSetup
        From `prepare` on the fused recording.
    lever_arm : (3,) ndarray
        GNSS antenna from the origin of the body, m.
    heading : float or None
        Of the body at the start, rad, where it was given.
    notes : tuple of str
        What was done to the array, in words.
    """

    array: ImuArray
    recording: ImuRecording
    fusion: Fusion
    models: tuple[SensorErrorModel, ...]
    noise_models: tuple[NoiseModel, ...]
    setup: RunSetup
    lever_arm: FloatArray
    heading: float | None
    notes: tuple[str, ...]

    def sensor_start(self) -> SensorStart:
        """Return what is known of all sensor states at the first sample.

        Returns
        -------
        SensorStart
            In the order of `extended_model`.
        """
        return sensor_start(self.array, self.models, self.fusion, self.setup.alignment)


def prepare_array(
    array: ImuArray,
    gnss: GnssRecording,
    noise_models: NoiseModel | Sequence[NoiseModel] | None = None,
    *,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    heading: float | None = None,
    mounting: FloatArray | None = None,
    time_offset: Literal["estimate"] | float | tuple[float, float] = "estimate",
    tune_noise: bool | None = None,
    aiding: Sequence[str] = (),
    turn_on_accel: float = TURN_ON_ACCEL,
    turn_on_gyro: float = TURN_ON_GYRO,
    progress: Progress | None = None,
) -> PreparedArray:
    """Align, find time offsets and noise of the fused IMU.

    Parameters
    ----------
    array : ImuArray
        Two IMUs or more.
    gnss : GnssRecording
        Only epochs that may be looked at.
    noise_models : NoiseModel, sequence of NoiseModel, or None
        One for all IMUs or one for each, in their own axes; None: a generic one.
    lever_arm, heading, mounting, time_offset, tune_noise, aiding, turn_on_accel, turn_on_gyro
        As for `navigate`; the body takes the place of the IMU.
    progress : callable or None
        Called with a line of text now and then.

    Returns
    -------
    PreparedArray
        For `run_mechanization`.

    Raises
    ------
    InputError
        One IMU only, a copy, sensors that are silent.
    NavigationError
        As `prepare`.
    """
    whole, notes = complete_array(array)
    tuned = noise_models is None if tune_noise is None else tune_noise
    given = generic_noise_model() if noise_models is None else noise_models
    if not isinstance(given, NoiseModel) and len(given) == array.count != whole.count:
        kept = [array.names.index(name) for name in whole.names]
        given = [given[i] for i in kept]
    noises = noise_models_of(given, whole.count)
    models = tuple(
        without_idle_states(
            sensor_error_model(n, turn_on_accel=turn_on_accel, turn_on_gyro=turn_on_gyro)
        )
        for n in noises
    )
    fusion = fusion_of(whole.mounting, models)
    arm = np.asarray(lever_arm, dtype=np.float64)
    recording, setup = prepare(
        fused_recording(whole, fusion),
        gnss,
        fused_noise_model(noises, fusion),
        lever_arm=arm - fusion.centre,
        heading=heading,
        mounting=mounting,
        time_offset=time_offset,
        tune_noise=tuned,
        aiding=aiding,
        turn_on_accel=turn_on_accel,
        turn_on_gyro=turn_on_gyro,
        progress=progress,
    )
    broken = [u for u in setup.condition.unseen if u.gap] or setup.condition.restarts
    if broken:
        raise NavigationError(
            "; ".join(f.message for f in setup.condition.findings if f.kind == "gap"),
            expected="an array recording without gaps",
            cure="navigate the parts before and after by themselves",
        )
    if recording.size != whole.size:
        after = np.nextafter(recording.time[-1], np.inf)
        whole = whole.between(float(recording.time[0]), float(after))
    return PreparedArray(whole, recording, fusion, models, noises, setup, arm, heading, notes)


def sensor_start(
    array: ImuArray, models: Sequence[SensorErrorModel], fusion: Fusion, alignment: Alignment
) -> SensorStart:
    """Tell the constant parts of all gyros from the alignment.

    At rest each gyro shows its own constant, the turn of the earth apart, which is common to all.
    In motion the alignment found the constant of the fused gyro; each gets its share of it by the
    prior.

    Parameters
    ----------
    array : ImuArray
        Complete.
    models : sequence of SensorErrorModel
        One for each IMU.
    fusion : Fusion
        How the sensors are added up.
    alignment : Alignment
        Of the fused IMU.

    Returns
    -------
    SensorStart
        In the order of `extended_model`.
    """
    first = np.concatenate([[0], np.cumsum([m.size for m in models])]).astype(int)
    covariance = np.zeros((first[-1], first[-1]))
    for i, model in enumerate(models):
        covariance[first[i] : first[i + 1], first[i] : first[i + 1]] = model.initial_covariance
    state = np.zeros(first[-1])
    if alignment.gyro_bias_sd is None:
        return SensorStart(state, covariance)
    places = np.array(
        [first[i] + bias_state(models[i], 3 + a)
         for i in range(array.count) for a in range(3)]
    )  # fmt: skip
    if alignment.rest is not None:
        mean, sd = _at_rest(array, alignment.rest)
        state[places] = mean
        covariance[places] = 0.0
        covariance[:, places] = 0.0
        block = np.diag(sd**2) + EARTH_RATE**2 * fusion.axes @ fusion.axes.T
        covariance[np.ix_(places, places)] = block
        return SensorStart(state, covariance)
    shown = np.zeros((3, first[-1]))
    own = np.concatenate([sensor_directions(m) for m in models])[places]
    for p, place in enumerate(places):
        shown[:, place] = fusion.gyro[:, p - p % 3 : p - p % 3 + 3] @ own[p]
    spread = shown @ covariance @ shown.T + alignment.gyro_bias_sd**2 * np.eye(3)
    gain = np.linalg.solve(spread, shown @ covariance).T
    state = gain @ alignment.gyro_bias
    reduced = covariance - gain @ shown @ covariance
    return SensorStart(state, 0.5 * (reduced + reduced.T))


def _at_rest(array: ImuArray, rest: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Mean of every gyro over a rest and its standard deviation, (3 k,), by means of seconds."""
    part = slice(*np.searchsorted(array.time, rest, side="left"))
    gyro = array.gyro[part].reshape(-1, 3 * array.count)
    block = max(round(array.rate), 1)
    count = gyro.shape[0] // block
    if count < 2:
        return gyro.mean(axis=0), np.full(gyro.shape[1], np.radians(0.1))
    seconds = gyro[: count * block].reshape(count, block, -1).mean(axis=1)
    return gyro.mean(axis=0), seconds.std(axis=0, ddof=1) / np.sqrt(count)


def merged_start(start: SensorStart, merge: FloatArray) -> SensorStart:
    """Turn what is known of all sensors into what is known of the fused states.

    Parameters
    ----------
    start : SensorStart
        Of `extended_model`.
    merge : (f, m) ndarray
        From `fused_model`.

    Returns
    -------
    SensorStart
        Of the fused model.
    """
    return SensorStart(merge @ start.state, merge @ start.covariance @ merge.T)


def own_factors(setup: RunSetup, rotation: FloatArray) -> RunSetup:
    """Turn the noise factors that were found on the body's axes to those of one IMU.

    Parameters
    ----------
    setup : RunSetup
        Of the fused IMU.
    rotation : (3, 3) ndarray
        C_bs of the IMU.

    Returns
    -------
    RunSetup
        With factors on its own axes.
    """
    square = rotation**2
    white = setup.factors.white**2
    own = np.sqrt(np.concatenate([white[:3] @ square, white[3:] @ square]))
    return replace(setup, factors=replace(setup.factors, white=own))
