"""What a calibration between IMUs found, how it is applied, and how it is kept in a file."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from schuler.arrays.calibration.disagreement import Disagreement
from schuler.arrays.clocks.delays import shift
from schuler.arrays.clocks.polling import PollingTrack
from schuler.arrays.clocks.resampling import rate_of_change
from schuler.data import ImuArray, Mounting
from schuler.data._checks import check_finite, frozen
from schuler.data.exportable import Exportable
from schuler.data.yaml_file import read_yaml
from schuler.errors import InputError
from schuler.rotations import orthonormalize, rotation_vector_from_dcm
from schuler.types import FloatArray

FILE_KIND = "schuler array calibration"
FILE_VERSION = 1

_SHAPES = {
    "nominal": (3, 3),
    "gyro_sensor": (3, 3),
    "gyro_deviation_sd": (3, 3),
    "gyro_bias": (3,),
    "gyro_bias_sd": (3,),
    "accel_sensor": (3, 3),
    "accel_deviation_sd": (3, 3),
    "accel_bias": (3,),
    "accel_bias_sd": (3,),
    "position": (3,),
    "position_sd": (3,),
    "delay": (),
    "delay_sd": (),
}


@dataclass(frozen=True, slots=True, eq=False)
class ArrayCalibration(Exportable):
    """Calibration between the IMUs of an array, relative to their mean.

    A gyro triad shows g = gyro_sensor w + gyro_bias of the body's rate w, an accelerometer triad
    ``a = accel_sensor (f + [dw/dt x] l + [w x][w x] l) + accel_bias``. The axes of the body, the
    scale and the centre are the means over the IMUs: what all sensors have in common is not seen
    by their differences.

    Parameters
    ----------
    names : tuple of str
        Of the k IMUs.
    nominal : (k, 3, 3) ndarray
        C_bs as declared, or found to the quarter turn.
    gyro_sensor, accel_sensor : (k, 3, 3) ndarray
        From the body's vector to the reading, in the sensor's axes.
    gyro_deviation_sd, accel_deviation_sd : (k, 3, 3) ndarray
        Standard deviations of the elements of nominal @ sensor - I.
    gyro_bias, gyro_bias_sd : (k, 3) ndarray
        rad/s, in the sensor's axes.
    accel_bias, accel_bias_sd : (k, 3) ndarray
        m/s², in the sensor's axes.
    position, position_sd : (k, 3) ndarray
        Lever arms in the body, m.
    delay, delay_sd : (k,) ndarray
        Constant delays against the mean, s.
    period : float or None
        Internal sampling period of chips that run free and are polled, s; None where they are
        read in step.
    beat : (k,) ndarray
        Of these, cycles a second; zero otherwise.
    noise : float
        Standard deviation of a gyro's component at rest, rad/s.
    rests : int
        Static poses seen.
    gravity_fit : (float, float) or None
        Standard deviation of |force| over the poses before and after the fit to gravity, m/s².
    before, after : tuple of Disagreement
        On the recording that was fitted.
    findings : tuple of str
        What to know about it, in words.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(2_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> gyro = rate + 1e-3 * rng.standard_normal((2_000, 4, 3))
    >>> accel = force + 1e-2 * rng.standard_normal((2_000, 4, 3))
    >>> array = schuler.ImuArray(time, gyro, accel, schuler.Mounting.aligned(4))
    >>> found = schuler.calibrate_array(array)
    >>> found.names
    ('imu 1', 'imu 2', 'imu 3', 'imu 4')
    """

    names: tuple[str, ...]
    nominal: FloatArray
    gyro_sensor: FloatArray
    gyro_deviation_sd: FloatArray
    gyro_bias: FloatArray
    gyro_bias_sd: FloatArray
    accel_sensor: FloatArray
    accel_deviation_sd: FloatArray
    accel_bias: FloatArray
    accel_bias_sd: FloatArray
    position: FloatArray
    position_sd: FloatArray
    delay: FloatArray
    delay_sd: FloatArray
    period: float | None
    beat: FloatArray
    noise: float
    rests: int = 0
    gravity_fit: tuple[float, float] | None = None
    before: tuple[Disagreement, ...] = ()
    after: tuple[Disagreement, ...] = ()
    findings: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        k = len(self.names)
        for name, shape in (*_SHAPES.items(), ("beat", ())):
            array = frozen(getattr(self, name), name, (k, *shape))
            check_finite(array, name)
            object.__setattr__(self, name, array)
        for name in ("gyro_sensor", "accel_sensor"):
            determinant = np.linalg.det(self.nominal @ getattr(self, name))
            if not (determinant > 0.0).all():
                raise InputError(
                    f"{name} of {self.names[int(np.argmin(determinant))]} is singular or "
                    "left-handed",
                    expected="matrices close to the nominal mounting",
                    cure="check the signs and the order of its axes",
                )

    @property
    def count(self) -> int:
        """Number of IMUs."""
        return len(self.names)

    @property
    def mounting(self) -> Mounting:
        """Nearest rotations of the gyro triads, and the lever arms."""
        return Mounting(orthonormalize(np.swapaxes(self.gyro_sensor, 1, 2)), self.position)

    @property
    def gyro_correction(self) -> FloatArray:
        """(k, 3, 3) matrices from a gyro reading less its bias to the body's rate."""
        return np.asarray(np.linalg.inv(self.gyro_sensor), dtype=np.float64)

    @property
    def accel_correction(self) -> FloatArray:
        """(k, 3, 3) matrices from an accelerometer reading less its bias to the body's force."""
        return np.asarray(np.linalg.inv(self.accel_sensor), dtype=np.float64)

    @property
    def gyro_deviation(self) -> FloatArray:
        """(k, 3, 3) nominal @ gyro_sensor - I: scale, turn and misalignment of the gyros."""
        return np.asarray(self.nominal @ self.gyro_sensor - np.eye(3))

    @property
    def accel_deviation(self) -> FloatArray:
        """(k, 3, 3) nominal @ accel_sensor - I."""
        return np.asarray(self.nominal @ self.accel_sensor - np.eye(3))

    @property
    def turn(self) -> FloatArray:
        """(k, 3) small rotation of each gyro triad against its nominal mounting, rad."""
        back = np.swapaxes(self.nominal, 1, 2)
        return rotation_vector_from_dcm(self.mounting.rotation @ back)

    @property
    def gyro_scale(self) -> FloatArray:
        """(k, 3) scale error of each gyro: length of its row of `gyro_sensor`, less one."""
        return np.asarray(np.linalg.norm(self.gyro_sensor, axis=2) - 1.0)

    @property
    def accel_scale(self) -> FloatArray:
        """(k, 3) scale error of each accelerometer."""
        return np.asarray(np.linalg.norm(self.accel_sensor, axis=2) - 1.0)

    @property
    def gyro_scale_sd(self) -> FloatArray:
        """(k, 3) standard deviations of `gyro_scale`."""
        return self._scale_sd(self.gyro_deviation_sd)

    @property
    def accel_scale_sd(self) -> FloatArray:
        """(k, 3) standard deviations of `accel_scale`."""
        return self._scale_sd(self.accel_deviation_sd)

    def _scale_sd(self, deviation_sd: FloatArray) -> FloatArray:
        """From the axes of the body to those of the sensor."""
        diagonal = np.diagonal(deviation_sd, axis1=1, axis2=2) ** 2
        return np.asarray(np.sqrt(np.einsum("kji,kj->ki", self.nominal**2, diagonal)))

    @property
    def turn_sd(self) -> FloatArray:
        """(k, 3) standard deviations of `turn`, rad."""
        v = self.gyro_deviation_sd**2
        both = np.stack(
            [v[:, 2, 1] + v[:, 1, 2], v[:, 0, 2] + v[:, 2, 0], v[:, 1, 0] + v[:, 0, 1]], axis=1
        )
        return np.asarray(0.5 * np.sqrt(both))

    def apply(self, array: ImuArray, track: PollingTrack | None = None) -> ImuArray:
        """Return the array calibrated: all vectors in the body, in one scale, at one instant.

        Parameters
        ----------
        array : ImuArray
            Of the same IMUs in the same order, in their own axes.
        track : PollingTrack, optional
            Sampling phases of this recording (`track_phases`), for polled chips; every sample is
            then moved to the mean age by the derivative of the mean.

        Returns
        -------
        ImuArray
            Its mounting turns nothing and has the lever arms found; forces still are those at
            the place of each sensor. A vector that lacks a component is missing as a whole.

        Raises
        ------
        InputError
            Another number of IMUs.
        """
        self.check_fits(array)
        gyro, accel = array.gyro, array.accel
        if track is None and np.abs(self.delay).max() > 1e-7:
            gyro = shift(array.time, gyro, self.delay)
            if not np.isnan(accel).all():
                accel = shift(array.time, accel, self.delay)
        gyro = np.einsum("kij,nkj->nki", self.gyro_correction, gyro - self.gyro_bias)
        accel = np.einsum("kij,nkj->nki", self.accel_correction, accel - self.accel_bias)
        lines = ["calibrated"]
        if track is not None:
            moved = track.relative_delay(array.time)[..., None]
            gyro = gyro + moved * rate_of_change(array.time, gyro.mean(axis=1))[:, None]
            if not np.isnan(accel).all():
                accel = accel + moved * rate_of_change(array.time, accel.mean(axis=1))[:, None]
            lines.append("samples of polled chips moved to their mean age")
        return replace(
            array,
            gyro=gyro,
            accel=accel,
            mounting=Mounting(np.tile(np.eye(3), (self.count, 1, 1)), self.position),
            history=(*array.history, *lines),
        )

    def check_fits(self, array: ImuArray) -> None:
        """Raise when an array has another number of IMUs.

        Parameters
        ----------
        array : ImuArray
            What is to be calibrated.

        Raises
        ------
        InputError
            Another number.
        """
        if array.count != self.count:
            raise InputError(
                f"a calibration of {self.count} IMUs and an array of {array.count}",
                expected="the same IMUs in the same order",
            )

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and lists, by the names of the fields, with units in SI."""
        values = {one.name: _plain(getattr(self, one.name)) for one in fields(self)}
        return {"kind": FILE_KIND, "version": FILE_VERSION, **values}

    def to_yaml(self) -> str:
        """Return the calibration as YAML, which people can read and `load` understands."""
        import yaml

        return yaml.safe_dump(self.to_dict(), sort_keys=False, default_flow_style=None, width=100)

    def save(self, path: str | Path) -> None:
        """Write the calibration as YAML; the file appears only when it is complete.

        Parameters
        ----------
        path : str or Path
            File to write.
        """
        from schuler.data.table import write_text

        write_text(path, self.to_yaml())

    @classmethod
    def load(cls, path: str | Path) -> ArrayCalibration:
        """Read a calibration.

        Parameters
        ----------
        path : str or Path
            File written by `save`.

        Returns
        -------
        ArrayCalibration
            Checked like any other.

        Raises
        ------
        InputError
            No YAML, another kind of file, another version, or fields that are missing or of the
            wrong shape.
        """
        place = str(path)
        content = read_yaml(path, "a calibration of an array")
        if not isinstance(content, dict) or content.get("kind") != FILE_KIND:
            raise InputError(
                "this is no calibration of an array",
                expected=f"a file whose kind is '{FILE_KIND}'",
                cure="write one with schuler calibrate --out",
                where=place,
            )
        if content.get("version") != FILE_VERSION:
            raise InputError(
                f"version {content.get('version')} of the file",
                expected=f"version {FILE_VERSION}",
                where=place,
            )
        missing = [f.name for f in fields(cls) if f.name not in content]
        if missing:
            raise InputError(f"the field '{missing[0]}' is missing", where=place)
        try:
            values = {f.name: _field(f.name, content[f.name]) for f in fields(cls)}
            return cls(**values)
        except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
            raise InputError(f"a field cannot be read ({error})", where=place) from None
        except InputError as error:
            raise error.at(place) from None


def _plain(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Disagreement):
        return {one.name: _plain(getattr(value, one.name)) for one in fields(value)}
    return [_plain(v) for v in value] if isinstance(value, tuple) else value


def _field(name: str, value: Any) -> Any:
    if name in _SHAPES or name == "beat":
        return np.array(value, dtype=np.float64)
    if name in ("before", "after"):
        return tuple(Disagreement(**one) for one in value)
    if name in ("names", "findings"):
        return tuple(str(v) for v in value)
    if name == "gravity_fit":
        return None if value is None else (float(value[0]), float(value[1]))
    if name == "period":
        return None if value is None else float(value)
    return int(value) if name == "rests" else float(value)
