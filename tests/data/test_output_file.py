"""Files are written whole or not at all, and nothing of the user's is replaced by surprise."""

import os
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from schuler import InputError
from schuler.data.table import write_atomically, write_text
from schuler.output_file import OutputFile

posix = pytest.mark.skipif(os.name != "posix", reason="links, FIFOs and devices of Unix")
ENDLESS = """
import sys, time
from pathlib import Path
from schuler.data.table import write_atomically

def write(path):
    with path.open("w") as stream:
        for k in range(10**9):
            stream.write(f"new {k}\\n")
            stream.flush()
            if k == 100:
                print("begun", flush=True)

write_atomically(sys.argv[1], write)
"""


def names(folder):
    return sorted(p.name for p in folder.iterdir())


@posix
def test_a_link_is_followed_and_the_mode_kept(tmp_path):
    (tmp_path / "there").mkdir()
    real, link = tmp_path / "there" / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    real.chmod(0o600)
    link.symlink_to(Path("there") / "real.txt")
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert stat.S_IMODE(real.stat().st_mode) == 0o600
    assert names(tmp_path) == ["link.txt", "there"]
    assert names(tmp_path / "there") == ["real.txt"]


@posix
def test_a_link_to_nothing_makes_the_file_it_names(tmp_path):
    (tmp_path / "link").symlink_to("goal")
    write_text(tmp_path / "link", "x")
    assert (tmp_path / "goal").read_text() == "x"
    assert (tmp_path / "link").is_symlink()


@posix
def test_devices_and_fifos_are_written_into_and_stay(tmp_path):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    heard = []
    reader = threading.Thread(target=lambda: heard.append(fifo.read_text()))
    reader.start()
    write_text(fifo, "through\n" * 50_000)
    reader.join(10.0)
    assert heard == ["through\n" * 50_000]
    assert fifo.is_fifo()
    write_text("/dev/null", "x")
    assert Path("/dev/null").is_char_device()
    assert names(tmp_path) == ["fifo"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
def test_a_full_disk_is_told(tmp_path):
    with pytest.raises(InputError, match=r"No space left on device.*free some space"):
        write_text("/dev/full", "x" * 100)


def test_a_full_disk_that_a_library_in_rust_tells_is_understood(tmp_path):
    (tmp_path / "x").write_text("old")

    def write(path):
        raise OSError("No space left on device (os error 28): /somewhere")

    with pytest.raises(InputError, match=r"x: cannot write there \(No space left"):
        write_atomically(tmp_path / "x", write)
    assert (tmp_path / "x").read_text() == "old"
    assert names(tmp_path) == ["x"]


@posix
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_a_kill_in_mid_write_leaves_the_old_file_and_the_next_write_clears_the_rest(tmp_path, how):
    target = tmp_path / "x.txt"
    target.write_text("old")
    for pause in (0.0, 0.002, 0.01):
        run = subprocess.Popen(
            [sys.executable, "-c", ENDLESS, target], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        assert run.stdout is not None
        assert run.stdout.readline() == b"begun\n"
        time.sleep(pause)
        run.send_signal(how)
        run.communicate(timeout=20)
        assert target.read_text() == "old"
        if how == signal.SIGINT:
            assert names(tmp_path) == ["x.txt"]
    write_text(tmp_path / "other.txt", "y")
    assert names(tmp_path) == ["other.txt", "x.txt"]


@posix
def test_two_runs_at_one_output_see_each_other_and_neither_clears_the_other(tmp_path):
    first = OutputFile(tmp_path / "x")
    second = OutputFile(tmp_path / "x")
    other = OutputFile(tmp_path / "y")
    assert (first.others, second.others, other.others) == (False, True, False)
    for each, text in ((first, "1"), (second, "2"), (other, "3")):
        each.fill(lambda path, text=text: path.write_text(text))
        each.publish()
    assert (tmp_path / "x").read_text() == "2"
    assert names(tmp_path) == ["x", "y"]


@pytest.mark.parametrize("length", [1, 255])
def test_names_of_any_length_can_be_written(tmp_path, length):
    write_text(tmp_path / ("n" * length), "x")
    assert names(tmp_path) == ["n" * length]


def test_a_folder_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match="cannot write there"):
        write_text(tmp_path / "none" / "x", "x")
    with pytest.raises(InputError, match="cannot write there"):
        write_text(tmp_path, "x")


def test_a_writer_that_writes_whole_files_itself_fills_a_temporary_one(tmp_path):
    """As tables do: renaming over the temporary file would take its lock away."""
    outputs = [OutputFile(tmp_path / name) for name in "abc"]
    for output in outputs:
        output.fill(lambda temporary: write_text(temporary, "x"))
    write_text(tmp_path / "d", "x")  # clears what nobody holds
    for output in outputs:
        output.publish()
    assert names(tmp_path) == ["a", "b", "c", "d"]
