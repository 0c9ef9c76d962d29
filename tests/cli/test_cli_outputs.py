"""Outputs of commands: links, devices, closed and full streams, two runs at one file."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from schuler.output_file import OutputFile

MODEL = "channels:\n  gyro_x:\n    - white_noise: {density: 1e-3}\n"
unix = pytest.mark.skipif(not Path("/dev/full").exists(), reason="shells and devices of Linux")


@pytest.fixture
def model(tmp_path):
    path = tmp_path / "noise.yaml"
    path.write_text(MODEL)
    return path


def shell(command, *arguments):
    return subprocess.run(
        ["sh", "-c", command, sys.executable, *map(str, arguments)],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


@unix
@pytest.mark.parametrize("where", ["> /dev/full", ">&-"])
def test_a_stream_that_takes_nothing_is_one_line(where):
    done = shell(f'"$0" -m schuler formats {where}')
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert "standard output" in done.stderr


@unix
def test_a_reader_that_leaves_is_no_error():
    done = shell('{ "$0" -m schuler formats; echo $? >&2; } | head -1')
    assert done.stderr.split() == ["0"]


@unix
def test_the_null_device_survives_and_a_full_one_is_told(model, call):
    assert call("export", model, "/dev/null").code == 0
    assert Path("/dev/null").is_char_device()
    done = call("export", model, "/dev/full")
    assert done.code == 2
    assert "No space left on device" in done.one_line()


def test_a_second_run_at_one_output_is_told(model, tmp_path, call):
    first = OutputFile(tmp_path / "out.yaml")
    done = call("export", model, tmp_path / "out.yaml")
    first.release()
    assert done.code == 2
    assert "another run of schuler" in done.one_line()
    assert call("export", model, tmp_path / "out.yaml").code == 0


@pytest.mark.skipif(os.name != "posix", reason="links of Unix")
@pytest.mark.parametrize("link", ["symlink_to", "hardlink_to"])
def test_a_link_to_an_input_is_an_input(model, tmp_path, call, link):
    getattr(tmp_path / "same.yaml", link)(model)
    done = call("export", model, tmp_path / "same.yaml")
    assert done.code == 2
    assert "is also an input" in done.one_line()
    assert model.read_text() == MODEL


def test_a_failed_command_leaves_nothing(model, tmp_path, call):
    model.write_text("a: [")
    assert call("export", model, tmp_path / "out.yaml").code == 2
    assert [p.name for p in tmp_path.iterdir()] == ["noise.yaml"]
