"""A file format of another package: read and written with no file of ours touched."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import schuler
from schuler.errors import InputError
from schuler.io import registry
from schuler.io.registry import format_of, formats, recording_format

ROOT = Path(__file__).resolve().parents[1]
MODULE = """
import numpy as np
from schuler.io import Format, MemorySource

NAMES = ("time_s", *(f"gyro_{a}_rad_s" for a in "xyz"), *(f"accel_{a}_m_s2" for a in "xyz"))


def detect(start):
    return start.bytes.startswith(b"TICK1")


def open_ticks(path, what, options):
    table = np.frombuffer(path.read_bytes()[5:], dtype="<f8").reshape(-1, 7)
    columns = {n: table[:, k].copy() for k, n in enumerate(NAMES)}
    return MemorySource(path, columns, assumptions=("ticks are of the quartz",))


def write_ticks(path, recording):
    table = np.column_stack([recording.time, recording.gyro, recording.accel])
    path.write_bytes(b"TICK1" + table.astype("<f8").tobytes())


TICKS = Format("ticks", "ticks of my logger", (".tick",), ("imu",), detect=detect,
               open=open_ticks, write_recording=write_ticks)
NO_FORMAT = 7
BLIND = Format("blind", "cannot see", (".b",), ("imu",), open=open_ticks)
MUTE = Format("mute", "opens nothing", (".tick",), ("imu",), detect=detect,
              open=lambda path, what, options: {"time": 1})
LOUD = Format("loud", "falls over", (".tick",), ("imu",), detect=lambda start: 1 / 0,
              open=open_ticks)
"""


def install(folder: Path, attribute: str) -> None:
    """Lay a package with an entry point beside the others, as an installer would."""
    (folder / "ticks_of_mine.py").write_text(MODULE, encoding="utf-8")
    info = folder / "ticks_of_mine-1.0.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: ticks-of-mine\nVersion: 1.0\n")
    entry = f"[schuler.formats]\nticks = ticks_of_mine:{attribute}\n"
    (info / "entry_points.txt").write_text(entry)


def forget() -> None:
    for cached in (registry.formats, registry._readers, registry._of_users):
        cached.cache_clear()
    sys.modules.pop("ticks_of_mine", None)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    place = tmp_path / "site"
    place.mkdir()
    monkeypatch.syspath_prepend(str(place))
    forget()
    yield place
    monkeypatch.undo()
    forget()


def recording(n: int = 3000) -> schuler.ImuRecording:
    rng = np.random.default_rng(3)
    gyro, accel = 1e-3 * rng.standard_normal((n, 3)), 0.01 * rng.standard_normal((n, 3))
    return schuler.ImuRecording(np.arange(n) / 100.0, gyro, accel + np.array([0.0, 0.0, 9.8]))


def write(path: Path) -> None:
    rows = recording()
    table = np.column_stack([rows.time, rows.gyro, rows.accel])
    path.write_bytes(b"TICK1" + table.astype("<f8").tobytes())


def test_a_format_of_ones_own_is_read_and_written(folder: Path, tmp_path: Path) -> None:
    install(folder, "TICKS")
    path = tmp_path / "a.tick"
    write(path)
    assert format_of(path).title == "ticks of my logger"
    assert "ticks" in {f.name for f in formats()}
    imu = schuler.read_imu(path)
    assert np.array_equal(imu.gyro, recording().gyro)
    assert imu.assumptions == ("ticks are of the quartz",)
    writer = recording_format(".tick").write_recording
    assert writer is not None
    writer(tmp_path / "b.tick", imu)
    assert (tmp_path / "b.tick").read_bytes() == path.read_bytes()
    with pytest.raises(InputError, match="ticks of my logger, which holds an IMU"):
        schuler.read_gnss(path)


@pytest.mark.parametrize(
    ("attribute", "said"),
    [
        ("NO_FORMAT", "format 'ticks' of ticks_of_mine:NO_FORMAT is a int; expected a schuler.io"),
        ("MISSING", "cannot be loaded .*MISSING.*to name a schuler.io.Format"),
        ("BLIND", "can be opened but not recognised; expected magic= or detect="),
        ("MUTE", "format 'mute' opened a.tick as a dict without path; expected a schuler.io"),
        ("LOUD", "format 'loud' failed to recognise a file .*ZeroDivisionError.*True or False"),
    ],
)
def test_a_format_that_breaks_its_protocol_is_named(
    folder: Path, tmp_path: Path, attribute: str, said: str
) -> None:
    install(folder, attribute)
    path = tmp_path / "a.tick"
    write(path)
    with pytest.raises(InputError, match=said):
        schuler.read_imu(path)


def test_down_to_the_page_of_the_program(tmp_path: Path) -> None:
    place = tmp_path / "site"
    place.mkdir()
    install(place, "TICKS")
    write(tmp_path / "a.tick")
    page, answer = tmp_path / "page.html", tmp_path / "answer.json"
    paths = [str(place), str(ROOT / "src"), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-m", "schuler", "characterize", str(tmp_path / "a.tick"),
         "--report", str(page), "--json", str(answer)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "assumed: a.tick: ticks are of the quartz" in done.stderr
    assert "ticks are of the quartz" in page.read_text(encoding="utf-8")
    assert "ticks are of the quartz" in answer.read_text(encoding="utf-8")
