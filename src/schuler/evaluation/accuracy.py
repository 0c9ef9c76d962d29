"""Any trajectory judged by a better one: absolute and relative errors, and what it claims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.data.to_dict import ToDict
from schuler.data.track import Track
from schuler.data.trajectory import DIRECTIONS, NavigationSolution, Trajectory
from schuler.earth import metres_per_radian
from schuler.errors import InputError
from schuler.evaluation.alignment import Align, Pair, pair_tracks
from schuler.evaluation.velocity_axes import in_own_axes
from schuler.rotations import rotation_vector_from_dcm
from schuler.types import FloatArray, IntArray

SPANS = (1.0, 10.0, 60.0)
"""Seconds over which relative errors are taken."""
STRETCHES = (100.0, 1000.0)
"""Metres of way over which relative errors are taken."""
PARTS = 20
"""Of the time, whose scatter tells how sure a shift of the clock is, ..."""
SURE = 4.0
"""... in so many standard errors, and ..."""
EXPLAINED = 1.0 / 3.0
"""... the share of the squared error that it has to explain."""


@dataclass(frozen=True, slots=True)
class RelativeError(ToDict):
    """How far apart two moments come out, against how far apart they were."""

    over: float  # seconds or metres between the two moments
    unit: str  # of `over`
    pairs: int  # pairs of moments; neighbours share most of their way.
    # rms_m, worst_m: length of the difference
    rms_m: float
    worst_m: float
    rms_rad: float  # angle of the difference; NaN where attitude is not known.


@dataclass(frozen=True, slots=True)
class WindowError(ToDict):
    """Horizontal error within a stretch of time."""

    # start_s, duration_s: seconds after the first common moment, and length
    start_s: float
    duration_s: float
    # max_m, mean_m, end_m: horizontal error
    max_m: float
    mean_m: float
    end_m: float


@dataclass(frozen=True, slots=True)
class TimeShift(ToDict):
    """A shift of the clock that explains much of an error: it lies along the velocity."""

    # offset_s, sd_s: seconds to add to the time of the reference besides what was added, and how
    # sure
    offset_s: float
    sd_s: float
    explained: float  # share of the squared error
    remaining_m: float  # root mean square of what is left, m


@dataclass(frozen=True, slots=True, eq=False)
class TrajectoryEvaluation(Exportable):
    """Errors of a trajectory against a reference, estimated minus true.

    Parameters
    ----------
    name, truth_name : str
        Of the two.
    time : (n,) ndarray
        Seconds.
    error : (n, 3) ndarray
        North, east, down in m.
    velocity_error : (n, 3) ndarray or None
        North, east, down in m/s, where both know velocity.
    attitude_error : (n, 3) ndarray or None
        Small angles about north, east, down in rad, where both know attitude.
    claimed_sd : (n, 3) ndarray or None
        Standard deviations of position that the trajectory claims, m.
    truth_sd : (n, 3) ndarray or None
        Those of the reference.
    distance : float
        Way of the reference in m.
    relative : tuple of RelativeError
        Over spans of time and stretches of way.
    windows : tuple of WindowError
        Stretches that were asked for.
    notes : tuple of str
        What was done, and what limits the comparison.
    time_shift : TimeShift or None
        Where another clock explains a third of the squared error or more.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Track, evaluate_trajectory
    >>> way = np.column_stack([np.arange(100.0), np.zeros(100), np.zeros(100)])
    >>> truth = Track(np.arange(100.0), way, local=True)
    >>> round(evaluate_trajectory(truth, truth).distance)
    99
    """

    JSON = (
        "name truth_name samples duration_s distance_m=distance ate_m horizontal_m vertical_m axes "
        "velocity_rms_m_s attitude_rms_rad relative windows claims notes "
        "time_shift"
    )
    AXES = "north east down"

    name: str
    truth_name: str
    time: FloatArray
    error: FloatArray
    velocity_error: FloatArray | None
    attitude_error: FloatArray | None
    claimed_sd: FloatArray | None
    truth_sd: FloatArray | None
    distance: float
    relative: tuple[RelativeError, ...]
    windows: tuple[WindowError, ...]
    notes: tuple[str, ...] = field(default=())
    time_shift: TimeShift | None = None

    @property
    def samples(self) -> int:
        """Number of moments that were compared."""
        return int(self.time.size)

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last of them."""
        return float(self.time[-1] - self.time[0])

    @property
    def ate_m(self) -> dict[str, float]:
        """Absolute trajectory error in space: rms, mean, median, 95 %, largest."""
        return _spread(np.linalg.norm(self.error, axis=1))

    @property
    def horizontal_m(self) -> dict[str, float]:
        """The same of the horizontal error."""
        return _spread(np.hypot(self.error[:, 0], self.error[:, 1]))

    @property
    def vertical_m(self) -> dict[str, float]:
        """The same of the vertical error."""
        return _spread(np.abs(self.error[:, 2]))

    @property
    def axes(self) -> dict[str, dict[str, float]]:
        """Mean, standard deviation and rms by axis, m."""
        return {
            d: {
                "mean_m": float(e.mean()),
                "sd_m": float(e.std()),
                "rms_m": float(np.sqrt(np.mean(e**2))),
            }
            for d, e in zip(DIRECTIONS, self.error.T, strict=True)
        }

    @property
    def velocity_rms_m_s(self) -> list[float] | None:
        """Root mean squares north, east, down."""
        return _rms(self.velocity_error)

    @property
    def attitude_rms_rad(self) -> list[float] | None:
        """Root mean squares about north, east, down."""
        return _rms(self.attitude_error)

    @property
    def claims(self) -> dict[str, Any] | None:
        """What the claimed standard deviations are worth; None where there are none.

        `within_2_sigma` is 0.954 and `nees_per_axis` is 1 for an honest claim. The variance of
        the reference is added to that of the trajectory where it is known.
        """
        if self.claimed_sd is None:
            return None
        variance = self.claimed_sd**2
        if self.truth_sd is not None:
            variance = variance + self.truth_sd**2
        square = self.error**2 / np.maximum(variance, 1e-30)
        return {
            "within_2_sigma": dict(zip(DIRECTIONS, (square <= 4.0).mean(axis=0), strict=True)),
            "nees_per_axis": float(square.mean()),
            "reference_variance_added": self.truth_sd is not None,
        }


