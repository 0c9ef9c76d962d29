"""Pipes, names that are no Unicode, and numbers without end are answered in one line."""

import os
import sys

import numpy as np
import pytest

from schuler import ImuRecording

linux = pytest.mark.skipif(sys.platform != "linux", reason="names of bytes and FIFOs of Linux")


def recording(path):
    rng = np.random.default_rng(3)
    force = 0.01 * rng.normal(size=(500, 3)) - (0.0, 0.0, 9.81)
    ImuRecording(np.arange(500) / 100.0, 1e-3 * rng.normal(size=(500, 3)), force).to_parquet(path)


@linux
def test_a_pipe_is_refused_at_once(tmp_path, call):
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", "/dev/zero", "/dev/null"):
        done = call("read", place)
        assert done.code == 2
        assert "a pipe or a device" in done.one_line()


@linux
def test_a_name_that_is_no_unicode_is_only_a_name(tmp_path, call):
    path = tmp_path / os.fsdecode(b"bad\xff.parquet")
    recording(path)
    done = call(
        "characterize", path, "--report", tmp_path / "r.html", "--json", tmp_path / "j.json"
    )
    assert done.code in (0, 1), done.err
    assert "bad\\udcff.parquet" in (tmp_path / "r.html").read_text(encoding="utf-8")


@pytest.mark.skipif(os.name == "nt", reason="links of Unix")
def test_a_link_to_itself_is_one_line(tmp_path, call):
    (tmp_path / "loop").symlink_to("loop")
    assert call("read", tmp_path / "loop").code == 2


@pytest.mark.parametrize("option", ["--rate", "--gnss-rate"])
@pytest.mark.parametrize("value", ["1e400", "-1", "0", "nan", "1e12"])
def test_a_rate_that_cannot_be_is_one_line(tmp_path, call, option, value):
    done = call("simulate", tmp_path / "x", "--duration", "120", f"{option}={value}")
    assert done.code == 2
    assert "a rate of" in done.one_line()


def test_a_log_that_was_moved_for_a_moment_says_so_first(tmp_path, call):
    rng = np.random.default_rng(4)
    n = 12_000
    gyro = 1e-3 * rng.normal(size=(n, 3))
    force = 0.01 * rng.normal(size=(n, 3)) - (0.0, 0.0, 9.81)
    swing = np.sin(np.arange(400) * 0.1)[:, None]
    gyro[6000:6400] += swing
    force[6000:6400] += 3.0 * swing
    ImuRecording(np.arange(n) / 50.0, gyro, force).to_parquet(tmp_path / "m.parquet")
    done = call("characterize", tmp_path / "m.parquet")
    first = next(line for line in done.out.splitlines() if line.startswith("!"))
    assert "the sensor was moved from 120" in first
    assert "--repair" in first
    mended = call("characterize", tmp_path / "m.parquet", "--repair")
    assert "the sensor was moved from" not in mended.out
