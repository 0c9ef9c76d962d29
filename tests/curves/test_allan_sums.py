"""Allan sums of pieces: as in memory, whatever the pieces, and parts that add up."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import allan_deviation
from schuler.curves import allan_sums
from schuler.curves.allan_sums import AllanAccumulator
from schuler.errors import InputError


def collect(signal: np.ndarray, pieces: np.ndarray, rate: float = 100.0) -> AllanAccumulator:  # type: ignore[type-arg]
    """Add a signal in pieces."""
    columns = 1 if signal.ndim == 1 else signal.shape[1]
    collected = AllanAccumulator(rate, columns)
    for part in np.split(signal, pieces):
        collected.add(part)
    return collected


def walk(rng: np.random.Generator, n: int) -> np.ndarray:  # type: ignore[type-arg]
    return rng.standard_normal(n) + 0.01 * np.cumsum(rng.standard_normal(n)) + 9.8


def test_pieces_give_what_memory_gives() -> None:
    rng = np.random.default_rng(7)
    signal = np.column_stack([walk(rng, 1_200_000), rng.standard_normal(1_200_000)])
    pieces = np.sort(rng.integers(0, len(signal), 37))
    curve = collect(signal, pieces).sums().curve()
    whole = allan_deviation(signal, 100.0, curve.tau)
    short = curve.factors <= allan_sums.LONGEST
    assert np.count_nonzero(~short) > 5
    assert curve.deviation[short] == pytest.approx(whole.deviation[short], rel=1e-11)
    assert curve.degrees_of_freedom == pytest.approx(whole.degrees_of_freedom, rel=0.01)
    # longer clusters begin more seldom: apart by far less than their error
    error = whole.deviation / np.sqrt(2.0 * whole.degrees_of_freedom)
    assert np.all(np.abs(curve.deviation - whole.deviation)[~short] < 0.01 * error[~short])


def test_clusters_longer_than_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(allan_sums, "_GRID", allan_sums.default_factors(9 * 64))
    monkeypatch.setattr(allan_sums, "_UPPER", np.array([33, 37, 42, 47, 53, 58, 64]))
    signal = walk(np.random.default_rng(3), 100_000)
    curve = collect(signal, np.array([5, 6, 40_000])).sums().curve()
    assert curve.factors[-1] > 100_000 / 12
    whole = allan_deviation(signal, 100.0, curve.tau)
    error = whole.deviation / np.sqrt(2.0 * whole.degrees_of_freedom)
    away = (curve.deviation[:, 0] - whole.deviation) / error
    assert np.all(np.abs(away) < 0.1)


def test_days_add_up_to_a_week() -> None:
    rng = np.random.default_rng(11)
    days = [rng.standard_normal(20_000) for _ in range(7)]
    parts = [collect(day, np.array([100])).sums() for day in days]
    week = parts[0]
    for part in parts[1:]:
        week = week + part
    stretches = AllanAccumulator(100.0)
    for day in days:
        stretches.add(day)
        stretches.pause()
    assert stretches.sums().squares == pytest.approx(week.squares, rel=1e-12)
    assert week.samples == 140_000
    curve = week.curve()
    each = [allan_deviation(day, 100.0, curve.tau[:40]).deviation ** 2 for day in days]
    assert curve.deviation[:40, 0] ** 2 == pytest.approx(np.mean(each, axis=0), rel=1e-11)
    assert curve.factors[-1] > 20_000 / 9  # longer than one day tells
    freedom = allan_deviation(days[0], 100.0, curve.tau[:40]).degrees_of_freedom
    assert curve.degrees_of_freedom[:40, 0] == pytest.approx(7.0 * freedom, rel=0.15)


def test_what_cannot_be_added() -> None:
    collected = AllanAccumulator(100.0, 2)
    with pytest.raises(InputError, match="3 channels"):
        collected.add(np.zeros((4, 3)))
    with pytest.raises(InputError, match="not finite"):
        collected.add(np.array([[1.0, np.nan]]))
    with pytest.raises(InputError, match="no samples"):
        collected.sums()
    with pytest.raises(InputError, match="rate"):
        AllanAccumulator(0.0)
    one, other = AllanAccumulator(100.0), AllanAccumulator(200.0)
    for each in (one, other):
        each.add(np.random.default_rng(1).standard_normal(100))
    with pytest.raises(InputError, match="one rate"):
        one.sums() + other.sums()
