"""Profiles: what a user says about the files of his logger, once, in a file of YAML."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, Literal

from schuler.data import GnssRecording, ImuRecording
from schuler.data.table import write_text
from schuler.data.yaml_file import read_yaml
from schuler.errors import InputError
from schuler.io.options import ReadOptions

Kind = Literal["imu", "gnss"]
_HEAD = "# How schuler reads the files of a logger; see `schuler read --help`.\n"
_TAKEN = re.compile(r"(?P<what>gyro|accel|time) taken as (?P<unit>[^\s:,;]+)")


def load_profile(path: str | Path, kind: Kind) -> dict[str, Any]:
    """Return the options of a profile for a file of an IMU or of a receiver."""
    file = Path(path)
    content = read_yaml(file, "a profile of a logger")
    if not isinstance(content, dict) or not set(content) <= {"imu", "gnss"}:
        raise InputError(
            "this is no profile",
            expected="'imu:' and 'gnss:' with options below them, as --save-profile writes them",
            where=str(file),
        )
    options = content.get(kind) or {}
    known = {f.name for f in fields(ReadOptions)}
    given = options if isinstance(options, dict) else {"options": options}
    wrong = sorted(str(key) for key in set(given) - known)
    if wrong:
        raise InputError(
            f"the profile has no option '{wrong[0]}'",
            expected=f"out of {', '.join(sorted(known))}",
            where=f"{file}, {kind}",
        )
    return dict(given)


def save_profile(
    path: str | Path,
    kind: Kind,
    options: Mapping[str, Any],
    recording: ImuRecording | GnssRecording,
) -> None:
    """Write what was said about a file, and the units that were taken for granted with it."""
    import yaml

    file = Path(path)
    content: dict[str, Any] = {}
    if file.exists():
        other: Kind = "gnss" if kind == "imu" else "imu"
        kept = load_profile(file, other)
        content = {other: kept} if kept else {}
    said = {k: _plain(v) for k, v in options.items() if v is not None}
    for line in recording.assumptions:
        match = _TAKEN.match(line)
        if match and match["unit"] != "the":
            said.setdefault(f"{match['what']}_unit", match["unit"])
    content[kind] = said
    write_text(file, _HEAD + yaml.safe_dump(content, sort_keys=True, allow_unicode=True))


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    return [_plain(v) for v in value] if isinstance(value, (tuple, list)) else value
