"""One IMU out of several: weighted least squares with the covariance of every sample (spec 6.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.arrays.common_axes import require_common_axes
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.faults import FaultDetection, detect_faults
from schuler.arrays.lever_arms import turning_tensor
from schuler.arrays.redundant import (
    RedundantSensors,
    Sensor,
    kinds_recorded,
    redundant_sensors,
)
from schuler.arrays.synthesis.array_noise import ArrayNoise
from schuler.arrays.synthesis.fused_noise import combine_noise_models, white_noise_model
from schuler.arrays.synthesis.fused_sensor import FusedSensor, fuse_followed, fuse_weighted
from schuler.arrays.synthesis.rate_from_accelerometers import (
    BeyondRange,
    fuse_beyond_range,
    gyro_range_of,
    masked_beyond_range,
)
from schuler.arrays.synthesis.wavelet_weights import wavelet_covariance
from schuler.arrays.tracking import OnlineSettings, start_values
from schuler.data import ImuArray, ImuRecording
from schuler.data._checks import median_step
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.keywords import refuse_unknown
from schuler.noise import NoiseModel
from schuler.types import FloatArray

Weights = Literal[
    "auto", "equal", "inverse_variance", "averaged_volatility", "ewma", "garch", "wavelet"
]
WEIGHTS: tuple[Weights, ...] = (
    "auto",
    "equal",
    "inverse_variance",
    "averaged_volatility",
    "ewma",
    "garch",
    "wavelet",
)


@dataclass(frozen=True, slots=True, eq=False)
class SyntheticImu(Exportable):
    """What several IMUs say together.

    Parameters
    ----------
    imu : ImuRecording
        In the axes of the body, at its origin; samples that too few sensors measured are left out.
    rows : (m,) ndarray of int
        Which samples of the array these are.
    gyro, accel : FusedSensor or None
        The vectors with their covariances and weights through time.
    weights : str
        How they were weighed.
    noise_model : NoiseModel
        Of the synthetic IMU, for the filter.
    faults : FaultDetection or None
        What the tests said, if faults were looked for.
    beyond : BeyondRange or None
        Where gyros were out of range, and how well accelerometers then told the rate.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, synthesize
    >>> rng = np.random.default_rng(1)
    >>> gyro, accel = 1e-3 * rng.standard_normal((2, 6_000, 4, 3))
    >>> accel[..., 2] -= 9.81
    >>> array = ImuArray(np.arange(6_000) / 100.0, gyro, accel, Mounting.aligned(4))
    >>> synthesize(array).imu.size
    6000
    """

    imu: ImuRecording
    rows: NDArray[np.int64]
    gyro: FusedSensor | None
    accel: FusedSensor | None
    weights: str
    noise_model: NoiseModel
    faults: FaultDetection | None = None
    beyond: BeyondRange | None = None

    def sensor(self, kind: Sensor) -> FusedSensor:
        """Return the fused gyros or accelerometers.

        Parameters
        ----------
        kind : {"gyro", "accel"}
            Which.

        Returns
        -------
        FusedSensor
            At all samples of the array.

        Raises
        ------
        InputError
            They were not recorded.
        """
        found = self.gyro if kind == "gyro" else self.accel
        if found is None:
            raise InputError(f"the array recorded no {kind}", expected="what was recorded")
        return found

    def covariance(self, kind: Sensor) -> FloatArray:
        """Return the covariance of the fused vector at every sample of `imu`.

        Parameters
        ----------
        kind : {"gyro", "accel"}
            Which.

        Returns
        -------
        (m, 3, 3) ndarray
            (rad/s)² or (m/s²)².
        """
        return self.sensor(kind).covariances()[self.rows]

    def noise_density(self, kind: Sensor) -> FloatArray:
        """Return the density of the white noise at every sample of `imu`, for the filter.

        Parameters
        ----------
        kind : {"gyro", "accel"}
            Which.

        Returns
        -------
        (m, 3) ndarray
            sqrt(variance x sampling interval), rad/s/sqrt(Hz) or m/s²/sqrt(Hz).
        """
        fused = self.sensor(kind)
        deviation = np.sqrt(np.einsum("pii->pi", fused.covariance))
        return np.asarray(deviation[fused.which[self.rows]] * np.sqrt(1.0 / self.imu.rate))

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        return {
            "weights": self.weights,
            "samples": self.imu.size,
            "left_out": int((self.rows[-1] + 1) - self.rows.size),
            "sensors": {
                f.sensors.sensor: f.to_dict() for f in (self.gyro, self.accel) if f is not None
            },
            "noise": {c: self.noise_model.process(c).parameters for c in self.noise_model.channels},
            "faults": None if self.faults is None else self.faults.to_dict(),
            "beyond_range": None if self.beyond is None else self.beyond.to_dict(),
        }


class SynthesisOptions(TypedDict, total=False):
    """Keywords of `synthesize` that few runs need; explained there."""

    arma: tuple[int, int]
    static: ImuArray | None
    scales: Sequence[float]
    causal: bool
    gyro_range: float | None
    name: str


def synthesize(
    array: ImuArray,
    weights: Weights = "auto",
    *,
    settings: OnlineSettings | None = None,
    noise: ArrayNoise | None = None,
    covariance: dict[Sensor, ArrayLike] | None = None,
    noise_models: Sequence[NoiseModel] | None = None,
    faults: FaultSettings | None = None,
    **options: Unpack[SynthesisOptions],
) -> SyntheticImu:
    """Return one IMU out of several.

    Parameters
    ----------
    array : ImuArray
        Of two or more IMUs.
    weights : str
        "equal"; "inverse_variance": constant, from `noise` or, off-line, from the whole recording
        by the N-cornered hat; "averaged_volatility": equal weights with one variance that changes
        through time; "ewma": a variance for every axis that follows the past; "garch": from GARCH
        (with `arma`, also the mean) of every axis, fitted on the beginning; "wavelet": constant,
        least wavelet variance at `scales` of the `static` recording; "auto": "ewma", or for two
        IMUs, which cannot be told apart, "averaged_volatility".
    settings : OnlineSettings, optional
        Of weights and bias differences.
    noise : ArrayNoise, optional
        Known beforehand (`array_noise`); otherwise the first seconds are learnt from.
    covariance : dict of {"gyro", "accel"} to (M,) or (M, M) array_like, optional
        Constant covariances of the measurements to weigh by, instead of `weights`.
    noise_models : sequence of NoiseModel, optional
        Of each IMU: the synthetic one's is made of them. Otherwise it is the white noise that the
        redundancy shows.
    faults : FaultSettings, optional
        Look for faults too, and do without what is faulty; the weights are then "ewma", or with
        their `online` settings.
    arma : tuple of int, default (0, 0)
        Orders of the conditional mean for "garch".
    static : ImuArray or None, default None
        For "wavelet": the same array at rest; this one if not given.
    scales : sequence of float, default (1, 10)
        For "wavelet", s.
    causal : bool, default True
        Angular accelerations for the lever arms from the past alone; from both sides otherwise.
    gyro_range : float or None, default None
        Full scale of the gyros, rad/s: beyond it the rate comes from accelerometers at known
        places, together with the gyros that are in range. Found where values pile up at one end if
        not given.
    name : str, default "synthetic"
        Of the recording.

    Returns
    -------
    SyntheticImu
        In the body. On-line weights use samples before the one they weigh, apart from the
        beginning that is learnt from; changing weights do not turn the sensors' biases into
        noise, because bias differences are removed: the bias that remains is the mean of all.

    Raises
    ------
    InputError
        One IMU only, axes that leave a direction unmeasured or are not what the mounting says, an
        accelerometer that contradicts the others, an IMU recorded twice, a covariance that is
        none, unknown weights.
    EstimationError
        Sensors that cannot be told apart where their variances are asked for, or too short a
        beginning.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, synthesize
    >>> rng = np.random.default_rng(1)
    >>> four = Mounting(np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3)))
    >>> gyro = 1e-3 * rng.standard_normal((6_000, 4, 3))
    >>> accel = np.array([0.0, 0.0, -9.81]) + 1e-2 * rng.standard_normal((6_000, 4, 3))
    >>> fused = synthesize(ImuArray(np.arange(6_000) / 100.0, gyro, accel, four))
    >>> round(float(fused.imu.gyro.std() / gyro.std()), 1)
    0.5
    """
    refuse_unknown(synthesize, options, SynthesisOptions)
    static, gyro_range = options.get("static"), options.get("gyro_range")
    arma, scales = options.get("arma", (0, 0)), options.get("scales", (1.0, 10.0))
    causal, name = options.get("causal", True), options.get("name", "synthetic")
    if weights not in WEIGHTS:
        raise InputError(f"weights '{weights}'", expected=f"one of {', '.join(WEIGHTS)}")
    how = OnlineSettings() if settings is None else settings
    require_common_axes(array, broken_may_pass=faults is not None)
    kinds = kinds_recorded(array)
    chosen = weights
    if weights == "auto":
        chosen = "ewma" if array.count > 2 else "averaged_volatility"
    detection: FaultDetection | None = None
    beyond: BeyondRange | None = None
    fused: dict[Sensor, FusedSensor] = {}
    if faults is not None:
        if weights not in ("auto", "ewma") or covariance is not None:
            raise InputError(
                f"weights '{weights}' together with faults",
                expected="'auto' or 'ewma': the tests need variances that follow the sensors",
                cure="detect faults first, mask them in the array, then weigh as you like",
            )
        chosen = "ewma"
        detection = detect_faults(array, faults, noise=noise, causal=causal)
        for found in detection.sensors:
            fused[found.sensor] = FusedSensor.from_followed(found.followed)
    else:
        whole, limit = array, _range(array, gyro_range)
        if limit is not None:
            array = masked_beyond_range(array, limit)
        for kind in kinds:
            sensors = redundant_sensors(array, kind)
            tensor = None
            if kind == "accel" and "gyro" in fused and sensors.spacing > 0.0:
                tensor = turning_tensor(sensors.time, fused["gyro"].vectors, causal=causal)
            known = None if noise is None else noise.of(sensors)
            if covariance is not None and kind in covariance:
                full = np.asarray(covariance[kind], dtype=np.float64)
                fused[kind] = fuse_weighted(sensors, full, known, how, tensor)
            elif chosen == "wavelet":
                rest = sensors if static is None else redundant_sensors(static, kind)
                full = _joined(wavelet_covariance(rest, scales), sensors)
                sample = start_values(rest, rest.time.size) if known is None else known
                fused[kind] = fuse_weighted(sensors, full, sample, how, tensor)
            elif chosen in ("equal", "inverse_variance"):
                rate = fused["gyro"].covariance[0] if "gyro" in fused else None
                fused[kind] = fuse_weighted(
                    sensors,
                    None,
                    known,
                    how,
                    tensor,
                    equal=chosen == "equal",
                    rate_covariance=rate,
                    causal=causal,
                )
            else:
                fused[kind] = fuse_followed(sensors, chosen, known, how, tensor, arma)
            if kind == "gyro" and limit is not None:
                fused[kind], beyond = fuse_beyond_range(whole, fused[kind], limit, how)
    done = _assembled(array, fused, chosen, noise_models, detection, name)
    return replace(done, beyond=beyond)


def _range(array: ImuArray, given: float | None) -> float | None:
    """Full scale of the gyros where they exceed it and accelerometers can tell the rate."""
    if given is None:
        tells = array.count >= 4 and np.ptp(array.mounting.position, axis=0).max() > 0.0
        if not tells or not {"gyro", "accel"} <= set(kinds_recorded(array)):
            return None
        return gyro_range_of(redundant_sensors(array, "gyro"))
    return given


def _joined(covariance: FloatArray, sensors: RedundantSensors) -> FloatArray:
    if covariance.shape[0] != sensors.count:
        raise InputError(
            f"a static recording of {covariance.shape[0]} axes for an array of {sensors.count}",
            expected="the same array at rest",
        )
    return covariance


def _assembled(
    array: ImuArray,
    fused: dict[Sensor, FusedSensor],
    weights: str,
    noise_models: Sequence[NoiseModel] | None,
    detection: FaultDetection | None,
    name: str,
) -> SyntheticImu:
    vectors = {
        k: fused[k].vectors if k in fused else np.full((array.size, 3), np.nan)
        for k in ("gyro", "accel")
    }
    rows = np.arange(array.size)
    for f in fused.values():
        # one sum tells that no sample is missing: only then each one needs a look
        if not np.isfinite(f.vectors.sum()):
            x, y, z = f.vectors[rows].T
            rows = rows[np.isfinite(x + y + z)]
    if rows.size < 2:
        raise InputError(
            f"{rows.size} samples that enough sensors measured",
            expected="at least 2",
            cure="check which sensors were recorded at the same time",
        )
    history = [*array.history, f"synthesized from {array.count} IMUs with weights '{weights}'"]
    if rows.size < array.size:
        history.append(f"{array.size - rows.size} samples left out: too few sensors")
    whole = rows.size == array.size
    imu = ImuRecording(
        array.time if whole else array.time[rows],
        vectors["gyro"] if whole else vectors["gyro"][rows],
        vectors["accel"] if whole else vectors["accel"][rows],
        name=name,
        history=tuple(history),
    )
    if noise_models is None:
        model = white_noise_model(
            {k: f.mean_covariance for k, f in fused.items()}, median_step(array.time)
        )
    else:
        if len(noise_models) != array.count:
            raise InputError(
                f"{len(noise_models)} noise models for {array.count} IMUs", expected="one for each"
            )
        model = combine_noise_models(noise_models, {k: f.mean_pi for k, f in fused.items()})
    return SyntheticImu(imu, rows, fused.get("gyro"), fused.get("accel"), weights, model, detection)
