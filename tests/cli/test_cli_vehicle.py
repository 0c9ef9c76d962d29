"""What `--aid` does on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from outcome import Outcome


def drive(folder: Path) -> list[str]:
    options = ["--time-offset", "0", "--noise", str(folder / "noise.yaml")]
    for kind in ("imu", "gnss"):
        options += ["--" + kind, str(folder / f"{kind}.parquet")]
    return options


def test_navigate_uses_what_is_known_of_the_vehicle(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    target = tmp_path / "n.json"
    report = ["--report", str(tmp_path / "n.html")]
    aid = ["--aid", "zupt", "--aid", "nhc"]
    done = call("navigate", *drive(recordings), *aid, "--json", target, *report)
    assert done.code == 0, done.err
    summary = json.loads(target.read_text())
    assert summary["settings"]["aiding"] == ["nhc", "zupt"]
    last = summary["causal"]["last_sensor_errors"]
    # the twin's springs: 0.005 rad nose up for a m/s²
    assert last["spring pitch"] == pytest.approx(-0.005, abs=0.002)
    assert "velocity across the vehicle" in (tmp_path / "n.html").read_text()


def test_outages_use_what_is_known_of_the_vehicle(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    target = tmp_path / "o.json"
    window = ["--window", "100:30", "--json", target]
    assert call("outages", *drive(recordings), "--aid", "nhc", *window).code == 0
    assert json.loads(target.read_text())["runs"][0]["aiding"] == ["nhc"]


@pytest.mark.parametrize("verb", ["navigate", "outages"])
def test_an_unknown_aid_is_refused(
    recordings: Path, call: Callable[..., Outcome], verb: str
) -> None:
    window = ["--window", "100:30"] if verb == "outages" else []
    done = call(verb, *drive(recordings), "--aid", "wheels", *window)
    assert done.code == 2
    assert "'wheels'" in done.err
    assert "nhc or zupt" in done.err
    assert done.err.count("\n") == 1
