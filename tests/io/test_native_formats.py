"""Formats of receivers, autopilots and loggers, against other readers or their description."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from schuler.errors import InputError
from schuler.io import read_gnss, read_imu
from schuler.io.formats.decoder_process import decoded_apart
from schuler.io.formats.novatel import checksum
from schuler.io.registry import format_of

DATA = os.environ.get("SCHULER_DATA")
SAMPLES = Path(DATA).parent / "samples" if DATA else Path("samples")
needs_samples = pytest.mark.skipif(not SAMPLES.is_dir(), reason="no samples of receivers here")
N = 400
TIME = np.arange(N) / 100.0
RNG = np.random.default_rng(5)
GYRO = 0.1 * np.sin(TIME[:, np.newaxis] * (1.0, 0.7, 1.3)) + 1e-3 * RNG.standard_normal((N, 3))
ACCEL = np.array([0.3, -0.4, -9.79]) + 0.02 * RNG.standard_normal((N, 3))


def close(path: Path, gyro: float = 1e-6, accel: float = 1e-6, **how: Any) -> Any:
    imu = read_imu(path, **how)
    assert imu.size == N
    assert np.abs(imu.gyro - GYRO).max() < gyro
    assert np.abs(imu.accel - ACCEL).max() < accel
    assert np.abs(imu.time - imu.time[0] - TIME).max() < 2e-6
    return imu


# --- ULog, UBX, NMEA, NovAtel, GnssLogger: real files, independent readers ----------------------


@needs_samples
def test_ulog_is_what_pyulog_reads() -> None:
    pyulog = pytest.importorskip("pyulog")
    path = SAMPLES / "px4_sample_log_small.ulg"
    log = {d.name: d.data for d in pyulog.ULog(str(path)).data_list}
    imu, gnss = read_imu(path), read_gnss(path)
    assert np.array_equal(imu.gyro[:, 1], log["sensor_combined"]["gyro_rad[1]"])
    assert np.array_equal(imu.time, log["sensor_combined"]["timestamp"] * 1e-6)
    assert gnss.size == 32
    known = log["vehicle_gps_position"]
    assert np.allclose(np.degrees(gnss.position[:, 0]), known["lat"] * 1e-7, atol=1e-9)


@needs_samples
@pytest.mark.parametrize(
    ("name", "identity", "count"),
    [("ublox_mixed.ubx", "NAV-PVT", 39), ("ublox_sf_calibration.ubx", "NAV-PVAT", 527)],
)
def test_ubx_is_what_pyubx2_reads(name: str, identity: str, count: int) -> None:
    pyubx2 = pytest.importorskip("pyubx2")
    path = SAMPLES / name
    gnss = read_gnss(path)
    assert gnss.size == count
    with path.open("rb") as stream:
        reader = pyubx2.UBXReader(stream, protfilter=2, quitonerror=0)
        known = [m for _, m in reader if getattr(m, "identity", "") == identity]
    assert np.allclose(np.degrees(gnss.position[:, 1]), [m.lon for m in known], atol=1e-9)
    assert np.allclose(gnss.position[:, 2], [m.height * 1e-3 for m in known])
    assert gnss.velocity is not None
    assert np.allclose(gnss.velocity[:, 0], [m.velN * 1e-3 for m in known])
    assert np.allclose(gnss.time, [m.iTOW * 1e-3 for m in known])


@needs_samples
def test_nmea_is_what_pynmeagps_reads() -> None:
    pynmeagps = pytest.importorskip("pynmeagps")
    path = SAMPLES / "ublox_f9k_drive_first400k.nmea"
    gnss = read_gnss(path)
    with path.open("rb") as stream:
        reader = pynmeagps.NMEAReader(stream, quitonerror=0)
        known = [m for _, m in reader if getattr(m, "msgID", "") == "GGA" and m.quality]
    assert gnss.size == 230
    assert abs(len(known) - 230) <= 1  # the last sentence is cut
    assert np.allclose(np.degrees(gnss.position[:, 0]), [m.lat for m in known[:230]], atol=1e-8)
    assert np.allclose(gnss.position[:, 2], [m.alt + m.sep for m in known[:230]])


@needs_samples
def test_novatel_and_gnss_logger_samples() -> None:
    gnss = read_gnss(SAMPLES / "novatel_BESTPOS.GPS")
    assert gnss.size == 1  # one epoch, written a thousand times
    assert np.degrees(gnss.position[0, 0]) == pytest.approx(51.11637049360, abs=1e-10)
    assert gnss.position[0, 2] == pytest.approx(1059.7447 - 16.9)
    assert np.allclose(gnss.position_sd[0], [1.8736, 1.5644, 2.8763])
    assert any("999" in line for line in gnss.assumptions)
    phone = read_gnss(SAMPLES / "android_pixel6.txt")
    assert phone.size == 94
    assert "provider GPS" in phone.assumptions[0]


# --- files made from the public description of their format -------------------------------------


def novatel_log(number: int, body: bytes, week: int, milliseconds: int) -> bytes:
    head = struct.pack("<3sBHHL", b"\xaa\x44\x13", len(body), number, week, milliseconds)
    return head + body + struct.pack("<L", checksum(head + body))


def test_novatel_binary_increments_and_counts(tmp_path: Path) -> None:
    corrected, raw = b"", b""
    for k, t in enumerate(TIME):
        seconds = 1000.0 + t
        step = (*(GYRO[k] * 0.01), *(ACCEL[k] * 0.01))
        corrected += novatel_log(813, struct.pack("<Ld6d", 2300, seconds, *step), 2300, 0)
        counts = np.round(np.array(step) * 2.0**30).astype(int)
        order = (counts[5], -counts[4], counts[3], counts[2], -counts[1], counts[0])
        raw += novatel_log(325, struct.pack("<LdL6l", 2300, seconds, 0, *order), 2300, 0)
    path = tmp_path / "a.bin"
    path.write_bytes(corrected)
    assert format_of(path).name == "novatel"
    close(path, 1e-9, 1e-9)
    path.write_bytes(raw[:-7] + b"\xaa\x44")  # cut in the last log
    with pytest.raises(InputError, match=r"scale depends on the IMU.*gyro_unit="):
        read_imu(path)
    imu = read_imu(path, gyro_unit="LSB 1073741824/rad", accel_unit="LSB 1073741824/(m/s)")
    assert imu.size == N - 1
    assert np.abs(imu.gyro - GYRO[:-1]).max() < 1e-6


def dataflash(path: Path, with_text: bool = False) -> None:
    """Two IMUs and a GPS, as the messages FMT of ArduPilot describe them."""
    kinds = {
        128: ("FMT", "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"),
        131: ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "<QBffffff"),
        132: ("GPS", "QBBLLefff", "TimeUS,I,Status,Lat,Lng,Alt,Spd,GCrs,VZ", "<QBBiiifff"),
    }
    data, text = b"", []
    for kind, (name, letters, labels, form) in kinds.items():
        size = struct.calcsize(form) + 3
        fields = (kind, size, name.encode(), letters.encode(), labels.encode())
        data += b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", *fields)
        text.append(f"FMT, {kind}, {size}, {name}, {letters}, {labels}")
    text = [text[0], *text]  # real logs describe dozens
    text.append("FMT, 140, 8, XXX, B, A")
    for k, t in enumerate(TIME):
        for number in (0, 1):
            row = (int(t * 1e6), number, *(GYRO[k] + 0.1 * number), *ACCEL[k])
            data += b"\xa3\x95\x83" + struct.pack("<QBffffff", *row)
            text.append("IMU, " + ", ".join(f"{x:.9g}" for x in row))
        if k % 20 == 0:
            row = (
                int(t * 1e6),
                0,
                6,
                round((48.1 + t * 1e-5) * 1e7),
                115000000,
                52000,
                1.11,
                0.0,
                0.0,
            )
            data += b"\xa3\x95\x84" + struct.pack("<QBBiiifff", *row)
            text.append(
                "GPS, " + ", ".join(map(str, (*row[:3], row[3] / 1e7, 11.5, 520, *row[6:])))
            )
        if k == 50:
            data += b"\x00\xff\xa3"  # a byte lost on the card
    path.write_bytes("\n".join(text).encode() + b"\n" if with_text else data)


@pytest.mark.parametrize("with_text", [False, True])
def test_dataflash_binary_and_text(tmp_path: Path, with_text: bool) -> None:
    path = tmp_path / ("a.log" if with_text else "00000001.BIN")
    dataflash(path, with_text)
    assert format_of(path).name == ("dataflash-text" if with_text else "dataflash")
    close(path, 1e-6, 1e-5)
    second = read_imu(path, imu=1)
    assert np.abs(second.gyro - GYRO - 0.1).max() < 1e-6
    gnss = read_gnss(path)
    assert gnss.size == 20
    assert np.degrees(gnss.position[0]) == pytest.approx([48.1, 11.5, np.degrees(520.0)])
    assert gnss.quality is not None
    assert set(gnss.quality) == {1}


def ubx(kind: int, payload: bytes) -> bytes:
    body = struct.pack(">H", kind) + struct.pack("<H", len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 255
        b = (b + a) & 255
    return b"\xb5b" + body + bytes((a, b))


@pytest.mark.parametrize("raw", [True, False])
def test_ubx_sensor_messages(tmp_path: Path, raw: bool) -> None:
    codes = ((14, 0, 2.0**12), (13, 1, 2.0**12), (5, 2, 2.0**12),
             (16, 3, 2.0**10), (17, 4, 2.0**10), (18, 5, 2.0**10))  # fmt: skip
    values = np.hstack([np.degrees(GYRO), ACCEL])
    data = b"$GPTXT,noise*00\r\n"
    for k, t in enumerate(TIME):
        words = [
            (code << 24) | (round(values[k, c] * scale) & 0xFFFFFF) for code, c, scale in codes
        ]
        if raw:
            tag = round(t / 2.56e-5)
            payload = bytes(4) + b"".join(struct.pack("<LL", w, tag) for w in words)
        else:
            payload = struct.pack("<LHH", round(t * 1e3), 6 << 11, 0)
            payload += b"".join(struct.pack("<L", w) for w in words)
        data += ubx(0x1003 if raw else 0x1002, payload)
    path = tmp_path / "a.ubx"
    path.write_bytes(data)
    imu = read_imu(path)
    assert imu.size == N
    assert np.abs(imu.gyro - GYRO).max() < 1e-5
    assert np.abs(imu.accel - ACCEL).max() < 1e-3
    assert np.abs(imu.time - imu.time[0] - TIME).max() < 2e-5
    path.write_bytes(data.replace(ubx(0x0107, b"")[:2], b"\xb5c")[:3000])
    with pytest.raises(InputError):
        read_gnss(path)


def test_matlab_of_navego_and_psins(tmp_path: Path) -> None:
    scipy_io = pytest.importorskip("scipy.io")
    path = tmp_path / "a.mat"
    scipy_io.savemat(path, {"imu1": {"t": TIME, "wb": GYRO, "fb": ACCEL, "freq": 100.0}})
    close(path)
    scipy_io.savemat(path, {"imu": np.hstack([GYRO * 0.01, ACCEL * 0.01, TIME[:, np.newaxis]])})
    close(path)
    lat = np.radians(48.1) + 1e-6 * np.arange(20)
    gnss = {"t": np.arange(20.0), "lat": lat, "lon": np.full(20, 0.2), "h": np.full(20, 5.0),
            "stdm": [1.0, 1.0, 2.0]}  # fmt: skip
    scipy_io.savemat(path, {"gnss": gnss})
    read = read_gnss(path)
    assert np.allclose(read.position[:, 0], lat)
    assert np.allclose(read.position_sd[3], [1.0, 1.0, 2.0])
    path.write_bytes(path.read_bytes()[:900])
    with pytest.raises(InputError, match="cut short or damaged"):
        read_gnss(path)


def test_matlab_73(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("imu")
        for name, values in (("t", TIME[np.newaxis]), ("wb", GYRO.T), ("fb", ACCEL.T)):
            group[name] = values
    content = bytearray(path.read_bytes())
    content[:19] = b"MATLAB 7.3 MAT-file"
    path.write_bytes(bytes(content))
    close(path)


def kf_gins(path: Path) -> None:
    np.savetxt(path, np.column_stack([TIME + 456300.0, GYRO * 0.01, ACCEL * 0.01]), fmt="%.12e")


def psins(path: Path) -> None:
    np.savetxt(path, np.column_stack([GYRO * 0.01, ACCEL * 0.01, TIME]), fmt="%.12e")


def json_lines(path: Path) -> None:
    rows = [json.dumps({"t": t, "gyro": list(w), "acc": list(f)})
            for t, w, f in zip(TIME, GYRO, ACCEL, strict=True)]  # fmt: skip
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def table(path: Path, head: str, rows: np.ndarray, mark: str = ",") -> None:
    lines = [mark.join(f"{x:.9g}" for x in r) for r in rows]
    path.write_text(head + "\n" + "\n".join(lines) + "\n", encoding="utf-8")


def microstrain(path: Path) -> None:
    names = [f"{a} Accel [x8004]" for a in "XYZ"] + [f"{a} Gyro [x8005]" for a in "XYZ"]
    head = "DATA_START\nGPS TFlags,GPS Week,GPS TOW," + ",".join(names)
    ones = np.ones(N)
    rows = [7 * ones, 2300 * ones, 1000.0 + TIME, *(ACCEL / 9.80665).T, *GYRO.T]
    table(path, head, np.column_stack(rows))


def xsens_mt(path: Path) -> None:
    head = "// Start Time: 0\n// Update Rate: 100.0Hz\nPacketCounter\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\t"
    counter = (65500 + np.arange(N)) % 65536  # wraps round
    table(path, head + "Gyr_Y\tGyr_Z", np.column_stack([counter, ACCEL, GYRO]), "\t")


def shimmer(path: Path) -> None:
    names = ["Timestamp_Unix_CAL", *(f"Accel_LN_{a}_CAL" for a in "XYZ"),
             *(f"Accel_WR_{a}_CAL" for a in "XYZ"), *(f"Gyro_{a}_CAL" for a in "XYZ")]  # fmt: skip
    units = "\t".join(["ms", *["m/(s^2)"] * 6, *["deg/s"] * 3])
    head = '"sep=\t"\n' + "\t".join(f"Shimmer_AB12_{n}" for n in names) + "\n" + units
    rows = [1000.0 * TIME, *ACCEL.T, *(ACCEL + 0.5).T, *np.degrees(GYRO).T]
    table(path, head, np.column_stack(rows), "\t")


def sensorlog(path: Path) -> None:
    names = ["loggingSample(N)", "accelerometerTimestamp_sinceReboot(s)",
             *(f"accelerometerAcceleration{a}(G)" for a in "XYZ"),
             *(f"gyroRotation{a}(rad/s)" for a in "XYZ")]  # fmt: skip
    rows = [np.arange(N), 5e4 + TIME, *(ACCEL / 9.80665).T, *GYRO.T]
    lines = [",".join(f"{x:.12g}" for x in r) for r in np.column_stack(rows)]
    path.write_text(",".join(names) + "\n" + "\n".join(lines) + "\n", encoding="utf-8")


def vectornav(path: Path) -> None:
    names = ["TimeStartup", *(f"UncompAccel{a}" for a in "XYZ"), *(f"UncompGyro{a}" for a in "XYZ")]
    table(path, ",".join(names), np.column_stack([1e9 * TIME, ACCEL, GYRO]))


@pytest.mark.parametrize(
    ("name", "make", "form"),
    [
        ("imu.txt", kf_gins, "kf-gins"),
        ("imu.txt", psins, "kf-gins"),
        ("a.jsonl", json_lines, "json-lines"),
        ("a.csv", microstrain, "microstrain"),
        ("a.txt", xsens_mt, "xsens-mt"),
        ("a.csv", shimmer, "shimmer"),
        ("a.csv", sensorlog, "sensorlog"),
        ("a.csv", vectornav, "vectornav"),
    ],
)
def test_text_of_makers(tmp_path: Path, name: str, make: Callable[[Path], None], form: str) -> None:
    path = tmp_path / name
    make(path)
    assert format_of(path).name == form
    close(path, 1e-5, 1e-4)


def test_vectornav_lines_need_a_rate(tmp_path: Path) -> None:
    lines = []
    for w, f in zip(GYRO, ACCEL, strict=True):
        body = "VNIMU," + ",".join(f"{x:+.6f}" for x in (0.2, 0.1, 0.4, *f, *w, 25.0, 101.3))
        total = 0
        for byte in body.encode():
            total ^= byte
        lines.append(f"${body}*{total:02X}\r\n")
    lines[7] = lines[7].replace("*", "9*")
    path = tmp_path / "a.txt"
    path.write_text("".join(lines), encoding="ascii", newline="")
    with pytest.raises(InputError, match="rate="):
        read_imu(path)
    imu = read_imu(path, rate=100.0)
    assert imu.size == N - 1
    assert "left out 1 lines with a wrong checksum" in imu.assumptions


def test_folders_of_phones_and_data_sets(tmp_path: Path) -> None:
    phone = tmp_path / "phone"
    phone.mkdir()
    gravity = np.tile([0.0, 0.0, -9.8], (N, 1))
    for name, values in (("Gyroscope", GYRO), ("Accelerometer", ACCEL - gravity),
                         ("Gravity", gravity)):  # fmt: skip
        rows = [1.7e18 + 1e9 * TIME, TIME, *values.T[::-1]]
        lines = [f"{int(r[0])}," + ",".join(f"{x:.9f}" for x in r[1:])
                 for r in np.column_stack(rows)]  # fmt: skip
        head = "time,seconds_elapsed,z,y,x\n"
        (phone / f"{name}.csv").write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    imu = read_imu(phone)
    assert np.abs(imu.accel - ACCEL).max() < 1e-6
    assert np.abs(imu.gyro - GYRO).max() < 1e-6

    oxts = tmp_path / "oxts"
    (oxts / "data").mkdir(parents=True)
    stamps = []
    for k, t in enumerate(TIME[:50]):
        row = np.zeros(30)
        row[:3], row[7:9] = (49.0 + 1e-7 * k, 8.0, 110.0), (1.11, 0.0)
        row[11:14], row[17:20], row[23:25] = ACCEL[k], GYRO[k], (0.05, 0.02)
        (oxts / "data" / f"{k:010d}.txt").write_text(" ".join(map(str, row)), encoding="utf-8")
        stamps.append(f"2011-09-26 13:02:{25 + t:012.9f}")
    (oxts / "timestamps.txt").write_text("\n".join(stamps) + "\n", encoding="utf-8")
    assert np.allclose(read_imu(oxts).gyro, GYRO[:50])
    assert read_gnss(oxts).size == 50


def test_sbet_ends_in_mid_epoch(tmp_path: Path) -> None:
    rows = np.zeros((30, 17))
    rows[:, 0] = 1000.0 + np.arange(30) * 0.5
    rows[:, 1], rows[:, 2], rows[:, 3] = np.radians(48.1), 0.2, 520.0
    path = tmp_path / "a.sbet"
    path.write_bytes(rows.astype("<f8").tobytes())
    assert np.allclose(read_gnss(path).position[:, 2], 520.0)
    path.write_bytes(rows.astype("<f8").tobytes()[:-3])
    with pytest.raises(InputError, match="middle of an epoch"):
        read_gnss(path)


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("while True: pass", "cut short or damaged"),
        ("return {'a': bytearray(4 << 30)}", "claims more than there is"),
        ("import os; os.abort()", "cut short or damaged"),
        ("raise InputError('odd', where=str(path))", "odd"),
    ],
)
def test_a_decoder_that_fails_in_its_own_process_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, body: str, told: str
) -> None:
    pytest.importorskip("resource", reason="limits of time and memory are of Unix")
    head = "from schuler.errors import InputError\n"
    (tmp_path / "a_decoder.py").write_text(f"{head}def find(path):\n    {body}\n", "utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    path = tmp_path / "a.mat"
    path.write_bytes(b"nothing")
    with pytest.raises(InputError, match=told):
        decoded_apart(path, "MATLAB", "a_decoder", "find", seconds=1.0)


def test_what_another_process_decodes_comes_back_as_numbers_in_structs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = "{'a': {'b': np.arange(3), 'c': 'text', 'd': {'e': 2.5}}, 'o': np.array([None])}"
    (tmp_path / "other_decoder.py").write_text(
        f"import numpy as np\ndef find(path):\n    return {found}\n", "utf-8"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "a.mat").write_bytes(b"nothing")
    got = decoded_apart(tmp_path / "a.mat", "MATLAB", "other_decoder", "find")
    assert set(got) == {"a"}
    assert set(got["a"]) == {"b", "d"}
    assert got["a"]["b"].tolist() == [0, 1, 2]
    assert float(got["a"]["d"]["e"]) == 2.5
