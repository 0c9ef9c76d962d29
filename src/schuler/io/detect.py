"""What format a file has: judged by its content first, by its name where content cannot tell."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from schuler.errors import InputError
from schuler.io.rtklib import is_pos
from schuler.io.source import existing_file
from schuler.io.text_layout import head

Format = Literal["text", "parquet", "npz", "pos", "bag"]

_MAGIC: tuple[tuple[bytes, Format], ...] = (
    (b"PAR1", "parquet"),
    (b"PK\x03\x04", "npz"),
    (b"#ROSBAG V", "bag"),
    (b"SQLite format 3\x00", "bag"),
    (b"\x89MCAP0\r\n", "bag"),
)
_SUFFIXES: dict[str, tuple[str, bytes]] = {
    ".parquet": ("a Parquet file", b"PAR1"),
    ".npz": ("an NPZ archive", b"PK"),
    ".bag": ("a ROS 1 bag", b"#ROSBAG"),
    ".db3": ("a ROS 2 bag (SQLite)", b"SQLite"),
    ".mcap": ("a ROS 2 bag (MCAP)", b"\x89MCAP"),
}


def detect_format(path: Path) -> Format:
    """Find the format of a file."""
    if path.is_dir() and (path / "metadata.yaml").exists():
        return "bag"
    existing_file(path)
    with path.open("rb") as stream:
        start = stream.read(64)
    for magic, name in _MAGIC:
        if start.startswith(magic):
            return name
    claimed = _SUFFIXES.get(path.suffix.lower())
    if claimed is not None:
        raise InputError(
            f"the name says {claimed[0]}, the content does not",
            expected=f"a file that begins with {claimed[1]!r}",
            cure="check that the copy was complete, or rename the file",
            where=str(path),
        )
    return "pos" if is_pos(head(path)) else "text"


def file_in_folder(folder: Path, what: Literal["imu", "gnss"]) -> Path:
    """Find the one recording of a kind in a folder."""
    if (folder / "metadata.yaml").exists():
        return folder
    words = ("imu",) if what == "imu" else ("gnss", "gps")
    kinds = {".parquet", ".csv", ".txt", ".npz", ".pos", ".bag", ".db3", ".mcap", ".tsv", ".dat"}
    files = sorted(p for p in folder.iterdir() if p.suffix.lower() in kinds)
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
