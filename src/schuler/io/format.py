"""What a file format is: how it is recognised, read and written."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from schuler.errors import InputError
from schuler.io.source import Source, existing_file
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.data import GnssRecording, ImuRecording
    from schuler.io.options import ReadOptions
    from schuler.noise import NoiseModel

What = Literal["imu", "gnss", "sensor"]
"""What is wanted from a file."""

TrackColumns = Mapping[str, FloatArray]
"""A trajectory as named columns, in the units of their names."""

_HEAD_BYTES = 1 << 16


class Start:
    """The beginning of a file, by which formats recognise their own.

    Parameters
    ----------
    path : Path
        A file, or a folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def plain(self) -> bytes:
        """The first bytes, those of text in UTF-16 as UTF-8."""
        wide = self.bytes[:2] in (b"\xff\xfe", b"\xfe\xff")
        return "\n".join(self.lines).encode() if wide else self.bytes

    @cached_property
    def bytes(self) -> bytes:
        """First 64 KiB; nothing for a folder."""
        if self.path.is_dir():
            return b""
        with existing_file(self.path).open("rb") as stream:
            return stream.read(_HEAD_BYTES)

    @cached_property
    def lines(self) -> list[str]:
        """First lines, when they are text; none for a binary file or a folder."""
        data = self.bytes
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            return data[: len(data) // 2 * 2].decode("utf-16", errors="replace").splitlines()
        data = data.rstrip(b"\0")  # left where the power failed
        if b"\0" in data:
            return []
        return data.decode("utf-8-sig", errors="replace").splitlines()

    @cached_property
    def names(self) -> frozenset[str]:
        """Names of the files in a folder; none for a file."""
        if not self.path.is_dir():
            return frozenset()
        return frozenset(p.name for p in self.path.iterdir())


@dataclass(frozen=True, slots=True)
class NoiseRequest:
    """What the form of another program needs beside the noise model.

    Parameters
    ----------
    rate : float or None
        Samples a second; None: that of the model.
    topic : str
        Name of the ROS topic.
    """

    rate: float | None = None
    topic: str = "/imu0"


@dataclass(frozen=True, slots=True)
class Format:
    """A file format.

    A format of your own is one such object, named by an entry point of the group
    ``schuler.formats``; every function and every command then knows it.

    Parameters
    ----------
    name : str
        Short name, such as "ulog".
    title : str
        As people call it, such as "PX4 ULog".
    suffixes : tuple of str
        Endings of the names of such files, with the dot, in lower case. The first is used to
        choose a writer.
    holds : tuple of {"imu", "gnss", "sensor"}
        What can be read from such a file.
    magic : tuple of bytes
        Beginnings of such files. A file with a suffix of a format that has them, but none of
        them at its beginning, is refused.
    detect : callable, optional
        From a `Start` to whether the file is of this format, where no magic tells.
    open : callable, optional
        From path, what is wanted, and `ReadOptions` to a `Source` of named columns.
    parts : callable, optional
        From path, what is wanted, `ReadOptions` and a number of rows to one `Source` after the
        other, each of about so many rows that follow those before, never the whole in memory. By
        `first_row` each says where in the file it begins.
    write_trajectory : callable, optional
        From path and named columns (those of `schuler navigate --out`) to the written file.
    write_recording : callable, optional
        From path and `ImuRecording` or `GnssRecording` to the written file.
    beside : callable, optional
        From the columns of a trajectory to the text of a file that belongs beside it, such as the
        origin of local coordinates.
    write_noise : callable, optional
        From `NoiseModel` and `NoiseRequest` to the text of the file; bytes for a binary one.
    extra : str
        Optional dependency of the package that reading needs, such as "px4".
    """

    name: str
    title: str
    suffixes: tuple[str, ...] = ()
    holds: tuple[What, ...] = ()
    magic: tuple[bytes, ...] = ()
    detect: Callable[[Start], bool] | None = None
    open: Callable[[Path, What, ReadOptions], Source] | None = None
    parts: Callable[[Path, What, ReadOptions, int], Iterator[Source]] | None = None
    write_trajectory: Callable[[Path, TrackColumns], None] | None = None
    write_recording: Callable[[Path, ImuRecording | GnssRecording], None] | None = None
    beside: Callable[[TrackColumns], str] | None = None
    write_noise: Callable[[NoiseModel, NoiseRequest], str | bytes] | None = None
    extra: str = ""

    def recognises(self, start: Start) -> bool:
        """Tell whether a file is of this format."""
        if any(start.bytes.startswith(m) for m in self.magic):
            return True
        return self.detect is not None and bool(self.detect(start))


def lacking(package: str, extra: str, path: Path) -> InputError:
    """Return the error for an optional dependency that is not installed."""
    return InputError(
        f"reading this file needs the package {package}, which is not installed",
        cure=f"install it with: pip install 'schuler[{extra}]'",
        where=str(path),
    )


def damaged(path: Path, title: str, error: Exception) -> InputError:
    """Return the error for a file that its reader could not follow to the end."""
    lines = str(error).splitlines() or [""]
    reason = f"{type(error).__name__}: {lines[0][:80]}".rstrip(": ")
    return InputError(
        f"the file is cut short or damaged ({reason})",
        expected=f"a complete file of {title}",
        cure="copy it again",
        where=str(path),
    )
