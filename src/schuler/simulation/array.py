"""Several IMUs on one body (spec 1.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import ImuRecording, Mounting
from schuler.errors import InputError
from schuler.simulation.imu import TriadErrors, ideal_imu, simulate_imu
from schuler.simulation.motions.profile import Profile
from schuler.simulation.size_effect import add_size_effect, arm_tensor

if TYPE_CHECKING:
    from schuler.noise.noise_model import NoiseModel


T = TypeVar("T")

Errors = TriadErrors | Sequence[TriadErrors | None] | None


def simulate_array(
    profile: Profile,
    rotations: ArrayLike,
    positions: ArrayLike,
    noise_models: NoiseModel | Sequence[NoiseModel | None] | None,
    rate: float,
    rng: np.random.Generator,
    *,
    size_effect: bool = True,
    gyro_errors: Errors = None,
    accel_errors: Errors = None,
    names: Sequence[str] | None = None,
    motion: ImuRecording | None = None,
    body: ArrayLike | None = None,
) -> tuple[ImuRecording, ...]:
    """Return what several IMUs on one body record.

    Parameters
    ----------
    profile : Profile
        True motion of the body.
    rotations : (k, 3, 3) array_like
        Body from sensor.
    positions : (k, 3) array_like
        In the body, m.
    noise_models : NoiseModel, sequence of NoiseModel or None, optional
        Of all or of each; None: no noise.
    rate : float
        Samples a second, Hz.
    rng : numpy.random.Generator
        Source of randomness.
    size_effect : bool
        Accelerometers away from the origin feel its turning.
    gyro_errors, accel_errors : TriadErrors or sequence, optional
        Scale factors and misalignments.
    names : sequence of str, optional
        Of the recordings.
    motion : ImuRecording, optional
        What an ideal IMU records, if it is known already.
    body : (3,) array_like, optional
        Place at which the motion is given, m.

    Returns
    -------
    tuple of ImuRecording
        One for each IMU, in its own axes.

    Raises
    ------
    InputError
        Numbers of rotations, positions and models that differ.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> place = schuler.Mounting.aligned(2)
    >>> ride = schuler.motorcycle(120.0)
    >>> rng = np.random.default_rng(0)
    >>> len(schuler.simulate_array(ride, place.rotation, place.position, None, 50.0, rng))
    2
    """
    turned = np.asarray(rotations, dtype=np.float64)
    arms = np.asarray(positions, dtype=np.float64)
    k = Mounting(turned, arms).count
    models = _for_each(noise_models, k, "noise models")
    gyros = _for_each(gyro_errors, k, "gyro errors")
    accels = _for_each(accel_errors, k, "accelerometer errors")
    titles = [f"imu {i + 1}" for i in range(k)] if names is None else list(names)
    if len(titles) != k:
        raise InputError(f"{len(titles)} names", expected=f"{k}")
    turn = np.eye(3) if body is None else np.asarray(body, dtype=np.float64)
    centre = motion
    if centre is None:
        plain = ideal_imu(profile, rate)
        centre = replace(plain, gyro=plain.gyro @ turn, accel=plain.accel @ turn)
    tensor = None
    if size_effect and arms.any():
        tensor = turn.T @ arm_tensor(profile, centre.time) @ turn
    recordings = []
    for i, child in enumerate(rng.spawn(k)):
        here = centre if tensor is None else add_size_effect(centre, tensor, arms[i])
        # row vectors: C_sb v is v C_bs
        seen = replace(here, gyro=here.gyro @ turned[i], accel=here.accel @ turned[i])
        recordings.append(
            simulate_imu(
                seen, models[i], child, gyro_errors=gyros[i], accel_errors=accels[i], name=titles[i]
            )
        )
    return tuple(recordings)


def _for_each(values: T | Sequence[T | None] | None, k: int, what: str) -> list[T | None]:
    if not isinstance(values, Sequence):
        return [values] * k
    if len(values) != k:
        raise InputError(f"{len(values)} {what}", expected=f"one for all, or {k}")
    return list(values)
