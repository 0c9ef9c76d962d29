"""No verdict is written down: not in code, not in data; and nothing printed is left unused."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
import yaml

import schuler_papers
from schuler.errors import ModelError
from schuler_papers.judging import Found, _rows, _sheet, arithmetic, forecasts
from schuler_papers.outcome import VERDICTS
from schuler_papers.registry import PAPERS

OWN = Path(schuler_papers.__file__).parent
JUDGEMENTS = set(VERDICTS) - {"shown", "setting"}
"""These two name kinds of rows as well."""
# the words of verdicts stand where they are computed and where they are coloured
WORDED = {"outcome.py", "wording.py", "report_section.py", "summary.py"}


def constants(source: Path) -> list[str]:
    """String constants of a file that are verdicts, docstrings not counted."""
    tree = ast.parse(source.read_text(encoding="utf-8"))
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and node.value in JUDGEMENTS
    ]


def test_no_study_writes_a_verdict() -> None:
    sources = [p for p in OWN.rglob("*.py") if p.name not in WORDED]
    assert len(sources) > 30
    assert [(p.name, constants(p)) for p in sources if constants(p)] == []
    for paper in PAPERS:
        text = (OWN / paper / "paper.yaml").read_text(encoding="utf-8")
        assert "verdict" not in text
        entries = yaml.safe_load(text)
        specs = [
            spec
            for entry in entries
            for item in entry["items"]
            for spec in (*item.get("rows", ()), *item.get("tables", ()))
        ]
        assert len(specs) > 40
        assert not [s for s in specs if set(map(str, s.values())) & JUDGEMENTS]


def test_the_scan_sees_a_constant(tmp_path: Path) -> None:
    source = tmp_path / "study.py"
    source.write_text('row = dict(verdict="reproduced")')
    assert constants(source) == ["reproduced"]


def test_derived_numbers_are_arithmetic_of_printed_ones() -> None:
    assert arithmetic("2e-16 / 2e-12") == pytest.approx(1e-4)
    assert arithmetic("(37 + 25 + 34) / 3") == pytest.approx(32.0)
    assert arithmetic("-0.5") == -0.5
    for text in ("open(1)", "x + 1", "'a' * 3"):
        with pytest.raises(ModelError, match="no arithmetic"):
            arithmetic(text)


def test_rows_come_from_data() -> None:
    import numpy as np

    found = Found({"a": np.array([[1.0, 2.0], [3.0, 4.0]]), "b x": 7.0})
    spec = {
        "for": {"k": [1, 2]},
        "is": "a",
        "of": "a{k}",
        "each": {"printed": [2, 3]},
        "within": 0.1,
    }
    first, second = _rows(spec, found, "quick")
    assert (first.quantity, first.estimate.value, first.printed) == ("a1", 2.0, 2.0)
    assert first.estimate.standard_error == pytest.approx(1.0)
    assert (second.estimate.value, second.agrees) == (3.0, True)
    (named,) = _rows({"for": {"n": ["x"]}, "is": "b {n}", "of": "b"}, found, "quick")
    assert named.estimate.value == 7.0
    assert list(_rows({"is": "b x", "of": "b", "only": "full"}, found, "quick")) == []
    with pytest.raises(KeyError):
        list(_rows({"is": "c", "of": "c"}, found, "quick"))


def test_a_forecast_is_as_sure_as_its_mean_and_keeps_the_scatter_of_a_draw() -> None:
    import numpy as np

    spec = {
        "is": "a", "title": "t", "lines": ["x"], "columns": ["u", "v"], "printed": [[14, 30]],
        "forecast": 0.1, "errors": 3,
    }  # fmt: skip
    found = Found({"a": np.array([[[9.0, 30.0]], [[13.0, 30.0]]])})
    forecast = {"mean": [[10.0, 30.0]], "scatter": [[3.0, 20.0]], "seeds": [100, 64]}
    ((sure, vague),) = _sheet(spec, found, "quick", forecast).cells
    assert sure is not None
    assert vague is not None
    assert (sure.band.low, sure.band.high) == (9.0, 11.0)  # type: ignore[union-attr]
    assert sure.estimate.standard_error == pytest.approx(3.0 / np.sqrt(2.0))
    assert (sure.narrow, sure.agrees, sure.verdict) == (True, False, "reproduced in kind")
    # 64 draws of 20 leave the mean uncertain by 5: the band is not called narrow
    assert (vague.band.high, vague.narrow) == (35.0, False)  # type: ignore[union-attr]


def test_every_table_that_asks_for_a_forecast_has_one() -> None:
    for paper in PAPERS:
        frozen = forecasts(f"schuler_papers.{paper}")
        entries = yaml.safe_load((OWN / paper / "paper.yaml").read_text(encoding="utf-8"))
        asked = {
            f"{item['label']}/{table['title']}"
            for entry in entries
            for item in entry["items"]
            for table in item.get("tables", ())
            if "forecast" in table or "forecast" in table.get("each", {})
        }
        assert asked <= set(frozen)
        assert all(f["seeds"][0] >= 100 and f["seeds"][1] >= 8 for f in frozen.values())
