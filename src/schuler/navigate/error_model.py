"""From the noise model of a sensor to states of the filter. Spec 7.3, design 5 and 6.

Every state belongs to one channel and shows in the body frame along a direction. Nothing here
knows which process a state came from: any sum whose parts exist in continuous time will do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import CHANNELS
from schuler.errors import ModelError
from schuler.processes.base import StateSpace
from schuler.processes.drifts import TurnOnBias
from schuler.processes.noise_model import NoiseModel
from schuler.processes.white import Quantization

FloatArray = NDArray[np.float64]

# the filter counts accelerometers first, as they drive the velocity
FILTER_CHANNELS = (*CHANNELS[3:], *CHANNELS[:3])


@dataclass(frozen=True, slots=True, eq=False)
class SensorErrorModel:
    """Sensor error states of the filter and the white noise of its channels.

    Parameters
    ----------
    channel : (m,) ndarray of int
        Channel of each state: 0-2 accelerometer, 3-5 gyro, x, y, z.
    direction : (m, 3) ndarray
        How the state shows in the body frame; NaN: it is the whole error of its own axis.
    drift : (m, 2) ndarray
        1/s: on itself, and of its partner on it.
    diffusion : (m, 2) ndarray
        Noise densities: on the state, and between it and its partner.
    partner : (m,) ndarray of int
        Other state of a block of two, or -1.
    initial_covariance : (m, m) ndarray
        Before any alignment.
    white_density : (6,) ndarray
        N of each channel, accelerometers (m/s²/sqrt(Hz)) then gyros (rad/s/sqrt(Hz)).
    names : tuple of str
        E.g. "gyro_x random walk".
    ignored : tuple of str
        Parts that a filter of this kind cannot hold and leaves out (bounded quantisation).
    """

    channel: NDArray[np.int64]
    direction: FloatArray
    drift: FloatArray
    diffusion: FloatArray
    partner: NDArray[np.int64]
    initial_covariance: FloatArray
    white_density: FloatArray
    names: tuple[str, ...]
    ignored: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.channel.size)

    def constant_states(self, channel: int) -> NDArray[np.int64]:
        """Indices of the states of a channel that keep a constant: walks and turn-on biases.

        Parameters
        ----------
        channel : int
            0-5 as in `channel`.

        Returns
        -------
        ndarray of int
            Usually one index.
        """
        own = (self.channel == channel) & (self.drift[:, 0] == 0.0) & (self.partner < 0)
        return np.flatnonzero(own)


def sensor_error_model(
    noise_model: NoiseModel,
    *,
    turn_on_accel: float,
    turn_on_gyro: float,
    hold_constants: bool = True,
) -> SensorErrorModel:
    """Lay out the states of all six channels, each with a state that can hold a constant.

    A channel without a constant state gets a turn-on bias: without one a filter forgets the
    constant part within an outage (spec 7.3, turn-on bias).

    Parameters
    ----------
    noise_model : NoiseModel
        All six channels.
    turn_on_accel, turn_on_gyro : float
        Standard deviation of the constant at switch-on, m/s² and rad/s, added to what the
        model itself says of the start.
    hold_constants : bool
        False leaves channels without a constant state as they are, as the filters of S004 do;
        their slowest part starts with the turn-on variance instead, and forgets it.

    Returns
    -------
    SensorErrorModel
        States in the order accelerometer x, y, z, gyro x, y, z.

    Raises
    ------
    ModelError
        A channel is missing, or a part exists only at one sample step.
    """
    channel: list[int] = []
    names: list[str] = []
    ignored: list[str] = []
    spaces: list[StateSpace] = []
    white = np.zeros(6)
    for c, name in enumerate(FILTER_CHANNELS):
        turn_on = turn_on_accel if c < 3 else turn_on_gyro
        parts = list(noise_model.process(name).components)
        held = [p for p in parts if not isinstance(p, Quantization)]
        ignored += [f"{name} quantisation" for p in parts if isinstance(p, Quantization)]
        variance = 0.0
        constant = False
        first = len(spaces)
        for part in held:
            space = _continuous(part.state_space(1.0), name)
            variance += space.white_density**2
            if space.size == 1 and space.transition[0, 0] == 1.0 and not constant:
                constant = True
                space = _wider_start(space, turn_on)
            if space.size:
                spaces.append(space)
                channel += [c] * space.size
                names += [f"{name} {state}" for state in space.names]
        if hold_constants and not constant:
            spaces.append(TurnOnBias(turn_on).state_space(1.0))
            channel.append(c)
            names.append(f"{name} turn-on bias")
        elif not constant and len(spaces) > first:
            slowest = max(range(first, len(spaces)), key=lambda k: _memory(spaces[k]))
            spaces[slowest] = _wider_start(spaces[slowest], turn_on)
        white[c] = np.sqrt(variance)
    return _stack(spaces, channel, names, ignored, white)


def _continuous(space: StateSpace, channel: str) -> StateSpace:
    if space.size and (space.drift is None or space.diffusion is None):
        raise ModelError(
            f"{channel} has a part that exists only at one sample step",
            expected="processes in continuous time",
            cure="use Gauss-Markov, random walk or bias instability terms",
        )
    return space


def _memory(space: StateSpace) -> float:
    """What is left of the slowest mode after a second."""
    return float(np.abs(np.linalg.eigvals(space.transition)).max() ** (1.0 / space.dt))


def _wider_start(space: StateSpace, turn_on: float) -> StateSpace:
    """Let the states start at a common constant: rank one, as all lags of an AR share it."""
    from dataclasses import replace

    return replace(space, initial_covariance=space.initial_covariance + turn_on**2)


def _stack(
    spaces: list[StateSpace],
    channel: list[int],
    names: list[str],
    ignored: list[str],
    white: FloatArray,
) -> SensorErrorModel:
    m = len(channel)
    direction = np.full((m, 3), np.nan)
    drift, diffusion = np.zeros((m, 2)), np.zeros((m, 2))
    partner = np.full(m, -1, dtype=np.int64)
    initial = np.zeros((m, m))
    first = 0
    for space in spaces:
        assert space.drift is not None
        assert space.diffusion is not None
        initial[first : first + space.size, first : first + space.size] = space.initial_covariance
        for block in space.blocks:
            size = block.stop - block.start
            for i in range(size):
                local = block.start + i
                j = first + local
                drift[j, 0] = space.drift[local, local]
                diffusion[j, 0] = space.diffusion[local, local]
                if space.output[local] != 1.0:
                    direction[j] = 0.0
                    direction[j, channel[j] % 3] = space.output[local]
                if size == 2:
                    other = block.start + 1 - i
                    partner[j] = first + other
                    drift[j, 1] = space.drift[local, other]
                    diffusion[j, 1] = space.diffusion[local, other]
        first += space.size
    return SensorErrorModel(
        channel=np.array(channel, dtype=np.int64),
        direction=direction,
        drift=drift,
        diffusion=diffusion,
        partner=partner,
        initial_covariance=initial,
        white_density=white,
        names=tuple(names),
        ignored=tuple(ignored),
    )
