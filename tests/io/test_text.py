"""Text files: layouts, units, increments, time; numbers must come back exactly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from schuler.errors import SchulerError
from schuler.io import read_gnss, read_imu

DEG = math.pi / 180.0
G = 9.80665
NAMES = ("time", "gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def table(rows: int = 200, rate: float = 100.0) -> np.ndarray:
    """Time and six channels of a slowly rocking sensor, all different."""
    t = np.arange(rows) / rate
    phase = np.arange(6)
    signals = 0.1 * np.sin(2.0 * t[:, None] + phase) + [0.0, 0.0, 0.0, 0.3, -0.2, 9.8]
    return np.column_stack([t, signals])


def write(path: Path, values: np.ndarray, header: str = "", sep: str = ",", **how: object) -> Path:
    comma = bool(how.get("comma"))
    lines = [sep.join(repr(float(v)) for v in row) for row in values]
    if comma:
        lines = [line.replace(".", ",") for line in lines]
    before = str(how.get("before", ""))
    end = str(how.get("end", "\n"))
    text = before + (header + end if header else "") + end.join(lines) + end
    path.write_bytes(text.encode(str(how.get("encoding", "utf-8"))))
    return path


def same(imu: object, values: np.ndarray, gyro: float = 1.0, accel: float = 1.0) -> None:
    assert np.allclose(imu.time, values[:, 0], rtol=0, atol=1e-9)
    assert np.allclose(imu.gyro, values[:, 1:4] * gyro, rtol=1e-14, atol=0)
    assert np.allclose(imu.accel, values[:, 4:7] * accel, rtol=1e-14, atol=0)


@pytest.mark.parametrize("sep", [",", ";", "\t", " ", "   ", ", ", " ; "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_delimiter_is_found(tmp_path: Path, sep: str, end: str) -> None:
    values = table()
    name = sep.join(NAMES)
    same(read_imu(write(tmp_path / "a.csv", values, name, sep, end=end)), values)


@pytest.mark.parametrize("sep", [";", "\t", " "])
def test_decimal_comma(tmp_path: Path, sep: str) -> None:
    values = table()
    same(read_imu(write(tmp_path / "a.txt", values, sep.join(NAMES), sep, comma=True)), values)


def test_units_in_the_header(tmp_path: Path) -> None:
    values = table()
    header = (
        "Time [ms],Gyr_X (deg/s),Gyr_Y (deg/s),Gyr_Z (deg/s),Acc_X [mg],Acc_Y [mg],Acc_Z [mg],note"
    )
    scaled = values * ([1e3] + [1 / DEG] * 3 + [1e3 / G] * 3)
    path = tmp_path / "a.csv"
    lines = [",".join(map(repr, map(float, row))) + ",text" for row in scaled]
    path.write_text(header + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    imu = read_imu(path)
    assert np.allclose(imu.time, values[:, 0], atol=1e-12)
    assert np.allclose(imu.gyro, values[:, 1:4], rtol=1e-13)
    assert np.allclose(imu.accel, values[:, 4:7], rtol=1e-13)
    assert "gyro converted from deg/s" in imu.history
    assert "accel converted from mg" in imu.history
    assert "time converted from ms" in imu.history


def test_units_given_count_more_and_unnamed_units_are_told(tmp_path: Path) -> None:
    values = table()
    path = write(tmp_path / "a.csv", values, ",".join(NAMES))
    assert "gyro taken as rad/s: no unit is named" in read_imu(path).history
    imu = read_imu(path, gyro_unit="deg/s", accel_unit="g")
    same(imu, values, DEG, G)
    with pytest.raises(SchulerError, match=r"mg.*acceleration.*angular rate"):
        read_imu(path, gyro_unit="mg")


def test_second_header_line_of_units_and_preamble(tmp_path: Path) -> None:
    values = table()
    header = ";".join(NAMES) + "\n" + "s;deg/s;deg/s;deg/s;g;g;g"
    before = "Device: DOT 5\nFirmware; 2.0\n\n"
    imu = read_imu(write(tmp_path / "a.txt", values, header, ";", before=before))
    same(imu, values, DEG, G)


def test_header_in_a_comment_and_nanoseconds_since_1970(tmp_path: Path) -> None:
    """The layout of the EuRoC data sets."""
    values = table()
    start = 1403636579758555392
    header = (
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
        "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]"
    )
    rows = [
        f"{start + k * 10_000_000}," + ",".join(map(repr, map(float, row[1:])))
        for k, row in enumerate(values)
    ]
    path = tmp_path / "data.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    imu = read_imu(path)
    assert imu.time[0] == pytest.approx(1403636579.758555392, abs=3e-7)
    assert np.allclose(np.diff(imu.time), 0.01, atol=1e-6)
    assert np.array_equal(imu.gyro, values[:, 1:4])


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "s"), (1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_unix_time_tells_its_unit_by_its_size(tmp_path: Path, scale: float, unit: str) -> None:
    values = table()
    values[:, 0] += 1.75e9
    stored = values.copy()
    stored[:, 0] = np.round(stored[:, 0] * scale, 3)
    imu = read_imu(write(tmp_path / "a.csv", stored, ",".join(NAMES)))
    assert np.allclose(imu.time, values[:, 0], atol=6e-4 if unit == "s" else 2e-6)
    assert f"time taken as {unit}: no unit is named" in imu.history


def test_unit_of_time_follows_from_the_rate_or_is_asked_for(tmp_path: Path) -> None:
    values = table()
    values[:, 0] *= 1e3
    path = write(tmp_path / "a.csv", values, ",".join(NAMES))
    imu = read_imu(path)
    assert imu.rate == pytest.approx(100.0)
    assert "time taken as ms: no unit is named" in imu.assumptions
    values[:, 0] *= 10.0  # steps of 100: 10 Hz in ms, 10 kHz in us
    path = write(tmp_path / "b.csv", values, ",".join(NAMES))
    units = {"gyro_unit": "rad/s", "accel_unit": "m/s^2"}
    with pytest.raises(
        SchulerError, match=r"100 s apart; as ms 10 Hz, as us 1e\+04 Hz.*time_unit='ms'"
    ):
        read_imu(path, **units)
    assert read_imu(path, time_unit="ms", **units).rate == pytest.approx(10.0)


def test_dates_and_gps_weeks(tmp_path: Path) -> None:
    values = table(50)
    dates = np.datetime64("2025-07-08T19:34:59.600") + (values[:, 0] * 1e3).astype(int)
    body = [
        f"{d}Z," + ",".join(map(repr, map(float, r[1:])))
        for d, r in zip(dates, values, strict=True)
    ]
    path = tmp_path / "dates.csv"
    path.write_text(",".join(NAMES) + "\n" + "\n".join(body) + "\n", encoding="utf-8")
    imu = read_imu(path)
    # 2025-07-08 00:00 UTC is day 20277 of the Unix epoch.
    assert imu.time[0] == pytest.approx(20277 * 86400 + 19 * 3600 + 34 * 60 + 59.6, abs=1e-6)
    assert np.allclose(np.diff(imu.time), 0.01, atol=1e-6)

    sow = 604799.8 + values[:, 0]
    week = np.where(sow >= 604800.0, 2375.0, 2374.0)
    weekly = np.column_stack([week, sow % 604800.0, values[:, 1:]])
    path = write(tmp_path / "week.csv", weekly, ",".join(("week", "sow_s", *NAMES[1:])))
    imu = read_imu(path)
    assert np.allclose(imu.time, sow, atol=1e-8)
    assert "seconds of GPS week 2374" in imu.history


def test_no_header_needs_names_or_numbers(tmp_path: Path) -> None:
    values = table()
    path = write(tmp_path / "a.txt", values, "", " ")
    with pytest.raises(SchulerError, match="no line with the names of its 7 columns"):
        read_imu(path)
    same(read_imu(path, columns=NAMES), values)
    by_number = {"time": 0, "gyro": (1, 2, 3), "accel": (4, 5, 6)}
    same(read_imu(path, columns=by_number), values)
    swapped = read_imu(path, columns={**by_number, "gyro": (3, 2, 1)})
    assert np.array_equal(swapped.gyro, values[:, 3:0:-1])
    with pytest.raises(SchulerError, match="6 columns are named, the file has 7"):
        read_imu(path, columns=NAMES[:6])


def test_skip_lines_comments_and_delimiter_given(tmp_path: Path) -> None:
    values = table()
    before = "1,2,3,4,5,6,7\n! remark\n"
    path = write(tmp_path / "a.txt", values, "|".join(NAMES), "|", before=before)
    same(read_imu(path, skip_lines=1, comment="!", delimiter="|"), values)


def test_increments_become_rates(tmp_path: Path) -> None:
    """Increments over 10 ms, the names and the units of KF-GINS; a sample lost at row 100."""
    values = np.delete(table(), 100, axis=0)
    increments = values.copy()
    increments[:, 1:] *= 0.01
    names = ("time", "dtheta_x", "dtheta_y", "dtheta_z", "dv_x", "dv_y", "dv_z")
    imu = read_imu(write(tmp_path / "a.csv", increments, ",".join(names)))
    assert np.allclose(imu.gyro, values[:, 1:4], rtol=1e-9)
    assert np.allclose(imu.accel, values[:, 4:7], rtol=1e-9)
    assert "gyro increments divided by the time step" in imu.history

    by_option = read_imu(write(tmp_path / "b.csv", increments, ",".join(NAMES)), increments=True)
    assert np.allclose(by_option.accel, values[:, 4:7], rtol=1e-9)

    degrees = increments.copy()
    degrees[:, 1:4] /= DEG
    names = ("time_s", *(f"gyro_{a}_deg" for a in "xyz"), *(f"accel_{a}_m_s" for a in "xyz"))
    by_unit = read_imu(write(tmp_path / "c.csv", degrees, ",".join(names)))
    assert np.allclose(by_unit.gyro, values[:, 1:4], rtol=1e-9)
    assert np.allclose(by_unit.accel, values[:, 4:7], rtol=1e-9)


def test_rate_in_place_of_time(tmp_path: Path) -> None:
    values = table()
    path = write(tmp_path / "a.csv", values[:, 1:], ",".join(NAMES[1:]))
    with pytest.raises(SchulerError, match=r"no sampling rate.*rate="):
        read_imu(path)
    imu = read_imu(path, rate=250.0)
    assert imu.rate == pytest.approx(250.0)
    assert imu.time[10] == pytest.approx(0.04)
    (tmp_path / "README.md").write_text("Sampled at 200 Hz, noise 0.1 deg/s/sqrt(Hz).", "utf-8")
    imu = read_imu(path)
    assert imu.rate == pytest.approx(200.0)
    assert any("README.md: 200 Hz" in line for line in imu.history)
    (tmp_path / "README.md").write_text("Gyro at 200 Hz, magnetometer at 50 Hz.", "utf-8")
    with pytest.raises(SchulerError, match=r"README.md states several rates \(50, 200 Hz\)"):
        read_imu(path)


def test_gnss_table_with_two_velocity_components(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    path.write_text(
        "time_s,lat,lon,alt,ve,vn,hacc,vacc\n"
        "1.0,48.0,-11.5,500.0,3.0,4.0,1.414213562373095,2.5\n"
        "2.0,48.00001,-11.5,500.5,3.5,,1.414213562373095,2.5\n",
        encoding="utf-8",
    )
    gnss = read_gnss(path)
    assert gnss.position[0] == pytest.approx([48.0 * DEG, -11.5 * DEG, 500.0])
    assert gnss.velocity[0] == pytest.approx([4.0, 3.0, 0.0])
    assert gnss.position_sd[0] == pytest.approx([1.0, 1.0, 2.5])
    assert np.isnan(gnss.velocity_sd[0, :2]).all()
    assert np.isinf(gnss.velocity_sd[0, 2])
    assert np.isinf(gnss.velocity_sd[1, 0])
    assert gnss.velocity[1, 0] == 0.0
    given = read_gnss(path, position_sd=2.0, velocity_sd=0.1)
    assert given.position_sd[1] == pytest.approx([2.0, 2.0, 3.0])
    assert given.velocity_sd[0, :2] == pytest.approx([0.1, 0.1])


def test_gnss_local_and_earth_fixed_positions(tmp_path: Path) -> None:
    path = tmp_path / "local.csv"
    path.write_text("time_s,north_m,east_m,down_m\n0,0,0,0\n1,100,50,-2\n", encoding="utf-8")
    assert any("without an origin" in line for line in read_gnss(path).history)
    origin = (45.0 * DEG, 7.0 * DEG, 300.0)
    gnss = read_gnss(path, origin=origin)
    assert gnss.position[0] == pytest.approx(origin, abs=1e-9)
    # Meridian radius at 45 deg: 6 367 382 m; parallel radius (6 388 838 + h) cos 45 deg.
    assert gnss.position[1, 0] - origin[0] == pytest.approx(100.0 / 6367682.0, rel=1e-4)
    east = 50.0 / (6389138.0 * math.cos(origin[0]))
    assert gnss.position[1, 1] - origin[1] == pytest.approx(east, rel=1e-3)
    assert gnss.position[1, 2] == pytest.approx(302.0, abs=2e-3)

    path = tmp_path / "ecef.csv"
    path.write_text("time_s,x_ecef_m,y_ecef_m,z_ecef_m\n0,6378137.0,0,0\n", encoding="utf-8")
    assert read_gnss(path).position[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    path.write_text("time_s,ecef_x,ecef_y,ecef_z\n0,0,6378237.0,0\n", encoding="utf-8")
    assert read_gnss(path).position[0] == pytest.approx([0.0, math.pi / 2, 100.0], abs=1e-6)


def test_velocity_from_speed_and_course(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    path.write_text(
        "time_s,latitude_deg,longitude_deg,height_m,speed_km/h,course_deg\n0,1,2,3,36,90\n",
        encoding="utf-8",
    )
    assert read_gnss(path).velocity[0] == pytest.approx([0.0, 10.0, 0.0], abs=1e-12)


def test_degree_sign_in_any_encoding(tmp_path: Path) -> None:
    values = table()
    header = "time (s);" + ";".join(f"gyro {a} (°/s)" for a in "xyz")
    header += ";" + ";".join(f"acc {a} (m/s²)" for a in "xyz")
    for encoding in ("utf-8", "utf-8-sig", "latin-1"):
        path = write(tmp_path / "a.csv", values, header, ";", encoding=encoding)
        same(read_imu(path), values, DEG)


def test_damaged_text_gives_a_recording_or_one_clear_line(tmp_path: Path) -> None:
    """Three hundred random edits of good files: never a traceback, always the file's name."""
    rng = np.random.default_rng(11)
    path = tmp_path / "a.csv"
    good = write(path, table(40), ",".join(NAMES)).read_bytes()
    pos = b"%  GPST  latitude(deg) longitude(deg) height(m)  Q  ns  sdn(m)  sde(m)  sdu(m)\n"
    for k in range(30):
        pos += b"2025/07/08 19:34:%02d.5 40.0966 -105.1474 1585.4 1 21 0.01 0.01 0.02\n" % k
    pieces = [
        b",",
        b"\n",
        b"nan",
        b'"',
        b"  ",
        b"1e999",
        b"-",
        b"text",
        b"\r",
        b"\xb0",
        b"\0",
        b".",
    ]
    outcomes = {True: 0, False: 0}
    for trial in range(300):
        text = bytearray(good if trial % 2 else pos)
        for _ in range(int(rng.integers(1, 4))):
            place = int(rng.integers(len(text)))
            if rng.random() < 0.5:
                text[place:place] = pieces[int(rng.integers(len(pieces)))]
            else:
                del text[place : place + int(rng.integers(1, 6))]
        path.write_bytes(bytes(text))
        read = read_imu if trial % 2 else read_gnss
        try:
            read(path)
            outcomes[True] += 1
        except SchulerError as error:
            outcomes[False] += 1
            assert str(path) in str(error)
            assert "\n" not in str(error)
    assert min(outcomes.values()) > 30


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        (
            "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],"
            "accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2]",
            1e6,
        ),
        (
            "%time,field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,"
            "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z",
            1e6,
        ),
        (
            "SampleTimeFine,Gyr_X,Gyr_Y,Gyr_Z,Acc_X,Acc_Y,Acc_Z",
            1e6,
        ),
        (
            '"Time (us)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)",'
            '"Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"',
            1e6,
        ),
    ],
)
def test_headers_of_other_makers(tmp_path: Path, header: str, unit: float) -> None:
    """PX4's ulog2csv, rostopic echo -p, Xsens, phyphox."""
    values = table()
    stored = values.copy()
    stored[:, 0] *= unit
    path = write(tmp_path / "a.csv", stored, header)
    how = {"columns": {"time": "SampleTimeFine"}} if "Fine" in header else {}
    same(read_imu(path, time_unit="us", **how), values)


