"""Rotations: direction cosine matrices, quaternions, rotation vectors, Euler angles, Wahba.

`C_nb` takes vectors of frame b into frame n, and so do the quaternion and the rotation vector that
stand for it. Quaternions are Hamilton's, scalar first. Euler angles turn n into b by yaw about z,
then pitch about the new y, then roll about the newest x (spec 0). All functions work on arrays
with any leading axes; nothing divides by an angle, so zero and tiny rotations lose no digits.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

NED_FROM_ENU: FloatArray = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Takes east-north-up vectors into north-east-down; it is its own inverse."""

FRD_FROM_FLU: FloatArray = np.diag([1.0, -1.0, -1.0])
"""Takes forward-left-up vectors into forward-right-down; it is its own inverse."""

NED_FROM_ENU.flags.writeable = False
FRD_FROM_FLU.flags.writeable = False


def _vectors(values: ArrayLike, what: str, length: int = 3) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim < 1 or array.shape[-1] != length:
        raise InputError(f"{what} has shape {array.shape}", expected=f"(..., {length})")
    return array


def _matrices(values: ArrayLike, what: str = "rotation matrix") -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim < 2 or array.shape[-2:] != (3, 3):
        raise InputError(f"{what} has shape {array.shape}", expected="(..., 3, 3)")
    return array


