"""What GNSS can see of the state, and which directions it cannot. S002 (13), spec 7.5.

Over a stretch in which force and attitude hardly change the error dynamics are constant, and what
is seen of the state is the row space of H, H F, H F² ...; over several stretches the matrices are
carried back to the start and stacked (Goshen-Meskin and Bar-Itzhack 1992, the total observability
matrix). Its rank says what can be seen at all, its singular values how well; what lies in its
null space is put into words. The Gramian says the same with the noise of the measurements and the
prior taken in, and the filter's own covariance says what came of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray

NAVIGATION_NAMES = (
    "position north", "position east", "position down",
    "velocity north", "velocity east", "velocity down",
    "tilt about north", "tilt about east", "heading",
)  # fmt: skip
# sizes of the errors of navigation at which they matter alike (m, m/s, rad)
NAVIGATION_SCALE = np.repeat([1.0, 1.0, 0.1], 3)
# singular values below this share of the largest are rounding
RANK_TOLERANCE = 1e-11
# and those below this share are seen in theory only: noise hides them
PRACTICAL_TOLERANCE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A stretch of motion with constant error dynamics.

    Parameters
    ----------
    force : (3,) ndarray
        Specific force north, east, down, m/s².
    rotation : (3, 3) ndarray
        C_nb.
    duration : float
        Seconds.
    frame_rate : (3,) ndarray or None
        Rate of n against the inertial frame, rad/s; None leaves the turn of the earth out.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Segment
    >>> Segment(np.array([0.0, 0.0, -9.81]), np.eye(3)).duration
    10.0
    """

    force: FloatArray
    rotation: FloatArray
    duration: float = 10.0
    frame_rate: FloatArray | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Observability(Exportable):
    """Which directions of the state are seen.

    Parameters
    ----------
    names : tuple of str
        Of the states.
    scale : (s,) ndarray
        Size of each state at which it counts as one: its prior standard deviation.
    singular_values : (s,) ndarray
        Of the scaled observability matrix, largest first.
    directions : (s, s) ndarray
        Scaled directions in columns, in the same order.
    rank : int
        Directions that are seen at all.
    practical_rank : int
        Directions that are seen well enough to be told from rounding and noise.
    shown : (2, 3, s) ndarray
        How the states show in fused force and rate: zero for those of the navigation.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import GaussMarkov, NoiseModel, Segment, WhiteNoise
    >>> from schuler import observability, sensor_error_model
    >>> biased = WhiteNoise(1e-4) + GaussMarkov(1e-4, 100.0)
    >>> states = sensor_error_model(
    ...     NoiseModel.isotropic(biased, biased), turn_on_accel=0.1, turn_on_gyro=0.01
    ... )
    >>> still = Segment(np.array([0.0, 0.0, -9.81]), np.eye(3))
    >>> found = observability(states, [still])
    >>> found.rank < len(found.names)
    True
    """

    names: tuple[str, ...]
    scale: FloatArray
    singular_values: FloatArray
    directions: FloatArray
    rank: int
    practical_rank: int
    shown: FloatArray

    @property
    def relative(self) -> FloatArray:
        """Singular values as shares of the largest."""
        whole: FloatArray = self.singular_values / self.singular_values[0]
        return whole

    @property
    def unseen(self) -> FloatArray:
        """Orthonormal scaled directions that are not seen, (s, s - rank)."""
        return self.directions[:, self.rank :]

    @property
    def unseen_share(self) -> FloatArray:
        """How much of each state is not seen, 0 to 1, (s,)."""
        share: FloatArray = np.sum(self.unseen**2, axis=1)
        return share

    def sentences(self) -> tuple[str, ...]:
        """Say in words what is not seen.

        Returns
        -------
        tuple of str
            One sentence a fact, the most important first.
        """
        size = len(self.names)
        told = [f"{self.rank} of {size} directions of the state are seen."]
        if self.practical_rank < self.rank:
            told.append(
                f"Of these, {self.rank - self.practical_rank} are seen in theory only: their "
                f"singular values lie below {PRACTICAL_TOLERANCE:g} of the largest."
            )
        told += describe_directions(self.unseen, self.names, self.scale, self.shown)
        if self.rank == size and self.practical_rank == size:
            told.append("Nothing is hidden.")
        return tuple(told)


