"""Noise of an array's sensors followed through a recording, for the weights and for the filter.

S000 section 6: what redundant sensors show of their noise goes into the filter that uses them, so
that it believes neither a sensor that became noisy nor itself too much.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from schuler.arrays.lever_arms import turning_tensor
from schuler.arrays.redundant import RedundantSensors, redundant_sensors
from schuler.arrays.synthesis.conditional import conditional_noise
from schuler.arrays.tracking import OnlineSettings, follow_sensors
from schuler.data import ImuArray
from schuler.errors import EstimationError, InputError
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_model import white_variances
from schuler.types import FloatArray

FilterWeights = Literal["auto", "constant", "averaged_volatility", "ewma", "garch"]
FILTER_WEIGHTS: tuple[FilterWeights, ...] = get_args(FilterWeights)

ROW = 1.0
"""Seconds for which a filter keeps weights."""
LEARNT = 0.3
"""Share of a recording that GARCH is fitted on, at most."""


def check_weights(weights: str) -> None:
    """Raise for weights that a filter does not know."""
    if weights not in FILTER_WEIGHTS:
        raise InputError(f"weights '{weights}'", expected=" or ".join(FILTER_WEIGHTS))


def followed_variances(
    array: ImuArray,
    models: Sequence[SensorErrorModel],
    weights: FilterWeights,
    *,
    relative: bool,
) -> tuple[FloatArray, FloatArray]:
    """Return times (q,) and squared densities (q, 2, 3 k) of all sensors, row by row.

    A row counts with what was known at its end: noise that begins with it would otherwise be
    believed in for seconds, and an outage that begins there as well claim far too little.
    Samples of sensors that are out are missing. `relative`: the level of the models is kept, and
    only its changes and differences are taken from the samples. Otherwise the samples count, but
    never less than the models: a low-pass in a sensor makes its samples look better than they are.
    """
    row = max(round(ROW * array.rate), 1)
    begins = np.arange(0, array.size, row)
    ends = np.minimum(begins + row, array.size - 1)
    told = white_variances(models)
    found = np.empty((begins.size, 2, 3 * array.count))
    rate: FloatArray | None = None
    settings = OnlineSettings()
    for kind, name in ((1, "gyro"), (0, "accel")):
        sensors = redundant_sensors(array, "gyro" if kind else "accel")
        tensor = None
        if rate is not None and sensors.spacing > 0.0:
            tensor = turning_tensor(array.time, rate, causal=False)
        followed = follow_sensors(sensors, None, settings, tensor=tensor)
        rate = followed.fused if name == "gyro" else rate
        if weights == "garch":
            sampled = _garch(sensors, settings, tensor)
            variance = np.add.reduceat(sampled, begins) / np.diff([*begins, array.size])[:, None]
        else:
            variance = followed.variance[ends // followed.block]
        ratio = variance / array.rate / told[kind]
        if weights == "averaged_volatility":
            ratio = np.broadcast_to(ratio.mean(axis=1, keepdims=True), ratio.shape)
        level = 1.0 / float(np.median(ratio))
        found[:, kind] = told[kind] * ratio * (level if relative else max(level, 1.0))
    return array.time[begins], found


def _garch(
    sensors: RedundantSensors, settings: OnlineSettings, tensor: FloatArray | None
) -> FloatArray:
    size = sensors.time.size
    learning = int(np.clip(round(LEARNT * size), 500, 20_000))
    if learning > size:
        raise EstimationError(
            f"{size} samples to fit GARCH on", expected="500 or more", cure="weigh by 'ewma'"
        )
    whole = conditional_noise(sensors, learning, settings, tensor=tensor).variance
    return np.asarray(whole)


def chosen_weights(weights: FilterWeights, count: int, *, noise_only: bool) -> FilterWeights:
    """What "auto" is: a variance for every axis where they can be told apart, and are noise."""
    if weights != "auto":
        return weights
    if not noise_only:
        return "constant"
    return "ewma" if count > 2 else "averaged_volatility"
