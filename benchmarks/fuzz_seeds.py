"""Small sound files of every format, which the fuzzing damages."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from schuler import GnssRecording, ImuRecording, NoiseModel
from schuler.io.formats.novatel import checksum
from schuler.io.registry import formats

N = 60
TIME = 1000.0 + np.arange(N) / 50.0
_RNG = np.random.default_rng(1)
GYRO = 0.1 * np.sin(TIME[:, None] * (1.0, 0.7, 1.3)) + 1e-3 * _RNG.normal(size=(N, 3))
ACCEL = np.array([0.3, -0.4, -9.79]) + 0.02 * _RNG.normal(size=(N, 3))
IMU = ImuRecording(TIME, GYRO, ACCEL)
_PLACE = np.radians([48.1, 11.5, 0.0]) + np.arange(N)[:, None] * (1.887e-8, 4.22e-8, -2e-3)
GNSS = GnssRecording(
    TIME,
    np.add(_PLACE, (0.0, 0.0, 520.0)),
    velocity=np.tile((6.0, 9.0, 0.1), (N, 1)),
    position_sd=np.full((N, 3), 0.5),
    velocity_sd=np.full((N, 3), 0.1),
)
TRACK = {"time_s": TIME, "latitude_deg": np.degrees(_PLACE[:, 0]),
         "longitude_deg": np.degrees(_PLACE[:, 1]), "height_m": 520.0 + _PLACE[:, 2]}  # fmt: skip
TRACK |= {f"vel_{a}_m_s": np.full(N, v) for a, v in (("north", 6.0), ("east", 9.0), ("down", 0.1))}
TRACK |= {f"{a}_deg": np.full(N, 1.0) for a in ("roll", "pitch", "heading")}
TRACK |= {
    f"{quantity}_std_{axis}_{unit}": np.full(N, 0.1)
    for quantity, unit in (("pos", "m"), ("vel", "m_s"), ("att", "deg"))
    for axis in ("north", "east", "down")
}
NOISE = """source: made
rate: 100 Hz
channels:
  gyro_x:
    - white_noise: {density: 0.2 +- 0.01 deg/sqrt(h)}
    - gauss_markov: {sigma: 1.5e-4 rad/s, correlation_time: 120 s}
  accel_z:
    - random_walk: {density: 1e-4}
excluded:
  gyro_x: {random_walk.density: 1e-6}
effects:
  gyro_x:
    - {of: temperature, term: linear, coefficient: 1e-5 +- 1e-6, reference: 25.0}
