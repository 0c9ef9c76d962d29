"""Which logs a batch works on: those of a folder, or the rows of a table."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from schuler.errors import InputError

_COLUMNS = (
    "file", "sensor", "serial", "date", "temperature", "gnss", "noise", "calibration", "profile"
)  # fmt: skip
_ENDINGS = frozenset(
    {".csv", ".txt", ".parquet", ".npz", ".bag", ".mcap", ".db3", ".ulg", ".bin", ".ubx", ".mat"}
    | {".log", ".dat", ".asc", ".json", ".jsonl", ".tsv"}
)
_FIXES = ("gnss", "gps", "pos")
"""Files of these names hold the fixes of the drive in the same folder."""


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One log, and what is known of it.

    Parameters
    ----------
    file : Path
        IMU recording.
    sensor : str
        Make and model; sensors of one kind are compared with each other.
    serial : str
        Serial number; logs of one serial number are followed over time.
    date : str
        When it was recorded, as ISO 8601.
    temperature : float or None
        Of the sensor, degrees Celsius.
    gnss : Path or None
        Fixes of the same drive: then it is a drive, else a static log.
    noise : Path or None
        Noise model that the drive uses.
    calibration : Path or None
        Of the sensor, as YAML: the log is calibrated, and the database keeps it for the sensor.
    profile : Path or None
        How its files are read (rate, units, columns), from `schuler read --save-profile`.
    """

    file: Path
    sensor: str = ""
    serial: str = ""
    date: str = ""
    temperature: float | None = None
    gnss: Path | None = None
    noise: Path | None = None
    calibration: Path | None = None
    profile: Path | None = None

    @property
    def unit(self) -> str:
        """The serial number, or the name of the file where none is known."""
        return self.serial or self.file.stem


def list_logs(where: Path) -> tuple[tuple[LogEntry, ...], tuple[str, ...]]:
    """List the logs of a folder or of a table.

    Parameters
    ----------
    where : Path
        A folder, searched with all folders in it, or a CSV or Parquet table with a column `file`
        and, where known, `sensor`, `serial`, `date`, `temperature` (degrees Celsius), `gnss`,
        `noise`, `calibration` and `profile`; files relative to the table.

    Returns
    -------
    entries : tuple of LogEntry
        In the order of the table, or by path.
    remarks : tuple of str
        What was left out or taken for granted.

    Raises
    ------
    InputError
        Nothing there, or a table without `file`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler.fleet import list_logs
    >>> folder = Path(tempfile.mkdtemp())
    >>> _ = (folder / "a.csv").write_text("time_s,gyro_x")
    >>> entries, remarks = list_logs(folder)
    >>> entries[0].unit
    'a'
    """
    if where.is_dir():
        return _of_folder(where)
    if not where.is_file():
        raise InputError("there is no such folder or table", where=str(where))
    return _of_table(where)


def _of_folder(folder: Path) -> tuple[tuple[LogEntry, ...], tuple[str, ...]]:
    files = [
        path
        for path in sorted(folder.rglob("*"))
        if path.is_file()
        and path.suffix.lower() in _ENDINGS
        and not any(part.startswith(".") for part in path.relative_to(folder).parts)
        and not path.stem.lower().startswith("readme")
    ]
    fixes = {path.parent: path for path in files if path.stem.lower() in _FIXES}
    entries = tuple(
        LogEntry(path, gnss=fixes.get(path.parent) if path.stem.lower() == "imu" else None)
        for path in files
        if path not in fixes.values()
    )
    if not entries:
        raise InputError(
            "no recordings are there",
            expected=f"files that end in {', '.join(sorted(_ENDINGS)[:6])}, ...",
            where=str(folder),
        )
    remark = (
        "no table says which sensor a file is of: every file counts as a sensor of its own, all "
        "of one kind (a CSV with columns file, sensor, serial, date, temperature tells it)"
    )
    return entries, (remark,)


def _of_table(table: Path) -> tuple[tuple[LogEntry, ...], tuple[str, ...]]:
    rows = _rows(table)
    names = set(rows[0]) if rows else set()
    if "file" not in names:
        raise InputError(
            f"the table has no column 'file' among {', '.join(sorted(names)) or 'none'}",
            expected=f"columns {', '.join(_COLUMNS)} (the first one at least)",
            where=str(table),
        )
    remarks = [f"column '{n}' of the table is not used" for n in sorted(names - set(_COLUMNS))]
    entries = tuple(_entry(table, k, row) for k, row in enumerate(rows))
    if not any(e.serial for e in entries):
        remarks.append("no serial numbers: every file counts as a sensor of its own")
    seen: dict[tuple[str, str], Path] = {}
    for entry in entries:
        key = (entry.serial, entry.date)
        if all(key) and key in seen:
            remarks.append(
                f"{seen[key].name} and {entry.file.name} are both of {entry.serial} at "
                f"{entry.date}: one sensor cannot be in two logs at one time"
            )
        seen.setdefault(key, entry.file)
    return entries, tuple(remarks)


def _rows(table: Path) -> list[dict[str, str]]:
    import polars

    try:
        if table.suffix.lower() == ".parquet":
            frame = polars.read_parquet(table, glob=False)
        else:
            frame = polars.read_csv(table, infer_schema=False, glob=False)
    except (polars.exceptions.PolarsError, OSError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(f"the table cannot be read ({reason[:80]})", where=str(table)) from None
    frame = frame.rename({n: n.strip().lower() for n in frame.columns})
    frame = frame.rename({n: "temperature" for n in frame.columns if n == "temperature_degc"})
    return [
        {k: "" if v is None else str(v).strip() for k, v in r.items()} for r in frame.to_dicts()
    ]


def _entry(table: Path, number: int, row: Mapping[str, str]) -> LogEntry:
    where = f"{table}, row {number + 1}"
    if not row["file"]:
        raise InputError("the row names no file", where=where)
    text = row.get("temperature", "")
    try:
        temperature = float(text) if text else None
    except ValueError:
        raise InputError(
            f"temperature is '{text}'", expected="degrees Celsius", where=where
        ) from None

    def path(name: str) -> Path | None:
        return table.parent / row[name] if row.get(name) else None

    file = table.parent / row["file"]
    return LogEntry(
        file,
        row.get("sensor", ""),
        row.get("serial", ""),
        row.get("date", ""),
        temperature,
        path("gnss"),
        path("noise"),
        path("calibration"),
        path("profile"),
    )
