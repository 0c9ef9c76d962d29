"""The library is broken in a dozen places, and each time a study notices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from schuler_papers.reproduction import reproduce

Broken = Callable[[Callable[..., Any]], Callable[..., Any]]


def scaled(factor: float) -> Broken:
    """A function whose result is too large."""
    return lambda good: lambda *a, **k: factor * good(*a, **k)


def changed(**fields: Callable[[Any], Any]) -> Broken:
    """A function whose result has other fields."""

    def breaking(good: Callable[..., Any]) -> Callable[..., Any]:
        def bad(*a: Any, **k: Any) -> Any:
            found = good(*a, **k)
            return replace(found, **{name: change(found) for name, change in fields.items()})

        return bad

    return breaking


def one_degree_too_many(good: Callable[..., Any]) -> Callable[..., Any]:
    return lambda deviation, rate, freedom: good(deviation, rate, freedom + 1)


def first_imu_only(good: Callable[..., Any]) -> Callable[..., Any]:
    return lambda array, *a, **k: good(array.select(np.arange(2)), *a, **k)


def the_paper_s_divisor(good: Callable[..., Any]) -> Callable[..., Any]:
    def bad(array: Any, half: int, *, divisor: str = "unbiased", **k: Any) -> Any:
        return good(array, half, divisor="paper", **k)

    return bad


def swapped(good: Callable[..., Any]) -> Callable[..., Any]:
    return lambda a, b: good(b, a)


BREAKS: dict[str, tuple[str, str, str, str, Broken]] = {
    "fusion of half the sensors": (
        "S002", "Fig. 5, eq. (1)", "waegli2008.sensors", "synthesize", first_imu_only,
    ),
    "parity vector of the wrong size": (
        "S002", "eqs. (2), (3)", "waegli2008.sensors", "parity_matrix", scaled(1.05),
    ),
    "degrees of freedom of the threshold": (
        "S002", "eqs. (2), (3)", "waegli2008.sensor_items", "chi_square_threshold",
        one_degree_too_many,
    ),
    "best threshold": (
        "S002", "Fig. 7", "waegli2008.sensors", "empirical_threshold",
        changed(missed=lambda t: t.missed // 2),
    ),
    "best cone": (
        "S002", "arithmetic", "waegli2008.sensor_items", "optimize_cone",
        changed(parameters=lambda o: 1.1 * o.parameters),
    ),
    "Schuler's pendulum": (
        "S003", "E-003-5", "tamazin2013.arithmetic", "schuler_factor", scaled(2.0),
    ),
    "lattice": (
        "S003", "Figs. 3-4, eqs. (1)-(13)", "tamazin2013.estimators", "whiten_lattice",
        lambda good: lambda *a: tuple(reversed(good(*a))),
    ),
    "one level of de-noising too few": (
        "S003", "Table 1", "tamazin2013.predictors", "denoise",
        lambda good: lambda *a, level, **k: good(*a, level=level - 1, **k),
    ),
    "divisor of the volatility": (
        "S000", "eqs. (2)-(3), Fig. 7", "waegli2010.volatility", "averaged_volatility",
        the_paper_s_divisor,
    ),
    "cornered hat without unmixing": (
        "S000", "eq. (12), weights", "waegli2010.fusion", "cornered_hat",
        changed(variances=lambda h: h.residual_variances),
    ),
    "slope of the Allan deviation": (
        "S004", "Fig. 6, eqs. (13)-(14)", "quinchia2013.laws", "allan_deviation",
        changed(deviation=lambda c: c.deviation * c.tau**0.2),
    ),
    "pairs the wrong way round": (
        "S004", "Tables 9-10, percentages", "quinchia2013.arithmetic", "paired_statistics", swapped,
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", BREAKS)
def test_a_study_notices(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    paper, item, module, name, breaking = BREAKS[what]
    study = import_module(f"schuler_papers.{module}")
    assert reproduce([paper], item=item, seeds=2).holds
    monkeypatch.setattr(study, name, breaking(getattr(study, name)))
    assert not reproduce([paper], item=item, seeds=2).holds