"""
MOUNTING = """kind: schuler mounting
imus:
  - {name: a, roll_pitch_yaw_deg: [0, 0, 90], position_m: [0.1, 0, 0]}
  - {name: b, rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
"""
PROFILE = "imu: {gyro_unit: deg/s, columns: {time: t, gyro: [a, b, c]}, rate: 100.0}\ngnss: {}\n"
JOB = "- simulate: drive\n  duration: 30\n- navigate: drive\n  smooth: true\n  out: a.csv\n"


def seeds() -> dict[str, bytes]:
    """Return sound files by name; the ending tells the format."""
    found = dict(_written())
    found |= {"a.npz": _npz(), "a.jsonl": _json_lines(), "a.ubx": _ubx(), "a.ulg": _ulog(),
              "a.BIN": _dataflash(), "novatel.bin": _novatel(), "a.mat": _matlab(),
              "newer.mat": _hdf5()}  # fmt: skip
    found |= {"kf.txt": _table("", np.column_stack([TIME, GYRO * 0.02, ACCEL * 0.02]), " ")}
    found |= dict(_loggers()) | dict(_bags())
    found |= {"noise.yaml": NOISE.encode(), "mounting.yaml": MOUNTING.encode(),
              "profile.yaml": PROFILE.encode(), "job.yaml": JOB.encode()}  # fmt: skip
    found |= dict(_calibrations())
    return found


def _written() -> Iterator[tuple[str, bytes]]:
    """Everything that this package writes itself."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "file"
        for form in formats():
            # The first ending of bags is that of ROS 1, and their reader goes by it.
            ending = ".mcap" if form.name == "mcap" else (form.suffixes or ("",))[0]
            jobs = []
            if form.write_recording is not None:
                jobs += [("imu", lambda p, f=form: f.write_recording(p, IMU)),
                         ("gnss", lambda p, f=form: f.write_recording(p, GNSS))]  # fmt: skip
            if form.write_trajectory is not None:
                jobs.append(("track", lambda p, f=form: f.write_trajectory(p, TRACK)))
            for name, write in jobs:
                write(path)
                yield f"{form.name}-{name}{ending}", path.read_bytes()
                path.unlink()


def _npz() -> bytes:
    stream = io.BytesIO()
    np.savez(stream, time_s=TIME, gyro_rad_s=GYRO, accel_m_s2=ACCEL, rate=50.0)
    return stream.getvalue()


def _matlab() -> bytes:
    from scipy.io import savemat

    stream = io.BytesIO()
    savemat(stream, {"imu": {"t": TIME, "wb": GYRO, "fb": ACCEL, "freq": 50.0}})
    return stream.getvalue()


def _hdf5() -> bytes:
    import h5py

    stream = io.BytesIO()
    with h5py.File(stream, "w", userblock_size=512) as file:
        group = file.create_group("imu")
        for name, values in (("t", TIME[np.newaxis]), ("wb", GYRO.T), ("fb", ACCEL.T)):
            group[name] = values
    content = bytearray(stream.getvalue())
    content[:19] = b"MATLAB 7.3 MAT-file"
    return bytes(content)


def _json_lines() -> bytes:
    rows = zip(TIME, GYRO, ACCEL, strict=True)
    lines = [json.dumps({"t": t, "gyro": list(w), "acc": list(f)}) for t, w, f in rows]
    return "\n".join(lines).encode()


def _table(head: str, rows: np.ndarray, mark: str) -> bytes:
    lines = [mark.join(f"{x:.9g}" for x in r) for r in rows]
    return "\n".join([head, *lines] if head else lines).encode()


def _loggers() -> Iterator[tuple[str, bytes]]:
    both = np.column_stack([ACCEL, GYRO])
    names = [f"{a} Accel [x8004]" for a in "XYZ"] + [f"{a} Gyro [x8005]" for a in "XYZ"]
    head = "DATA_START\nGPS TFlags,GPS Week,GPS TOW," + ",".join(names)
    ones = np.ones(N)
    yield "microstrain.csv", _table(head, np.column_stack([7 * ones, 2300 * ones, TIME, both]), ",")
    head = "// Update Rate: 50.0Hz\nPacketCounter\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z"
    yield "xsens.txt", _table(head, np.column_stack([65500 + np.arange(N), both]), "\t")
    head = ",".join(["TimeStartup", *(f"Uncomp{s}{a}" for s in ("Accel", "Gyro") for a in "XYZ")])
    yield "vectornav.csv", _table(head, np.column_stack([1e9 * TIME, both]), ",")
    rows = [f"{s},{int(1e9 * t)},{x[0]:.6g},{x[1]:.6g},{x[2]:.6g}" for k, t in enumerate(TIME)
            for s, x in (("ACC", ACCEL[k]), ("GYR", GYRO[k]))]  # fmt: skip
    yield "long.csv", ("sensor,time_ns,x,y,z\n" + "\n".join(rows)).encode()
    rows = [",".join([f"{t:.2f} s", *(f"{x:.6f} rad/s" for x in w), *(f"{x:.5f}m/s^2" for x in f)])
            for t, w, f in zip(TIME, GYRO, ACCEL, strict=True)]  # fmt: skip
    yield "units.csv", ("time,gx,gy,gz,ax,ay,az\n" + "\n".join(rows)).encode()
    fixes = [f"Fix,GPS,{48.1 + k * 1e-5},11.5,520.0,5.0,3.0,{10**12 + 1000 * k},0.5,10.0"
             for k in range(N)]  # fmt: skip
    names = ["LatitudeDegrees", "LongitudeDegrees", "AltitudeMeters", "SpeedMps", "AccuracyMeters",
             "UnixTimeMillis", "SpeedAccuracyMps", "BearingDegrees"]  # fmt: skip
    head = ",".join(["# Fix,Provider", *names])
    yield "gnss_log.txt", "\n".join([head, *fixes]).encode()


def _ubx() -> bytes:
    def message(kind: int, payload: bytes) -> bytes:
        body = struct.pack(">H", kind) + struct.pack("<H", len(payload)) + payload
        a = b = 0
        for byte in body:
            a = (a + byte) & 255
            b = (b + a) & 255
        return b"\xb5b" + body + bytes((a, b))

    data = b""
    for k, t in enumerate(TIME):
        codes = ((14, 0, 2.0**12), (13, 1, 2.0**12), (5, 2, 2.0**12),
                 (16, 3, 2.0**10), (17, 4, 2.0**10), (18, 5, 2.0**10))  # fmt: skip
        values = [*np.degrees(GYRO[k]), *ACCEL[k]]
        words = [(c << 24) | (round(values[j] * s) & 0xFFFFFF) for c, j, s in codes]
        tags = b"".join(struct.pack("<LL", w, round(t / 2.56e-5)) for w in words)
        data += message(0x1003, bytes(4) + tags)
        if k % 10 == 0:
            fix = struct.pack("<L", round(t * 1e3)) + bytes(16) + b"\x03\x01\x00\x0c"
            fix += struct.pack("<ll", 115000000, 481000000) + bytes(60)
            data += message(0x0107, fix)
    return data


def _ulog() -> bytes:
    def message(kind: bytes, payload: bytes) -> bytes:
        return struct.pack("<Hc", len(payload), kind) + payload

    fields = (b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
              b"int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;"
              b"uint32_t accelerometer_integral_dt;")  # fmt: skip
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000)
    data += message(b"F", fields) + message(b"A", struct.pack("<BH", 0, 7) + b"sensor_combined")
    for k, t in enumerate(TIME):
        row = struct.pack("<HQ3fIi3fI", 7, round(t * 1e6), *GYRO[k], 20000, 0, *ACCEL[k], 20000)
        data += message(b"D", row)
    return data


