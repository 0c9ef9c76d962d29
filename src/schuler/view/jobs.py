"""Commands of the program as children of the window: their progress, and what they leave."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from threading import Lock
from typing import Any

from schuler.errors import InputError
from schuler.execution.progress import MARK
from schuler.view.folder import Folder

MOST_NOTES = 30
MOST_WAITING = 20
_UNITS = {"gyro_unit": ("rad/s", "deg/s"), "accel_unit": ("m/s^2", "g", "mg")}
_WINDOW = re.compile(r"\d{1,7}(\.\d{1,6})?:\d{1,5}(\.\d{1,6})?")


@dataclass(slots=True)
class Job:
    """One command."""

    number: int  # its number, from 1
    title: str  # what it does, for people
    arguments: list[str]  # what stands behind `schuler`
    # page, numbers: names of what it leaves in the folder
    page: str
    numbers: str
    state: str = "waiting"  # how far it is
    progress: str = ""  # what it does right now
    notes: list[str] = field(default_factory=list)  # what it said

    def shown(self) -> dict[str, Any]:
        """Return what the page needs."""
        names = ("number", "title", "state", "progress", "page", "numbers")
        return {name: getattr(self, name) for name in names} | {"notes": list(self.notes)}


def reading(wanted: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of reading an IMU that were chosen, checked."""
    chosen: dict[str, Any] = {}
    for name, units in _UNITS.items():
        unit = wanted.get(name) or ""
        if unit and unit not in units:
            raise InputError(f"'{unit}' as {name}", expected=f"one of {', '.join(units)}")
        chosen |= {name: unit} if unit else {}
    try:
        rate = float(wanted.get("rate") or 0.0)
    except (TypeError, ValueError):
        rate = -1.0
    if not 0.0 <= rate < 1e6:
        raise InputError("a rate that is no number of Hz", expected="such as 100")
    return chosen | ({"rate": rate} if rate else {})


def _options(how: Mapping[str, Any]) -> list[str]:
    return [f"--{name.replace('_', '-')}={value}" for name, value in how.items()]


class Jobs:
    """The commands that were asked for, run one after the other.

    Parameters
    ----------
    folder : Folder
        Where their inputs are, and where they write.
    """

    def __init__(self, folder: Folder) -> None:
        self.folder = folder
        self._all: dict[int, Job] = {}
        self._children: dict[int, subprocess.Popen[str]] = {}
        self._numbers = count(1)
        self._lock = Lock()
        self._worker = ThreadPoolExecutor(1, "jobs")

    def shown(self) -> list[dict[str, Any]]:
        """Return all jobs, the last one first."""
        return [job.shown() for job in reversed(list(self._all.values()))]

    def start(self, wanted: Mapping[str, Any]) -> Job:
        """Start what a request asks for; the names in it are looked for in the folder."""
        makers = {"characterize": self._characterize, "navigate": self._navigate,
                  "compare": self._compare}  # fmt: skip
        make = makers.get(str(wanted.get("verb")))
        if make is None:
            raise InputError("nothing that is done here", expected=f"one of {', '.join(makers)}")
        title, arguments, stem = make(wanted)
        with self._lock:
            if sum(job.state == "waiting" for job in self._all.values()) >= MOST_WAITING:
                raise InputError("too many jobs wait", cure="stop some, or wait")
            stem = re.sub(r"[^A-Za-z0-9_-]+", "-", f"{arguments[0]}-{stem}")[:60]
            place = self.folder.results(stem)
            page, numbers = place.with_suffix(".html"), place.with_suffix(".json")
            numbers.touch()  # takes the name until the result replaces it
            arguments += ["--report", str(page), "--json", str(numbers), "--force", "--verbose"]
            left = self.folder.name(page), self.folder.name(numbers)
            job = Job(next(self._numbers), title, arguments, *left)
            self._all[job.number] = job
        self._worker.submit(self._run, job)
        return job

    def stop(self, number: int) -> None:
        """Stop a job that waits or runs."""
        job = self._all.get(number)
        if job is not None and job.state in ("waiting", "running"):
            job.state = "stopped"
            child = self._children.get(number)
            if child is not None:
                child.terminate()

    def close(self) -> None:
        """Stop everything, as the window is shut."""
        for number in list(self._all):
            self.stop(number)
        self._worker.shutdown(cancel_futures=True)

    def _characterize(self, wanted: Mapping[str, Any]) -> tuple[str, list[str], str]:
        place = self.folder.path(wanted.get("imu"))
        how = _options(reading(wanted))
        return f"Characterize {place.name}", ["characterize", str(place), *how], place.stem

    def _navigate(self, wanted: Mapping[str, Any]) -> tuple[str, list[str], str]:
        imu, gnss = (self.folder.path(wanted.get(kind)) for kind in ("imu", "gnss"))
        windows = str(wanted.get("windows") or "").replace(",", " ").split()
        for window in windows:
            if not _WINDOW.fullmatch(window):
                raise InputError(f"'{window[:40]}' as outage", expected="START:SECONDS as 120:30")
        verb = (
            ["outages", *(f"--window={w}" for w in windows)]
            if windows
            else ["navigate", "--smooth"]
        )
        arguments = [*verb, "--imu", str(imu), "--gnss", str(gnss)]
        if wanted.get("noise"):
            arguments += ["--noise", str(self.folder.model(wanted["noise"]))]
        how = reading(wanted)
        how |= {"imu_rate": how.pop("rate")} if "rate" in how else {}
        arguments += _options(how)
        without = f", {len(windows)} outage{'s' * (len(windows) > 1)}" if windows else ""
        return f"Navigate {imu.name} with {gnss.name}{without}", arguments, imu.stem

    def _compare(self, wanted: Mapping[str, Any]) -> tuple[str, list[str], str]:
        names = wanted.get("results")
        if not isinstance(names, list) or not 2 <= len(names) <= 8:
            raise InputError("too few or too many results", expected="two to eight of them")
        places = [self.folder.numbers(name) for name in names]
        title = f"Compare {', '.join(p.stem for p in places)}"
        return title, ["compare", *map(str, places)], places[0].stem

    def _run(self, job: Job) -> None:
        if job.state != "waiting":
            return
        # -P: modules that lie in the folder are not imported
        command = [sys.executable, "-P", "-m", "schuler", *job.arguments]
        child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            text=True, encoding="utf-8", errors="replace", cwd=self.folder.root,
        )  # fmt: skip
        self._children[job.number] = child
        if job.state == "stopped":
            child.terminate()
        else:
            job.state = "running"
        assert child.stderr is not None
        for line in child.stderr:
            if line.startswith(MARK):
                job.progress = line.removeprefix(MARK).strip()
            else:
                job.notes = [*job.notes, line.strip().removeprefix("schuler: ")][-MOST_NOTES:]
        code = child.wait()
        del self._children[job.number]
        if job.state != "stopped":
            job.state = "done" if code in (0, 1) else "failed"
        if job.state != "done":
            with suppress(OSError):
                Path(self.folder.root, job.numbers).unlink()
