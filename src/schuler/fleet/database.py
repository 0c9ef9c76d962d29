"""The database of a fleet: one SQLite file, each log entered whole or not at all."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from schuler.errors import InputError

UPGRADES = (
    """
    CREATE TABLE log (
        key TEXT PRIMARY KEY, file TEXT NOT NULL, sensor TEXT NOT NULL, serial TEXT NOT NULL,
        date TEXT NOT NULL, temperature REAL, kind TEXT NOT NULL, status TEXT NOT NULL,
        message TEXT NOT NULL, seconds REAL, rate REAL, cpu_seconds REAL, model TEXT NOT NULL,
        assumptions TEXT NOT NULL
    );
    CREATE TABLE figure (
        key TEXT NOT NULL REFERENCES log (key) ON DELETE CASCADE, axis TEXT NOT NULL,
        name TEXT NOT NULL, value REAL, standard_error REAL, upper_limit REAL,
        PRIMARY KEY (key, axis, name)
    );
    CREATE INDEX log_serial ON log (serial, date);
    """,
    """
    ALTER TABLE log ADD COLUMN calibration TEXT NOT NULL DEFAULT '';
    CREATE INDEX log_file ON log (file, kind);
    """,
)
"""What turns version k into k + 1; the first makes an empty file a database."""

_LOG = (
    "key", "file", "sensor", "serial", "date", "temperature", "kind", "status", "message",
    "seconds", "rate", "cpu_seconds", "model", "assumptions", "calibration",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Measurement:
    """One figure of one log, with what is known of the log."""

    file: str
    sensor: str
    serial: str
    date: str
    temperature: float | None
    kind: str
    axis: str
    name: str
    value: float | None
    standard_error: float | None
    upper_limit: float | None


class FleetDatabase:
    """What was measured of a fleet; a context that closes the file at its end.

    Parameters
    ----------
    path : Path
        SQLite file; made when it does not exist.
    create : bool
        False: it has to be there.

    Raises
    ------
    InputError
        No such file, no database of a fleet, one of a newer schuler, or a disk that is full.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler.fleet import FleetDatabase
    >>> with FleetDatabase(Path(tempfile.mkdtemp()) / "fleet.sqlite") as fleet:
    ...     fleet.logs()
    []
    """

    def __init__(self, path: Path, *, create: bool = True) -> None:
        self.path = path
        if not create and not path.is_file():
            raise InputError("there is no such database of a fleet", where=str(path))
        with self._told():
            self._connection = sqlite3.connect(path, isolation_level=None, timeout=30.0)
            self._connection.execute("PRAGMA foreign_keys = ON")
            try:
                self._upgrade()
            except BaseException:
                self._connection.close()
                raise

    def __enter__(self) -> FleetDatabase:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    def _upgrade(self) -> None:
        tables = {r[0] for r in self._connection.execute("SELECT name FROM sqlite_master")}
        (version,) = self._connection.execute("PRAGMA user_version").fetchone()
        if version > len(UPGRADES):
            raise InputError(
                f"the database has version {version}, made by a newer schuler",
                expected=f"version {len(UPGRADES)} or older",
                cure="update schuler, or write to another file",
                where=str(self.path),
            )
        if version == 0 and tables:
            raise InputError(
                "the file is a database of something else", expected="a database that "
                "`schuler batch` wrote, or a new file", where=str(self.path),
            )  # fmt: skip
        for step in range(version, len(UPGRADES)):
            done = f"PRAGMA user_version = {step + 1};"
            self._connection.executescript(f"BEGIN IMMEDIATE; {UPGRADES[step]} {done} COMMIT;")

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Turn what SQLite complains of into one clear line."""
        try:
            yield
        except sqlite3.Error as error:
            raise InputError(
                f"the database cannot be used ({error})",
                expected="a file of `schuler batch` on a disk with room; what is in it stays",
                cure="make room or correct the path, and run again: it goes on where it stopped",
                where=str(self.path),
            ) from None

    def load(self, key: str) -> dict[str, Any] | None:
        """Return whether a log has been done: its status and message, or None."""
        with self._told():
            row = self._connection.execute(
                "SELECT status, message FROM log WHERE key = ?", (key,)
            ).fetchone()
        return None if row is None else {"status": row[0], "message": row[1]}

    def save(self, key: str, outcome: Mapping[str, Any], /) -> None:
        """Enter a log with all its figures, or nothing of it; an older entry of it goes."""
        row: dict[str, Any] = dict.fromkeys(_LOG, "") | {
            "seconds": None,
            "rate": None,
            "temperature": None,
        }
        row |= {k: v for k, v in outcome.items() if k in _LOG}
        row |= {"key": key, "assumptions": json.dumps(outcome.get("assumptions", []))}
        row["cpu_seconds"] = float(outcome.get("cpu seconds", 0.0))
        figures = [(key, *figure) for figure in outcome.get("figures", ())]
        with self._told():
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                self._connection.execute(
                    "DELETE FROM log WHERE file = ? AND kind = ?", (row["file"], row["kind"])
                )
                marks = ", ".join("?" * len(_LOG))
                self._connection.execute(
                    f"INSERT INTO log ({', '.join(_LOG)}) VALUES ({marks})",
                    tuple(row[name] for name in _LOG),
                )
                self._connection.executemany(
                    "INSERT INTO figure VALUES (?, ?, ?, ?, ?, ?)", figures
                )
            except BaseException:
                self._connection.execute("ROLLBACK")
                raise
            self._connection.execute("COMMIT")

    def forget_failed(self) -> None:
        """Take out the logs that failed, so that they are tried again."""
        with self._told():
            self._connection.execute("DELETE FROM log WHERE status = 'failed'")

    def logs(self) -> list[dict[str, Any]]:
        """Return every log, by serial number and date."""
        names = [n for n in _LOG if n not in ("model", "assumptions", "calibration")]
        with self._told():
            found = self._connection.execute(
                f"SELECT {', '.join(names)} FROM log ORDER BY sensor, serial, date, file"
            ).fetchall()
        return [dict(zip(names, row, strict=True)) for row in found]

    def measurements(self, serial: str | None = None) -> list[Measurement]:
        """Return every figure of every log that was done, or of those of one sensor, by date."""
        with self._told():
            found = self._connection.execute(
                "SELECT file, sensor, serial, date, temperature, kind, axis, name, value, "
                "standard_error, upper_limit FROM log JOIN figure USING (key) "
                "WHERE status = 'done' AND serial = coalesce(?, serial) "
                "ORDER BY sensor, serial, date, file",
                (serial,),
            ).fetchall()
        return [Measurement(*row) for row in found]

    def newest(self, serial: str, kind: str) -> tuple[str, str] | None:
        """Return date and text of the newest noise model ("model") or calibration of a sensor."""
        if kind not in ("model", "calibration"):
            raise InputError(f"nothing of kind '{kind}' is kept", expected="model or calibration")
        with self._told():
            found = self._connection.execute(
                f"SELECT date, {kind} FROM log WHERE serial = ? AND {kind} <> '' AND "
                "status = 'done' ORDER BY date DESC, file DESC LIMIT 1",
                (serial,),
            ).fetchone()
        return None if found is None else (str(found[0]), str(found[1]))

    def serials(self) -> list[str]:
        """Return the sensors of which something is known."""
        with self._told():
            rows = self._connection.execute(
                "SELECT DISTINCT serial FROM log WHERE status = 'done' ORDER BY serial"
            ).fetchall()
        return [str(row[0]) for row in rows]
