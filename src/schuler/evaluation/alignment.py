"""Two tracks on one time axis and in one frame; what cannot be brought there is told why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from schuler import rotations
from schuler.data.track import Track
from schuler.earth import metres_per_radian, ned_from_geodetic
from schuler.errors import InputError
from schuler.types import BoolArray, FloatArray, IntArray

Align = Literal["auto", "none", "shift", "turn"]
PLAUSIBLE = 0.02
"""A fit that is off by less than this share of the extent of a track shows what was meant."""
FAR = 50_000.0
"""Metres: two tracks so far apart were not recorded in one place."""
LONGEST_STEP = 2.0
"""Seconds: over a longer pause nothing is interpolated."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A track and its reference at the same moments, in metres about the first of them."""

    time: FloatArray  # (n,): seconds of the reference
    # truth, estimate: (n, 3) north, east, down
    truth: FloatArray
    estimate: FloatArray
    rows: IntArray  # (n,): the nearest rows of the track
    truth_rows: IntArray  # (n,): the nearest rows of the reference
    turn: FloatArray  # (3, 3): what the vectors of the track were turned by
    notes: tuple[str, ...]  # what was done and what limits the comparison


def pair_tracks(track: Track, truth: Track, align: Align = "auto") -> Pair:
    """Return both at the stamps of the one with fewer of them, aligned where it must be."""
    inside = _common(track, truth)
    sparse, dense = (track, truth) if _step(track) >= _step(truth) else (truth, track)
    time = sparse.time[(sparse.time >= inside[0]) & (sparse.time <= inside[1])]
    time = time[_bridged(dense.time, time)]
    if time.size < 3:
        raise InputError(
            f"{track.name} and {truth.name} have {time.size} moments in common",
            expected="at least 3",
        )
    theirs, ours = _at(truth, time), _at(track, time)
    notes = [_interpolation(dense, time)]
    if track.local or truth.local:
        if not truth.local:
            theirs = ned_from_geodetic(theirs, theirs[0])
        if not track.local:
            ours = ned_from_geodetic(ours, ours[0])
    else:
        north, east = metres_per_radian(theirs)
        scale = np.stack([north, east, -np.ones(north.size)], axis=-1)
        error = (ours - theirs) * scale
        error[:, 1] = (ours[:, 1] - theirs[:, 1] + np.pi) % (2 * np.pi) * east - np.pi * east
        theirs = ned_from_geodetic(theirs, theirs[0])
        ours = theirs + error
    turn, shift, said = _alignment(ours, theirs, track, truth, align)
    ours = ours @ turn.T + shift
    return Pair(
        time, theirs, ours, _nearest(track.time, time), _nearest(truth.time, time), turn,
        tuple(filter(None, (*track.history, *truth.history, *notes, said))),
    )  # fmt: skip


def _common(track: Track, truth: Track) -> tuple[float, float]:
    start, stop = max(track.time[0], truth.time[0]), min(track.time[-1], truth.time[-1])
    if start < stop:
        return float(start), float(stop)
    ranges = [f"{t.name} {t.time[0]:.1f} .. {t.time[-1]:.1f} s" for t in (track, truth)]
    cure = "bring both to one time scale, or say the difference with time_offset="
    unix = [t.time[0] > 1e9 for t in (track, truth)]
    if unix[0] != unix[1]:
        cure = "one counts Unix time, the other not; say the difference with time_offset="
    raise InputError(
        f"no overlap in time: {', '.join(ranges)}", expected="one time axis", cure=cure
    )


def _step(track: Track) -> float:
    return float(np.median(np.diff(track.time)))


def _bridged(stamps: FloatArray, wanted: FloatArray) -> BoolArray:
    """Tell which moments lie on a stamp or in a short step between two."""
    after = np.clip(np.searchsorted(stamps, wanted), 1, stamps.size - 1)
    step = stamps[after] - stamps[after - 1]
    longest = max(LONGEST_STEP, 3.0 * float(np.median(np.diff(stamps))))
    found: BoolArray = (step <= longest) | (wanted == stamps[after]) | (wanted == stamps[0])
    return found


