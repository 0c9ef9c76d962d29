"""Files a command writes: checked before the work starts, written together at its end."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from schuler.cli.console import MANNERS
from schuler.errors import InputError
from schuler.output_file import OutputFile

STDOUT = Path("-")


def json_text(value: Any) -> str:
    """Return JSON that every parser reads."""
    from schuler.data.to_dict import plain

    return json.dumps(plain(value), indent=2, allow_nan=False) + "\n"


class Outputs:
    """The files of one command.

    Parameters
    ----------
    *paths : Path or None
        Files that will be written; ``-`` is standard output, None is not wanted.
    inputs : iterable of Path
        Files that are read, which must not be overwritten.

    Raises
    ------
    InputError
        A folder that does not exist or cannot be written, a folder in place of a file, one file
        named twice, an input among the outputs, or a file that exists, unless --force was said.
    """

    def __init__(self, *paths: Path | None, inputs: Iterable[Path] = ()) -> None:
        self._claimed: dict[Path, OutputFile] = {}
        self._jobs: list[tuple[Path, Callable[[Path], None]]] = []
        self._spoken: list[str] = []
        read = tuple(inputs)
        for path in paths:
            if path is not None and path != STDOUT:
                self._claim(path, read)

    def _claim(self, path: Path, read: tuple[Path, ...] = ()) -> OutputFile:
        """Take a file for this run, so that a second run at the same file is told of it."""
        _check(path, read, self._claimed)
        found = OutputFile(path)
        if found.others and not found.special:
            found.release()
            raise InputError(
                "another run of schuler is about to write it",
                expected="another name, or that run at its end",
                where=str(path),
            )
        self._claimed[path] = found
        return found

    def text(self, path: Path | None, make: Callable[[], str]) -> None:
        """Add a file of text, or nothing when `path` is None."""
        if path is None:
            return
        content = make()
        if path == STDOUT:
            self._spoken.append(content)
        else:
            self.file(path, lambda temporary: _write(temporary, content))

    def file(self, path: Path | None, write: Callable[[Path], None]) -> None:
        """Add a file that a function writes, or nothing when `path` is None."""
        if path is not None:
            self._jobs.append((path, write))

    def commit(self) -> tuple[Path, ...]:
        """Write all files; none appears before all are complete."""
        try:
            for path, write in self._jobs:
                (self._claimed.get(path) or self._claim(path)).fill(write)
            for path, _ in self._jobs:
                self._claimed[path].publish()
        finally:
            for claimed in self._claimed.values():
                claimed.release()
        for content in self._spoken:
            sys.stdout.write(content)
        return tuple(path for path, _ in self._jobs)


def refuse_existing(path: Path) -> None:
    """Raise where a file would be lost."""
    if path.is_file() and not MANNERS.force:
        raise InputError(
            "exists already", expected="a new name, or --force to write over it",
            where=str(path),
        )  # fmt: skip


def _write(path: Path, content: str) -> None:
    # Names of files that are no Unicode stand in texts too.
    path.write_text(content, encoding="utf-8", errors="backslashreplace", newline="\n")


def _check(path: Path, read: Iterable[Path], seen: Iterable[Path]) -> None:
    if path.is_dir():
        raise InputError("is a folder", expected="a file to write", where=str(path))
    if not path.parent.is_dir():
        raise InputError(
            "its folder does not exist",
            expected="an existing folder that can be written",
            where=str(path),
        )
    if any(_same(path, other) for other in read):
        raise InputError("is also an input", expected="another name", where=str(path))
    refuse_existing(path)
    if any(_same(path, other) for other in seen) and (path.is_file() or not path.exists()):
        raise InputError("is named for two outputs", expected="two names", where=str(path))


def _same(one: Path, other: Path) -> bool:
    """Tell whether two names are of one file, through links of either kind."""
    if one.exists() and other.exists():
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)
