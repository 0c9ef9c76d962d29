"""Files a command writes: checked before the work starts, written together at its end."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from schuler.errors import InputError

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
        named twice, or an input among the outputs.
    """

    def __init__(self, *paths: Path | None, inputs: Iterable[Path] = ()) -> None:
        self._jobs: list[tuple[Path, Callable[[Path], None]]] = []
        self._spoken: list[str] = []
        read = {p.resolve() for p in inputs}
        seen: set[Path] = set()
        for path in paths:
            if path is not None and path != STDOUT:
                _check(path, read, seen)
                seen.add(path.resolve())

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
        self._write_from(0)
        for content in self._spoken:
            sys.stdout.write(content)
        return tuple(path for path, _ in self._jobs)

    def _write_from(self, k: int) -> None:
        from schuler.data.table import write_atomically

        if k == len(self._jobs):
            return
        path, write = self._jobs[k]

        def write_and_go_on(temporary: Path) -> None:
            write(temporary)
            self._write_from(k + 1)

        write_atomically(path, write_and_go_on)


def _write(path: Path, content: str) -> None:
    path.write_text(content, encoding="utf-8", newline="\n")


def _check(path: Path, read: set[Path], seen: set[Path]) -> None:
    if path.is_dir():
        raise InputError("is a folder", expected="a file to write", where=str(path))
    folder = path.parent
    if not folder.is_dir():
        raise InputError(
            "its folder does not exist",
            expected="an existing folder that can be written",
            where=str(path),
        )
    if not os.access(folder, os.W_OK):
        raise InputError("its folder cannot be written", where=str(path))
    if path.resolve() in read:
        raise InputError("is also an input", expected="another name", where=str(path))
    if path.resolve() in seen:
        raise InputError("is named for two outputs", expected="two names", where=str(path))
