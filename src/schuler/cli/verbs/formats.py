"""`schuler formats`: every format that is read and written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from schuler.io.format import Format

_HELD = {"imu": "IMU", "gnss": "GNSS", "sensor": "sensors"}


def formats(*, json: Path | None = None) -> int:
    """List the formats of files that are read and written.

    Example: `schuler formats`

    Parameters
    ----------
    json : Path, optional
        Write the list here; - for standard output.
    """
    from schuler.cli.console import Screen
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.io.registry import formats as known

    found = known()
    outputs = Outputs(json)
    outputs.text(json, lambda: json_text({"formats": [_entry(f) for f in found]}))
    written = outputs.commit()
    screen = Screen(json_on_stdout=json == STDOUT)
    rows = [
        (
            one.name,
            one.title,
            " ".join(one.suffixes),
            ", ".join(_HELD[h] for h in one.holds),
            ", ".join(_written(one)),
            f"pip install 'schuler[{one.extra}]'" if one.extra else "",
        )
        for one in found
    ]
    screen.table(("format", "what", "endings", "read as", "written", "needs"), rows, words=6)
    screen.line("Files are recognised by their content, whatever their names.", "dim")
    for path in written:
        screen.line(f"wrote {path}", "dim")
    return 0


def _written(one: Format) -> list[str]:
    kinds = (
        ("trajectory", one.write_trajectory),
        ("recording", one.write_recording),
        ("noise", one.write_noise),
    )
    return [word for word, writer in kinds if writer is not None]


def _entry(one: Format) -> dict[str, Any]:
    return {
        "name": one.name,
        "title": one.title,
        "endings": list(one.suffixes),
        "reads": list(one.holds),
        "writes": _written(one),
        "extra": one.extra,
    }
