"""Velocities that are in other axes than the positions of the same file are known by them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.data.track import Track
from schuler.earth import ned_from_ecef_rotation, ned_from_geodetic
from schuler.types import FloatArray, IntArray

SPAN = 2.0
"""Seconds over which a way is compared with the velocities: noise of positions counts less."""
FEWEST = 10
"""Spans, so that chance does not decide."""
BETTER = 3.0
"""Other axes have to fit so many times better."""
SEEN = 0.1
"""m/s: velocities that are off by less tell nothing of axes."""


def in_own_axes(track: Track) -> tuple[Track, str]:
    """Return a track with velocities in the axes of its positions, and what was found of them."""
    if track.velocity is None:
        return track, ""
    metres = track.position
    if not track.local:
        metres = ned_from_geodetic(track.position, track.position[0])
    ends = _spans(track.time)
    if ends.shape[1] < FEWEST:
        return track, ""
    as_it_is = _off(track, metres, track.velocity, ends)
    others = _others(track, track.velocity)
    off = {name: _off(track, metres, v, ends) for name, v in others.items()}
    best = min(off, key=lambda name: off[name])
    if not as_it_is > max(SEEN, BETTER * off[best]):
        return track, ""
    said = (
        f"velocities of {track.name} are in other axes than its positions: as north, east, down "
        f"they are {as_it_is:.3g} m/s off the way it went, as {best} {off[best]:.2g} m/s, and "
        "were taken so"
    )
    return replace(track, velocity=others[best]), said


def _spans(time: FloatArray) -> IntArray:
    """Return first and last rows of stretches of about `SPAN` without a pause."""
    step = float(np.median(np.diff(time)))
    rows = np.arange(0, time.size, max(1, round(SPAN / step)))
    first, last = rows[:-1], rows[1:]
    whole = time[last] - time[first] < 1.5 * max(SPAN, step)
    return np.stack([first[whole], last[whole]]).astype(np.int64)


def _off(track: Track, metres: FloatArray, velocity: FloatArray, ends: IntArray) -> float:
    """Return how far velocities are from the way over the spans, rms of three axes, m/s."""
    first, last = ends
    step = np.diff(track.time)[:, None]
    way = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * step, axis=0)
    way = np.concatenate([np.zeros((1, 3)), way])
    seconds = (track.time[last] - track.time[first])[:, None]
    error = (metres[last] - metres[first] - way[last] + way[first]) / seconds
    return float(np.sqrt((error**2).sum(axis=1).mean()))


def _others(track: Track, velocity: FloatArray) -> dict[str, FloatArray]:
    """Return what velocities are, north, east, down, if they were written in other axes."""
    found = {
        "east, north, up": velocity[:, [1, 0, 2]] * (1.0, 1.0, -1.0),
        "north, east, up": velocity * (1.0, 1.0, -1.0),
        "north, west, up": velocity * (1.0, -1.0, -1.0),
    }
    if track.rotation is not None:
        for name, signs in (("right, down", (1.0, 1.0, 1.0)), ("left, up", (1.0, -1.0, -1.0))):
            body = np.einsum("nij,nj->ni", track.rotation, velocity * signs)
            found[f"forward, {name} of the body"] = body
    if not track.local:
        found["ECEF"] = velocity @ ned_from_ecef_rotation(*track.position[0, :2]).T
    return found
