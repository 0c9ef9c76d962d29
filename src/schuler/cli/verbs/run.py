"""`schuler run`: several verbs, one after the other, as a file says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from schuler.cli.console import MANNERS, Screen
from schuler.errors import InputError

EXAMPLE = """\
# schuler run job.yaml: one step an entry, each a verb with what stands behind it on the command
# line, and its options by name. A list repeats an option; true sets it, false sets --no-...
- characterize: static.csv
  gyro-unit: deg/s
  accel-unit: g
  noise-out: noise.yaml
  report: noise.html
- navigate:
  imu: drive/imu.csv
  gnss: drive/gnss.csv
  noise: noise.yaml
  aid: [nhc, zupt]
  smooth: true
  out: trajectory.parquet
  report: drive.html
- outages:
  imu: drive/imu.csv
  gnss: drive/gnss.csv
  noise: noise.yaml
  sweep: 30:60
  report: outages.html
"""


def run(job: Path | None = None, /, *, example: bool = False) -> int:
    """Do what a file says: several verbs, one after the other.

    All steps are checked before the first begins. A failed check lets the others go on, bad input
    ends the run.

    Example: `schuler run --example > job.yaml`, then `schuler run job.yaml`

    Parameters
    ----------
    job : Path, optional
        Steps as YAML; paths in it are seen from the current folder.
    example : bool
        Print such a file.
    """
    from schuler.cli.app import BAD_INPUT, check
    from schuler.cli.app import run as call

    if example == (job is not None):
        raise InputError("which job", expected="a file, or --example")
    if job is None:
        print(EXAMPLE, end="")
        return 0
    manners = MANNERS.options()
    steps = list(_steps(job))
    for number, step in enumerate(steps, 1):
        check(step, f"{job}, step {number} ({step[0]})")
    worst, screen = 0, Screen()
    for number, step in enumerate(steps, 1):
        screen.heading(f"Step {number} of {len(steps)}", f"schuler {' '.join(step)}")
        worst = max(worst, call([*step, *manners]))
        if worst >= BAD_INPUT:
            break
    return worst


def _steps(job: Path) -> Iterator[list[str]]:
    """Yield the arguments of every step."""
    from schuler.cli.registry import verbs
    from schuler.data.yaml_file import read_yaml

    read = read_yaml(job, "a job: a list of steps")
    if not isinstance(read, list) or not read:
        raise InputError("holds no list of steps", expected="schuler run --example", where=str(job))
    for number, step in enumerate(read, 1):
        verb = next(iter(step), None) if isinstance(step, dict) else step
        if not isinstance(verb, str) or verb not in verbs() or verb == "run":
            raise InputError(
                f"step {number} begins with '{verb}'",
                expected=f"a verb: {', '.join(v for v in verbs() if v != 'run')}",
                where=str(job),
            )
        options = dict(step) if isinstance(step, dict) else {verb: None}
        inputs = options.pop(verb)
        yield [str(verb), *map(str, _several(inputs)), *_options(options)]


def _several(value: Any) -> list[Any]:
    return [] if value is None else value if isinstance(value, list) else [value]


def _options(options: dict[str, Any]) -> Iterator[str]:
    for key, value in options.items():
        name = str(key).replace("_", "-")
        for each in _several(value):
            if isinstance(each, bool):
                yield f"--{name}" if each else f"--no-{name}"
            else:
                yield f"--{name}={each}"
