"""Experiments on many draws: the same whoever works, compared on the same draws, judged."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from schuler import monte_carlo
from schuler.errors import InputError
from schuler.execution import Kept, workers


def experiment(rng: np.random.Generator) -> dict[str, object]:
    """Return two estimates of one mean, and a normalised square of three components."""
    draws = rng.standard_normal(50)
    return {
        "mean": abs(draws.mean()),
        "half": abs(draws[:25].mean()),
        "square": float(np.sum(rng.standard_normal(3) ** 2)),
        "track": draws[:4],
    }


def test_means_errors_and_comparisons() -> None:
    result = monte_carlo(experiment, 400, seed=17)
    assert result.runs == 400
    expected = np.sqrt(2.0 / np.pi / 50.0)
    assert abs(result.mean("mean") - expected) < 4.0 * result.standard_error("mean")
    assert result.standard_error("mean") == pytest.approx(
        expected * np.sqrt(np.pi / 2.0 - 1.0) / 20.0, rel=0.15
    )
    assert result.compare("mean", "half").standard_errors_apart < -4.0
    assert result.mean("track").shape == (4,)
    mean, low, high = result.squares_within("square", 3)
    assert low < mean < high
    assert high - low == pytest.approx(2.0 * 3.29 * np.sqrt(2.0 / 1200.0), rel=0.02)


def test_the_same_whoever_works_and_after_a_stop(tmp_path: Path) -> None:
    one = monte_carlo(experiment, 12, seed=3)
    with ThreadPoolExecutor(2) as threads:
        others = [
            monte_carlo(experiment, 12, seed=3, executor=threads),
            monte_carlo(experiment, 12, seed=3, executor=workers(2)),
        ]
    monte_carlo(experiment, 5, seed=3, kept=Kept(tmp_path))
    others.append(monte_carlo(experiment, 12, seed=3, kept=Kept(tmp_path)))
    for other in others:
        assert all(np.array_equal(one.values[n], other.values[n]) for n in one.values)


def test_experiments_that_break_their_word() -> None:
    with pytest.raises(InputError, match="two or more"):
        monte_carlo(experiment, 1, seed=1)
    with pytest.raises(InputError, match="not the same"):
        monte_carlo(lambda rng: {"x": np.zeros(int(rng.integers(1, 9)))}, 9, seed=1)
    with pytest.raises(InputError, match="run 0"):
        monte_carlo(lambda rng: {"x": np.nan}, 3, seed=1)
    with pytest.raises(InputError, match="no quantity 'y'"):
        monte_carlo(lambda rng: {"x": rng.random()}, 3, seed=1).mean("y")
