"""The imports of the rooms run one way."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def test_the_rooms_import_one_way() -> None:
    pytest.importorskip("importlinter")
    program = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [str(program), "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


def test_every_public_name_is_there_and_only_those_are_promised() -> None:
    import schuler

    assert set(schuler.__all__) == set(schuler._HOME_OF)
    for name in schuler.__all__:
        value = getattr(schuler, name)
        assert value.__module__.startswith("schuler."), name
        assert value.__doc__, name
    assert set(dir(schuler)) == set(schuler.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = schuler.nonsense