def describe_directions(
    directions: FloatArray, names: Sequence[str], scale: FloatArray, shown: FloatArray
) -> list[str]:
    """Put a space of directions into words.

    First what cancels between sensors and is gone in the fused measurement, then whole states,
    then mixtures by their largest parts.
    """
    told = []
    left = directions
    for what, rows in zip(("accelerometer", "gyro"), shown, strict=True):
        part = np.flatnonzero(np.abs(rows).sum(axis=0) > 0.0)
        if part.size <= 3 or not left.shape[1]:
            continue
        cancelling = np.zeros((len(names), part.size - 3))
        cancelling[part] = _null_space(rows[:, part] * scale[part])
        overlap = np.linalg.svd(left.T @ cancelling, compute_uv=False)
        count = int(np.sum(overlap > 1.0 - 1e-6))
        if count:
            told.append(
                f"{count} combinations of the {part.size} {what} states cancel in the fused "
                "measurement: differences between the sensors are not seen, only their sum."
            )
            left = _without(left, cancelling)
    for j in range(len(names)):
        if left.shape[1] and np.sum(left[j] ** 2) > 0.999:
            told.append(f"{names[j][0].upper()}{names[j][1:]} is not seen at all.")
            axis = np.zeros((len(names), 1))
            axis[j] = 1.0
            left = _without(left, axis)
    told += [f"Not seen: {_mixture(c, names, scale, shown)}." for c in _simple(left).T]
    return told


def _mixture(column: FloatArray, names: Sequence[str], scale: FloatArray, shown: FloatArray) -> str:
    """Words for one direction: its parts in the navigation, and what it makes of the fused IMU."""
    parts = [names[j] for j in range(9) if abs(column[j]) > 0.2]
    for what, rows in zip(("accelerometer", "gyro"), shown, strict=True):
        own = np.abs(rows).sum(axis=0) > 0.0
        if np.sum(column[own] ** 2) < 0.04:
            continue
        fused = rows @ (scale * column)
        apart = np.linalg.norm(fused) < 1e-3 * np.linalg.norm((scale * column)[own])
        if apart:
            parts.append(f"{what} errors that cancel")
            continue
        unit = fused / np.linalg.norm(fused)
        along = " and ".join(
            f"{'-' if unit[a] < 0.0 else ''}{'xyz'[a]}" for a in range(3) if abs(unit[a]) > 0.3
        )
        article = "an" if what[0] == "a" else "a"
        parts.append(f"{article} {what} bias along {along} of the body")
    if len(parts) == 1:
        return parts[0]
    return f"{', '.join(parts[:-1])} and {parts[-1]}, which make up for each other"


def _null_space(matrix: FloatArray) -> FloatArray:
    right: FloatArray = np.linalg.svd(matrix)[2]
    return right[matrix.shape[0] :].T


def _without(space: FloatArray, part: FloatArray) -> FloatArray:
    """The part of a space that is square to another one."""
    basis, _ = np.linalg.qr(part)
    rest = space - basis @ (basis.T @ space)
    left, values, _ = np.linalg.svd(rest, full_matrices=False)
    return np.asarray(left[:, values > 1e-4])


def _simple(space: FloatArray) -> FloatArray:
    """Turn a basis so that its vectors have few large parts: pivoted elimination."""
    if space.shape[1] < 2:
        return space
    from scipy.linalg import qr

    _, _, pivot = qr(space.T, pivoting=True)
    chosen = space[pivot[: space.shape[1]]]
    turned = space @ np.linalg.inv(chosen)
    whole: FloatArray = turned / np.linalg.norm(turned, axis=0)
    return whole


def state_names(model: SensorErrorModel) -> tuple[str, ...]:
    """Return the names of all states of a filter, navigation first."""
    return (*NAVIGATION_NAMES, *model.names)