def evaluate_trajectory(
    estimate: NavigationSolution | Trajectory | Track,
    truth: NavigationSolution | Trajectory | Track,
    *,
    align: Align = "auto",
    time_offset: float = 0.0,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    windows: Sequence[tuple[float, float]] = (),
) -> TrajectoryEvaluation:
    """Judge a trajectory by a reference.

    Parameters
    ----------
    estimate : NavigationSolution, Trajectory or Track
        What is judged; `read_track` reads that of any program.
    truth : NavigationSolution, Trajectory or Track
        The reference.
    align : {"auto", "none", "shift", "turn"}
        Whether the best shift, or rotation and shift, is taken out first. "auto": only where one
        of the two is in local axes; frames that do not fit are refused.
    time_offset : float
        Seconds added to the time of the reference.
    lever_arm : (3,) array_like
        From the point of the trajectory to that of the reference (such as its antenna), m, in
        body axes.
    windows : sequence of (float, float)
        Start after the first common moment and length, s, of stretches that are judged alone.

    Returns
    -------
    TrajectoryEvaluation
        Errors at the stamps of the one that has fewer.

    Raises
    ------
    InputError
        No overlap in time, another frame, a mirrored trajectory, a lever arm without attitude.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Track, evaluate_trajectory
    >>> time = np.arange(100.0)
    >>> way = np.column_stack([5.0 * time, np.sin(0.1 * time) * 50.0, np.zeros(100)])
    >>> off = way + (0.3, -0.4, 0.0)
    >>> found = evaluate_trajectory(Track(time, off, local=True), Track(time, way, local=True))
    >>> round(found.ate_m["rms"], 3)
    0.5
    """
    if align not in ("auto", "none", "shift", "turn"):
        raise InputError(f"align '{align}'", expected="auto, none, shift or turn")
    track = _moved(Track.of(estimate), np.asarray(lever_arm, dtype=np.float64))
    reference = Track.of(truth)
    if time_offset:
        reference = replace(reference, time=reference.time + time_offset)
    pair = pair_tracks(track, reference, align)
    attitudes = _attitudes(track, reference, pair)
    velocity_error, axes = _velocity_error(track, reference, pair)
    step = np.linalg.norm(np.diff(pair.truth, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(step)])
    return TrajectoryEvaluation(
        track.name,
        reference.name,
        pair.time,
        pair.estimate - pair.truth,
        velocity_error,
        None if attitudes is None else _small_angles(*attitudes),
        None if track.position_sd is None else track.position_sd[pair.rows],
        None if reference.position_sd is None else reference.position_sd[pair.truth_rows],
        float(way[-1]),
        tuple(_relative(pair, way, attitudes)),
        tuple(_window(pair, *w) for w in windows),
        (*pair.notes, *axes),
        _time_shift(pair.time, pair.estimate - pair.truth, pair.truth),
    )


def _time_shift(time: FloatArray, error: FloatArray, truth: FloatArray) -> TimeShift | None:
    """Regress errors on the velocity of the reference; parts of the time tell how sure it is."""
    if time.size < 2 * PARTS:
        return None
    velocity = np.gradient(truth, time, axis=0)
    along, power = (velocity * error).sum(axis=1), (velocity**2).sum(axis=1)
    if not power.sum() > 0.0:
        return None
    late = float(along.sum() / power.sum())
    residual = along - late * power
    parts = [float(p.sum()) for p in np.array_split(residual, PARTS)]
    sd = float(np.sqrt(np.sum(np.square(parts)) * PARTS / (PARTS - 1)) / power.sum())
    whole, left = float((error**2).sum()), float(((error - late * velocity) ** 2).sum())
    explained = 1.0 - left / max(whole, 1e-30)
    if explained < EXPLAINED or abs(late) < max(SURE * sd, 1e-3):
        return None
    return TimeShift(-late, sd, explained, float(np.sqrt(left / time.size)))


