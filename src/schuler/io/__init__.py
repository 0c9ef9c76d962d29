"""Files in: `read_imu`, `read_gnss` and `read_sensor`, and behind them one `Format` a file format.

A format of your own is a `Format` named by an entry point of the group ``schuler.formats``.
"""

from schuler.io.format import Format, Start
from schuler.io.options import ReadOptions
from schuler.io.read import read_gnss, read_imu, read_imus, read_sensor
from schuler.io.source import MemorySource

__all__ = [
    "Format",
    "MemorySource",
    "ReadOptions",
    "Start",
    "read_gnss",
    "read_imu",
    "read_imus",
    "read_sensor",
]
