"""The table of formats: ours by module, those of users by the entry points ``schuler.formats``."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from schuler.errors import InputError
from schuler.io.format import Format, Start, What, damaged
from schuler.io.source import Source, existing_file
from schuler.io.tables.foreign import refuse_foreign
from schuler.plugins import plugins

GROUP = "schuler.formats"
_READ = "schuler.io.formats."
_TABLES = "schuler.io.tables."
_TRACKS = "schuler.io.trajectories."
_NOISE = "schuler.io.noise_forms."


class _Reader(NamedTuple):
    """A module of formats that are read, and what a file must show before it is asked."""

    module: str  # its name
    shows: bytes = b""  # pattern that is found in the first bytes of all its files; empty: of none.
    folder: bool = False  # whether its files may be folders
    endings: tuple[str, ...] = ()  # endings of the names of all its files; empty: any.

    def may_know(self, start: Start) -> bool:
        """Tell whether a file or a folder can be one of these."""
        if start.path.is_dir():
            return self.folder
        if self.endings and start.path.suffix.lower() not in self.endings:
            return False
        return bool(self.shows) and re.search(self.shows, start.plain) is not None

    @property
    def formats(self) -> tuple[Format, ...]:
        """Formats of the module that can be read."""
        return tuple(f for f in import_module(self.module).FORMATS if f.open is not None)


# in the order in which they are asked: those that begin in a way of their own first, text, which is
# nearly everything, last
_READERS = (
    _Reader(_READ + "rosbag", rb"\A(?:#ROSBAG V|SQLite format 3\0|\x89MCAP0\r\n)", folder=True),
    _Reader(_READ + "ulog", rb"\AULog\x01\x12\x35"),
    _Reader(_READ + "matlab", rb"\AMATLAB [57]\."),
    _Reader(_TABLES + "parquet", rb"\APAR1"),
    _Reader(_TABLES + "npz", rb"\A(?:PK\x03\x04|\x93NUMPY)"),
    _Reader(_READ + "dataflash", rb"\A\xa3\x95\x80|FMT, "),
    _Reader(_READ + "ubx", rb"\xb5b"),
    _Reader(_READ + "novatel", rb"[#%](?:BEST|INS|RAWIMU|CORRIMU)|\xaa\x44[\x12\x13]"),
    _Reader(_READ + "nmea", rb"\$..(?:GGA|RMC)"),
    _Reader(_READ + "rtklib", rb"%"),
    _Reader(_READ + "sbet", rb"\0"),
    _Reader(_READ + "kitti", folder=True),
    _Reader(_READ + "gnss_logger", rb"# (?:Raw|Fix|UncalAccel),"),
    _Reader(_READ + "phone_folder", folder=True),
    # the name of a sensor below the names of the columns
    _Reader(_READ + "long_rows", rb"(?i)[\r\n][^\r\n]*(?:gyr|angular|rotation)"),
    _Reader(_READ + "loggers", rb"[^\0]"),
    _Reader(_READ + "inertial_explorer", rb"Longitude"),
    _Reader(_READ + "kf_gins", rb"[^\0]", endings=(".txt", ".imu", ".dat", ".asc", ".gnss")),
    _Reader(_TABLES + "json_lines", rb"\A(?:\xef\xbb\xbf)?\s*[{\[]"),
    _Reader(_TABLES + "text", rb"(?s)."),
)
_TRAJECTORY_WRITERS = tuple(_TRACKS + m for m in ("local", "receivers", "maps"))
_NOISE_WRITERS = tuple(_NOISE + m for m in ("ros", "slam", "post_processing"))


@cache
def formats() -> tuple[Format, ...]:
    """Return every format that is known, those of users first."""
    return (*_of_users(), *_ours())


def _ours() -> tuple[Format, ...]:
    found: list[Format] = []
    for name in (*(r.module for r in _READERS), *_TRAJECTORY_WRITERS, *_NOISE_WRITERS):
        found += import_module(name).FORMATS
    return tuple(found)


@cache
def _readers() -> tuple[Format, ...]:
    own = (f for reader in _READERS for f in reader.formats)
    return (*(f for f in _of_users() if f.open is not None), *own)


def _candidates(start: Start) -> Iterator[Format]:
    """Formats that a file can be of, in the order in which they are asked; users' own first."""
    yield from (f for f in _of_users() if f.open is not None)
    for reader in _READERS:
        if reader.may_know(start):
            yield from reader.formats


@cache
def _of_users() -> tuple[Format, ...]:
    return tuple(f for name, value in plugins(GROUP).items() for f in _loaded(name, value))


def _loaded(name: str, value: str) -> tuple[Format, ...]:
    """Load the formats of an entry point; what is no `Format` is named."""
    module, _, attribute = value.partition(":")
    who = f"format '{name}' of {value}"
    try:
        given = getattr(import_module(module.strip()), attribute.strip())
    except Exception as error:
        raise InputError(
            f"{who} cannot be loaded ({type(error).__name__}: {error})",
            expected=f"'{value}' to name a schuler.io.Format",
            cure="correct or uninstall the package of this format",
        ) from error
    found = given if isinstance(given, tuple) else (given,)
    for one in found:
        problem = _problem(one)
        if problem:
            raise InputError(
                f"{who} {problem[0]}",
                expected=problem[1],
                cure="correct or uninstall the package of this format",
            )
    return found


