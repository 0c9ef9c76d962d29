"""The page that sets error models side by side: its numbers and lines are the comparison's."""

from __future__ import annotations

import base64

import numpy as np
import pytest

from schuler.data import CHANNELS
from schuler.evaluation.error_model_comparison import ErrorModelComparison, ModelOutages
from schuler.evaluation.outage_windows import OutageStatistics, OutageWindow
from schuler.navigation.error_models.catalogue import ErrorModel
from schuler.noise import NoiseModel, WhiteNoise
from schuler.report import FigureGrid, Table, render_report
from schuler.report.sections import sections_of

NOISE = NoiseModel(dict.fromkeys(CHANNELS, WhiteNoise(1e-3)))
TIME = np.arange(0.0, 30.0)


def window(start: float, largest: float, claimed: float) -> OutageWindow:
    error = np.zeros((TIME.size, 3))
    error[:, 0] = largest * (TIME / TIME[-1]) ** 2
    covariance = np.tile(0.5 * claimed**2 * np.eye(2), (TIME.size, 1, 1))
    return OutageWindow(
        start, 30.0, largest, float(error[:, 0].mean()), claimed, 1.0, start + TIME, error,
        covariance, floor=0.1 * TIME,
    )  # fmt: skip


@pytest.fixture(scope="module")
def comparison() -> ErrorModelComparison:
    results, tracks = [], [{"time": TIME, "reference": np.zeros((30, 2))} for _ in range(3)]
    for name, scale in (("15AV", 2.0), ("flicker4", 1.0)):
        windows = tuple(window(100.0 * k, scale * (10.0 + k), 10.0) for k in range(3))
        model = ErrorModel(name, NOISE, notes=("E-004-7: <b>told</b>",) if scale > 1 else ())
        results.append(ModelOutages(model, (OutageStatistics(windows),), (), (1.0,)))
        for track, w in zip(tracks, windows, strict=True):
            track[name] = w.error_ned[:, 1::-1]
    return ErrorModelComparison(tuple(results), tracks=tuple(tracks))


def test_tables_hold_the_numbers_of_the_comparison(comparison: ErrorModelComparison) -> None:
    (section,) = sections_of(comparison)
    tables = {b.caption: b for b in section.blocks if isinstance(b, Table)}
    accuracy = tables["Horizontal error over all outages, in m"]
    assert [row[:2] for row in accuracy.rows] == [("15AV", "22.0"), ("flicker4", "11.0")]
    honesty = tables["What the filter claims of itself"]
    # 10 m claimed throughout; rms of 10, 11, 12 m is 11.03 m at the end, and of (t/T)² 0.459 less
    assert [row[2] for row in honesty.rows] == ["0.988", "1.98"]
    assert [row[-1] for row in honesty.rows] == ["2.90", "2.90"]
    largest = tables["Horizontal largest error of every outage, in m"]
    assert largest.rows[2][3:5] == ("24.0", "12.0")
    pairs = tables["Model against model on the same cases"]
    first = pairs.rows[0]
    assert first[0] == "15AV against flicker4"
    assert first[2].startswith("11.0")
    assert first[3] == "0 of 3"
    # twice as large: 1 - 2
    assert first[-2:] == ("-100 %", "-100 %")
    assert "ratio of sums" in pairs.note


def test_every_model_has_its_line_in_every_window(comparison: ErrorModelComparison) -> None:
    (section,) = sections_of(comparison)
    _, tracks, growth = (b for b in section.blocks if isinstance(b, FigureGrid))
    assert len(tracks.figures) == len(growth.figures) == 3
    for figure in tracks.figures:
        assert [t["name"] for t in figure.traces] == [
            "reference", "15AV", "flicker4", "GNSS is lost",
        ]  # fmt: skip
    last = {t["name"]: t for t in growth.figures[2].traces}
    values = np.frombuffer(base64.b64decode(last["15AV"]["y"]["bdata"]), last["15AV"]["y"]["dtype"])
    assert values[-1] == pytest.approx(24.0, rel=1e-6)
    assert "white-noise floor" in last


def test_the_page_says_who_is_best_and_escapes_what_it_quotes(
    comparison: ErrorModelComparison,
) -> None:
    page = render_report(comparison, title="Models")
    assert "flicker4 has the smallest" in page
    assert "<b>told</b>" not in page
    assert "&lt;b&gt;told" in page
