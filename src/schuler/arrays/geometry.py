"""Directions of redundant single-axis sensors: triads, cones, platonic solids, any axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data import Mounting
from schuler.data._checks import check_finite, frozen
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler
from schuler.types import FloatArray

SOLIDS = ("cube", "octahedron", "dodecahedron", "icosahedron")
"""Whose face normals carry an axis each; those of the tetrahedron are those of the octahedron."""

ISOTROPIC_HALF_ANGLE = float(np.arccos(1.0 / np.sqrt(3.0)))
"""Half angle of a cone on which equal sensors measure equally well in all directions, rad."""
GOLDEN = (1.0 + np.sqrt(5.0)) / 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Geometry(Exportable):
    """Sensitive axes of M sensors on one body.

    Parameters
    ----------
    axes : (M, 3) ndarray
        Unit vectors h in the body: sensor i measures h_i · w. Stacked they are the matrix A of
        S002 (8).
    units : (M,) ndarray of int
        Housing of each sensor, from 0: sensors of one unit can fail together. Each its own if
        empty.
    title : str
        For people.
    names : tuple of str
        Of the sensors; "1 x", "1 y", ... for triads if empty.

    Raises
    ------
    InputError
        Wrong shapes, axes that are not of unit length, or axes that leave a direction unmeasured.

    Examples
    --------
    >>> from schuler import Geometry
    >>> Geometry.from_axes([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.6, 0.6]]).redundancy
    1
    """

    axes: FloatArray
    units: NDArray[np.int64]
    title: str = "user's axes"
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        axes = frozen(self.axes, "sensor axes", (None, 3))
        check_finite(axes, "sensor axes")
        count = axes.shape[0]
        length = np.linalg.norm(axes, axis=1)
        off = np.flatnonzero(np.abs(length - 1.0) > 1e-6)
        if off.size:
            raise InputError(
                f"axis {off[0] + 1} has length {length[off[0]]:.6g}", expected="unit vectors"
            )
        units = np.asarray(self.units, dtype=np.int64).copy()
        units = np.arange(count) if units.size == 0 else units
        if units.shape != (count,):
            raise InputError(f"{units.size} units for {count} axes", expected="one for each")
        units.flags.writeable = False
        check_rank(axes)
        names = tuple(self.names) or _names(units)
        if len(names) != count:
            raise InputError(f"{len(names)} names for {count} axes", expected="one for each")
        object.__setattr__(self, "axes", axes)
        object.__setattr__(self, "units", units)
        object.__setattr__(self, "names", names)

    @classmethod
    def from_axes(
        cls, axes: ArrayLike, *, title: str = "user's axes", units: Sequence[int] = ()
    ) -> Geometry:
        """Return a geometry of any directions.

        Parameters
        ----------
        axes : (M, 3) array_like
            Directions, of any length but zero.
        title : str
            For people.
        units : sequence of int
            Housing of each sensor; each its own if empty.

        Returns
        -------
        Geometry
            With unit axes.

        Raises
        ------
        InputError
            A direction of length zero, or axes that leave a direction unmeasured.
        """
        directions = frozen(axes, "sensor axes", (None, 3))
        length = np.linalg.norm(directions, axis=1, keepdims=True)
        if not (length > 0.0).all():
            raise InputError("an axis of length zero", expected="a direction for each sensor")
        return cls(directions / length, np.asarray(units, dtype=np.int64), title)

    @classmethod
    def from_mounting(cls, mounting: Mounting, *, title: str = "triads") -> Geometry:
        """Return the axes of mounted triads.

        Parameters
        ----------
        mounting : Mounting
            Of k IMUs.
        title : str
            For people.

        Returns
        -------
        Geometry
            3k axes, x, y, z of the first IMU first; each IMU is a unit.
        """
        axes = np.swapaxes(mounting.rotation, 1, 2).reshape(-1, 3)
        return cls(axes, np.repeat(np.arange(mounting.count), 3), title)

    @classmethod
    def named(cls, text: str, half_angle: float | None = None) -> Geometry:
        """Return a geometry by its name.

        Parameters
        ----------
        text : str
            "orthogonal:4" (triads), "tetrahedron" (four triads), "cone:6" (axes around a cone),
            "cone-axis:5" (and one along it), or one axis for each face normal of a solid: "cube",
            "octahedron", "dodecahedron" or "icosahedron".
        half_angle : float, optional
            Of a cone, rad; the isotropic one if not given.

        Returns
        -------
        Geometry
            With names of its axes.

        Raises
        ------
        InputError
            An unknown name, a number that is none, or too few axes.

        Examples
        --------
        >>> Geometry.named("cone:6").redundancy
        3
        """
        name, _, number = text.partition(":")
        if name == "tetrahedron" and not number:
            return tetrahedron()
        if name in SOLIDS and not number:
            return platonic(name)
        makers = {"orthogonal": orthogonal, "cone": cone, "cone-axis": cone_with_axis}
        if name not in makers or not number.isdecimal():
            raise InputError(
                f"no geometry '{text}'",
                expected="orthogonal:K, tetrahedron, cone:M, cone-axis:M, " + ", ".join(SOLIDS),
            )
        if half_angle is None or name == "orthogonal":
            return makers[name](int(number))
        return (cone if name == "cone" else cone_with_axis)(int(number), half_angle)

    @property
    def count(self) -> int:
        """Number of sensors M."""
        return int(self.axes.shape[0])

    @property
    def redundancy(self) -> int:
        """Sensors beyond the three that are needed: degrees of freedom of the parity vector."""
        return self.count - 3


def check_rank(axes: FloatArray) -> None:
    """Raise when axes leave a direction of the body unmeasured."""
    if axes.shape[0] < 3:
        raise InputError(f"{axes.shape[0]} sensor axes", expected="at least three")
    _, singular, directions = np.linalg.svd(axes, full_matrices=False)
    if singular[2] > 1e-6 * singular[0]:
        return
    unseen = directions[2] * np.sign(directions[2][np.argmax(np.abs(directions[2]))])
    what = "lie in one plane" if singular[1] > 1e-6 * singular[0] else "are all parallel"
    raise InputError(
        f"the sensor axes {what} (rank {int(np.sum(singular > 1e-6 * singular[0]))}): nothing "
        f"measures along ({', '.join(f'{v + 0.0:.2f}' for v in unseen)})",
        expected="axes that span three dimensions",
        cure="add a sensor along that direction, or check the mounting",
    )


def _names(units: NDArray[np.int64]) -> tuple[str, ...]:
    names, seen = [], dict.fromkeys(units.tolist(), 0)
    sizes = {u: int(np.count_nonzero(units == u)) for u in seen}
    for u in units.tolist():
        letter = "xyz"[seen[u]] if sizes[u] == 3 else str(seen[u] + 1)
        names.append(str(u + 1) if sizes[u] == 1 else f"{u + 1} {letter}")
        seen[u] += 1
    return tuple(names)


def orthogonal_mounting(count: int) -> Mounting:
    """Return triads that all have the axes of the body, at its origin."""
    return Mounting.aligned(count)


def tetrahedron_mounting(radius: float = 0.0) -> Mounting:
    """Return four triads on the faces of a regular tetrahedron.

    Parameters
    ----------
    radius : float
        Distance of the IMUs from the origin of the body, m.

    Returns
    -------
    Mounting
        Rotations (4, 3, 3) body from sensor, positions (4, 3) in m.

    Raises
    ------
    InputError
        A radius that is not finite.

    Notes
    -----
    S000 Fig. 4 and S002 Fig. 8. The twelve axes satisfy A'A = 4 I, as those of any four full
    triads do: turning them gains isolation of faults, not noise.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> axes = np.concatenate([c.T for c in schuler.tetrahedron_mounting().rotation])
    >>> bool(np.allclose(axes.T @ axes, 4.0 * np.eye(3)))
    True
    """
    tilt = np.arccos(-1.0 / 3.0)
    yaw = np.radians([0.0, 0.0, 120.0, 240.0])
    pitch = np.array([np.pi, np.pi - tilt, np.pi - tilt, np.pi - tilt])
    rotation = dcm_from_euler(np.zeros(4), pitch, yaw)
    return Mounting(rotation, radius * rotation[:, :, 2])


def orthogonal(count: int) -> Geometry:
    """Return `count` triads along the axes of the body."""
    return Geometry.from_mounting(orthogonal_mounting(count), title=f"{count} aligned triads")


def tetrahedron() -> Geometry:
    """Return four triads on the faces of a tetrahedron (`tetrahedron_mounting`)."""
    return Geometry.from_mounting(tetrahedron_mounting(), title="tetrahedron of triads")


def cone(count: int, half_angle: float = ISOTROPIC_HALF_ANGLE) -> Geometry:
    """Return sensors evenly around a cone about the z axis."""
    around = 2.0 * np.pi * np.arange(count) / max(count, 1)
    axes = np.column_stack(
        [
            np.sin(half_angle) * np.cos(around),
            np.sin(half_angle) * np.sin(around),
            np.full(count, np.cos(half_angle)),
        ]
    )
    title = f"cone of {count}, {np.degrees(half_angle):.2f}°"
    return Geometry(axes, np.arange(count), title)


def cone_with_axis(count: int, half_angle: float | None = None) -> Geometry:
    """Return sensors evenly around a cone and one along its axis z."""
    if half_angle is None:
        half_angle = float(np.arccos(np.sqrt(max(count - 2, 0) / (3.0 * max(count, 1)))))
    axes = np.vstack([cone(count, half_angle).axes, [0.0, 0.0, 1.0]])
    title = f"cone of {count} and its axis, {np.degrees(half_angle):.2f}°"
    return Geometry(axes, np.arange(count + 1), title)


def platonic(solid: str) -> Geometry:
    """Return one sensor along each different face normal of a platonic solid."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=np.float64)
    pairs = np.array([[0, 1, GOLDEN], [0, -1, GOLDEN]])
    edges = np.array([[0, 1 / GOLDEN, GOLDEN], [0, -1 / GOLDEN, GOLDEN]])
    normals = {
        "cube": np.eye(3),
        "octahedron": corners,
        "dodecahedron": np.vstack([np.roll(pairs, shift, axis=1) for shift in range(3)]),
        "icosahedron": np.vstack([corners, *(np.roll(edges, s, axis=1) for s in range(3))]),
    }
    if solid not in normals:
        raise InputError(f"a solid called '{solid}'", expected=f"one of {', '.join(normals)}")
    return Geometry.from_axes(normals[solid], title=solid)
