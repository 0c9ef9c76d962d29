"""The set-up script: what it asks for, and that a second run does nothing twice."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """run.py with its environment in a temporary folder and no real installation."""
    spec = importlib.util.spec_from_file_location("run_script", ROOT / "run.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    python = tmp_path / ".venv" / "bin" / "python"
    monkeypatch.setattr(module, "ENVIRONMENT", tmp_path / ".venv")
    monkeypatch.setattr(module, "PYTHON", python)
    monkeypatch.setattr(module, "STAMP", tmp_path / ".venv" / "stamp.json")
    return module


@pytest.fixture
def commands(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Every command that would be run; all of them succeed."""
    seen: list[list[str]] = []

    def run(command: list[str], **options: object) -> subprocess.CompletedProcess[bytes]:
        if "-c" in command:  # a look at an interpreter
            return subprocess.CompletedProcess(command, 0)
        seen.append(command)
        if "venv" in command:
            script.PYTHON.parent.mkdir(parents=True)
            script.PYTHON.touch()
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(script.subprocess, "run", run)
    return seen


def test_first_run_installs_and_second_run_only_runs(
    script: ModuleType, commands: list[list[str]], tmp_path: Path
) -> None:
    assert script.main(["test", "-k", "allan"]) == 0
    assert [c[1:3] for c in commands] == [["-m", "venv"], ["-m", "pip"], ["-m", "pytest"]]
    assert commands[0][0] == commands[1][0] == sys.executable
    assert "--without-pip" in commands[0]
    assert commands[1][3:5] == ["--python", str(script.PYTHON)]
    assert commands[1][-1].endswith("[test]")
    assert commands[2][-2:] == ["-k", "allan"]
    commands.clear()
    assert script.main(["demo", "--out", "x"]) == 0
    assert [c[-4:] for c in commands] == [["schuler", "demo", "--out", "x"]]


def test_a_python_without_pip_gives_the_environment_its_own(
    script: ModuleType, commands: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(script, "pip_serves_others", lambda: False)
    assert script.main(["demo"]) == 0
    assert commands[0][1:] == ["-m", "venv", str(script.ENVIRONMENT)]
    assert commands[1][:3] == [str(script.PYTHON), "-m", "pip"]
    assert "--python" not in commands[1]


def test_a_changed_project_or_a_larger_extra_installs_again(
    script: ModuleType, commands: list[list[str]]
) -> None:
    script.main(["demo"])
    commands.clear()
    script.main(["test"])
    assert any("pip" in c for c in commands)
    commands.clear()
    stamp = json.loads(script.STAMP.read_text())
    assert stamp["extras"] == ["", "test"]
    script.STAMP.write_text(json.dumps(stamp | {"digest": "another"}))
    script.main(["test"])
    assert any("pip" in c for c in commands)


def test_a_failing_installation_leaves_no_stamp(
    script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(command: list[str], **options: object) -> subprocess.CompletedProcess[bytes]:
        return subprocess.CompletedProcess(command, 1 if "pip" in command else 0)

    monkeypatch.setattr(script.subprocess, "run", run)
    assert script.main(["demo"]) == 2
    assert "pip could not install" in capsys.readouterr().err
    assert not script.STAMP.exists()


def test_wrong_tasks_are_named(script: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    assert script.main(["dance"]) == 2
    assert "there is no task 'dance'" in capsys.readouterr().err
    assert script.main(["--help"]) == 0
    assert "run.py demo" in capsys.readouterr().out


def test_the_readme_has_exactly_the_two_commands() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = text.split("## Set up")[1].split("```")[1]
    assert block.split("\n")[1:3] == ["python run.py demo", "python run.py test"]
