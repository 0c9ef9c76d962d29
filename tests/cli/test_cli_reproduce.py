"""`schuler reproduce`: what it prints, writes, keeps and compares."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from outcome import Outcome

Call = Callable[..., Outcome]


def test_one_item_in_full_with_json_and_page(call: Call, tmp_path: Path) -> None:
    page, values = tmp_path / "page.html", tmp_path / "values.json"
    options = ("--processes", 1, "--report", page, "--json", values)
    done = call("reproduce", "S003", "--item", "E-003-5", *options)
    assert done.code == 0
    assert "wrong in the paper" in done.out
    rows = json.loads(values.read_text())
    assert {"paper", "item", "verdict", "printed", "ours", "band"} <= set(rows[0])
    assert rows[0]["paper"] == "tamazin2013"
    assert rows[0]["item"] == "E-003-5"
    html = page.read_text()
    # the number of the result is the number on the page, with its verdict in words
    assert re.search(r"0\.6235 m", html)
    assert html.count('class="verdict v-wrong">wrong in the paper') == 2
    assert "E-003-5" in html


def test_a_run_is_kept_judged_again_and_compared(call: Call, tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    for folder, seeds in ((one, 2), (two, 3)):
        options = ("--processes", 1, "--seeds", seeds, "--resume", folder, "--json", "-")
        assert call("reproduce", "S003", "--item", "E-003-7", *options).code == 0
    first = json.loads(call("reproduce", "--kept", one, "--json", "-").out)
    assert {row["item"] for row in first} == {"E-003-7"}
    same = call("reproduce", "--kept", one, "--against", one)
    assert same.code == 0
    assert "3 the same number" in same.out
    other = json.loads(call("reproduce", "--kept", one, "--against", two, "--json", "-").out)
    assert [d["same"] for d in other] == [True, True, False]
    assert not any(d["noticeable"] for d in other)


def test_a_value_outside_its_band_is_a_failed_check(
    call: Call, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from schuler_papers.tamazin2013 import arithmetic

    monkeypatch.setattr(arithmetic, "EQUATION_29", (1.25, *arithmetic.EQUATION_29[1:]))
    page = tmp_path / "page.html"
    options = ("--item", "E-003-10", "--processes", 1, "--report", page)
    done = call("reproduce", "S003", *options)
    assert done.code == 1
    assert "outside the band" in done.err
    assert "outside its band" in done.out
    assert "v-failed" in page.read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("S001",), "no paper 'S001'"),
        (("S003", "--item", "Table 9"), "no item 'Table 9'"),
        (("S003", "--seeds", "0"), "0 seeds"),
        (("S003", "--processes", "0"), "0 processes"),
        (("--against", "x"), "--against without --kept"),
        (("--kept", "x", "--full"), "--kept runs nothing"),
        (("--kept", "nowhere"), "no such folder"),
        (("S003", "--item", "E-003-5", "--data", "nowhere"), "no such folder"),
    ],
)
def test_bad_input_is_one_line(call: Call, arguments: tuple[str, ...], words: str) -> None:
    done = call("reproduce", *arguments)
    assert done.code == 2
    assert words in done.one_line()
