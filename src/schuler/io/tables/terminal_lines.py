"""Lines that a terminal has stamped: '[12:34:56.789] 0.1, 0.2' and '12:34:56.789 -> 0.1, 0.2'."""

from __future__ import annotations

import re

from schuler.io.columns import find_columns
from schuler.io.tables.content import Content
from schuler.io.tables.fields import is_number, split_all

_CLOCK = r"(?:\d{4}-\d\d-\d\d[T ])?\d\d?:\d\d:\d\d(?:[.,]\d+)?"
_STAMP = re.compile(
    rf"[ \t]*(?:\[(?P<inside>{_CLOCK})\]|(?P<bare>{_CLOCK})[ \t]*->)[ \t]*[,;:]?[ \t]*"
)
_LOOKED_AT = 200


def without_terminal_stamps(content: Content) -> Content:
    """Return the text with the stamps of the terminal in a column of their own."""
    opening = content.head(1 << 14)[0].decode("utf-8-sig", errors="replace").split("\n")[:-1]
    opening = [x for x in opening if x.strip()][:_LOOKED_AT]
    stamped = [x for x in opening if _STAMP.match(x)]
    if len(stamped) < 3 or len(stamped) < 0.6 * len(opening):
        return content
    rest = _STAMP.sub("", stamped[-1], count=1).strip()
    delimiter = next((d for d in "\t;,|" if d in rest), " ")
    lines = content.whole().decode("utf-8-sig", errors="replace").splitlines()
    out = [_line(x, delimiter, len(split_all(rest, delimiter))) for x in lines]
    note = "taken as time of arrival: the stamps that a terminal put in front of the lines"
    return Content(content.path, ("\n".join(out) + "\n").encode(), (*content.notes, note))


def _line(line: str, delimiter: str, width: int) -> str:
    """Return a line with its stamp as first field; a header gets a name for it."""
    match = _STAMP.match(line)
    text = line if match is None else line[match.end() :]
    fields = split_all(text, delimiter)
    if len(fields) == width and not any(is_number(f, True) for f in fields):
        # a clock of the sensor is better than that of the terminal
        name = "terminal" if "time" in find_columns(fields, {}, {}) else "time"
        return f"{name}{delimiter}{text}"
    if match is None:
        return line
    stamp = (match["inside"] or match["bare"]).replace(" ", "T").replace(",", ".")
    return f"{stamp}{delimiter}{text}"
