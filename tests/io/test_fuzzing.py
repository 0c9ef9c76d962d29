"""Damaged files are refused and nothing else happens (the long form: python -m benchmarks.fuzz)."""

import random
from pathlib import Path

import pytest

pytest.importorskip("resource", reason="limits of memory are of Unix")
fuzz = pytest.importorskip("benchmarks.fuzz")
FINDS = sorted((Path(__file__).parent / "finds").glob("*"))


def test_a_few_damaged_files_of_every_format():
    """Seed and cases are those of the long form, so that a find can be run again alone."""
    finds = fuzz.campaign("", 20, 0, 300)
    assert [find for find in finds if find[1] != fuzz.TRIED] == []


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("path", FINDS, ids=lambda path: path.name)
def test_what_was_found_once_is_refused_or_read(path, tmp_path):
    """Names are seed-case-file; the name of the file chooses the reader of YAML."""
    copy = tmp_path / path.name.split("-", 2)[2]
    copy.write_bytes(path.read_bytes())
    fuzz.read(copy, random.Random(0))
