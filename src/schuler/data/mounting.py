"""Where the IMUs of an array sit on the body and how they are turned, and the file that says so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.data._checks import check_finite, frozen
from schuler.data.exportable import Exportable
from schuler.data.yaml_file import read_yaml
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler
from schuler.types import FloatArray

MOUNTING_FILE = "mounting.yaml"
"""In the folder of the recordings: `read_array` finds it there."""
FILE_KIND = "schuler mounting"
ORTHONORMAL_TOLERANCE = 1e-6
"""Largest element of C C' - I that is still taken for rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Mounting(Exportable):
    """Where the IMUs sit on the body and how they are turned.

    Parameters
    ----------
    rotation : (k, 3, 3) ndarray
        C_bs of each IMU: takes vectors from its axes into those of the body.
    position : (k, 3) ndarray
        Of each IMU from the origin of the body, in the body, m.

    Raises
    ------
    InputError
        Other shapes, no IMU, values that are not finite, or a matrix that is no rotation: a
        left-handed one (an axis or a sign swapped) or one that is not orthonormal.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Mounting
    >>> Mounting(np.tile(np.eye(3), (2, 1, 1)), np.zeros((2, 3))).rotation.shape
    (2, 3, 3)
    """

    rotation: FloatArray
    position: FloatArray

    def __post_init__(self) -> None:
        rotation = frozen(self.rotation, "mounting rotation", (None, 3, 3))
        k = rotation.shape[0]
        if k < 1:
            raise InputError("a mounting of no IMU", expected="at least one")
        position = frozen(self.position, "mounting position", (k, 3))
        check_finite(rotation, "mounting rotation")
        check_finite(position, "mounting position")
        off = np.abs(rotation @ np.swapaxes(rotation, 1, 2) - np.eye(3)).max(axis=(1, 2))
        handed = np.linalg.det(rotation)
        # told apart first: a mirrored matrix is orthonormal and everything else would accept it
        for i in np.flatnonzero((handed < 0.0) & (off <= ORTHONORMAL_TOLERANCE)):
            raise InputError(
                f"the mounting of IMU {i + 1} is left-handed (determinant {handed[i]:.3f})",
                expected="a rotation, of determinant +1",
                cure="one axis has the wrong sign, or two are swapped: check the directions",
            )
        for i in np.flatnonzero(off > ORTHONORMAL_TOLERANCE):
            raise InputError(
                f"the mounting of IMU {i + 1} is no rotation: its rows are off from unit length "
                f"or right angles by {off[i]:.2g}",
                expected="an orthonormal matrix of determinant +1",
                cure="give it with all digits, or through schuler.rotations.orthonormalize",
            )
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "position", position)

    @classmethod
    def aligned(cls, count: int) -> Mounting:
        """Return IMUs that all have the axes of the body and sit at its origin.

        Parameters
        ----------
        count : int
            Number of IMUs.

        Returns
        -------
        Mounting
            Of `count` IMUs.

        Raises
        ------
        InputError
            Fewer than one.
        """
        return cls(np.tile(np.eye(3), (max(count, 0), 1, 1)), np.zeros((max(count, 0), 3)))

    @property
    def count(self) -> int:
        """Number of IMUs."""
        return int(self.rotation.shape[0])

    def select(self, imus: ArrayLike) -> Mounting:
        """Return some of the IMUs.

        Parameters
        ----------
        imus : (m,) array_like of int or bool
            Which, counted from zero, or a mask.

        Returns
        -------
        Mounting
            In the order asked for.
        """
        chosen = chosen_imus(imus, self.count)
        return Mounting(self.rotation[chosen], self.position[chosen])


def mounting_yaml(mounting: Mounting, names: Sequence[str]) -> str:
    """Return a mounting as YAML, an entry for each IMU by the name of its file."""
    import yaml

    entries = [
        {"name": name, "rotation": rotation.tolist(), "position_m": position.tolist()}
        for name, rotation, position in zip(
            names, mounting.rotation, mounting.position, strict=True
        )
    ]
    told = {"kind": FILE_KIND, "rotation": "takes vectors of the IMU to the body", "imus": entries}
    return yaml.safe_dump(told, sort_keys=False, default_flow_style=None, width=100)


def read_mounting(path: Path) -> tuple[tuple[str, ...], Mounting]:
    """Read a mounting: the names of the IMUs, and how each sits.

    Every entry has a ``rotation`` (three rows of C_bs) or ``roll_pitch_yaw_deg``, which turn the
    axes of the body into those of the IMU; ``position_m`` is zero if left out.
    """
    place = str(path)
    content = read_yaml(path, "a mounting")
    if not isinstance(content, dict) or content.get("kind") != FILE_KIND:
        raise InputError(
            "this is no mounting", expected=f"a file whose kind is '{FILE_KIND}'", where=place
        )
    try:
        entries = list(content["imus"])
        names = tuple(str(e["name"]) for e in entries)
        rotation = np.array([_rotation_of(e) for e in entries])
        position = np.array([e.get("position_m", (0.0, 0.0, 0.0)) for e in entries], np.float64)
        return names, Mounting(rotation, position)
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
        raise InputError(
            f"an entry cannot be read ({error})",
            expected="imus: a list with name, rotation or roll_pitch_yaw_deg, and position_m",
            where=place,
        ) from None
    except InputError as error:
        raise error.at(place) from None


def _rotation_of(entry: dict[str, Any]) -> FloatArray:
    if "roll_pitch_yaw_deg" in entry:
        roll, pitch, yaw = np.radians(np.array(entry["roll_pitch_yaw_deg"], dtype=np.float64))
        return dcm_from_euler(roll, pitch, yaw)
    return np.array(entry["rotation"], dtype=np.float64)


def chosen_imus(imus: ArrayLike, count: int) -> list[int]:
    """Return which IMUs are meant, by number or by a mask."""
    chosen = np.asarray(imus)
    if chosen.dtype == bool and chosen.shape == (count,):
        chosen = np.flatnonzero(chosen)
    if chosen.ndim != 1 or chosen.dtype.kind != "i" or chosen.size == 0:
        raise InputError(
            f"a choice of IMUs of shape {chosen.shape}", expected=f"numbers from 0 to {count - 1}"
        )
    if chosen.min() < 0 or chosen.max() >= count:
        raise InputError(
            f"IMUs {chosen.tolist()} of {count}", expected=f"numbers from 0 to {count - 1}"
        )
    return [int(i) for i in chosen]
