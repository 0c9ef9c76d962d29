"""Files of other kinds are named; hemispheres, longitudes and shorthand units are read right."""

from __future__ import annotations

import gzip
import zipfile
from pathlib import Path

import numpy as np
import pytest

from schuler import read_gnss, read_imu, units
from schuler.cli.verbs.read import read
from schuler.errors import InputError, UnitError

TABLE = "time_s,gx,gy,gz,ax,ay,az\n" + "".join(f"{k / 100},0.1,0.2,0.3,0,0,9.8\n" for k in range(9))


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.csv.gz", gzip.compress(TABLE.encode(), mtime=0), "gzip"),
        ("a.csv", b"<!DOCTYPE html>\n<html><body>404</body></html>\n", "HTML"),
        ("a.gpx", b'<?xml version="1.0"?><gpx></gpx>\n', "XML"),
        ("a.pdf", b"%PDF-1.7\n\0\0\0", "PDF"),
        ("a.xls", b"\xd0\xcf\x11\xe0" + b"\0" * 99, "Excel"),
    ],
)
def test_a_file_of_another_kind_is_named(
    tmp_path: Path, name: str, content: bytes, said: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_imu(path)


def test_an_archive_that_holds_no_arrays_is_named(tmp_path: Path) -> None:
    path = tmp_path / "log.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("imu.csv", TABLE)
    with pytest.raises(InputError, match="ZIP archive"):
        read_imu(path)


@pytest.mark.parametrize(
    ("unit", "kind", "value"),
    [
        ("mps2", "acceleration", 1.0),
        ("cmps2", "acceleration", 0.01),
        ("radps", "angular rate", 1.0),
        ("degps", "angular rate", np.pi / 180.0),
        ("1/s", "angular rate", 1.0),
        ("N/kg", "acceleration", 1.0),
        ("mps", "velocity", 1.0),
        ("kn", "velocity", 1852.0 / 3600.0),
    ],
)
def test_shorthand_of_column_names(unit: str, kind: str, value: float) -> None:
    assert units.parse(f"1 {unit}", kind) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(("ns", "ew", "signs"), [("N", "E", (1, 1)), ("S", "W", (-1, -1))])
def test_hemispheres_in_columns_of_their_own(
    tmp_path: Path, ns: str, ew: str, signs: tuple[int, int]
) -> None:
    path = tmp_path / "gnss.csv"
    rows = [f"{k},{48.1 + 1e-6 * k},{ns},{11.5},{ew},520" for k in range(9)]
    path.write_text("\n".join(["time_s,lat_deg,ns,lon_deg,ew,height_m", *rows]))
    found = read_gnss(path)
    assert np.degrees(found.position[0, :2]) == pytest.approx((48.1 * signs[0], 11.5 * signs[1]))
    assert "hemisphere from 'ns'" in found.history


def test_longitudes_up_to_360_degrees(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    rows = [f"{k},48.1,{lon},520" for k, lon in enumerate((359.99, 359.995, 0.0, 0.005))]
    path.write_text("\n".join(["time_s,lat_deg,lon_deg,height_m", *rows]))
    found = np.degrees(read_gnss(path).position[:, 1])
    assert found == pytest.approx((-0.01, -0.005, 0.0, 0.005), abs=1e-9)


def _recorded(tmp_path: Path, content: bytes, name: str = "log.csv") -> np.ndarray:
    path = tmp_path / name
    path.write_bytes(content)
    imu = read_imu(path)
    assert np.allclose(np.diff(imu.time), 0.01, atol=1e-6)
    assert np.allclose(imu.accel[:, 2], 9.8)
    return np.degrees(imu.gyro)


NAMES = "gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2"
PLAIN = TABLE.replace("0,0,9.8", "0.1,0.2,9.8")
SI = PLAIN.replace("gx,gy,gz,ax,ay,az", NAMES)


def test_zero_bytes_that_a_power_failure_left_are_left_out_and_said(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(SI.encode() + bytes(70_000))
    imu = read_imu(path)
    assert imu.size == 9
    assert any("70000 zero bytes" in line for line in imu.assumptions)


def test_units_that_were_encoded_twice(tmp_path: Path) -> None:
    names = "Time (s),GyroX (°/s),GyroY (°/s),GyroZ (°/s),AccX (m/s²),AccY (m/s²),AccZ (m/s²)"
    twice = PLAIN.replace("time_s,gx,gy,gz,ax,ay,az", names).encode().decode("latin-1").encode()
    assert np.allclose(_recorded(tmp_path, twice), (0.1, 0.2, 0.3))


@pytest.mark.parametrize("name", ["ts", "Time since start in ms "])
def test_time_by_other_names(tmp_path: Path, name: str) -> None:
    rows = SI.splitlines()[1:]
    table = SI.splitlines()[0].replace("time_s", name) + "\n"
    table += "".join(f"{10 * k}{row[row.index(',') :]}\n" for k, row in enumerate(rows))
    assert np.allclose(_recorded(tmp_path, table.encode()), np.degrees((0.1, 0.2, 0.3)))


def test_gravity_and_acceleration_without_it_are_not_dropped_in_silence(tmp_path: Path) -> None:
    names = "t_s,rx_rad_s,ry_rad_s,rz_rad_s,gravityX,gravityY,gravityZ," + ",".join(
        f"userAcceleration{a}" for a in "XYZ"
    )
    path = tmp_path / "phone.csv"
    names = names.replace("rx_", "gyro_x_").replace("ry_", "gyro_y_").replace("rz_", "gyro_z_")
    rows = "".join(f"{k / 100},0.1,0.2,0.3,0,0,-1,0,0,0\n" for k in range(9))
    path.write_text(f"{names}\n{rows}", encoding="utf-8")
    with pytest.raises(InputError, match="two parts"):
        read_imu(path)
    assert read_imu(path, columns={"accel_x": None}).size == 9


STAMPED = "".join(f"[12:34:{56 + k / 100:06.3f}] 0.1, 0.2, 0.3, 0.1, 0.2, 9.8\n" for k in range(9))


@pytest.mark.parametrize(
    "text",
    [
        f"{NAMES}\n{STAMPED}",
        f"12:34:55.000 -> {NAMES}\n" + STAMPED.replace("[", "").replace("]", " ->"),
    ],
)
def test_the_stamps_of_a_terminal_are_the_time(tmp_path: Path, text: str) -> None:
    assert np.allclose(_recorded(tmp_path, text.encode()), np.degrees((0.1, 0.2, 0.3)))


def test_units_between_blanks(tmp_path: Path) -> None:
    row = "0.1 deg/s 0.2 deg/s 0.3 deg/s 0.1 m/s^2 0.2 m/s^2 9.8 m/s^2\n"
    text = "t gx gy gz ax ay az\n" + "".join(f"{k / 100} s {row}" for k in range(9))
    assert np.allclose(_recorded(tmp_path, text.encode()), (0.1, 0.2, 0.3))


@pytest.mark.parametrize("day", [739000.5, 45000.25])
def test_days_of_matlab_and_excel(tmp_path: Path, day: float) -> None:
    rows = [x.split(",", 1)[1] for x in SI.splitlines()]
    table = f"time,{rows[0]}\n"
    table += "".join(f"{day + k / 8640000:.10f},{r}\n" for k, r in enumerate(rows[1:]))
    path = tmp_path / "days.csv"
    path.write_text(table)
    imu = read_imu(path)
    assert imu.time[0] == pytest.approx((day - (719529 if day > 1e5 else 25569)) * 86400)
    assert np.allclose(np.diff(imu.time), 0.01, atol=2e-5)
    assert any("taken as days" in line for line in imu.assumptions)


@pytest.mark.parametrize("form", ["{:#06x}", "{:04X}"])
def test_hexadecimal_is_named(tmp_path: Path, form: str) -> None:
    path = tmp_path / "hex.csv"
    row = ",".join(form.format(v) for v in (0xFFF0, 0xFFE6, 0xFC, 0xA, 0xFFFF, 0x7FE))
    path.write_text("t_ms,gx,gy,gz,ax,ay,az\n" + "".join(f"{10 * k},{row}\n" for k in range(9)))
    with pytest.raises(InputError, match="hexadecimal"):
        read_imu(path)


@pytest.mark.parametrize(
    ("latitude", "longitude"),
    [("48.1 S", "11.5W"), ("4806.0 S", "01130.0 W"), ("48 6' S", "11 30' W"),
     ("48°06′00″S", "11°30′00″W")],
)  # fmt: skip
def test_hemispheres_in_cells(tmp_path: Path, latitude: str, longitude: str) -> None:
    path = tmp_path / "gnss.csv"
    rows = [f"{k},{latitude},{longitude},{520 + k}" for k in range(9)]
    path.write_text("\n".join(["time_s,latitude,longitude,height_m", *rows]), encoding="utf-8")
    found = read_gnss(path)
    assert np.degrees(found.position[0, :2]) == pytest.approx((-48.1, -11.5), abs=1e-9)


def test_names_of_flight_controllers_and_phones(tmp_path: Path) -> None:
    names = "time (us),gyroADC[0],gyroADC[1],gyroADC[2],accSmooth[0],accSmooth[1],accSmooth[2]"
    rows = "".join(f"{10000 * k},1,-2,{k % 2},10,20,2050\n" for k in range(90))
    path = tmp_path / "box.csv"
    path.write_text(f"{names}\n{rows}")
    with pytest.raises(InputError, match="perhaps 2048 LSB per g"):
        read_imu(path)
    days = [f"2024-05-01 12:34:{56 + k / 100:06.3f} +0200" for k in range(3)]
    text = SI.replace("time_s", "loggingTime(txt)")
    for k, day in enumerate(days):
        text = text.replace(f"\n{k / 100},", f"\n{day},")
    path.write_text("".join(text.splitlines(keepends=True)[:4]))
    assert np.allclose(np.diff(read_imu(path).time), 0.01, atol=1e-6)


def test_a_voltage_names_its_column(tmp_path: Path) -> None:
    path = tmp_path / "mv.csv"
    path.write_text(SI.replace(",0.1,0.2,0.3", ",0.1 mV,0.2,0.3"))
    with pytest.raises(UnitError, match="gyro_x_rad_s"):
        read_imu(path)


@pytest.mark.parametrize(
    ("unit", "value", "said"),
    [("g", 9.8, "g twice"), ("m_s2", 0.0098, "times less than gravity"), ("m_s2", 0.0, "removed"),
     ("m_s2", 9.8, "")],
)  # fmt: skip
def test_read_tells_a_stated_unit_that_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], unit: str, value: float, said: str
) -> None:
    noise = np.random.default_rng(4).normal(0.0, 0.01 * max(value, 0.5), (400, 3))
    names = NAMES.replace("m_s2", unit)
    rows = [
        f"{k / 100},{0.001 * (k % 2)},{0.001 * (k % 3)},{0.001 * (k % 5)},{a},{b},{c + value}"
        for k, (a, b, c) in enumerate(noise)
    ]
    path = tmp_path / "imu.csv"
    path.write_text("\n".join([f"time_s,{names}", *rows, ""]))
    assert read(path) == 0
    shown = capsys.readouterr().out
    assert said in shown
    assert ("! " in shown) == bool(said)


def test_read_tells_how_to_leave_a_stuck_axis_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "imu.csv"
    path.write_text(SI)
    assert read(path) == 0
    assert "--column gyro_x=" in capsys.readouterr().out