def _spread(values: FloatArray) -> dict[str, float]:
    return {
        "rms": float(np.sqrt(np.mean(values**2))),
        "mean": float(values.mean()),
        "median": float(np.median(values)),
        "p95": float(np.quantile(values, 0.95)),
        "max": float(values.max()),
    }


def _rms(values: FloatArray | None) -> list[float] | None:
    return None if values is None else [float(x) for x in np.sqrt(np.mean(values**2, axis=0))]


def _moved(track: Track, arm: FloatArray) -> Track:
    """Return a track of another point of the body."""
    if arm.shape != (3,):
        raise InputError(f"lever arm of shape {arm.shape}", expected="three numbers")
    if not arm.any():
        return track
    if track.rotation is None:
        raise InputError(f"a lever arm, but {track.name} holds no attitude", expected="attitude")
    ned = track.rotation @ arm
    if not track.local:
        north, east = metres_per_radian(track.position)
        ned = ned / np.stack([north, east, -np.ones(north.size)], axis=-1)
    return replace(track, position=track.position + ned, velocity=None)


def _velocity_error(track: Track, truth: Track, pair: Pair) -> tuple[FloatArray | None, list[str]]:
    """Return errors of velocity, and what was said of axes that do not suit the positions."""
    found, said = zip(*(in_own_axes(t) for t in (track, truth)), strict=True)
    if track.velocity is None or truth.velocity is None:
        return None, []
    ours, theirs = (
        np.column_stack([np.interp(pair.time, t.time, v) for v in t.velocity.T]) for t in found
    )
    return np.asarray(ours @ pair.turn.T - theirs), [s for s in said if s]


def _attitudes(track: Track, truth: Track, pair: Pair) -> tuple[FloatArray, FloatArray] | None:
    if track.rotation is None or truth.rotation is None:
        return None
    return pair.turn @ track.rotation[pair.rows], truth.rotation[pair.truth_rows]


def _small_angles(ours: FloatArray, theirs: FloatArray) -> FloatArray:
    """Return psi of C_computed = (I - [psi x]) C_true."""
    return -np.asarray(rotation_vector_from_dcm(ours @ theirs.transpose(0, 2, 1)))


def _relative(
    pair: Pair, way: FloatArray, attitudes: tuple[FloatArray, FloatArray] | None
) -> list[RelativeError]:
    """Return the errors between two moments some time or some way apart."""
    found = []
    for along, unit, spans in ((pair.time, "s", SPANS), (way, "m", STRETCHES)):
        for over in spans:
            first = np.flatnonzero(along <= along[-1] - over).astype(np.int64)
            last = np.searchsorted(along, along[first] + over - 1e-9).astype(np.int64)
            near = along[np.minimum(last, along.size - 1)] - along[first] < 1.2 * over + 1e-9
            first, last = first[near], last[near]
            if first.size >= 3:
                found.append(_between(pair, attitudes, first, last, over, unit))
    return found


def _between(
    pair: Pair,
    attitudes: tuple[FloatArray, FloatArray] | None,
    first: IntArray,
    last: IntArray,
    over: float,
    unit: str,
) -> RelativeError:
    """Return the difference of two ways; each in its own body axes where attitude is known."""
    ours = pair.estimate[last] - pair.estimate[first]
    theirs = pair.truth[last] - pair.truth[first]
    angle = np.full(1, np.nan)
    if attitudes is not None:
        a, b = attitudes
        ours = np.einsum("nji,nj->ni", a[first], ours)
        theirs = np.einsum("nji,nj->ni", b[first], theirs)
        turned = a[first].transpose(0, 2, 1) @ a[last]
        true = b[first].transpose(0, 2, 1) @ b[last]
        angle = np.linalg.norm(rotation_vector_from_dcm(true.transpose(0, 2, 1) @ turned), axis=1)
    length = np.linalg.norm(ours - theirs, axis=1)
    return RelativeError(
        over, unit, int(first.size), float(np.sqrt(np.mean(length**2))), float(length.max()),
        float(np.sqrt(np.mean(angle**2))),
    )  # fmt: skip


def _window(pair: Pair, start: float, seconds: float) -> WindowError:
    since = pair.time - pair.time[0]
    inside = (since >= start) & (since <= start + seconds)
    if not inside.any():
        raise InputError(
            f"no common moment in the window {start:g}:{seconds:g}",
            expected=f"a window within 0 .. {since[-1]:.0f} s",
        )
    error = np.hypot(*(pair.estimate - pair.truth)[inside, :2].T)
    return WindowError(start, seconds, float(error.max()), float(error.mean()), float(error[-1]))