def _at(track: Track, time: FloatArray) -> FloatArray:
    position = track.position.copy()
    if not track.local:
        position[:, 1] = np.unwrap(position[:, 1])
    return np.column_stack([np.interp(time, track.time, p) for p in position.T])


def _nearest(stamps: FloatArray, time: FloatArray) -> IntArray:
    after = np.clip(np.searchsorted(stamps, time), 1, stamps.size - 1)
    before = time - stamps[after - 1] < stamps[after] - time
    return np.asarray(after - before, dtype=np.int64)


def _interpolation(dense: Track, time: FloatArray) -> str:
    """Tell how far a straight line between two stamps can be from the way that was driven."""
    step = _step(dense)
    if step < 0.05 or np.isin(time, dense.time).mean() > 0.99:
        return ""
    metres = dense.position
    if not dense.local:
        metres = ned_from_geodetic(dense.position, dense.position[0])
    bend = np.linalg.norm(np.diff(metres, 2, axis=0), axis=1) / 8.0
    worst = float(np.quantile(bend, 0.95))
    return (
        f"{dense.name} has a position every {step:.3g} s; between two of them a straight line is "
        f"taken, which is off by up to {worst:.2g} m (95 %)"
    )


def _fit(ours: FloatArray, theirs: FloatArray) -> tuple[FloatArray, FloatArray, float, float]:
    """Return turn, shift and rms of the best fit, and the rms of the best mirrored one."""
    a, b = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    u, s, vt = np.linalg.svd(b.T @ a)
    sign = float(np.sign(np.linalg.det(u @ vt)))
    total = float((a**2).sum() + (b**2).sum())
    turned = [total - 2.0 * (s[0] + s[1] + d * s[2]) for d in (sign, -sign)]
    rms, mirrored = (float(np.sqrt(max(t, 0.0) / len(a))) for t in turned)
    turn = u @ np.diag([1.0, 1.0, sign]) @ vt
    return turn, theirs.mean(axis=0) - ours.mean(axis=0) @ turn.T, rms, mirrored


def _alignment(
    ours: FloatArray, theirs: FloatArray, track: Track, truth: Track, align: Align
) -> tuple[FloatArray, FloatArray, str]:
    """Return turn and shift, and what to say of them; other frames are refused."""
    turn, shift, rms, mirrored = _fit(ours, theirs)
    extent = float(np.sqrt(((theirs - theirs.mean(axis=0)) ** 2).sum(axis=1).mean()))
    as_it_is = float(np.sqrt(((ours - theirs) ** 2).sum(axis=1).mean()))
    if extent > 0.0 and mirrored < PLAUSIBLE * extent and rms > 10.0 * mirrored:
        raise InputError(
            f"{track.name} is mirrored against {truth.name}: it fits within {mirrored:.3g} m when "
            f"one axis is turned round, within {rms:.3g} m otherwise",
            expected="axes of one hand",
            cure="two axes are swapped or one sign is wrong, as where north-east-down is taken "
            "for east-north-up",
        )
    if align == "shift":
        middle = (theirs - ours).mean(axis=0)
        return np.eye(3), middle, f"shifted by {np.linalg.norm(middle):.3g} m for the best fit"
    angle = np.degrees(np.linalg.norm(rotations.rotation_vector_from_dcm(turn)))
    said = f"turned by {angle:.3g} deg and shifted for the best fit of positions"
    unknown = track.local != truth.local
    if align == "turn" or (align == "auto" and unknown):
        reason = f"{(track if track.local else truth).name} is in local axes, so it was "
        return turn, shift, (reason if align == "auto" else "") + said
    fits = extent > 0.0 and rms < PLAUSIBLE * extent and as_it_is > 20.0 * rms
    if align == "auto" and (as_it_is > FAR or (fits and as_it_is > 0.1 * extent)):
        raise InputError(
            f"{track.name} is in another frame than {truth.name}: {as_it_is:.3g} m apart (rms), "
            f"within {rms:.3g} m when turned by {angle:.3g} deg and shifted",
            expected="one frame and one unit of angles",
            cure="convert it, or take the best fit with align='turn'",
        )
    return np.eye(3), np.zeros(3), ""
