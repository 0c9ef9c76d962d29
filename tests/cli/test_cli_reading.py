"""What the program says about files: every assumption, and every cure as an option of its own."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

from schuler.cli.app import run
from schuler.cli.console import in_options

DATA = os.environ.get("SCHULER_DATA")
CASES = Path(DATA).parent / "cases" / "inputs" if DATA else Path("cases")
_PYTHON = re.compile(
    r"\b(?:columns|rate|time_unit|time_offset|gyro_unit|accel_unit|angle_unit|velocity_unit|origin|"
    r"position_sd|velocity_sd|delimiter|decimal|comment|skip_lines|header|topic|clock|imu|repair|"
    r"close_up|increments|missing|name)=(?!\w*NAME)"
)


def table(path: Path, scale: float = 1.0, head: str = "time,gx,gy,gz,ax,ay,az") -> Path:
    rng = np.random.default_rng(1)
    rows = np.column_stack(
        [np.arange(500) / 100.0, 1e-3 * rng.standard_normal((500, 3)),
         (np.array([0.0, 0.0, 9.8]) + 0.01 * rng.standard_normal((500, 3))) * scale]
    )  # fmt: skip
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    return path


@pytest.mark.skipif(not CASES.is_dir(), reason="no cases here")
def test_no_message_names_an_argument_of_python(capsys: pytest.CaptureFixture[str]) -> None:
    refused = 0
    for path in sorted(CASES.iterdir()):
        if path.suffix in (".json", ".npz"):
            continue
        kind = "gnss" if path.name.startswith(("gnss", "rtklib", "nmea")) else "imu"
        code = run(["read", str(path), "--as", kind])
        said = "".join(capsys.readouterr())
        assert code in (0, 2), (path.name, said)
        refused += code == 2
        assert not _PYTHON.search(said.replace(str(path), "")), (path.name, said)
        assert said.count("schuler: /") <= 1, said
    assert refused > 20


@pytest.mark.parametrize(
    ("text", "place", "wanted"),
    [
        ("say time_unit='us'", "imu", "say --imu-time-unit us"),
        ("say gyro_unit='LSB 131/(deg/s)'", "imu", "say --gyro-unit 'LSB 131/(deg/s)'"),
        ("read it with repair=True to", "one", "read it with --repair to"),
        ("columns={'time': ...}", "gnss", "--gnss-column time=NAME"),
        ("columns={'accel_x': None}", "one", "--column accel_x="),
        ("columns=('time', 'gyro_x', ...)", "imu", "--imu-columns time,gyro_x,..."),
        ("or give rate=", "one", "or give --rate"),
    ],
)
def test_cures_in_options(text: str, place: str, wanted: str) -> None:
    assert in_options(text, place) == wanted


def test_assumptions_are_said_and_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = table(tmp_path / "a.csv")
    answer, noise = tmp_path / "a.json", tmp_path / "n.yaml"
    assert run(["characterize", str(path), "--json", str(answer), "--noise-out", str(noise)]) == 0
    said = capsys.readouterr().err
    for words in ("time taken as s", "gyro taken as rad/s", "accel taken as m/s^2"):
        assert f"assumed: a.csv: {words}: no unit is named" in said
        assert any(words in x for x in json.loads(answer.read_text())["assumptions"])
        assert f"# assumed: a.csv: {words}" in noise.read_text(encoding="utf-8")


def test_a_profile_says_it_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, profile = table(tmp_path / "a.csv", 1.0 / 9.80665), tmp_path / "logger.yaml"
    assert run(["read", str(path)]) == 2
    assert "--accel-unit g" in capsys.readouterr().err
    assert run(["read", str(path), "--accel-unit", "g", "--save-profile", str(profile)]) == 0
    capsys.readouterr()
    assert run(["read", str(path), "--profile", str(profile), "--json", "-"]) == 0
    out = capsys.readouterr()
    assert json.loads(out.out)["facts"]["median_specific_force_m_s2"] == pytest.approx(9.8, 0.01)
    assert "assumed" not in out.err
    profile.write_text("imu: {no_such: 1}\n", encoding="utf-8")
    assert run(["read", str(path), "--profile", str(profile)]) == 2
    assert "no option 'no_such'" in capsys.readouterr().err


def test_convert_and_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = table(tmp_path / "a.csv", head="time_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,"
                                          "accel_x_m_s2,accel_y_m_s2,accel_z_m_s2")  # fmt: skip
    assert run(["convert", str(path), str(tmp_path / "b.mat")]) == 0
    assert run(["read", str(tmp_path / "b.mat")]) == 0
    assert run(["convert", str(path), str(tmp_path / "b.xyz")]) == 2
    assert "recordings are not written as '.xyz'" in capsys.readouterr().err
    assert run(["formats", "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)["formats"]
    reads = [f for f in found if f["reads"]]
    tracks = [f for f in found if "trajectory" in f["writes"]]
    noises = [f for f in found if "noise" in f["writes"]]
    assert (len(reads) >= 24, len(tracks) >= 12, len(noises) >= 9) == (True, True, True)
