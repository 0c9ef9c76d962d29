"""Sensor error states of an array: every sensor its own, or what is left of them when fused.

The fused rate and force are pi ell (spec 6.2), so a state of one sensor shows in the body along
the column of pi that belongs to its axis, and the input noise is pi C pi'. That is all in which
the extended and the synthetic mechanization differ from a single IMU (spec 7.4, 7.5): the filter
is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from schuler.arrays.synthesis.least_squares import least_squares
from schuler.data import Mounting
from schuler.errors import InputError, ModelError
from schuler.navigation.error_models.sensor_states import FILTER_CHANNELS, SensorErrorModel
from schuler.noise.noise_model import NoiseModel
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Fusion:
    """How the sensors of an array are added up in the body frame, spec 6.2."""

    # accel, gyro: (3, 3 k) pi of either: left inverses of the stacked axes, columns by IMU, then by
    # axis
    accel: FloatArray
    gyro: FloatArray
    axes: FloatArray  # (3 k, 3): the stacked sensor axes in the body, A
    # (3,): where the fused IMU sits: the mean place of the accelerometers by their weight, body, m
    centre: FloatArray

    @property
    def count(self) -> int:
        """Number of IMUs."""
        return int(self.axes.shape[0]) // 3

    def of(self, channel: int) -> FloatArray:
        """Pi of the accelerometers (channel 0-2) or gyros (3-5)."""
        return self.accel if channel < 3 else self.gyro


def white_variances(models: Sequence[SensorErrorModel]) -> FloatArray:
    """Squared densities of all sensor axes, (2, 3 k): accelerometers, gyros."""
    white = np.stack([m.white_density for m in models]) ** 2
    return np.stack([white[:, :3].ravel(), white[:, 3:].ravel()])


def left_inverse(axes: FloatArray, variance: FloatArray) -> FloatArray:
    """Return pi = (A' P A)^-1 A' P of the axes with finite variance; columns of others are zero."""
    used = np.isfinite(variance)
    # sensors without any white noise count alike
    weighed = variance[used] if np.all(variance[used] > 0.0) else np.ones(int(used.sum()))
    pi = np.zeros((3, variance.size))
    pi[:, used] = least_squares(axes[used], weighed).pi
    return pi


def fusion_of(mounting: Mounting, models: Sequence[SensorErrorModel]) -> Fusion:
    """Return pi = (A' P A)^-1 A' P with the inverse of the white noise as weight P."""
    axes = np.concatenate([c.T for c in mounting.rotation])
    variance = white_variances(models)
    accel = left_inverse(axes, variance[0])
    share = np.array(
        [np.trace(accel[:, 3 * i : 3 * i + 3] @ axes[3 * i : 3 * i + 3]) / 3.0
         for i in range(mounting.count)]
    )  # fmt: skip
    return Fusion(accel, left_inverse(axes, variance[1]), axes, share @ mounting.position)


def extended_model(
    models: Sequence[SensorErrorModel], fusion: Fusion, names: Sequence[str]
) -> SensorErrorModel:
    """Lay out the error states of every sensor of an array. Spec 7.5."""
    _check_continuous(models)
    first = np.concatenate([[0], np.cumsum([m.size for m in models])])
    total = int(first[-1])
    initial = np.zeros((total, total))
    for model, a, b in zip(models, first[:-1], first[1:], strict=True):
        initial[a:b, a:b] = model.initial_covariance
    partner = np.concatenate(
        [
            np.where(m.partner >= 0, m.partner + a, -1)
            for m, a in zip(models, first[:-1], strict=True)
        ]
    )
    shown = np.concatenate([body_directions(m, fusion, i) for i, m in enumerate(models)])
    return _with_white(
        SensorErrorModel(
            channel=np.concatenate([m.channel for m in models]),
            direction=shown,
            drift=np.concatenate([m.drift for m in models]),
            diffusion=np.concatenate([m.diffusion for m in models]),
            partner=partner.astype(np.int64),
            initial_covariance=initial,
            white_density=np.zeros(6),
            names=tuple(f"{n} {s}" for n, m in zip(names, models, strict=True) for s in m.names),
            ignored=tuple(
                f"{n} {s}" for n, m in zip(names, models, strict=True) for s in m.ignored
            ),
        ),
        models,
        fusion,
    )


def without_idle_states(model: SensorErrorModel) -> SensorErrorModel:
    """Leave out states that start at zero and stay there: constants of standard deviation zero."""
    idle = (np.diag(model.initial_covariance) == 0.0) & (model.diffusion[:, 0] == 0.0)
    idle &= model.partner < 0
    keep = np.flatnonzero(~idle)
    place = np.cumsum(~idle) - 1
    partner = model.partner[keep]
    return replace(
        model,
        channel=model.channel[keep],
        direction=model.direction[keep],
        drift=model.drift[keep],
        diffusion=model.diffusion[keep],
        partner=np.where(partner >= 0, place[np.maximum(partner, 0)], -1),
        initial_covariance=model.initial_covariance[np.ix_(keep, keep)],
        names=tuple(model.names[j] for j in keep),
        scaled_by=model.scaled_by[keep],
    )


def body_directions(model: SensorErrorModel, fusion: Fusion, imu: int) -> FloatArray:
    """How the states of one IMU show in the fused measurement."""
    own = sensor_directions(model)
    shown = np.zeros((model.size, 3))
    for j, channel in enumerate(model.channel):
        if channel >= 0:
            shown[j] = fusion.of(int(channel))[:, 3 * imu : 3 * imu + 3] @ own[j]
    return shown


def sensor_directions(model: SensorErrorModel) -> FloatArray:
    """How states show on the axes of their own IMU, (m, 3), unit vectors written out."""
    unit = np.eye(3)[np.maximum(model.channel, 0) % 3]
    return np.where(np.isnan(model.direction[:, :1]), unit, model.direction)


def fused_model(
    models: Sequence[SensorErrorModel], fusion: Fusion
) -> tuple[SensorErrorModel, FloatArray]:
    """Merge the error states of all sensors that move alike. Spec 7.4.

    States of one kind (accelerometers or gyros) with the same time constant cannot be told apart
    in the fused measurement: three states for each time constant carry all that is seen of them.
    """
    extended = extended_model(models, fusion, [str(i + 1) for i in range(len(models))])
    alone = np.flatnonzero((extended.partner >= 0) | (extended.channel < 0))
    groups: dict[tuple[bool, float], list[int]] = {}
    for j in np.flatnonzero((extended.partner < 0) & (extended.channel >= 0)):
        key = (bool(extended.channel[j] < 3), round(float(extended.drift[j, 0]), 12))
        groups.setdefault(key, []).append(int(j))
    kinds = _state_kinds(extended)
    rows: list[FloatArray] = []
    channel, direction, drift, diffusion, names = [], [], [], [], []
    for (of_force, rate), members in sorted(groups.items(), key=lambda g: (not g[0][0], g[0][1])):
        shown = extended.direction[members]
        spread = shown.T @ (extended.diffusion[members, 0][:, None] * shown)
        axes = _principal_axes(spread)
        for a in range(3):
            row = np.zeros(extended.size)
            row[members] = shown @ axes[:, a]
            rows.append(row)
            channel.append(a if of_force else 3 + a)
            unit = np.array_equal(axes[:, a], np.eye(3)[a])
            direction.append(np.full(3, np.nan) if unit else axes[:, a])
            drift.append([rate, 0.0])
            diffusion.append([float(axes[:, a] @ spread @ axes[:, a]), 0.0])
            names.append(f"{FILTER_CHANNELS[channel[-1]]} {kinds[members[0]]}")
    base = len(rows)
    for place, j in enumerate(alone):
        row = np.zeros(extended.size)
        row[j] = 1.0
        rows.append(row)
        channel.append(int(extended.channel[j]))
        direction.append(extended.direction[j])
        drift.append(list(extended.drift[j]))
        diffusion.append(list(extended.diffusion[j]))
        names.append(extended.names[j])
        alone[place] = j
    partner = np.full(len(rows), -1, dtype=np.int64)
    for place, j in enumerate(alone):
        if extended.partner[j] >= 0:
            partner[base + place] = base + int(np.flatnonzero(alone == extended.partner[j])[0])
    merge = np.stack(rows) if rows else np.zeros((0, 0))
    model = replace(
        extended,
        channel=np.array(channel, dtype=np.int64),
        direction=np.array(direction).reshape(-1, 3),
        drift=np.array(drift).reshape(-1, 2),
        diffusion=np.array(diffusion).reshape(-1, 2),
        partner=partner,
        initial_covariance=merge @ extended.initial_covariance @ merge.T,
        names=tuple(names),
        scaled_by=np.full(len(rows), -1, dtype=np.int64),
    )
    return model, merge


def _principal_axes(spread: FloatArray) -> FloatArray:
    """Axes along which the driving noise is independent; the body's own where they will do."""
    off = spread - np.diag(np.diag(spread))
    if np.abs(off).max() <= 1e-12 * max(np.abs(spread).max(), 1e-300):
        return np.eye(3)
    vectors: FloatArray = np.linalg.eigh(spread)[1]
    return vectors


def _state_kinds(model: SensorErrorModel) -> list[str]:
    """What the states are, without IMU and channel: "random walk", "Gauss-Markov"."""
    kinds = []
    for name, channel in zip(model.names, model.channel, strict=True):
        before = f"{FILTER_CHANNELS[channel]} " if channel >= 0 else "\0"
        kinds.append(name.partition(before)[2] or name)
    return kinds


def fused_white(fusion: Fusion, variance: FloatArray) -> FloatArray:
    """Covariance densities of the fused accelerometers and gyros, pi C pi', (2, 3, 3)."""
    finite = np.where(np.isfinite(variance), variance, 0.0)
    return np.stack(
        [(pi * own) @ pi.T for pi, own in zip((fusion.accel, fusion.gyro), finite, strict=True)]
    )


def _with_white(
    model: SensorErrorModel, models: Sequence[SensorErrorModel], fusion: Fusion
) -> SensorErrorModel:
    density, correlation = np.zeros(6), np.tile(np.eye(3), (2, 1, 1))
    for part, covariance in enumerate(fused_white(fusion, white_variances(models))):
        sd = np.sqrt(np.diag(covariance))
        density[3 * part : 3 * part + 3] = sd
        if np.all(sd > 0.0):
            correlation[part] = covariance / np.outer(sd, sd)
    return replace(model, white_density=density, white_correlation=correlation)


def _check_continuous(models: Sequence[SensorErrorModel]) -> None:
    for model in models:
        if model.blocks or np.any(model.scaled_by >= 0):
            raise ModelError(
                "the error model of an array has states that exist at one sample interval only, "
                "or that follow the motion",
                expected="white noise, Gauss-Markov, random walk, bias instability, constants",
                cure="leave autoregressive and scale-factor terms out for arrays",
            )


def noise_models_of(
    noise_models: NoiseModel | Sequence[NoiseModel], count: int
) -> tuple[NoiseModel, ...]:
    """Return one noise model for each IMU."""
    if isinstance(noise_models, NoiseModel):
        return (noise_models,) * count
    if len(noise_models) != count:
        raise InputError(
            f"{len(noise_models)} noise models for {count} IMUs",
            expected="one for all, or one for each",
        )
    return tuple(noise_models)
