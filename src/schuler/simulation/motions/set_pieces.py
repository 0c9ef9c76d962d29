"""Drives with set pieces: stretches of a given speed and turn where outages are to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.simulation.motions.cars import (
    COUNTRY,
    MOTORWAY,
    TOWN,
    Block,
    compose,
    to_speed,
    turning,
)
from schuler.simulation.motions.drives import Manoeuvre, Road, drive
from schuler.simulation.motions.profile import Profile

SURROUNDINGS: dict[str, tuple[Block, ...]] = {
    "town": TOWN,
    "country": COUNTRY,
    "motorway": MOTORWAY,
}
MARGIN = 1.0
"""Seconds of steady driving at both ends of a set piece, outside its window."""


@dataclass(frozen=True, slots=True)
class SetPiece:
    """A stretch of steady speed, straight or with one turn.

    Parameters
    ----------
    duration : float
        Seconds.
    speed : float
        m/s.
    turn : float
        Change of heading, rad; zero: straight.
    turn_at : float
        Where in the piece the turn is centred, 0 to 1.
    before : {"town", "country", "motorway"}
        What is driven before it.
    share : float
        For how much of the whole drive.

    Examples
    --------
    >>> from schuler import SetPiece
    >>> SetPiece(duration=30.0, speed=12.0, turn=1.57).before
    'town'
    """

    duration: float
    speed: float
    turn: float = 0.0
    turn_at: float = 0.5
    before: str = "town"
    share: float = 0.2

    def manoeuvres(self) -> list[Manoeuvre]:
        """Return the piece with its margins, entered and left at its speed."""
        whole = self.duration + 2.0 * MARGIN
        if self.turn == 0.0:
            return [Manoeuvre(whole, self.speed)]
        bend = turning(self.speed, self.turn)
        ahead = float(
            np.clip(self.turn_at * whole - 0.5 * bend.duration, 1.0, whole - bend.duration - 1.0)
        )
        rest = whole - ahead - bend.duration
        return [Manoeuvre(ahead, self.speed), bend, Manoeuvre(rest, self.speed)]


def car_with_set_pieces(
    duration: float,
    pieces: Sequence[SetPiece],
    rng: np.random.Generator | int = 0,
    *,
    standstill: float = 60.0,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
    after: str = "town",
) -> tuple[Profile, tuple[tuple[float, float], ...]]:
    """Return a drive that holds stretches of given length, speed and turn.

    Parameters
    ----------
    duration : float
        Of the whole drive, s.
    pieces : sequence of SetPiece
        In order.
    rng : numpy.random.Generator or int
        Source of randomness, or its seed.
    standstill : float
        At the beginning, s.
    origin : (3,) array_like
        Latitude rad, longitude rad, height m.
    after : {"town", "country", "motorway"}
        What is driven after the last piece.

    Returns
    -------
    profile : Profile
        True motion.
    windows : tuple of (start, seconds)
        Where the pieces lie, s after the start.

    Raises
    ------
    InputError
        A drive too short for its pieces.

    Notes
    -----
    The drives of S004 Figs. 20 and 23 with the outages of Tables 9 and 10.

    Examples
    --------
    >>> import schuler
    >>> drive, windows = schuler.car_with_set_pieces(400.0, [schuler.SetPiece(30.0, 10.0)])
    >>> windows[0][1]
    30.0
    """
    plan_rng, road_rng, heading_rng = np.random.default_rng(rng).spawn(3)
    built = [piece.manoeuvres() for piece in pieces]
    stages: list[tuple[float, Sequence[Block]]] = []
    for piece, parts in zip(pieces, built, strict=True):
        # a stage of next to no time is driven through once
        around = _any_of(SURROUNDINGS[piece.before])
        stages += [(piece.share, (around,)), (1e-9, (_block(parts),))]
    stages.append((1.0, (_any_of(SURROUNDINGS[after]),)))
    plan = compose(duration, standstill, stages, plan_rng)
    begin = np.concatenate([[0.0], np.cumsum([m.duration for m in plan])])
    places = {id(m): float(t) for m, t in zip(plan, begin, strict=False)}
    if not all(id(parts[0]) in places for parts in built):
        raise InputError(
            f"a drive of {duration:g} s for {len(pieces)} set pieces with what lies between them",
            expected="time for all of them",
            cure="last longer, or give smaller shares",
        )
    windows = tuple(
        (float(np.ceil(places[id(parts[0])])), piece.duration)
        for piece, parts in zip(pieces, built, strict=True)
    )
    profile = drive(
        plan,
        origin=origin,
        heading=heading_rng.uniform(-np.pi, np.pi),
        road=Road.random(road_rng),
    )
    return profile, windows


def _block(parts: list[Manoeuvre]) -> Block:
    def block(speed: float, rng: np.random.Generator) -> list[Manoeuvre]:
        return [to_speed(speed, parts[0].speed), *parts]

    return block


def _any_of(blocks: tuple[Block, ...]) -> Block:
    """One of several at a time, so that a stage ends within a block of its share."""

    def block(speed: float, rng: np.random.Generator) -> list[Manoeuvre]:
        return blocks[int(rng.integers(len(blocks)))](speed, rng)

    return block
