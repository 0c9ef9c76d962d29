"""Sensor error states of the filter: how they move, where they show, what is white. Spec 7.3.

The states come in blocks: single states and pairs in continuous time, and blocks of any size that
exist at one sample interval only (autoregressive noise). A state shows in the body frame along a
direction, by itself or in proportion to what a channel measures (scale factor, misalignment), or
it shows in no channel at all and only in measurements (a vehicle's mounting, slow errors of GNSS).
navigation/error_models/sensor_error_model.py makes them out of the noise model of a sensor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import CHANNELS
from schuler.errors import ModelError
from schuler.kernels.navigation.filter_data import SensorModel
from schuler.types import FloatArray, IntArray

# the filter counts accelerometers first, as they drive the velocity
FILTER_CHANNELS = (*CHANNELS[3:], *CHANNELS[:3])

# channel of a state that shows in measurements only
NO_CHANNEL = -1


@dataclass(frozen=True, slots=True, eq=False)
class DiscreteBlock:
    """Neighbouring states that move together, once a sample."""

    first: int  # place of the first of them among the sensor states
    # transition, noise_covariance: (p, p) over one interval
    transition: FloatArray
    noise_covariance: FloatArray
    # the only sample interval at which the block exists, s; at whole multiples, and across gaps, it
    # is raised to the power of the steps, and the noise is accumulated.
    interval: float

    @property
    def size(self) -> int:
        """Number of states p."""
        return len(self.transition)


def _no_integers() -> IntArray:
    return np.empty(0, dtype=np.int64)


def _uncorrelated() -> FloatArray:
    return np.tile(np.eye(3), (2, 1, 1))


@dataclass(frozen=True, slots=True, eq=False)
class SensorErrorModel:
    """Sensor error states of the filter and the white noise of its channels.

    Parameters
    ----------
    channel : (m,) ndarray of int
        Channel of each state: 0-2 accelerometer, 3-5 gyro, x, y, z; -1 (`NO_CHANNEL`): it shows
        in measurements only.
    direction : (m, 3) ndarray
        How the state shows in the body frame; NaN: it is the whole error of its own axis.
    drift : (m, 2) ndarray
        1/s: on itself, and of its partner on it. Zero for states of a discrete block.
    diffusion : (m, 2) ndarray
        Noise densities: on the state, and between it and its partner.
    partner : (m,) ndarray of int
        Other state of a pair, next to it, or -1.
    initial_covariance : (m, m) ndarray
        Before any alignment.
    white_density : (6,) ndarray
        N of each channel, accelerometers (m/s²/sqrt(Hz)) then gyros (rad/s/sqrt(Hz)).
    names : tuple of str
        E.g. "gyro_x random walk".
    ignored : tuple of str
        Parts that a filter of this kind cannot hold and leaves out (bounded quantisation).
    scaled_by : (m,) ndarray of int
        Channel whose measured value multiplies `direction` (scale factor, misalignment,
        g-sensitivity), -1: none. Left out: none at all.
    blocks : tuple of DiscreteBlock
        States that exist at one sample interval only.
    white_correlation : (2, 3, 3) ndarray
        Correlation of the white noise between the axes of the accelerometers and of the gyros,
        as fused or skewed sensors have it.

    Raises
    ------
    ModelError
        Arrays that do not fit together.

    Examples
    --------
    >>> from schuler import NoiseModel, WhiteNoise, sensor_error_model
    >>> noise = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))
    >>> states = sensor_error_model(noise, turn_on_accel=0.1, turn_on_gyro=0.01)
    >>> len(states.names)
    6
    """

    channel: IntArray
    direction: FloatArray
    drift: FloatArray
    diffusion: FloatArray
    partner: IntArray
    initial_covariance: FloatArray
    white_density: FloatArray
    names: tuple[str, ...]
    ignored: tuple[str, ...] = ()
    scaled_by: IntArray = field(default_factory=_no_integers)
    blocks: tuple[DiscreteBlock, ...] = ()
    white_correlation: FloatArray = field(default_factory=_uncorrelated)

    def __post_init__(self) -> None:
        m = self.size
        if self.scaled_by.size == 0 and m:
            object.__setattr__(self, "scaled_by", np.full(m, -1, dtype=np.int64))
        shapes = {
            "direction": (m, 3),
            "drift": (m, 2),
            "diffusion": (m, 2),
            "partner": (m,),
            "initial_covariance": (m, m),
            "white_density": (6,),
            "scaled_by": (m,),
            "white_correlation": (2, 3, 3),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ModelError(
                    f"'{name}' of the sensor error model has the shape {getattr(self, name).shape}",
                    expected=f"{shape} for {m} states",
                )
        if np.any((self.scaled_by >= 0) & np.isnan(self.direction[:, 0])):
            raise ModelError("a state in proportion to a channel has no direction")
        pairs = np.flatnonzero(self.partner >= 0)
        if np.any(np.abs(self.partner[pairs] - pairs) != 1):
            raise ModelError("the two states of a pair are not next to each other")

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.channel.size)

    @property
    def white_covariance(self) -> FloatArray:
        """Covariance densities (2, 3, 3) of the white noise of accelerometers and gyros."""
        density = self.white_density.reshape(2, 3)
        return self.white_correlation * density[:, :, None] * density[:, None, :]

    def constant_states(self, channel: int) -> IntArray:
        """Indices of the states of a channel that keep a constant: walks and turn-on biases."""
        own = (self.channel == channel) & (self.drift[:, 0] == 0.0) & (self.partner < 0)
        own &= self.scaled_by < 0
        for block in self.blocks:
            own[block.first : block.first + block.size] = False
        return np.flatnonzero(own)

    def with_noise(self, white: ArrayLike, drive: ArrayLike) -> SensorErrorModel:
        """Multiply standard deviations of the noise."""
        factor = np.broadcast_to(np.asarray(drive, dtype=np.float64), (self.size,))
        shared = factor.copy()
        pairs = self.partner >= 0
        shared[pairs] = factor[self.partner[pairs]]
        diffusion = self.diffusion * np.column_stack([factor**2, factor * shared])
        blocks = tuple(
            replace(b, noise_covariance=b.noise_covariance * np.outer(own, own))
            for b in self.blocks
            for own in [factor[b.first : b.first + b.size]]
        )
        density = self.white_density * np.asarray(white, dtype=np.float64)
        return replace(self, white_density=density, diffusion=diffusion, blocks=blocks)

    def with_states(
        self,
        names: Sequence[str],
        initial_sd: ArrayLike,
        *,
        walk_density: ArrayLike = 0.0,
        correlation_time: ArrayLike = np.inf,
        channel: ArrayLike = NO_CHANNEL,
        direction: ArrayLike = 0.0,
        scaled_by: ArrayLike = -1,
    ) -> SensorErrorModel:
        """Append single states: random walks, constants or Gauss-Markov processes."""
        k, m = len(names), self.size
        sd = np.broadcast_to(np.asarray(initial_sd, dtype=np.float64), (k,))
        time = np.broadcast_to(np.asarray(correlation_time, dtype=np.float64), (k,))
        walk = np.broadcast_to(np.asarray(walk_density, dtype=np.float64), (k,)) ** 2
        stationary = np.isfinite(time) & (walk == 0.0)
        walk = np.where(stationary, 2.0 * sd**2 / time, walk)
        initial = np.zeros((m + k, m + k))
        initial[:m, :m] = self.initial_covariance
        initial[range(m, m + k), range(m, m + k)] = sd**2
        none = np.zeros(k)

        def more(old: IntArray, new: ArrayLike) -> IntArray:
            wide = np.broadcast_to(np.asarray(new, dtype=np.int64), (k,))
            return np.concatenate([old, wide])

        shown = np.broadcast_to(np.asarray(direction, dtype=np.float64), (k, 3))
        return replace(
            self,
            channel=more(self.channel, channel),
            direction=np.concatenate([self.direction, shown]),
            drift=np.concatenate([self.drift, np.column_stack([-1.0 / time, none])]),
            diffusion=np.concatenate([self.diffusion, np.column_stack([walk, none])]),
            partner=more(self.partner, -1),
            initial_covariance=initial,
            names=(*self.names, *names),
            scaled_by=more(self.scaled_by, scaled_by),
        )

    def layout(self) -> SensorModel:
        """Return the states as the kernels want them."""
        m = self.size
        widest = max([1, *(b.size for b in self.blocks)])
        if np.any(self.partner >= 0):
            widest = max(widest, 2)
        block = np.column_stack([np.arange(m), np.ones(m, dtype=np.int64)])
        interval, drift, diffusion = np.zeros(m), np.zeros((m, widest)), np.zeros((m, widest))
        drift[:, 0], diffusion[:, 0] = self.drift[:, 0], self.diffusion[:, 0]
        for j in np.flatnonzero(self.partner >= 0):
            other = int(self.partner[j])
            block[j] = np.array([min(int(j), other), 2])
            place = int(j - block[j, 0])
            drift[j, place], drift[j, 1 - place] = self.drift[j]
            diffusion[j, place], diffusion[j, 1 - place] = self.diffusion[j]
        for b in self.blocks:
            own = slice(b.first, b.first + b.size)
            block[own] = [b.first, b.size]
            interval[own] = b.interval
            drift[own, : b.size] = b.transition
            diffusion[own, : b.size] = b.noise_covariance
        return SensorModel(
            channel=np.array(self.channel, dtype=np.int64),
            direction=np.array(self.direction, dtype=np.float64, order="C"),
            scaled_by=np.array(self.scaled_by, dtype=np.int64),
            block=np.ascontiguousarray(block),
            interval=interval,
            drift=drift,
            diffusion=diffusion,
            white=np.ascontiguousarray(self.white_covariance),
            discrete=bool(np.any(interval > 0.0)),
            modulated=bool(np.any(self.scaled_by >= 0)),
        )


def no_sensor_states(white_density: ArrayLike = 0.0) -> SensorErrorModel:
    """Return a model without sensor states."""
    return SensorErrorModel(
        channel=_no_integers(),
        direction=np.empty((0, 3)),
        drift=np.empty((0, 2)),
        diffusion=np.empty((0, 2)),
        partner=_no_integers(),
        initial_covariance=np.empty((0, 0)),
        white_density=np.broadcast_to(np.asarray(white_density, dtype=np.float64), (6,)).copy(),
        names=(),
    )
