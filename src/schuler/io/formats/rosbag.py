"""ROS 1 and ROS 2 bags: sensor_msgs/Imu and sensor_msgs/NavSatFix, through `rosbags`.

`rosbags` is an optional dependency (``pip install 'schuler[ros]'``); ROS itself is not needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What, lacking
from schuler.io.source import MemorySource, even_parts
from schuler.io.trajectories.mcap import write_recording, write_trajectory

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_IMU = ("angular_velocity", "linear_acceleration")


def open_bag(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read one topic of a bag."""
    return next(bag_parts(path, what, options, None))


def bag_parts(
    path: Path, what: What, options: ReadOptions, rows: int | None
) -> Iterator[MemorySource]:
    """Yield one topic of a bag, so many messages at a time; None: all at once."""
    topic, clock = options.topic, options.clock
    if clock not in ("header", "bag"):
        raise InputError(f"clock is '{clock}'", expected="'header' or 'bag'")
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise lacking("rosbags", "ros", path) from None
    kind = "sensor_msgs/msg/Imu" if what == "imu" else "sensor_msgs/msg/NavSatFix"
    row = _imu_row if what == "imu" else _fix_row
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            connections = _choose(path, reader, kind, topic)
            messages = _messages(reader, connections, row)
            for first, stop in even_parts(sum(c.msgcount for c in connections), rows):
                table = np.array(list(islice(messages, stop - first)))
                source = _source(path, table, what, connections[0].topic, clock)
                yield source if rows is None else replace(source, first_row=first)
    except InputError:
        raise
    except Exception as error:  # rosbags, sqlite and struct raise many kinds for damaged bags
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError(
            f"the bag is cut short or damaged ({text[:80]})",
            expected="a complete ROS 1 or ROS 2 bag",
            cure="copy it again, or reindex it",
            where=str(path),
        ) from None


def _choose(path: Path, reader: Any, kind: str, topic: str | None) -> list[Any]:
    fitting = [c for c in reader.connections if c.msgtype == kind]
    topics = sorted({c.topic for c in fitting})
    short = kind.replace("/msg", "")
    if topic is not None:
        chosen = [c for c in fitting if c.topic == topic]
        if not chosen:
            raise InputError(
                f"no {short} on topic '{topic}'",
                expected=f"one of: {', '.join(topics) or 'none in this bag'}",
                where=str(path),
            )
        return chosen
    if not topics:
        there = sorted({f"{c.topic} ({c.msgtype.replace('/msg', '')})" for c in reader.connections})
        raise InputError(
            f"the bag has no topic of {short}",
            expected=f"one; it has {', '.join(there[:8]) or 'no topics'}",
            where=str(path),
        )
    if len(topics) > 1:
        raise InputError(
            f"the bag has {len(topics)} topics of {short}: {', '.join(topics)}",
            cure=f"choose one, such as topic='{topics[0]}'",
            where=str(path),
        )
    return fitting


def _messages(
    reader: Any, connections: list[Any], row: Callable[[Any], tuple[float, ...]]
) -> Iterator[tuple[float, ...]]:
    """Yield stamp of the header, stamp of the bag, and values of every message."""
    for connection, stamp, raw in reader.messages(connections=connections):
        message = reader.deserialize(raw, connection.msgtype)
        header = message.header.stamp
        yield header.sec + header.nanosec * 1e-9, stamp * 1e-9, *row(message)


def _imu_row(message: Any) -> tuple[float, ...]:
    w, f = message.angular_velocity, message.linear_acceleration
    return w.x, w.y, w.z, f.x, f.y, f.z


def _fix_row(message: Any) -> tuple[float, ...]:
    c = message.position_covariance  # east, north, up, row by row
    known = message.position_covariance_type > 0
    variances = (c[4], c[0], c[8]) if known else (np.nan,) * 3
    place = message.latitude, message.longitude, message.altitude
    return *place, *variances, float(message.status.status)


def _source(path: Path, table: Any, what: str, topic: str, clock: str) -> MemorySource:
    if not table.size:
        raise InputError(f"topic '{topic}' has no messages", where=str(path))
    history = [f"topic {topic}"]
    time = table[:, 0]
    if clock == "bag":
        time = table[:, 1]
        history.append("time of recording in the bag, as asked for")
    elif not time.any():
        time = table[:, 1]
        history.append("time of recording in the bag, as the headers hold no time")
    if what == "imu":
        names = [f"{s}_{a}" for s in ("gyro_{}_rad_s", "accel_{}_m_s2") for a in "xyz"]
        names = [f"gyro_{a}_rad_s" for a in "xyz"] + [f"accel_{a}_m_s2" for a in "xyz"]
        values = table[:, 2:]
    else:
        fix = table[:, 8] >= 0.0
        if not fix.all():
            history.append(f"left out {np.sum(~fix)} messages without a fix")
        table, time = table[fix], time[fix]
        if not table.size:
            raise InputError(f"no message on topic '{topic}' has a fix", where=str(path))
        names = ["latitude_deg", "longitude_deg", "height_m"]
        names += [f"pos_std_{a}_m" for a in ("north", "east", "down")]
        values = np.hstack([table[:, 2:5], np.sqrt(table[:, 5:8])])
    columns = {"time_s": time} | {n: values[:, k] for k, n in enumerate(names)}
    return MemorySource(path, columns, {}, None, tuple(history), row_word="message")


def _is_bag(start: Start) -> bool:
    return "metadata.yaml" in start.names


FORMATS = (
    Format(
        "mcap",
        "a ROS 1 or ROS 2 bag",
        (".bag", ".db3", ".mcap"),
        ("imu", "gnss"),
        magic=(b"#ROSBAG V", b"SQLite format 3\x00", b"\x89MCAP0\r\n"),
        detect=_is_bag,
        open=open_bag,
        parts=bag_parts,
        write_trajectory=write_trajectory,
        write_recording=write_recording,
        extra="ros",
    ),
)
