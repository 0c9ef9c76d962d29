"""Figures 18 and 20 to 26, tables 6 and 8 to 10: seven outages, five error models, many seeds."""

from __future__ import annotations

import functools

import numpy as np

from schuler import (
    OutageStatistics,
    OutageTwin,
    Profile,
    SetPiece,
    car_with_set_pieces,
    draw_outage_twin,
    ned_from_geodetic,
    outage_twin,
    run_outages,
)
from schuler_papers.experiment import FloatArray, Numbers, Size, generator, numbers
from schuler_papers.quinchia2013.sensor import (
    MODELS,
    PAPER,
    TURN_ON_ACCEL,
    TURN_ON_GYRO,
    bare,
    models,
    twin,
)

KMH = 1.0 / 3.6
QUARTER = float(np.pi / 2)
SHOWN = 60
LEVELS = (0, 3, 7)
# tables 9 and 10: seconds, mean speed; turns as the text and the figures have them
FIRST = (
    SetPiece(30.0, 23.58 * KMH, QUARTER, share=0.20),
    SetPiece(60.0, 42.31 * KMH, share=0.20),
    SetPiece(30.0, 47.60 * KMH, 0.3 * QUARTER, share=0.15),
)
SECOND = (
    SetPiece(30.0, 33.60 * KMH, 0.6 * QUARTER, share=0.10),
    SetPiece(30.0, 52.25 * KMH, QUARTER, share=0.12, before="country"),
    SetPiece(30.0, 20.44 * KMH, -QUARTER, share=0.08),
    SetPiece(60.0, 112.42 * KMH, 0.1 * QUARTER, 0.9, before="motorway", share=0.15),
)
PIECES = (*FIRST, *SECOND)
# table 6: seconds and mean speed of its own outages; where they turn is not printed
FIRST_STARRED = (
    SetPiece(30.0, 25.16 * KMH, QUARTER, share=0.08),
    SetPiece(30.0, 18.86 * KMH, share=0.08),
    SetPiece(30.0, 42.53 * KMH, share=0.08),
    SetPiece(30.0, 23.56 * KMH, -QUARTER, share=0.08),
    SetPiece(30.0, 39.32 * KMH, share=0.08),
)
SECOND_STARRED = (
    SetPiece(60.0, 103.36 * KMH, before="motorway", share=0.2),
    SetPiece(60.0, 122.73 * KMH, before="motorway", share=0.2),
)
STARRED = (*FIRST_STARRED, *SECOND_STARRED)
STRAIGHT_STARRED = tuple(k for k, p in enumerate(STARRED) if p.turn == 0.0)
STRAIGHT = tuple(k for k, p in enumerate(PIECES) if p.turn == 0.0)
LONG = tuple(k for k, p in enumerate(PIECES) if p.duration == 60.0)


@functools.cache
def drives(starred: bool = False) -> tuple[tuple[Profile, tuple[tuple[float, float], ...]], ...]:
    """Return both drives with the outages of tables 9 and 10, or of table 6 (starred)."""
    if starred:
        return (
            car_with_set_pieces(1038.0, FIRST_STARRED, 0),
            car_with_set_pieces(903.0, SECOND_STARRED, 0, after="country"),
        )
    return (
        car_with_set_pieces(1038.0, FIRST, 0),
        car_with_set_pieces(903.0, SECOND, 0, after="country"),
    )


@functools.cache
def twins(starred: bool = False) -> tuple[OutageTwin, ...]:
    """Return the twins of both drives."""
    return tuple(
        outage_twin(
            profile,
            twin(turn_on=True),
            # the first fix is one second after the start
            [(start - 1.0, seconds) for start, seconds in windows],
            turn_on_accel=TURN_ON_ACCEL,
            turn_on_gyro=TURN_ON_GYRO,
        )
        for profile, windows in drives(starred)
    )


def run(seed: int, size: Size) -> Numbers:
    """Drive both drives once with new noise, and every error model through the seven outages."""
    rng = generator(seed, PAPER, "outages")
    found: dict[str, FloatArray] = {}
    chosen = models(size)
    parts: dict[str, list[OutageStatistics]] = {name: [] for name in MODELS}
    nis: dict[str, list[float]] = {name: [] for name in MODELS}
    tracks: list[dict[str, FloatArray]] = []
    for drive, child in zip(twins(), rng.spawn(len(twins())), strict=True):
        kept: list[dict[str, FloatArray]] = []
        done = run_outages(drive, chosen, draw_outage_twin(drive, child), kept)
        tracks += kept
        for name, (statistics, mean) in done.items():
            parts[name].append(statistics)
            nis[name].append(mean)
    for name in MODELS:
        found |= _figures(name, parts[name])
        found[f"{name}:nis"] = np.array(nis[name])
    if seed == 0:
        for name in ("reference", *MODELS):
            found[f"{name}:track"] = np.array([_padded(t[name]) for t in tracks])
    first = [w for s in parts[MODELS[0]] for w in s.windows]
    found["floor"] = np.array([w.floor_m for w in first], dtype=np.float64)
    return numbers(**found)


def _figures(name: str, statistics: list[OutageStatistics]) -> dict[str, FloatArray]:
    windows = [w for s in statistics for w in s.windows]
    return {
        f"{name}:max": np.array([w.max_m for w in windows]),
        f"{name}:mean": np.array([w.mean_m for w in windows]),
        f"{name}:end": np.array([w.end_m for w in windows]),
        f"{name}:claimed": np.array([w.end_claimed_sd_m for w in windows]),
        f"{name}:inside": np.array([w.within_2_sigma for w in windows]),
        f"{name}:error": np.array([_padded(w.horizontal_m) for w in windows]),
    }


def _padded(values: FloatArray) -> FloatArray:
    """Sixty epochs; outages of thirty end in NaN."""
    out = np.full((SHOWN, *values.shape[1:]), np.nan)
    out[: len(values)] = values[:SHOWN]
    return out


def run_denoised(seed: int, size: Size) -> Numbers:
    """Drive table 6's outages without error model, de-noised to 0, 3 and 7 levels."""
    rng = generator(seed, PAPER, "denoised")
    found: dict[str, list[FloatArray]] = {}
    starred = twins(starred=True)
    for drive, child in zip(starred, rng.spawn(len(starred)), strict=True):
        done = run_outages(drive, [bare(level) for level in LEVELS], draw_outage_twin(drive, child))
        for name, (statistics, _) in done.items():
            for key, value in _figures(name, [statistics]).items():
                if key.endswith(("max", "end")):
                    found.setdefault(key, []).append(value)
    return numbers(**{key: np.concatenate(values) for key, values in found.items()})


def path_of(number: int, starred: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return a drive as seen from above, for figures 18, 20 and 23, and its speed in km/h."""
    profile, _ = drives(starred)[number]
    time = np.arange(profile.start, profile.start + profile.duration, 2.0)
    path = profile.trajectory(time)
    ned = ned_from_geodetic(path.position, path.position[0])
    return ned[:, 1::-1], np.hypot(path.velocity[:, 0], path.velocity[:, 1]) / KMH