def _problem(given: Any) -> tuple[str, str] | None:
    """Return what is wrong with a user's format, and what was expected."""
    if not isinstance(given, Format):
        return f"is a {type(given).__name__}", "a schuler.io.Format"
    if not (isinstance(given.name, str) and given.name and isinstance(given.title, str)):
        return "has no name or no title", "both as text"
    for field in ("detect", "open", "write_trajectory", "write_recording", "write_noise"):
        value = getattr(given, field)
        if value is not None and not callable(value):
            return f"has {field}={value!r}", "a function or None"
    if given.open is not None and not (given.magic or given.detect):
        return "can be opened but not recognised", "magic= or detect="
    if given.open is not None and not given.holds:
        return "can be opened but does not say what it holds", "holds= out of imu, gnss, sensor"
    return None


def format_of(path: Path) -> Format:
    """Find the format of a file or a folder: by its content, not by its name."""
    if not path.is_dir():
        existing_file(path)
    start = Start(path)
    for one in _candidates(start):
        try:
            if one.recognises(start):
                return one
        except InputError:
            raise
        except Exception as error:
            raise _broken(one, f"failed to recognise a file ({type(error).__name__}: {error})",
                          "detect to take a Start and return True or False") from error  # fmt: skip
    _refuse_false_name(path)
    refuse_foreign(path, start.bytes)
    raise InputError(
        "the file is not text and not of a known format",
        expected=f"one of: {', '.join(f.title for f in _readers())}",
        cure="`schuler formats` lists them with their endings",
        where=str(path),
    )


def _refuse_false_name(path: Path) -> None:
    ending = path.suffix.lower()
    for one in _readers():
        if one.magic and ending in one.suffixes:
            raise InputError(
                f"the name says {one.title}, the content does not",
                expected=f"a file that begins with {one.magic[0]!r}",
                cure="check that the copy was complete, or rename the file",
                where=str(path),
            )


def open_with(one: Format, path: Path, what: What, options: Any) -> Source:
    """Open a file with its format; what comes back must be a `Source`."""
    _require_held(one, path, what)
    assert one.open is not None
    with _reading(one, path):
        source = one.open(path, what, options)
    return _checked_source(one, path, source)


def parts_with(one: Format, path: Path, what: What, options: Any, rows: int) -> Iterator[Source]:
    """Yield a file in parts of about so many rows; as a whole where its format has no parts."""
    if one.parts is None:
        yield open_with(one, path, what, options)
        return
    _require_held(one, path, what)
    with _reading(one, path):
        parts = iter(one.parts(path, what, options, rows))
    while True:
        with _reading(one, path):
            part = next(parts, None)
        if part is None:
            return
        yield _checked_source(one, path, part)


def _require_held(one: Format, path: Path, what: What) -> None:
    if what not in one.holds:
        held = " and ".join({"imu": "an IMU", "gnss": "GNSS"}.get(h, f"a {h}") for h in one.holds)
        wanted = {"imu": "an IMU recording", "gnss": "a GNSS recording"}.get(what, "a sensor")
        raise InputError(
            f"this is a file of {one.title}, which holds {held or 'no recordings'}",
            expected=wanted,
            where=str(path),
        )


@contextmanager
def _reading(one: Format, path: Path) -> Iterator[None]:
    """Turn what a reader stumbles over into an error that names file and format."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if one in _of_users():
            raise _broken(one, f"failed to open {path.name} ({type(error).__name__}: {error})",
                          "a Source, or an InputError") from error  # fmt: skip
        if isinstance(error, (MemoryError, OSError)):
            raise
        raise damaged(path, one.title, error) from error


def _checked_source(one: Format, path: Path, source: Source) -> Source:
    lacks = [m for m in ("path", "names", "units", "rate", "history", "assumptions", "is_text",
                         "load", "place") if not hasattr(source, m)]  # fmt: skip
    if lacks:
        raise _broken(one, f"opened {path.name} as a {type(source).__name__} without {lacks[0]}",
                      "a schuler.io.Source, such as schuler.io.MemorySource")  # fmt: skip
    return source


def _broken(one: Format, what: str, expected: str) -> InputError:
    return InputError(f"format '{one.name}' {what}", expected=expected, cure="correct the format")


def is_recording(folder: Path) -> bool:
    """Tell whether a folder as a whole is of some format."""
    start = Start(folder)
    return any(f.recognises(start) for f in _candidates(start) if f.detect is not None)


def suffixes() -> frozenset[str]:
    """Return the endings of all files that can be read."""
    return frozenset(s for f in _readers() for s in f.suffixes)


def trajectory_format(name: str) -> Format:
    """Find a writer of trajectories by its name or by the ending of a file."""
    writers = [f for f in formats() if f.write_trajectory is not None]
    for one in writers:
        if name.lower() == one.name or name.lower() in one.suffixes:
            return one
    endings = sorted({s for f in writers for s in f.suffixes[:1]})
    raise InputError(
        f"ending '{name}' is not known" if name.startswith(".") or not name
        else f"'{name}' is no form of a trajectory",
        expected=f"out of {', '.join(f.name for f in writers)}, or an ending out of "
        f"{', '.join(endings)}",
    )  # fmt: skip


def recording_format(name: str) -> Format:
    """Find a writer of recordings by its name or by the ending of a file."""
    writers = [f for f in formats() if f.write_recording is not None]
    for one in writers:
        if name.lower() == one.name or name.lower() in one.suffixes:
            return one
    raise InputError(
        f"recordings are not written as '{name}'",
        expected=f"out of {', '.join(f.name for f in writers)}, or their endings",
    )


def noise_format(name: str) -> Format:
    """Find a writer of noise models by its name."""
    writers = [f for f in formats() if f.write_noise is not None]
    for one in writers:
        if name.lower() == one.name:
            return one
    raise InputError(
        f"'{name}' is no form of a noise model",
        expected=f"out of {', '.join(f.name for f in writers)}",
    )