def _dataflash() -> bytes:
    kinds = {
        128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"),
        131: ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "<QBffffff"),
        132: ("GPS", "QBBLLefff", "TimeUS,I,Status,Lat,Lng,Alt,Spd,GCrs,VZ", "<QBBiiifff"),
    }
    data = b""
    for kind, (name, letters, labels, form) in kinds.items():
        row = (kind, struct.calcsize(form) + 3, name.encode(), letters.encode(), labels.encode())
        data += b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", *row)
    for k, t in enumerate(TIME):
        data += b"\xa3\x95\x83" + struct.pack("<QBffffff", int(t * 1e6), 0, *GYRO[k], *ACCEL[k])
        if k % 10 == 0:
            row = (int(t * 1e6), 0, 6, 481000000 + k, 115000000, 52000, 1.1, 0.0, 0.0)
            data += b"\xa3\x95\x84" + struct.pack("<QBBiiifff", *row)
    return data


def _novatel() -> bytes:
    data = b""
    for k, t in enumerate(TIME):
        body = struct.pack("<Ld6d", 2300, t, *(GYRO[k] * 0.02), *(ACCEL[k] * 0.02))
        head = struct.pack("<3sBHHL", b"\xaa\x44\x13", len(body), 813, 2300, 0)
        data += head + body + struct.pack("<L", checksum(head + body))
    return data


def _bags() -> Iterator[tuple[str, bytes]]:
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    with TemporaryDirectory() as folder:
        for old in (True, False):
            store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
            kinds, name = store.types, Path(folder) / ("one.bag" if old else "two")
            sqlite = rosbag2.StoragePlugin.SQLITE3
            writer = (
                rosbag1.Writer(name)
                if old
                else rosbag2.Writer(name, version=9, storage_plugin=sqlite)
            )
            vector = kinds["geometry_msgs/msg/Vector3"]
            with writer:
                line = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
                for k, t in enumerate(TIME):
                    stamp = kinds["builtin_interfaces/msg/Time"](int(t), int(t % 1 * 1e9))
                    extra = {"seq": k} if old else {}
                    message = kinds["sensor_msgs/msg/Imu"](
                        kinds["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **extra),
                        kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), np.zeros(9),
                        vector(*GYRO[k]), np.zeros(9), vector(*ACCEL[k]), np.zeros(9),
                    )  # fmt: skip
                    pack = store.serialize_ros1 if old else store.serialize_cdr
                    writer.write(line, int(t * 1e9), pack(message, "sensor_msgs/msg/Imu"))
        yield "a.bag", (Path(folder) / "one.bag").read_bytes()
        yield "a.db3", next((Path(folder) / "two").glob("*.db3")).read_bytes()


def _calibrations() -> Iterator[tuple[str, bytes]]:
    """The files that calibrations save, from the fields of their classes."""
    from dataclasses import fields

    from schuler import ArrayCalibration, ImuCalibration

    for name, kind in (
        ("array_calibration", ArrayCalibration),
        ("imu_calibration", ImuCalibration),
    ):
        lines = [f"kind: {__import__(kind.__module__, fromlist=['x']).FILE_KIND}", "version: 1"]
        lines += [
            f"{f.name}: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]" for f in fields(kind)
        ]
        yield f"{name}.yaml", "\n".join(lines).encode()


def noise_of(path: Path) -> NoiseModel:
    """Load and use a noise model, as every reader of one does."""
    model = NoiseModel.load(path)
    model.to_yaml()
    return model
