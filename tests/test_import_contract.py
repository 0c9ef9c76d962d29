"""The imports of the rooms run one way."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import ModuleType

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
        home = value.__name__ if isinstance(value, ModuleType) else value.__module__
        assert home.startswith("schuler."), name
        assert callable(value), name
        assert value.__doc__, name
    assert set(dir(schuler)) == set(schuler.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = schuler.nonsense


@pytest.mark.parametrize(
    "before",
    [
        "",
        "import schuler.identify.joint",
        "from schuler.navigate import prepare",
        "import schuler.cli",
    ],
)
def test_a_verb_named_like_its_room_is_both(before: str) -> None:
    code = f"""
import inspect, schuler
{before}
from schuler import identify, navigate
import numpy as np
signal = np.random.default_rng(1).standard_normal(4000)
found = schuler.identify(signal, 10.0)
assert abs(found.parameters["white_noise.density"] * 10**0.5 - 1.0) < 0.1
assert identify is schuler.identify
assert identify.joint.Identification is type(found)
assert list(inspect.signature(schuler.navigate).parameters)[:3] == ["imu", "gnss", "noise_model"]
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
