"""Rows, bands and seeds of the studies."""

from __future__ import annotations

import math

import numpy as np
import pytest

from schuler.errors import InputError, ModelError
from schuler_papers import (
    PAPERS,
    VERDICTS,
    Band,
    Curve,
    Estimate,
    Proof,
    Row,
    estimate,
    experiments_of,
    generator,
    numbers,
    stacked,
)
from schuler_papers.outcome import Digits, rounding
from schuler_papers.registry import find_paper


def test_a_row_fails_outside_its_band_and_errors_widen_it_only_when_asked() -> None:
    strict = Band(0.46, 0.50, "spec")
    wide = Band(0.46, 0.50, "spec", standard_errors=2.0)
    assert Row("reduction", Estimate(0.499, 0.01), band=strict).holds
    assert not Row("reduction", Estimate(0.515, 0.01), band=strict).holds
    assert Row("reduction", Estimate(0.515, 0.01), band=wide).holds
    assert not Row("reduction", Estimate(0.525, 0.01), band=wide).holds
    assert not Row("reduction", math.nan, band=wide).holds
    assert Row("reduction", math.nan, band=wide).verdict == "outside its band"
    with pytest.raises(ModelError, match="measured"):
        Band(0.0, 1.0, "frozen")


HELD = Proof("they sum to one", 1.0, 0.999, 1.001)
FAILED = Proof("they sum to one", 0.9, 0.999, 1.001)
NARROW, WIDE = Band(0.9, 1.1), Band(0.5, 2.0)
FORECAST = Band(0.9, 1.1, "frozen", "1.0, mean of 64 draws", 3.0)
"""An error of this run does not widen what the printed number is compared with."""


@pytest.mark.parametrize(
    ("row", "verdict", "kind"),
    [
        (Row("x", 1.0, 1.05, band=NARROW), "reproduced", "printed"),
        # a printed 1.1 may be 1.149
        (Row("x", 1.0, 1.1, band=Band(0.9, 1.06)), "reproduced", "printed"),
        (Row("x", 1.0, 1.12, band=Band(0.9, 1.1)), "not met", "printed"),
        (Row("x", 1.0, 1.5, band=WIDE), "reproduced in kind", "printed"),
        (Row("x", 1.0, 3.0, band=WIDE), "not met", "printed"),
        (Row("x", 1.0, 3.0, band=WIDE, proof=HELD), "wrong in the paper", "printed"),
        (Row("x", 1.0, 3.0, band=WIDE, proof=FAILED), "not met", "printed"),
        (Row("x", 1.0, 1.05, band=NARROW, proof=HELD), "reproduced", "printed"),
        # arithmetic is no proof by itself, and what follows from printed numbers has no last digit
        (Row("x", 1.0, 3.0, band=WIDE, role="arithmetic"), "not met", "arithmetic"),
        (Row("x", 1.38, 1.0, band=Band(1.33, 1.45), derived=True), "not met", "printed"),
        (Row("x", 1.0, 3.0), "shown", "shown"),
        (Row("x", 1.0, 1.1, printed_error=0.06), "reproduced", "printed"),
        (Row("x", 1.0, 1.5, printed_error=0.3), "reproduced", "printed"),
        (Row("x", 1.0, 1.5, printed_error=0.1), "not met", "printed"),
        (Row("x", Estimate(1.0, 0.3), 1.5, printed_error=0.1), "reproduced in kind", "printed"),
        (Row("x", 1.0, 1.5, band=NARROW, scatter=0.3), "reproduced in kind", "printed"),
        (Row("x", 1.0, 1.7, band=NARROW, scatter=0.3), "not met", "printed"),
        (Row("x", 1.0, 1.5, scatter=0.3), "reproduced in kind", "printed"),
        (Row("x", Estimate(1.0, 1.0), 1.2, band=FORECAST), "not met", "printed"),
        (Row("x", 1.0, "no", band=NARROW), "reproduced in kind", "shown"),
        (Row("x", 1.0, "no", band=NARROW, against=True), "not met", "shown"),
        (Row("x", 1.0, "no", band=NARROW, against=True, proof=HELD), "wrong in the paper", "shown"),
        (Row("x", 1.0, band=NARROW), "beyond the paper", "shown"),
        (Row("x", 1.0), "shown", "shown"),
        (Row("x", 1.0, 1.0, role="setting"), "setting", "setting"),
        (Row("x", 3.0, 3.0, band=WIDE), "outside its band", "printed"),
    ],
)  # fmt: skip
def test_the_verdict_follows_from_the_numbers(row: Row, verdict: str, kind: str) -> None:
    assert (row.verdict, row.kind) == (verdict, kind)
    assert verdict in VERDICTS
    told = row.to_dict()
    assert (told["verdict"], told["kind"]) == (verdict, kind)


def test_a_printed_number_is_as_sure_as_its_last_digit() -> None:
    for printed, half in ((0.0155, 5e-5), (92.0, 0.5), (5e-9, 5e-10), (2.12e-2, 5e-5), (-37, 0.5)):
        assert rounding(printed) == pytest.approx(half), printed
    # YAML wants a point in 5.0e-9; elsewhere a zero that is printed is a digit
    for text, half in (("0.30", 5e-3), ("2.40", 5e-3), ("5.0e-9", 5e-10), ("1.10e-2", 5e-5)):
        assert rounding(Digits(text)) == pytest.approx(half), text
        assert Digits(text) == float(text)


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