def shown_states(model: SensorErrorModel) -> FloatArray:
    """Return how the states of a filter show in force and rate of the body, (2, 3, 9 + m)."""
    shown = np.zeros((2, 3, 9 + model.size))
    for j in range(model.size):
        c = int(model.channel[j])
        if c < 0 or model.scaled_by[j] >= 0:
            continue
        unit = np.isnan(model.direction[j, 0])
        shown[c // 3, :, 9 + j] = np.eye(3)[c % 3] if unit else model.direction[j]
    return shown


def system_matrix(model: SensorErrorModel, segment: Segment) -> FloatArray:
    """Return F of the error state over a stretch of motion. Spec 7.2."""
    if model.blocks:
        raise InputError(
            "observability of states that exist at one sample interval only",
            expected="error models in continuous time",
            cure="use Gauss-Markov noise and random walks",
        )
    from schuler.rotations import skew

    size = 9 + model.size
    f = np.zeros((size, size))
    f[:3, 3:6] = np.eye(3)
    f[3:6, 6:9] = skew(segment.force)
    if segment.frame_rate is not None:
        f[6:9, 6:9] = -skew(segment.frame_rate)
    shown = shown_states(model)
    f[3:6] += segment.rotation @ shown[0]
    f[6:9] -= segment.rotation @ shown[1]
    for j in range(model.size):
        f[9 + j, 9 + j] = model.drift[j, 0]
        other = int(model.partner[j])
        if other >= 0:
            f[9 + j, 9 + other] = model.drift[j, 1]
    return f


def gnss_rows(size: int, *, velocity: bool = False) -> FloatArray:
    """Return H of GNSS positions, and of velocities if asked, without lever arm."""
    rows = np.zeros((6 if velocity else 3, size))
    rows[range(rows.shape[0]), range(rows.shape[0])] = 1.0
    return rows


def observability(
    model: SensorErrorModel,
    segments: Sequence[Segment],
    *,
    rows: ArrayLike | None = None,
    velocity: bool = False,
) -> Observability:
    """Analyse the total observability matrix over stretches of motion. S002 (13), spec 7.5.

    Parameters
    ----------
    model : SensorErrorModel
        Sensor error states of the filter.
    segments : sequence of Segment
        At least one.
    rows : (r, 9 + m) array_like or None
        Further measurements that are linear in the states: parity, for instance.
    velocity : bool
        Whether GNSS measures velocity too.

    Returns
    -------
    Observability
        Of the state at the start.

    Raises
    ------
    InputError
        No segment, or a model that cannot be analysed.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import GaussMarkov, NoiseModel, Segment, WhiteNoise
    >>> from schuler import observability, sensor_error_model
    >>> biased = WhiteNoise(1e-4) + GaussMarkov(1e-4, 100.0)
    >>> states = sensor_error_model(
    ...     NoiseModel.isotropic(biased, biased), turn_on_accel=0.1, turn_on_gyro=0.01
    ... )
    >>> still = Segment(np.array([0.0, 0.0, -9.81]), np.eye(3))
    >>> found = observability(states, [still])
    >>> found.rank < len(found.names)
    True
    """
    if not segments:
        raise InputError("observability over no segment", expected="at least one")
    from scipy.linalg import expm

    size = 9 + model.size
    design = gnss_rows(size, velocity=velocity)
    if rows is not None:
        design = np.vstack([design, np.asarray(rows, dtype=np.float64)])
    scale = np.concatenate([NAVIGATION_SCALE, _prior_sd(model)])
    passed = np.eye(size)
    stacked = []
    for segment in segments:
        f = system_matrix(model, segment)
        row, power = design * scale, f * scale / scale[:, None] * segment.duration
        before = passed * scale / scale[:, None]
        for k in range(size):
            # what the k-th derivative adds to the measurement within the stretch, Taylor
            stacked.append(row @ before)
            row = row @ power / (k + 1.0)
        passed = expm(f * segment.duration) @ passed
    matrix = np.vstack(stacked)
    _, values, right = np.linalg.svd(matrix, full_matrices=False)
    relative = values / values[0]
    return Observability(
        names=state_names(model),
        scale=scale,
        singular_values=values,
        directions=right.T,
        rank=int(np.sum(relative > RANK_TOLERANCE)),
        practical_rank=int(np.sum(relative > PRACTICAL_TOLERANCE)),
        shown=shown_states(model),
    )


def _prior_sd(model: SensorErrorModel) -> FloatArray:
    sd = np.sqrt(np.diag(model.initial_covariance))
    return np.where(sd > 0.0, sd, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Gramian:
    """What the measurements of a run say of the state at its start, noise and prior taken in."""

    names: tuple[str, ...]  # of the states
    # (s,): eigenvalues of P0^1/2 (sum of Phi' H' R^-1 H Phi) P0^1/2, largest first: by how much the
    # measurements outweigh the prior. Below one the prior knows more.
    information: FloatArray
    # (s, s): eigenvectors in columns, in units of the prior standard deviations
    directions: FloatArray
    shown: FloatArray  # (2, 3, s): as in `Observability`

    @property
    def learnt(self) -> int:
        """Directions in which the measurements outweigh the prior."""
        return int(np.sum(self.information > 1.0))


def gramian(
    model: SensorErrorModel,
    segments: Sequence[Segment],
    initial_covariance: FloatArray,
    *,
    position_sd: float,
    interval: float = 1.0,
    rows: ArrayLike | None = None,
    row_sd: float = 1.0,
) -> Gramian:
    """Add up what every fix says of the state at the start. Process noise is left out."""
    from scipy.linalg import expm

    size = 9 + model.size
    sd = np.sqrt(np.diag(initial_covariance))
    sd = np.where(sd > 0.0, sd, 1e-12)
    design = gnss_rows(size) / position_sd
    if rows is not None:
        design = np.vstack([design, np.asarray(rows, dtype=np.float64) / row_sd])
    total, passed = np.zeros((size, size)), np.eye(size)
    for segment in segments:
        step = expm(system_matrix(model, segment) * interval)
        for _ in range(max(round(segment.duration / interval), 1)):
            passed = step @ passed
            seen = (design @ passed) * sd
            total += seen.T @ seen
    values, vectors = np.linalg.eigh(total)
    order = np.argsort(values)[::-1]
    return Gramian(
        names=state_names(model),
        information=np.maximum(values[order], 0.0),
        directions=vectors[:, order],
        shown=shown_states(model),
    )


def covariance_decay(sd: FloatArray) -> FloatArray:
    """Return by how much the filter's standard deviations fell since the start."""
    decay: FloatArray = sd / np.where(sd[0] > 0.0, sd[0], np.inf)
    return decay
