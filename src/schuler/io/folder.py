"""A folder in place of a file: the one recording of a kind in it."""

from __future__ import annotations

from pathlib import Path

from schuler.errors import InputError
from schuler.io.format import What
from schuler.io.registry import is_recording, suffixes


def file_in_folder(folder: Path, what: What) -> Path:
    """Find the one recording of a kind in a folder; the folder itself where it is one."""
    if is_recording(folder):
        return folder
    words = ("imu",) if what == "imu" else ("gnss", "gps")
    known = suffixes()
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in known)
    named = [p for p in files if p.stem.lower() in words]
    named = named or [p for p in files if any(w in p.stem.lower() for w in words)]
    if what == "gnss":
        named = named or [p for p in files if p.suffix.lower() == ".pos"]
    if not named and len(files) == 1:
        named = files
    if len(named) == 1:
        return named[0]
    shown = ", ".join(p.name for p in (named or files)[:10]) or "no files of a known format"
    raise InputError(
        f"the folder holds {'several candidates' if named else f'no {words[0]}.*'}: {shown}",
        expected=f"one file such as {words[0]}.parquet or {words[0]}.csv",
        cure="name the file itself",
        where=str(folder),
    )
