"""CPU of reading against the bare library, in one run and in turn: CSV, Parquet, MCAP, ULog.

    python -m benchmarks.reading [--mcap-minutes 10] [--ulog FILE]

Bars: CSV of 1 million rows of 7 and Parquet at most 2 times polars, MCAP at most 1.3 times
rosbags, ULog at most 1.3 times pyulog.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from schuler import ImuRecording, read_imu
from schuler.io.registry import recording_format

ROWS = 1_000_000
NAMES = ("time_s", *(f"gyro_{a}_rad_s" for a in "xyz"), *(f"accel_{a}_m_s2" for a in "xyz"))


def recording(rows: int, rate: float) -> ImuRecording:
    """Return noise of a sensor at rest."""
    rng = np.random.default_rng(1)
    gyro = 1e-3 * rng.standard_normal((rows, 3))
    accel = 0.02 * rng.standard_normal((rows, 3)) + np.array([0.0, 0.0, 9.8])
    return ImuRecording(np.arange(rows) / rate, gyro, accel)


def best(
    ours: Callable[[], object], theirs: Callable[[], object], times: int
) -> tuple[float, float]:
    """Return the least CPU seconds of each, run in turn."""
    found: list[list[float]] = [[], []]
    for _ in range(times):
        for k, work in enumerate((ours, theirs)):
            start = time.process_time()
            work()
            found[k].append(time.process_time() - start)
    return min(found[0]), min(found[1])


def report(name: str, pair: tuple[float, float], bar: float) -> None:
    """Print one line."""
    ratio = pair[0] / pair[1]
    print(f"{name:28s} {pair[0]:7.3f} {pair[1]:7.3f} CPU s  {ratio:5.2f}  (at most {bar})")


def bare_bag(path: Path) -> np.ndarray:  # type: ignore[type-arg]
    """Read every message of a bag into a table, with rosbags alone."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    rows = []
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, stamp, raw in reader.messages(connections=reader.connections):
            m = reader.deserialize(raw, connection.msgtype)
            w, f = m.angular_velocity, m.linear_acceleration
            rows.append((stamp * 1e-9, w.x, w.y, w.z, f.x, f.y, f.z))
    return np.array(rows)


def tables(folder: Path) -> None:
    """Measure CSV and Parquet."""
    import polars

    columns = dict(zip(NAMES, np.column_stack(
        [(r := recording(ROWS, 100.0)).time, r.gyro, r.accel]).T, strict=True))  # fmt: skip
    frame = polars.DataFrame({n: np.round(c, 9) for n, c in columns.items()})
    text, binary = folder / "a.csv", folder / "a.parquet"
    frame.write_csv(text)
    frame.write_parquet(binary)
    pair = best(lambda: read_imu(text), lambda: polars.read_csv(text).to_numpy(), 4)
    report(f"CSV, {ROWS} x 7", pair, 2.0)
    pair = best(lambda: read_imu(binary), lambda: polars.read_parquet(binary).to_numpy(), 6)
    report(f"Parquet, {ROWS} x 7", pair, 2.0)


def bag(folder: Path, minutes: float) -> None:
    """Measure MCAP at 100 Hz."""
    path = folder / "a.mcap"
    write = recording_format(".mcap").write_recording
    assert write is not None
    write(path, recording(round(6000 * minutes), 100.0))
    report(
        f"MCAP, {minutes:g} min at 100 Hz",
        best(lambda: read_imu(path), lambda: bare_bag(path), 2),
        1.3,
    )


def ulog(path: Path) -> None:
    """Measure ULog."""
    from pyulog import ULog

    pair = best(lambda: read_imu(path), lambda: ULog(str(path)), 3)
    report("ULog", pair, 1.3)
    pair = best(
        lambda: read_imu(path),
        lambda: ULog(str(path), message_name_filter_list=["sensor_combined"]),
        3,
    )
    report("ULog, one topic", pair, 1.3)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mcap-minutes", type=float, default=60.0)
    parser.add_argument("--ulog", type=Path)
    how = parser.parse_args()
    print(f"{'':28s}    ours    bare         ratio")
    with tempfile.TemporaryDirectory() as name:
        tables(Path(name))
        bag(Path(name), how.mcap_minutes)
    if how.ulog is not None:
        ulog(how.ulog)


if __name__ == "__main__":
    main()
