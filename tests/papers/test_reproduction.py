"""Choosing, keeping and judging: the same numbers however the work is done."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from schuler.errors import InputError
from schuler_papers.reproduction import code_version, judge_kept, reproduce
from schuler_papers.selection import named_parts, select


def test_items_are_found_as_people_write_them() -> None:
    assert named_parts("Figs. 9-11, eq. (12)") == {
        ("fig", "9"), ("fig", "10"), ("fig", "11"), ("eq", "12"),
    }  # fmt: skip
    for asked in ("Table 2", "table 2", "fig 2", "Figure 2", "eq. (29)", "E-003-6"):
        assert select(["S003"], asked), asked
    found = {item.label for _, items in select(["S003"], "Figure 2") for item in items}
    assert found == {"Fig. 2", "Fig. 2 on ADIS16405"}
    with pytest.raises(InputError, match="no item 'Table 9'"):
        select(["S003"], "Table 9")


def test_kept_results_are_judged_again_without_running(tmp_path: Path) -> None:
    first = reproduce(["S003"], item="Fig. 1", keep=tmp_path)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3
    assert all(code_version("tamazin2013") in f.name for f in files)
    before = [f.stat().st_mtime_ns for f in files]
    again = judge_kept(tmp_path, ["S003"], item="Fig. 1")
    assert again.rows() == first.rows()
    told: list[str] = []
    resumed = reproduce(
        ["S003"], item="Fig. 1", keep=tmp_path, seeds=4, told=lambda words, _: told.append(words)
    )
    assert len(told) == 1
    assert [f.stat().st_mtime_ns for f in files] == before
    assert next(iter(resumed.efforts.values())).repetitions == 4


def test_two_processes_give_the_same_numbers(tmp_path: Path) -> None:
    options = {"item": "E-003-7", "seeds": 3}
    here = reproduce(["S003"], **options)  # type: ignore[arg-type]
    there = reproduce(["S003"], processes=2, **options)  # type: ignore[arg-type]
    assert here.rows() == there.rows()


def test_rows_are_plain_values() -> None:
    done = reproduce(["S003"], item="E-003-5")
    white, row, _ = json.loads(json.dumps(done.rows()))
    asked = {"paper", "item", "kind", "printed", "ours", "standard_error", "band", "verdict"}
    assert asked <= set(row)
    assert row["verdict"] == "wrong in the paper"
    assert row["kind"] == "arithmetic"
    assert row["proof"]["holds"]
    assert white["printed"] == 458.0
    assert white["verdict"] == "not met"
    assert white["proof"] is None
    np.testing.assert_allclose(white["ours"], np.sqrt(5e-9 * 0.005 * 3600.0**3 / 3.0), rtol=1e-12)


def test_what_needs_recordings_is_left_out_and_said_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("SCHULER_DATA", raising=False)
    done = reproduce(["S003"], item="Fig. 2")
    assert [r.item.label for r in done.items] == ["Fig. 2"]
    assert "adis16405-static" in done.left_out[0]
    with pytest.raises(InputError, match="no such folder"):
        reproduce(["S003"], item="Fig. 2", data=tmp_path / "nowhere")
    with pytest.raises(InputError, match="nothing can be done"):
        reproduce(["S003"], item="Fig. 2 on ADIS16405", data=tmp_path)
