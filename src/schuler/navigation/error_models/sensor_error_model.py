"""From the noise model of a sensor to states of the filter. Spec 7.3, design 5 and 6.

Nothing here knows which process a state came from: any sum will do. Parts in continuous time serve
at any rate; parts that are defined sample by sample (autoregressive, ARMA) serve at their own
interval and its multiples, unless an equal sum of Gauss-Markov noises exists.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.errors import ModelError
from schuler.navigation.error_models.sensor_states import (
    FILTER_CHANNELS,
    DiscreteBlock,
    SensorErrorModel,
)
from schuler.noise.arma import ARMA
from schuler.noise.arma_exchange import arma_to_gauss_markov_sum
from schuler.noise.autoregressive import Autoregressive
from schuler.noise.base import Process, StateSpace
from schuler.noise.drifts import TurnOnBias
from schuler.noise.noise_model import NoiseModel
from schuler.noise.white import Quantization
from schuler.types import FloatArray

__all__ = [
    "FILTER_CHANNELS",
    "DiscreteBlock",
    "SensorErrorModel",
    "sensor_error_model",
    "with_misalignments",
    "with_scale_factors",
]

# the rate of an IMU is seldom exactly what its maker says: this much away is still the interval
SAME_INTERVAL = 0.01
FASTEST_FLICKER = 1.0
"""Seconds: correlation time of the first Gauss-Markov noise of a flicker sum in a filter."""


def sensor_error_model(
    noise_model: NoiseModel,
    *,
    turn_on_accel: float,
    turn_on_gyro: float,
    interval: float | None = None,
    hold_constants: bool = True,
) -> SensorErrorModel:
    """Lay out the states of all six channels, each with a state that can hold a constant.

    A channel without a constant state gets a turn-on bias: without one a filter forgets the
    constant part within an outage.

    Parameters
    ----------
    noise_model : NoiseModel
        Of one IMU.
    turn_on_accel, turn_on_gyro : float
        Standard deviations of constants at switch-on, m/s² and rad/s.
    interval : float, optional
        Between samples, s; for processes that exist at one interval only.
    hold_constants : bool
        Whether channels without a constant state get one.

    Returns
    -------
    SensorErrorModel
        For `observability` and filters.

    Raises
    ------
    ModelError
        A process without a state space.

    Examples
    --------
    >>> import schuler
    >>> noise = schuler.NoiseModel.isotropic(schuler.WhiteNoise(1e-3), schuler.WhiteNoise(1e-2))
    >>> schuler.sensor_error_model(noise, turn_on_accel=0.1, turn_on_gyro=0.01).size
    6
    """
    names: list[str] = []
    ignored: list[str] = []
    spaces: list[tuple[int, StateSpace]] = []
    white = np.zeros(6)
    for c, name in enumerate(FILTER_CHANNELS):
        turn_on = turn_on_accel if c < 3 else turn_on_gyro
        # flicker faster than a second acts as white noise on a filter
        parts = list(noise_model.process(name).coarser(FASTEST_FLICKER))
        held = [p for p in parts if not isinstance(p, Quantization)]
        ignored += [f"{name} quantisation" for p in parts if isinstance(p, Quantization)]
        found = [
            s for p in held for q in _at_interval(p, interval, name) for s in [_space(q, name)]
        ]
        white[c] = np.sqrt(sum(s.white_density**2 for s in found))
        own = [s for s in found if s.size]
        constant = [s.size == 1 and s.transition[0, 0] == 1.0 for s in own]
        if any(constant):
            own[constant.index(True)] = _wider_start(own[constant.index(True)], turn_on)
        elif hold_constants:
            own.append(TurnOnBias(turn_on).state_space(1.0))
        elif own:
            slow = int(np.argmax([_slowest(s)[1] for s in own]))
            own[slow] = _wider_start(own[slow], turn_on)
        spaces += [(c, s) for s in own]
        names += [f"{name} {state}" for s in own for state in s.names]
    return _stack(spaces, names, ignored, white)


def with_scale_factors(
    model: SensorErrorModel, *, accel_sd: float = 0.0, gyro_sd: float = 0.0
) -> SensorErrorModel:
    """Append scale factors of the axes as constants."""
    for c, name in enumerate(FILTER_CHANNELS):
        sd = accel_sd if c < 3 else gyro_sd
        if sd > 0.0:
            model = model.with_states(
                [f"{name} scale factor"],
                sd,
                channel=c,
                direction=np.eye(3)[c % 3][None],
                scaled_by=c,
            )
    return model


def with_misalignments(
    model: SensorErrorModel, *, accel_sd: float = 0.0, gyro_sd: float = 0.0
) -> SensorErrorModel:
    """Append what every axis feels of the two others, as constants."""
    for c, name in enumerate(FILTER_CHANNELS):
        sd = accel_sd if c < 3 else gyro_sd
        base = 0 if c < 3 else 3
        others = [base + a for a in range(3) if base + a != c]
        if sd > 0.0:
            model = model.with_states(
                [f"{name} misalignment to {FILTER_CHANNELS[o]}" for o in others],
                sd,
                channel=c,
                direction=np.tile(np.eye(3)[c % 3], (2, 1)),
                scaled_by=others,
            )
    return model


def _at_interval(part: Process, interval: float | None, channel: str) -> tuple[Process, ...]:
    """A part that the filter can hold at an interval: itself, or an equal sum."""
    if not isinstance(part, Autoregressive | ARMA):
        return (part,)
    if isinstance(part, ARMA):
        form = part
    else:
        phi = tuple(-a for a in part.coefficients)
        form = ARMA(phi, (), part.driving_variance, part.interval)
    try:
        return arma_to_gauss_markov_sum(form).components
    except ModelError:
        pass
    steps = 0.0 if interval is None else interval / part.interval
    whole = round(steps)
    if interval is None or whole < 1 or abs(steps / whole - 1.0) > SAME_INTERVAL:
        asked = "no interval was given" if interval is None else f"the IMU's is {interval:g} s"
        raise ModelError(
            f"{channel} has a part that exists only at one sample interval, {part.interval:g} s, "
            f"and {asked}",
            expected="an IMU of this interval or a whole multiple of it",
            cure="fit the model at the rate of the IMU, or use Gauss-Markov, random walk or bias "
            "instability terms",
        )
    return (part,)


def _space(part: Process, channel: str) -> StateSpace:
    own = part.interval if isinstance(part, Autoregressive | ARMA) else 1.0
    space = part.state_space(own)
    discrete = space.size and (space.drift is None or space.diffusion is None)
    if discrete and not isinstance(part, Autoregressive | ARMA):
        raise ModelError(
            f"{channel} has a part of kind '{part.kind}' that exists only at one sample interval",
            expected="processes in continuous time, autoregressive or ARMA noise",
        )
    return space


def _slowest(space: StateSpace) -> tuple[int, float]:
    """State of a part that forgets last, and its rate in 1/s; discrete blocks count as slow."""
    if space.drift is None:
        return 0, 0.0
    rate = np.where(space.output == 1.0, np.diag(space.drift), -np.inf)
    return int(np.argmax(rate)), float(rate.max())


def _wider_start(space: StateSpace, turn_on: float) -> StateSpace:
    """Add an unknown constant to the states as they would be had it been there for ever."""
    shared = np.zeros(space.size)
    if space.drift is not None:
        shared[_slowest(space)[0]] = 1.0
    elif space.output[0] == 1.0:
        # Harvey's form: the states behind the first are what the past says of later samples
        shared[:] = np.cumsum(space.transition[::-1, 0])[::-1]
        shared[0] = 1.0
    else:
        shared[:] = 1.0
    covariance = space.initial_covariance + turn_on**2 * np.outer(shared, shared)
    return replace(space, initial_covariance=covariance)


def _stack(
    spaces: list[tuple[int, StateSpace]],
    names: list[str],
    ignored: list[str],
    white: FloatArray,
) -> SensorErrorModel:
    channel = np.array([c for c, s in spaces for _ in range(s.size)], dtype=np.int64)
    m = channel.size
    direction = np.full((m, 3), np.nan)
    drift, diffusion = np.zeros((m, 2)), np.zeros((m, 2))
    partner = np.full(m, -1, dtype=np.int64)
    initial = np.zeros((m, m))
    blocks: list[DiscreteBlock] = []
    first = 0
    for c, space in spaces:
        own = slice(first, first + space.size)
        initial[own, own] = space.initial_covariance
        hidden = space.output != 1.0
        direction[own][hidden] = np.eye(3)[c % 3] * space.output[hidden, None]
        if space.drift is None or space.diffusion is None:
            blocks.append(DiscreteBlock(first, space.transition, space.noise_covariance, space.dt))
        else:
            for block in space.blocks:
                for local in range(int(block.start), int(block.stop)):
                    j = first + local
                    drift[j, 0] = space.drift[local, local]
                    diffusion[j, 0] = space.diffusion[local, local]
                    if block.stop - block.start == 2:
                        other = block.start + block.stop - 1 - local
                        partner[j] = first + other
                        drift[j, 1] = space.drift[local, other]
                        diffusion[j, 1] = space.diffusion[local, other]
        first += space.size
    return SensorErrorModel(
        channel=channel,
        direction=direction,
        drift=drift,
        diffusion=diffusion,
        partner=partner,
        initial_covariance=initial,
        white_density=white,
        names=tuple(names),
        ignored=tuple(ignored),
        blocks=tuple(blocks),
    )


# switch-on constants of consumer MEMS: 30 mg, 0.5 deg/s
TURN_ON_ACCEL = 0.3
TURN_ON_GYRO = float(np.radians(0.5))


def generic_noise_model() -> NoiseModel:
    """Where tuning starts when nobody says anything about the sensor: a consumer MEMS in a car."""
    from schuler.noise import RandomWalk, WhiteNoise

    accel = WhiteNoise(5e-3) + RandomWalk(5e-4)
    gyro = WhiteNoise(1e-3) + RandomWalk(2e-5)
    processes = {f"{s}_{a}": p for s, p in (("gyro", gyro), ("accel", accel)) for a in "xyz"}
    return NoiseModel(processes=processes, source="generic consumer MEMS, to be tuned")
