"""Where a result came from: versions, files with their digests, command line, date, seeds."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from schuler.data.to_dict import ToDict
from schuler.errors import InputError


@dataclass(frozen=True, slots=True)
class InputFile:
    """A file that went into a result."""

    name: str  # name without folder
    size: int  # bytes
    sha256: str  # digest of the content


@dataclass(frozen=True, slots=True)
class Provenance(ToDict):
    """What a result depends on."""

    version: str  # version of this package
    python: str  # version of Python and the kind of machine
    created: str  # local date and time with the offset to UTC
    command: str = ""  # command line, empty when called from Python
    inputs: tuple[InputFile, ...] = ()  # files
    seeds: Mapping[str, int] = field(default_factory=dict)  # seeds of everything that was drawn
    settings: Mapping[str, Any] = field(default_factory=dict)  # options, as plain JSON values


def digest_file(path: str | Path) -> InputFile:
    """Return name, size and SHA-256 of a file."""
    file = Path(path)
    try:
        with file.open("rb") as stream:
            digest = hashlib.file_digest(stream, "sha256").hexdigest()
        return InputFile(file.name, file.stat().st_size, digest)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(file)) from None


def record_provenance(
    *,
    command: str = "",
    inputs: Iterable[str | Path] = (),
    seeds: Mapping[str, int] | None = None,
    settings: Mapping[str, Any] | None = None,
) -> Provenance:
    """Record what a result made here and now depends on."""
    from schuler import __version__

    files: list[Path] = []
    for item in map(Path, inputs):
        files += sorted(p for p in item.iterdir() if p.is_file()) if item.is_dir() else [item]
    return Provenance(
        version=__version__,
        python=f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        created=datetime.now().astimezone().isoformat(sep=" ", timespec="seconds"),
        command=command,
        inputs=tuple(digest_file(p) for p in files),
        seeds=dict(seeds or {}),
        settings=dict(settings or {}),
    )
