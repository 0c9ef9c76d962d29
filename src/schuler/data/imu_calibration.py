"""The calibration of one IMU: what its readings mean, with errors, applied and kept in a file."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from schuler.data._checks import check_finite, frozen
from schuler.data.exportable import Exportable
from schuler.data.imu import ImuRecording
from schuler.data.table import write_text
from schuler.data.yaml_file import read_yaml
from schuler.errors import InputError
from schuler.types import FloatArray

FILE_KIND = "schuler imu calibration"
SHAPES = {
    "accel_matrix": (3, 3),
    "accel_matrix_sd": (3, 3),
    "accel_bias": (3,),
    "accel_bias_sd": (3,),
    "gyro_matrix": (3, 3),
    "gyro_matrix_sd": (3, 3),
    "gyro_bias": (3,),
    "gyro_bias_sd": (3,),
    "g_sensitivity": (3, 3),
    "g_sensitivity_sd": (3, 3),
}


@dataclass(frozen=True, slots=True, eq=False)
class ImuCalibration(Exportable):
    """Bias, scale and misalignment of one IMU.

    Specific force f = accel_matrix (reading - accel_bias), rate = gyro_matrix (reading - gyro_bias
    - g_sensitivity f). The axes are those in which the accelerometer's matrix is symmetric.

    Parameters
    ----------
    name : str
        Of the IMU.
    accel_matrix, accel_matrix_sd : (3, 3) ndarray
        Identity with zero deviation where it was not found.
    accel_bias, accel_bias_sd : (3,) ndarray
        m/s².
    gyro_matrix, gyro_matrix_sd : (3, 3) ndarray
        Into the axes of the accelerometer.
    gyro_bias, gyro_bias_sd : (3,) ndarray
        rad/s.
    g_sensitivity, g_sensitivity_sd : (3, 3) ndarray
        What the gyros show of the force, rad/s per m/s².
    poses, turns : int
        Static poses, and turns between them, that it rests on.
    norm_before, norm_after : float
        Standard deviation of the length of the force over the poses, m/s².
    findings : tuple of str
        What to know about it, in words.

    Raises
    ------
    InputError
        Wrong shapes, or a matrix that is singular or left-handed.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, turn = np.random.default_rng(1), np.sin(np.pi * (np.arange(100) + 0.5) / 100)
    >>> up, attitude, gyro, accel = np.array([0.0, 0.0, 9.80665]), np.eye(3), [], []
    >>> for vector in rng.normal(0.0, 1.0, (18, 3)):
    ...     for share in (*np.zeros(300), *np.pi / 200 * turn):
    ...         gyro.append(50.0 * share * vector)
    ...         accel.append(attitude.T @ up)
    ...         attitude = attitude @ schuler.dcm_from_rotation_vector(share * vector)
    >>> shape = (len(gyro), 3)
    >>> gyro = np.array(gyro) + 0.01 + rng.normal(0.0, 0.002, shape)
    >>> accel = np.array(accel) + 0.1 + rng.normal(0.0, 0.02, shape)
    >>> imu = schuler.ImuRecording(np.arange(shape[0]) / 50.0, gyro, accel)
    >>> found = schuler.calibrate_imu(imu)
    >>> found.poses, np.round(found.accel_bias, 2)
    (18, array([0.1, 0.1, 0.1]))
    """

    name: str
    accel_matrix: FloatArray
    accel_matrix_sd: FloatArray
    accel_bias: FloatArray
    accel_bias_sd: FloatArray
    gyro_matrix: FloatArray
    gyro_matrix_sd: FloatArray
    gyro_bias: FloatArray
    gyro_bias_sd: FloatArray
    g_sensitivity: FloatArray
    g_sensitivity_sd: FloatArray
    poses: int
    turns: int
    norm_before: float
    norm_after: float
    findings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, shape in SHAPES.items():
            values = frozen(getattr(self, name), name, shape)
            check_finite(values, name)
            object.__setattr__(self, name, values)
        for name in ("accel_matrix", "gyro_matrix"):
            if not np.linalg.det(getattr(self, name)) > 0.0:
                raise InputError(
                    f"{name} is singular or left-handed", expected="a matrix close to one"
                )

    def apply(self, imu: ImuRecording) -> ImuRecording:
        """Return the recording calibrated.

        Parameters
        ----------
        imu : ImuRecording
            Of this IMU, as it was read.

        Returns
        -------
        ImuRecording
            With a line of history.
        """
        accel = (imu.accel - self.accel_bias) @ self.accel_matrix.T
        # a recording without accelerometers has no force that gyros could feel
        felt = np.nan_to_num(accel) @ self.g_sensitivity.T
        gyro = (imu.gyro - self.gyro_bias - felt) @ self.gyro_matrix.T
        return replace(
            imu, gyro=gyro, accel=accel, history=(*imu.history, f"calibrated ({self.name})")
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain numbers and lists, by the names of the fields, SI."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in values.items()}
        return {"kind": FILE_KIND, "version": 1, **plain, "findings": list(self.findings)}

    def to_yaml(self) -> str:
        """Return the calibration as YAML that `load` and `read_imu` understand."""
        import yaml

        return yaml.safe_dump(self.to_dict(), sort_keys=False, default_flow_style=None, width=100)

    def save(self, path: str | Path) -> None:
        """Write the calibration as YAML.

        Parameters
        ----------
        path : str or Path
            File to write; it appears only when it is complete.
        """
        write_text(path, self.to_yaml())

    @classmethod
    def load(cls, path: str | Path) -> ImuCalibration:
        """Read a calibration.

        Parameters
        ----------
        path : str or Path
            File written by `save`.

        Returns
        -------
        ImuCalibration
            Checked like any other.

        Raises
        ------
        InputError
            No YAML, another kind of file, or fields that are missing or wrong.
        """
        place = str(path)
        content = read_yaml(path, "a calibration of one IMU")
        if not isinstance(content, dict) or content.get("kind") != FILE_KIND:
            raise InputError(
                "this is no calibration of one IMU",
                expected=f"a file whose kind is '{FILE_KIND}'",
                cure="write one with schuler calibrate FILE --out",
                where=place,
            )
        try:
            values = {f.name: content[f.name] for f in fields(cls)}
            values["findings"] = tuple(str(v) for v in values["findings"])
            return cls(**values)
        except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
            raise InputError(f"a field cannot be read ({error})", where=place) from None
        except InputError as error:
            raise error.at(place) from None
