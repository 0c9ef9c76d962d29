"""The motion behind a recorded GNSS track: a smooth profile that its fixes could have come from.

Positions and velocities are fitted by a quintic spline on even knots, whose third derivative is
penalised. The penalty is as strong as the standard deviations allow: it grows until the residuals
are as large as they claim (Reinsch 1967, Numerische Mathematik 10:177; penalty on differences of
the coefficients: Eilers & Marx 1996, Statistical Science 11:89).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler import earth
from schuler.data import GnssRecording
from schuler.errors import InputError
from schuler.simulation.motions.profile import DEGREE, Profile, fit_local_profile
from schuler.types import FloatArray

PENALISED = 3
"""Order of the differences: what is not asked for by the fixes has no jerk."""
MOST_KNOTS = 200_000
COURSE_SPEED = 1.0
"""Ground speed from which the course tells the heading, m/s."""
FOLLOWED = 0.5
"""Mean square of residuals over claims below which positions are followed too closely."""
HEADING_CUTOFF = 0.4
"""Hz above which the heading does not follow the course."""


@dataclass(frozen=True, slots=True, eq=False)
class _Basis:
    """Even B-splines over an interval, `spacing` seconds apart."""

    start: float
    spacing: float
    size: int

    @staticmethod
    def over(start: float, stop: float, spacing: float) -> _Basis:
        cells = max(int(np.ceil((stop - start) / spacing)), 1)
        return _Basis(start, (stop - start) / cells, cells + DEGREE)

    @property
    def knots(self) -> FloatArray:
        return np.asarray(self.start + self.spacing * np.arange(-DEGREE, self.size + 1.0))

    def _first(self, time: FloatArray) -> NDArray[np.int64]:
        cells = self.size - DEGREE
        return np.clip(((time - self.start) / self.spacing).astype(np.int64), 0, cells - 1)

    def rows(self, time: FloatArray, slope: bool = False) -> tuple[NDArray[np.int64], FloatArray]:
        """First coefficient at each time, and the six weights (or those of the derivative)."""
        first = self._first(time)
        u = (time - self.start) / self.spacing - first
        degree = DEGREE - 1 if slope else DEGREE
        # de Boor's recursion for evenly spaced knots
        weight = np.ones((time.size, 1))
        for d in range(1, degree + 1):
            j = np.arange(d + 1)
            wider = np.zeros((time.size, d + 1))
            wider[:, 1:] += weight * (u[:, None] + (d - j[1:])) / d
            wider[:, :-1] += weight * ((j[:-1] + 1.0) - u[:, None]) / d
            weight = wider
        if slope:
            difference = np.zeros((time.size, DEGREE + 1))
            difference[:, 1:] += weight
            difference[:, :-1] -= weight
            weight = difference / self.spacing
        return first, weight


class _Fit:
    """Normal equations of one component, to be solved with any strength of the penalty."""

    def __init__(self, basis: _Basis) -> None:
        self.basis = basis
        self.band = np.zeros((DEGREE + 1, basis.size))
        self.right = np.zeros(basis.size)
        self.data: list[tuple[NDArray[np.int64], FloatArray, FloatArray, FloatArray]] = []
        self.count = 0

    def add(self, time: FloatArray, values: FloatArray, sd: FloatArray, slope: bool) -> None:
        """Take measurements in; an infinite standard deviation leaves one out."""
        used = np.isfinite(sd)
        first, weights = self.basis.rows(time[used], slope)
        precision, values = 1.0 / sd[used] ** 2, values[used]
        for i in range(DEGREE + 1):
            np.add.at(self.right, first + i, precision * weights[:, i] * values)
            for j in range(i, DEGREE + 1):
                product = precision * weights[:, i] * weights[:, j]
                np.add.at(self.band[j - i], first + i, product)
        self.data.append((first, weights, values, precision))
        self.count += int(used.sum())

    def solve(self, strength: float) -> FloatArray:
        """Coefficients at one strength of the penalty."""
        from scipy.linalg import solveh_banded

        weights = np.array([(-1.0) ** k * v for k, v in enumerate((1.0, 3.0, 3.0, 1.0))])
        band = self.band.copy()
        rows = self.basis.size - PENALISED
        for i in range(PENALISED + 1):
            for j in range(i, PENALISED + 1):
                band[j - i, i : i + rows] += strength * weights[i] * weights[j]
        # a hair on the diagonal keeps coefficients that nothing asks for from being singular
        band[0] += 1e-12 * band[0].max()
        return np.asarray(solveh_banded(band, self.right, lower=True), dtype=np.float64)

    def misfit(self, coefficients: FloatArray) -> float:
        """Sum of squared residuals over their variances."""
        total = 0.0
        for first, weights, values, precision in self.data:
            index = first[:, None] + np.arange(DEGREE + 1)
            residual = values - np.sum(weights * coefficients[index], axis=1)
            total += float(np.sum(precision * residual**2))
        return total


def _smooth(alone: list[_Fit], joint: list[_Fit] | None, what: str) -> list[FloatArray]:
    """Coefficients from positions and velocities, or from positions where these contradict."""
    count = sum(fit.count for fit in alone)
    if count == 0:
        raise InputError(f"a track without {what}", expected="positions with standard deviations")
    if joint is not None:
        solved = _strongest(joint)
        # Velocities that come late, or claim too much, keep the residuals large at any strength;
        # what gives way then is the penalty, and the fit runs through the noise of positions.
        misfit = sum(f.misfit(c) for f, c in zip(alone, solved, strict=True))
        if misfit > FOLLOWED * count:
            return solved
    return _strongest(alone)


def _strongest(fits: list[_Fit]) -> list[FloatArray]:
    """Solve with the strongest common penalty that the standard deviations allow."""
    from scipy.optimize import brentq

    count = sum(fit.count for fit in fits)
    unit = max(float(fit.band[0].max()) for fit in fits)

    def excess(log_strength: float) -> float:
        strength = unit * 10.0**log_strength
        return float(np.log(sum(fit.misfit(fit.solve(strength)) for fit in fits) / count + 1e-300))

    weakest, strongest = -8.0, 8.0
    if excess(strongest) <= 0.0:
        best = strongest
    elif excess(weakest) >= 0.0:
        best = weakest
    else:
        best = float(brentq(excess, weakest, strongest, xtol=0.02))
    return [fit.solve(unit * 10.0**best) for fit in fits]


def _check(track: GnssRecording) -> None:
    if track.size <= DEGREE or track.duration < 2.0:
        raise InputError(
            f"a track of {track.size} epochs in {track.duration:.1f} s",
            expected=f"more than {DEGREE} epochs and 2 s",
        )
    assert track.position_sd is not None
    if np.isnan(track.position_sd).any():
        raise InputError(
            f"track '{track.name}' does not say how good its positions are",
            expected="a standard deviation for each",
            cure="give one with GnssRecording.with_standard_deviations",
        )


def _heading(time: FloatArray, velocity: FloatArray, spacing: float) -> FloatArray:
    """Course where there is one, led smoothly over stops; pitch along the climb; rad, (n, 2)."""
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    moving = speed > COURSE_SPEED
    if not moving.any():
        return np.zeros((time.size, 2))
    course = np.unwrap(np.arctan2(velocity[moving, 1], velocity[moving, 0]))
    climb = np.arctan2(-velocity[moving, 2], speed[moving])
    basis = _Basis.over(time[0], time[-1], spacing)
    # the fixes of a spline with this penalty pass up to the cut-off, at weight one
    penalty = (2.0 * np.pi * HEADING_CUTOFF * basis.spacing) ** (-2 * PENALISED)
    penalty *= basis.spacing / (time[1] - time[0])
    sd = np.where(moving, 1.0, 4.0)
    columns = []
    for angle in (course, climb):
        fit = _Fit(basis)
        fit.add(time, np.interp(time, time[moving], angle), sd, slope=False)
        first, weights = basis.rows(time)
        coefficients = fit.solve(penalty)
        columns.append(np.sum(weights * coefficients[first[:, None] + np.arange(6)], axis=1))
    return np.stack(columns, axis=-1)


def from_track(track: GnssRecording, *, knot_spacing: float | None = None) -> Profile:
    """Return a smooth motion that a recorded track could have come from."""
    _check(track)
    step = float(np.median(np.diff(track.time)))
    spacing = float(np.clip(0.5 * step, 0.1, 0.5)) if knot_spacing is None else knot_spacing
    if not (spacing > 0.0 and track.duration / spacing < MOST_KNOTS):
        raise InputError(
            f"knots {spacing:g} s apart in {track.duration:.0f} s",
            expected=f"a positive spacing and fewer than {MOST_KNOTS} knots",
        )
    origin = track.position[0].copy()
    origin_scale = np.array([*earth.metres_per_radian(origin), 1.0])
    local = (track.position - origin) * origin_scale
    here = np.stack([*earth.metres_per_radian(track.position), np.ones(track.size)], axis=-1)
    basis = _Basis.over(track.time[0], track.time[-1], spacing)
    alone, joint = [_Fit(basis) for _ in range(3)], [_Fit(basis) for _ in range(3)]
    assert track.position_sd is not None
    for j in range(3):
        for fit in (alone[j], joint[j]):
            fit.add(track.time, local[:, j], track.position_sd[:, j], slope=False)
        if track.velocity is not None and track.velocity_sd is not None:
            sign = -1.0 if j == 2 else 1.0
            sd = np.where(np.isnan(track.velocity_sd[:, j]), np.inf, track.velocity_sd[:, j])
            rate = sign * track.velocity[:, j] * origin_scale[j] / here[:, j]
            joint[j].add(track.time, rate, sd, slope=True)
    fast = track.velocity is not None
    solved = [
        *_smooth(alone[:2], joint[:2] if fast else None, "horizontal positions"),
        *_smooth(alone[2:], joint[2:] if fast else None, "heights"),
    ]
    knots = np.linspace(track.time[0], track.time[-1], basis.size - DEGREE + 1)
    return _profile(basis, np.stack(solved, axis=-1), knots, origin)


def _profile(
    basis: _Basis, coefficients: FloatArray, knots: FloatArray, origin: FloatArray
) -> Profile:
    """The profile with the smoothed positions, looking where it goes."""
    index = np.arange(DEGREE + 1)

    def evaluate(time: FloatArray, slope: bool) -> FloatArray:
        first, weights = basis.rows(time, slope)
        return np.asarray(np.einsum("nk,nkj->nj", weights, coefficients[first[:, None] + index]))

    if knots.size <= DEGREE:
        knots = np.linspace(knots[0], knots[-1], DEGREE + 1)
    velocity = evaluate(knots, slope=True) * np.array([1.0, 1.0, -1.0])
    yaw, pitch = _heading(knots, velocity, basis.spacing).T
    euler = np.stack([np.zeros(knots.size), pitch, yaw], axis=-1)
    return fit_local_profile(knots, evaluate(knots, slope=False), euler, origin)
