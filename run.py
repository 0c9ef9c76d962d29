"""Set up this checkout and run it: `python run.py demo`, `... test`, `... check`.

Needs Python 3.11 or newer and nothing else. Makes the virtual environment `.venv` beside this
file when it is missing or out of date, installs the project into it with pip, and hands the rest
of the command line on. A second run finds everything in place and starts at once.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

OLDEST_PYTHON = (3, 11)
ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
STAMP = ENVIRONMENT / "schuler-installed.json"
PYTHON = (
    ENVIRONMENT / "Scripts" / "python.exe" if os.name == "nt" else ENVIRONMENT / "bin" / "python"
)

USAGE = """\
python run.py demo  [options]         the main job on an embedded example, ends in a report
python run.py test  [pytest options]  the test suite
python run.py check                   lint, types and import contracts
python run.py docs  [mkdocs options]  the documentation site, into build/docs
python run.py schuler ...             any command of the program, e.g. `schuler --help`
"""

# Extras that each command needs; a later one includes those before it.
EXTRAS = {"demo": "", "schuler": "", "test": "test", "check": "check", "docs": "docs"}
INCLUDES = {"": {""}, "test": {"", "test"}, "check": {"", "test", "check"}, "docs": {"", "docs"}}


def fail(message: str) -> int:
    """Print one line on stderr and return the exit code of bad input."""
    print(f"run.py: {message}", file=sys.stderr)
    return 2


def digest() -> str:
    """Return what the installed environment depends on: the project file and the interpreter."""
    content = (ROOT / "pyproject.toml").read_bytes()
    return hashlib.sha256(content + repr(sys.version_info[:2]).encode()).hexdigest()


def installed_extras() -> set[str]:
    """Return the extras that are installed for exactly this project file."""
    try:
        stamp = json.loads(STAMP.read_text(encoding="utf-8"))
        return set(stamp["extras"]) if stamp["digest"] == digest() else set()
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def passes(python: str | Path, test: str) -> bool:
    """Tell whether an interpreter starts and passes a test."""
    probe = f"import sys; sys.exit(not ({test}))"
    done = subprocess.run([str(python), "-c", probe], capture_output=True)
    return done.returncode == 0


def pip_serves_others() -> bool:
    """Tell whether this Python's pip can fill the environment, which then needs none itself."""
    return passes(sys.executable, "tuple(map(int, __import__('pip').__version__.split('.')[:2])) "
                  ">= (22, 3)")  # fmt: skip


def make_environment(*, with_pip: bool) -> int:
    """Make `.venv` anew."""
    print(f"Making the virtual environment {ENVIRONMENT} ...", flush=True)
    if ENVIRONMENT.exists():
        shutil.rmtree(ENVIRONMENT)
    how = [] if with_pip else ["--without-pip"]
    code = subprocess.run([sys.executable, "-m", "venv", *how, str(ENVIRONMENT)]).returncode
    if code:
        return fail(
            "could not make a virtual environment (on Debian and Ubuntu: apt install python3-venv)"
        )
    return 0


def install(extra: str) -> int:
    """Install the project in place, with one extra, unless that has been done already."""
    if extra in installed_extras() and PYTHON.exists():
        return 0
    outside = pip_serves_others()
    needed = f"sys.version_info >= {OLDEST_PYTHON!r}"
    needed += "" if outside else " and __import__('pip')"
    if not (PYTHON.exists() and passes(PYTHON, needed)):
        code = make_environment(with_pip=not outside)
        if code:
            return code
    target = f"{ROOT}[{extra}]" if extra else str(ROOT)
    print("Installing schuler and what it needs (once; a minute or two) ...", flush=True)
    command = [sys.executable, "-m", "pip", "--python", str(PYTHON)]
    command = command if outside else [str(PYTHON), "-m", "pip"]
    command += ["install", "--quiet", "--no-compile", "--disable-pip-version-check"]
    code = subprocess.run([*command, "--editable", target]).returncode
    if code:
        return fail("pip could not install the project (its message is above); try again")
    extras = sorted(installed_extras() | INCLUDES[extra])
    STAMP.write_text(json.dumps({"digest": digest(), "extras": extras}), encoding="utf-8")
    return 0


def commands(task: str, arguments: list[str]) -> list[list[str]]:
    """Return the command lines of a task, to be run one after the other."""
    python = [str(PYTHON), "-P", "-m"]
    if task == "demo":
        return [[*python, "schuler", "demo", *arguments]]
    if task == "schuler":
        return [[*python, "schuler", *arguments]]
    if task == "test":
        return [[str(PYTHON), "-m", "pytest", *arguments]]
    if task == "docs":
        return [[*python, "mkdocs", "build", *arguments]]
    return [
        [*python, "ruff", "check", "."],
        [*python, "ruff", "format", "--check", "."],
        [*python, "mypy"],
        [str(PYTHON.with_name("lint-imports"))],
    ]


def main(arguments: list[str]) -> int:
    """Run one task and return its exit code."""
    if sys.version_info < OLDEST_PYTHON:
        return fail("Python {}.{} is too old; expected 3.11 or newer".format(*sys.version_info[:2]))
    if not arguments or arguments[0] in {"-h", "--help"}:
        print(USAGE, end="")
        return 0 if arguments else 2
    task, rest = arguments[0], arguments[1:]
    if task not in EXTRAS:
        return fail(f"there is no task '{task}'; expected one of {', '.join(EXTRAS)}")
    code = install(EXTRAS[task])
    if code:
        return code
    # What is about this checkout runs there; the program works where the user stands.
    where = ROOT if task in {"test", "check", "docs"} else None
    codes = [subprocess.run(command, cwd=where).returncode for command in commands(task, rest)]
    return next((c for c in codes if c), 0)


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