def test_date_and_time_of_day(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    rows = "\n".join(f"2025/07/08,19:34:{k:02d}.50,48.0,11.0,500" for k in range(5))
    path.write_text("Date,Time,Lat,Lon,Alt\n" + rows + "\n", encoding="utf-8")
    gnss = read_gnss(path)
    assert gnss.time[0] == pytest.approx(20277 * 86400 + 19 * 3600 + 34 * 60 + 0.5, abs=1e-6)
    assert np.diff(gnss.time) == pytest.approx(1.0, abs=1e-6)
    rows = "\n".join(f"19:34:{k:02d}.50,48.0,11.0,500" for k in range(5))
    path.write_text("Time,Lat,Lon,Alt\n" + rows + "\n", encoding="utf-8")
    gnss = read_gnss(path)
    assert gnss.time[1] == pytest.approx(19 * 3600 + 34 * 60 + 1.5)
    assert "seconds of the day" in " ".join(gnss.history)
    shifted = read_gnss(path, time_offset=-18.0)
    assert shifted.time == pytest.approx(gnss.time - 18.0)
    assert "-18.000000 s added to time" in shifted.history
    imu = read_imu(write(tmp_path / "imu.csv", table(), ",".join(NAMES)), time_offset=2.5)
    assert imu.time[0] == 2.5


def test_temperature_in_kelvin_and_incomplete(tmp_path: Path) -> None:
    values = np.column_stack([table(), np.linspace(293.15, 303.15, 200)])
    imu = read_imu(write(tmp_path / "a.csv", values, ",".join((*NAMES, "temperature_K"))))
    assert imu.temperature[[0, -1]] == pytest.approx([20.0, 30.0])
    values[5, 7] = np.nan
    imu = read_imu(write(tmp_path / "a.csv", values, ",".join((*NAMES, "temp_degC"))))
    assert imu.temperature is None
    assert "temperature left out: it is not complete" in imu.history


def cells(time: str, gyro: str, accel: str, mark: str = ",") -> list[str]:
    """Rows of a resting IMU whose numbers carry their units."""
    values = [(0.01 * k, 0.2 + 0.01 * (k % 3), 9.8 + 0.01 * (k % 2)) for k in range(100)]
    return [
        mark.join([f"{t:.2f}{time}", *3 * [f"{w:.3f}{gyro}"], *3 * [f"{f:.3f}{accel}"]])
        for t, w, f in values
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_a_unit_behind_every_number_is_the_unit_of_its_column(
    tmp_path: Path, mark: str, encoding: str
) -> None:
    path = tmp_path / "units.csv"
    head = mark.join(["time", "gx", "gy", "gz", "ax", "ay", "az"])
    path.write_text("\n".join([head, *cells(" s", "°/s", " m/s^2", mark)]), encoding=encoding)
    imu = read_imu(path)
    assert imu.time[-1] == pytest.approx(0.99)
    np.testing.assert_allclose(imu.gyro[0], math.radians(0.2))
    np.testing.assert_allclose(imu.accel[1], 9.81)


@pytest.mark.parametrize(
    ("line", "text", "said"),
    [(0, "time,gx,gy,gz,ax (g),ay,az", "the header says 'g', the cells say 'm/s"),
     (7, cells(" s", " rad/s", " m/s^2")[6], r"line 8, column 2"),
     (9, cells(" s", "", " m/s^2")[8], r"line 10, column 2")],
)  # fmt: skip
def test_units_in_cells_that_contradict_are_refused(
    tmp_path: Path, line: int, text: str, said: str
) -> None:
    lines = ["time,gx,gy,gz,ax,ay,az", *cells(" s", " deg/s", " m/s^2")]
    lines[line] = text
    path = tmp_path / "mixed.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(SchulerError, match=said):
        read_imu(path)


def test_names_of_mavlink_behind_the_field_of_a_topic(tmp_path: Path) -> None:
    names = [f"field.{a}{s}" for s in ("gyro", "acc") for a in "xyz"]
    path = tmp_path / "highres.csv"
    path.write_text("\n".join([",".join(["time", *names]), *cells("", "e-2", "")]))
    np.testing.assert_allclose(read_imu(path).accel[0], 9.8)
