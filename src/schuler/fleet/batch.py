"""A batch: every log that is not yet in the database, by as many workers as there are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from schuler.errors import InputError
from schuler.execution import Task, Workers, run_tasks, workers
from schuler.execution.executors import lent
from schuler.fleet.database import FleetDatabase
from schuler.fleet.logs import LogEntry
from schuler.fleet.work import work_on


@dataclass(frozen=True, slots=True)
class BatchSettings:
    """How the logs of a batch are treated, all alike.

    Parameters
    ----------
    model : str
        Which processes are fitted to static logs, as for `identify`.
    repair : bool
        Repair what the screening finds.
    sweep : (float, float)
        Outages of so many seconds, one every so many seconds, by which drives are judged.
    aiding : tuple of str
        What is known of the vehicle, as for `navigate`.
    position_sd, velocity_sd : float or None
        Of receivers that state none, m and m/s.
    """

    model: str = "auto"
    repair: bool = False
    sweep: tuple[float, float] = (30.0, 60.0)
    aiding: tuple[str, ...] = ()
    position_sd: float | None = None
    velocity_sd: float | None = None

    def __post_init__(self) -> None:
        if len(self.sweep) != 2 or not all(s > 0.0 for s in self.sweep):
            raise InputError(f"sweep {self.sweep}", expected="(seconds, every), both positive")


@dataclass(frozen=True, slots=True)
class BatchReport:
    """What a batch did.

    Parameters
    ----------
    done, failed, known : int
        Logs that were done now, that failed now, and that were in the database before.
    failures : tuple of (str, str)
        File and reason of every log that failed, now or before.
    """

    done: int
    failed: int
    known: int
    failures: tuple[tuple[str, str], ...]


class _Entered:
    """Puts what is known of each log beside its outcome when it is entered."""

    def __init__(self, database: FleetDatabase, entries: Mapping[str, LogEntry]) -> None:
        self.database = database
        self.entries = entries

    def load(self, key: str) -> dict[str, Any] | None:
        return self.database.load(key)

    def save(self, key: str, outcome: Mapping[str, Any], /) -> None:
        entry = self.entries[key]
        known = {
            "file": str(entry.file), "sensor": entry.sensor, "serial": entry.unit,
            "date": entry.date, "temperature": entry.temperature,
            "kind": "drive" if entry.gnss else "noise",
        }  # fmt: skip
        self.database.save(key, known | dict(outcome))


def run_batch(
    entries: Sequence[LogEntry],
    database: FleetDatabase,
    settings: BatchSettings = BatchSettings(),
    *,
    executor: Executor | Workers | None = None,
    told: Callable[[str, int, int], None] | None = None,
) -> BatchReport:
    """Work on every log that is not yet in the database.

    Parameters
    ----------
    entries : sequence of LogEntry
        As `list_logs` returns them.
    database : FleetDatabase
        Each result is entered when it is there: a batch that was stopped goes on.
    settings : BatchSettings
        For all logs.
    executor : concurrent.futures.Executor, Workers or None
        Who works: any executor, or what `schuler.execution.workers` returns; None: this process.
    told : callable or None
        Called with file, number done and number of all.

    Returns
    -------
    BatchReport
        Failed logs are in it, and in the database; they do not end the batch.

    Raises
    ------
    InputError
        Two entries of one file, workers that break down again and again, or a full disk.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler.fleet import FleetDatabase, LogEntry, run_batch
    >>> lost = LogEntry(Path("nowhere.csv"))
    >>> with FleetDatabase(Path(tempfile.mkdtemp()) / "fleet.sqlite") as fleet:
    ...     report = run_batch([lost], fleet)
    >>> report.failed
    1
    """
    plain = asdict(settings)
    keys = {_key(entry, plain): entry for entry in entries}
    if len(keys) != len(entries):
        twice = sorted({str(e.file) for e in entries if sum(f == e for f in entries) > 1})
        raise InputError(f"{', '.join(twice[:3])} stands in the list twice", expected="once")
    before = {key for key in keys if database.load(key) is not None}
    tasks = [
        Task(key, work_on, (*(str(p or "") for p in _files(e)), plain)) for key, e in keys.items()
    ]
    if executor is None:
        executor = workers(1)
    crew = executor if isinstance(executor, Workers) else lent(executor)

    def tell(key: str, done: int, total: int) -> None:
        if told is not None:
            told(str(keys[key].file), done, total)

    found = run_tasks(tasks, crew, _Entered(database, keys), tell, _killed)
    failures = {k: o for k, o in found.items() if o["status"] == "failed"}
    now = len(failures.keys() - before)
    return BatchReport(
        len(keys) - len(before) - now,
        now,
        len(before),
        tuple((str(keys[k].file), str(o["message"])) for k, o in failures.items()),
    )


def _killed(task: Task) -> dict[str, Any]:
    message = f"{task.arguments[0]}: the process that worked on it was killed (memory?)"
    return {"status": "failed", "message": message}


def _key(entry: LogEntry, settings: Mapping[str, Any]) -> str:
    """Name a piece of work after all it depends on: the files as they are, and the settings."""
    files = [(str(p), *_state(p)) for p in _files(entry) if p is not None]
    known = [entry.sensor, entry.serial, entry.date, entry.temperature]
    text = json.dumps([files, known, settings], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _files(entry: LogEntry) -> tuple[Path | None, ...]:
    return entry.file, entry.gnss, entry.noise, entry.calibration, entry.profile


def _state(path: Path) -> tuple[int, int]:
    try:
        found = path.stat()
    except OSError:
        return (0, 0)
    return found.st_size, found.st_mtime_ns