def skew(vector: ArrayLike) -> FloatArray:
    """Return the matrix [a x], with [a x] b = a x b."""
    a = _vectors(vector, "vector")
    matrix = np.zeros((*a.shape, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = a[..., 2], -a[..., 1], a[..., 0]
    return matrix


def dcm_from_euler(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> FloatArray:
    """Return C_nb of yaw-pitch-roll (Z-Y-X) Euler angles.

    Parameters
    ----------
    roll, pitch, yaw : float or (...) array_like
        rad.

    Returns
    -------
    (..., 3, 3) ndarray
        Takes vectors of the body to north, east, down.

    Notes
    -----
    Titterton and Weston, 2nd ed., equation (3.47).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> float(schuler.dcm_from_euler(0.0, 0.0, np.pi / 2).round(6)[1, 0])
    1.0
    """
    phi, theta, psi = np.broadcast_arrays(
        *(np.asarray(angle, dtype=np.float64) for angle in (roll, pitch, yaw))
    )
    s_phi, c_phi = np.sin(phi), np.cos(phi)
    s_theta, c_theta = np.sin(theta), np.cos(theta)
    s_psi, c_psi = np.sin(psi), np.cos(psi)
    c_nb = np.empty((*phi.shape, 3, 3))
    c_nb[..., 0, 0] = c_theta * c_psi
    c_nb[..., 0, 1] = s_phi * s_theta * c_psi - c_phi * s_psi
    c_nb[..., 0, 2] = c_phi * s_theta * c_psi + s_phi * s_psi
    c_nb[..., 1, 0] = c_theta * s_psi
    c_nb[..., 1, 1] = s_phi * s_theta * s_psi + c_phi * c_psi
    c_nb[..., 1, 2] = c_phi * s_theta * s_psi - s_phi * c_psi
    c_nb[..., 2, 0] = -s_theta
    c_nb[..., 2, 1] = s_phi * c_theta
    c_nb[..., 2, 2] = c_phi * c_theta
    return c_nb


def euler_from_dcm(c_nb: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return roll, pitch and yaw of C_nb.

    Parameters
    ----------
    c_nb : (..., 3, 3) array_like
        Takes vectors of the body to north, east, down.

    Returns
    -------
    roll, pitch, yaw : (...) ndarray
        rad, Z-Y-X.

    Notes
    -----
    Titterton and Weston, 2nd ed., section 3.6.3.3.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> [abs(float(a)) for a in schuler.euler_from_dcm(np.eye(3))]
    [0.0, 0.0, 0.0]
    """
    c = _matrices(c_nb)
    cos_pitch = np.hypot(c[..., 2, 1], c[..., 2, 2])
    pitch = np.arctan2(-c[..., 2, 0], cos_pitch)
    roll = np.where(cos_pitch < 1e-12, 0.0, np.arctan2(c[..., 2, 1], c[..., 2, 2]))
    s_phi, c_phi = np.sin(roll), np.cos(roll)
    yaw = np.arctan2(
        s_phi * c[..., 0, 2] - c_phi * c[..., 0, 1], c_phi * c[..., 1, 1] - s_phi * c[..., 1, 2]
    )
    return roll, pitch, yaw


def quaternion_from_dcm(c_nb: ArrayLike) -> FloatArray:
    """Return the quaternion of a rotation matrix, with scalar part not negative."""
    c = _matrices(c_nb)
    outer = np.empty((*c.shape[:-2], 4, 4))  # 4 q q'
    x, y, z = c[..., 0, 0], c[..., 1, 1], c[..., 2, 2]
    outer[..., 0, 0] = 1.0 + x + y + z
    outer[..., 1, 1] = 1.0 + x - y - z
    outer[..., 2, 2] = 1.0 - x + y - z
    outer[..., 3, 3] = 1.0 - x - y + z
    for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2)):
        difference = c[..., k - 1, j - 1] - c[..., j - 1, k - 1]
        total = c[..., k - 1, j - 1] + c[..., j - 1, k - 1]
        outer[..., 0, i] = outer[..., i, 0] = difference
        outer[..., j, k] = outer[..., k, j] = total
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(outer, largest[..., None, None], axis=-1)[..., 0]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.asarray(np.where(q[..., :1] < 0.0, -q, q))


def rotation_vector_from_quaternion(quaternion: ArrayLike) -> FloatArray:
    """Return the shortest rotation vector of a quaternion."""
    q = _vectors(quaternion, "quaternion", 4)
    q = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    scalar = q[..., :1]
    # Where the vector part vanishes the angle is 2 |v| / w to first order.
    ratio = np.where(
        sine > 0.0,
        2.0 * np.arctan2(sine, scalar) / np.where(sine > 0.0, sine, 1.0),
        2.0 / np.where(scalar > 0.0, scalar, 1.0),
    )
    return np.asarray(ratio * q[..., 1:])


def dcm_from_rotation_vector(rotation_vector: ArrayLike) -> FloatArray:
    """Return the matrix exp([p x]) of a rotation vector p.

    Parameters
    ----------
    rotation_vector : (..., 3) array_like
        Axis times angle, rad.

    Returns
    -------
    (..., 3, 3) ndarray
        The rotation.

    Raises
    ------
    InputError
        Not three components.

    Notes
    -----
    Rodrigues; Titterton and Weston, 2nd ed., equation (11.10).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> float(schuler.dcm_from_rotation_vector([0.0, 0.0, np.pi / 2]).round(6)[1, 0])
    1.0
    """
    p = _vectors(rotation_vector, "rotation vector")
    angle = np.linalg.norm(p, axis=-1)[..., None, None]
    cross = skew(p)
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2  # (1 - cos) / angle² without cancellation
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def rotation_vector_from_dcm(c_nb: ArrayLike) -> FloatArray:
    """Return the shortest rotation vector of a rotation matrix.

    Parameters
    ----------
    c_nb : (..., 3, 3) array_like
        Orthonormal, determinant one.

    Returns
    -------
    (..., 3) ndarray
        Axis times angle, rad; its length is at most pi.

    Notes
    -----
    Through the quaternion, which is safe near half a turn.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> float(np.abs(schuler.rotation_vector_from_dcm(np.eye(3))).max())
    0.0
    """
    return rotation_vector_from_quaternion(quaternion_from_dcm(c_nb))


def orthonormalize(matrix: ArrayLike) -> FloatArray:
    """Return the rotation nearest to a matrix, in the sense of least squares."""
    m = _matrices(matrix)
    if not np.isfinite(m).all():
        raise InputError("a rotation matrix holds values that are not finite")
    u, _, vt = np.linalg.svd(m)
    sign = np.ones(m.shape[:-1])
    sign[..., 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray((u * sign[..., None, :]) @ vt)


def wahba(a: ArrayLike, b: ArrayLike, weights: ArrayLike | None = None) -> FloatArray:
    """Return the rotation that takes the vectors b onto the vectors a.

    Parameters
    ----------
    a, b : (n, 3) array_like
        The same vectors in two frames.
    weights : (n,) array_like, optional
        Of the pairs; equal if not given.

    Returns
    -------
    (3, 3) ndarray
        Minimises the sum of weights |a - R b|².

    Raises
    ------
    InputError
        Shapes that differ.

    Notes
    -----
    Wahba 1965, by singular values (Markley 1988).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> b = np.eye(3)
    >>> turn = schuler.dcm_from_euler(0.1, 0.2, 0.3)
    >>> bool(np.allclose(schuler.wahba(b @ turn.T, b), turn))
    True
    """
    first, second = _vectors(a, "first vectors"), _vectors(b, "second vectors")
    w = np.ones(first.shape[0]) if weights is None else np.asarray(weights, dtype=np.float64)
    if first.ndim != 2 or first.shape != second.shape or w.shape != (first.shape[0],):
        raise InputError(
            f"vectors of shape {first.shape} and {second.shape}, weights of shape {w.shape}",
            expected="(k, 3), (k, 3) and (k,)",
        )
    attitude_profile = np.einsum("k,ki,kj->ij", w, first, second)
    singular = np.linalg.svd(attitude_profile, compute_uv=False)
    if not singular[1] > 1e-12 * singular[0]:
        raise EstimationError(
            "the vectors lie along one line",
            expected="vectors in at least two directions",
            cure="add motion about a second axis",
        )
    return orthonormalize(attitude_profile)
