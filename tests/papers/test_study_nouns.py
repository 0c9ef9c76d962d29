"""Rows, bands and seeds of the studies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from schuler.errors import InputError, ModelError
from schuler_papers import (
    PAPERS,
    Band,
    Curve,
    Estimate,
    Row,
    estimate,
    experiments_of,
    generator,
    numbers,
    stacked,
)
from schuler_papers.registry import find_paper


def test_a_row_fails_outside_its_band_and_errors_widen_it_only_when_asked() -> None:
    strict = Band(0.46, 0.50, "spec")
    wide = Band(0.46, 0.50, "spec", standard_errors=2.0)
    assert Row("reduction", Estimate(0.499, 0.01), band=strict).holds
    assert not Row("reduction", Estimate(0.515, 0.01), band=strict).holds
    assert Row("reduction", Estimate(0.515, 0.01), band=wide).holds
    assert not Row("reduction", Estimate(0.525, 0.01), band=wide).holds
    assert not Row("reduction", math.nan, band=wide).holds


def test_a_row_says_why() -> None:
    with pytest.raises(ModelError, match="without a reason"):
        Row("roots", 1.044, verdict="wrong in the paper")
    with pytest.raises(ModelError, match="measured"):
        Band(0.0, 1.0, "frozen")
    row = Row("roots", 1.1, 1.0, "wrong in the paper", reason="unstable", erratum="E-003-10")
    told = row.to_dict()
    assert (told["printed"], told["ours"], told["standard_error"]) == (1.0, 1.1, None)


def test_estimate_is_the_mean_with_the_error_of_the_mean() -> None:
    value, error = estimate([1.0, 2.0, 3.0, 4.0])
    assert value == 2.5
    assert error == pytest.approx(np.std([1, 2, 3, 4], ddof=1) / 2.0)
    assert math.isnan(estimate([1.0]).standard_error)
    results = [numbers(a=1.0, b=[1.0, 2.0]), numbers(a=3.0, b=[3.0, 4.0])]
    assert stacked(results, "b").shape == (2, 2)
    assert estimate(stacked(results, "a")).value == 2.0


def test_seeds_of_experiments_do_not_meet() -> None:
    first = generator(0, "waegli2010", "noise").normal(size=4)
    np.testing.assert_array_equal(first, generator(0, "waegli2010", "noise").normal(size=4))
    for other in (generator(1, "waegli2010", "noise"), generator(0, "waegli2010", "volatility")):
        assert not np.any(first == other.normal(size=4))


def test_papers_are_found_by_name_and_number() -> None:
    assert find_paper("s003").name == "tamazin2013"
    assert find_paper("Waegli2008").label == "S002"
    with pytest.raises(InputError, match="waegli2010"):
        find_paper("S001")


@pytest.mark.parametrize("paper", PAPERS)
def test_experiments_are_named_once_and_can_be_found_elsewhere(paper: str) -> None:
    experiments = experiments_of(paper)
    assert len({e.name for e in experiments}) == len(experiments)
    labels = [item.label for e in experiments for item in e.items]
    assert len(set(labels)) == len(labels)
    for experiment in experiments:
        assert experiment.paper == paper
        # other processes find the function by its name
        assert "<" not in experiment.run.__qualname__
        assert experiment.repetitions.full >= max(experiment.repetitions.quick, 1)


def test_a_curve_has_columns_of_one_length() -> None:
    with pytest.raises(ModelError, match="different lengths"):
        Curve("a", np.arange(3.0), np.arange(4.0))
