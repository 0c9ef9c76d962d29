"""What every command does alike: progress, quiet, examples in the help, jobs from a file."""

from __future__ import annotations

import io
import re
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from outcome import Outcome

import schuler.execution.progress  # noqa: F401
from schuler.cli.app import check
from schuler.cli.registry import VERBS, verbs
from schuler.cli.verbs.run import EXAMPLE

shown = sys.modules["schuler.execution.progress"]
Call = Callable[..., Outcome]


@pytest.mark.parametrize("verb", VERBS)
def test_help_has_an_example_that_is_understood(verb: str, call: Call) -> None:
    module, _, name = verbs()[verb].partition(":")
    function = getattr(import_module(module), name)
    found = re.search(r"Example: `schuler (.+?)( >.*)?`", function.__doc__)
    assert found is not None
    assert f"Example: schuler {verb}" in call(verb, "--help").out
    arguments = found[1].split()
    assert arguments[0] == verb
    check(arguments, "the example")


def test_quiet_leaves_the_machine_alone_with_its_json(recordings: Path, call: Call) -> None:
    loud = call("characterize", recordings / "static.parquet")
    quiet = call("characterize", recordings / "static.parquet", "--quiet")
    assert "white noise" in loud.out
    assert (quiet.code, quiet.out, quiet.err) == (0, "", "")
    failed = call("export", recordings / "none.yaml", "out.yaml", "--quiet")
    assert failed.code == 2
    assert failed.one_line()


def test_verbose_tells_every_step_and_both_together_are_refused(
    recordings: Path, call: Call
) -> None:
    done = call("characterize", recordings / "static.parquet", "--verbose")
    steps = [line for line in done.err.splitlines() if line.startswith("... ")]
    assert any("Reading static.parquet" in line for line in steps)
    assert any("Fitting the noise" in line for line in steps)
    assert "together" in call("warm", "--quiet", "--verbose").one_line()


def test_long_work_is_told_in_plain_lines_where_there_is_no_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(shown, "_manner", ["usual"])
    monkeypatch.setattr(shown, "FIRST", 0.05)
    monkeypatch.setattr(shown, "EVERY", 0.05)
    stream = io.StringIO()
    monkeypatch.setattr(sys, "stderr", stream)
    with shown.progress("Counting") as told:
        told.say("sheep")
        told.share(0.25)
        time.sleep(0.3)
    lines = stream.getvalue().splitlines()
    assert "... Counting: sheep, 25 %, 0 s" in lines
    monkeypatch.setattr(shown, "FIRST", 60.0)
    with shown.progress("Nothing"):
        time.sleep(0.2)
    assert "Nothing" not in stream.getvalue()


def test_a_job_runs_step_by_step_and_is_checked_before_it_begins(
    recordings: Path, tmp_path: Path, call: Call
) -> None:
    si, kalibr, job = tmp_path / "si.yaml", tmp_path / "imu.yaml", tmp_path / "job.yaml"
    steps = [
        {"export": [str(recordings / "noise.yaml"), str(si)], "to": "si"},
        {"export": [str(si), str(kalibr)], "to": "kalibr", "rate": 50},
    ]
    job.write_text(yaml.safe_dump(steps))
    done = call("run", job)
    assert done.code == 0, done.err
    assert kalibr.read_text().count("accelerometer_noise_density") == 1
    si.unlink()
    job.write_text(yaml.safe_dump([*steps, {"export": ["a", "b"], "rat": 50}]))
    wrong = call("run", job).one_line()
    assert "step 3 (export)" in wrong
    assert "Did you mean --rate" in wrong
    assert not si.exists()  # nothing was begun


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("- navigat: x\n", "step 1 begins with 'navigat'"),
        ("{a: 1}\n", "holds no list of steps"),
        ("- [\n", "not YAML"),
        ("- run: x\n", "step 1 begins with 'run'"),
        ("- [a, b]\n", "step 1 begins with '['a', 'b']'"),
    ],
)
def test_a_job_that_cannot_be_is_one_line(
    text: str, words: str, tmp_path: Path, call: Call
) -> None:
    job = tmp_path / "job.yaml"
    job.write_text(text)
    done = call("run", job)
    assert done.code == 2
    assert words in done.one_line()


def test_the_example_of_a_job_is_one(tmp_path: Path, call: Call) -> None:
    printed = call("run", "--example")
    assert printed.out == EXAMPLE
    for step in yaml.safe_load(EXAMPLE):
        verb, value = next(iter(step.items()))
        assert verb in VERBS
        assert value is None or isinstance(value, str)
    assert "which job" in call("run").one_line()
