"""From a noise model or a static log to the error models of the catalogue, by their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.navigation.error_models.allan_readings import (
    AllanReading,
    allan_readings,
    readings_of_static,
)
from schuler.navigation.error_models.autoregressive_fits import autoregressive_fits
from schuler.navigation.error_models.catalogue import ErrorModel, error_model, split_model_name
from schuler.navigation.error_models.changing_noise import (
    ChangingNoise,
    averaged_noise,
    fitted_noise,
    rest_variance,
)
from schuler.navigation.error_models.sensor_denoising import PAPERS_RATE, SensorDenoising
from schuler.noise import NoiseModel

SIMULATED_REST = 7200.0
"""Seconds of rest that are simulated where AR models are wanted and no static log is there."""
SEED = 20130101
ORDERS = {"15AR": 1, "27AR": 3}


def error_models(
    names: Sequence[str],
    *,
    noise_model: NoiseModel | None = None,
    static: ImuRecording | None = None,
    rate: float | None = None,
    denoising: Literal["off-line", "causal"] = "off-line",
) -> tuple[ErrorModel, ...]:
    """Build error models by name from what is known of the sensor.

    Parameters
    ----------
    names : sequence of str
        As for `error_model`.
    noise_model : NoiseModel, optional
        Of the sensor, all six channels; default: identified from `static`.
    static : ImuRecording, optional
        The sensor at rest, hours of it for slow noise. AR models are fitted to it; without it to
        a simulation of the noise model, which says so in the notes.
    rate : float, optional
        Samples a second of the drive, which AR models of order above one have to share.
    denoising : {"off-line", "causal"}
        For 18AVWD.

    Returns
    -------
    tuple of ErrorModel
        In the order of the names.

    Raises
    ------
    InputError
        A name that is not known, neither a noise model nor a static log, or a log of another
        rate.

    Examples
    --------
    >>> from schuler import NoiseModel, WhiteNoise, error_models
    >>> model = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))
    >>> [one.name for one in error_models(("own", "own+turn-on"), noise_model=model)]
    ['own', 'own+turn-on']
    """
    split = [split_model_name(name) for name in names]
    bases = [base for base, _ in split]
    if noise_model is None and static is None:
        raise InputError(
            f"error models {', '.join(names)} of an unknown sensor",
            expected="a noise model or a static recording",
            cure="give --noise FILE (from schuler characterize) or --static FILE",
        )
    readings: dict[str, AllanReading]
    if noise_model is None:
        assert static is not None
        noise_model, readings = readings_of_static(static)
    else:
        readings = allan_readings(noise_model)
    orders = tuple(sorted({ORDERS[b] for b in bases if b in ORDERS}))
    fits = {}
    note: tuple[str, ...] = ()
    if orders:
        record, note = _rest(noise_model, static, rate, orders)
        fits = autoregressive_fits(record, orders)
    changing: dict[str, ChangingNoise] = {}
    asked = {option for _, options in split for option in options}
    if static is not None and "garch" in asked:
        changing["garch"] = fitted_noise(static)
    if static is not None and "averaged" in asked:
        changing["averaged"] = averaged_noise(1.0 / static.rate, reference=rest_variance(static))
    built = []
    for name, (base, options) in zip(names, split, strict=True):
        model = error_model(
            name,
            readings,
            autoregressive=fits.get(ORDERS.get(base, 0)),
            noise_model=noise_model,
            denoising=SensorDenoising.table_7(denoising, rate or PAPERS_RATE),
            changing_noise=next((changing[o] for o in options if o in changing), None),
        )
        built.append(replace(model, notes=model.notes + note) if base in ORDERS else model)
    return tuple(built)


def _rest(
    noise_model: NoiseModel,
    static: ImuRecording | None,
    rate: float | None,
    orders: tuple[int, ...],
) -> tuple[ImuRecording, tuple[str, ...]]:
    if static is not None:
        away = 0.0 if rate is None else abs(static.rate / rate - 1.0)
        if away > 1e-3 and max(orders) > 1:
            raise InputError(
                f"a static log of {static.rate:.6g} Hz for AR({max(orders)}) models of a drive of "
                f"{rate:.6g} Hz",
                expected="the same rate: an AR model exists at the step it was fitted at",
            )
        return static, ()
    from schuler.simulation import simulate_static

    rate = rate or noise_model.rate
    if rate is None:
        raise InputError("AR models without a rate", expected="a static recording")
    record = simulate_static(noise_model, SIMULATED_REST, rate, np.random.default_rng(SEED))
    hours = SIMULATED_REST / 3600.0
    return record, (f"AR models fitted to {hours:g} h simulated from the noise model",)
