"""Kinds of faults in people's files: read right, or refused with the true cause."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from schuler.errors import InputError, SchulerError
from schuler.io import read_gnss, read_imu
from schuler.units import scale

N = 600
RNG = np.random.default_rng(7)
TIME = np.arange(N) / 100.0
ANGLE = 0.6 * np.sin(2.0 * TIME)
"""Roll of a body that swings: gravity turns with it."""


def swing() -> tuple[np.ndarray, np.ndarray]:
    gyro = 1e-3 * RNG.standard_normal((N, 3))
    gyro[:, 0] += 1.2 * np.cos(2.0 * TIME)
    accel = 9.8 * np.column_stack([0.0 * ANGLE, np.sin(ANGLE), np.cos(ANGLE)])
    return gyro, accel + 0.01 * RNG.standard_normal((N, 3))


def rest() -> tuple[np.ndarray, np.ndarray]:
    accel = np.array([0.1, 0.2, 9.8]) + 0.02 * RNG.standard_normal((N, 3))
    return 1e-3 * RNG.standard_normal((N, 3)) + 2e-3, accel


def write(
    path: Path, time: Any, gyro: Any, accel: Any, head: str = "time,gx,gy,gz,ax,ay,az"
) -> Path:
    rows = np.column_stack([time, gyro, accel])
    lines = [",".join(f"{x:.9f}" for x in r) for r in rows]
    path.write_text(head + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


# --- units ------------------------------------------------------------------------------------


@pytest.mark.parametrize("moves", [False, True])
@pytest.mark.parametrize(
    ("gyro_scale", "accel_scale", "said"),
    [
        (1.0, 1.0, ""),
        (57.29578, 1.0, r"gyro_unit='deg/s'"),
        (57295.78, 1.0, r"gyro_unit='mdps'"),
        (1.0, 1.0 / 9.80665, r"accel_unit='g'"),
        (1.0, 1000.0 / 9.80665, r"accel_unit='mg'"),
        (1.0, 1.0 / 0.3048, r"accel_unit='ft/s\^2'"),
        (1.0, 1e-3, "gravity seems to have been removed"),
    ],
)
def test_units_that_nobody_names(
    tmp_path: Path, moves: bool, gyro_scale: float, accel_scale: float, said: str
) -> None:
    gyro, accel = swing() if moves else rest()
    path = write(tmp_path / "a.csv", TIME, gyro * gyro_scale, accel * accel_scale)
    if said:
        with pytest.raises(InputError, match=said):
            read_imu(path)
        return
    imu = read_imu(path)
    assert any("gyro taken as rad/s" in x for x in imu.assumptions)
    if moves:
        assert any("gravity turns as it should" in x for x in imu.assumptions)


def test_counts_and_what_the_user_says(tmp_path: Path) -> None:
    gyro, accel = rest()
    counts = np.round(np.degrees(gyro) * 131.0), np.round(accel / 9.80665 * 16384.0)
    path = write(tmp_path / "a.csv", TIME, *counts)
    with pytest.raises(InputError, match=r"counts of the chip, perhaps 16384 LSB per g"):
        read_imu(path)
    imu = read_imu(path, gyro_unit="LSB 131/(deg/s)", accel_unit="LSB 16384/g")
    assert np.abs(imu.accel - accel).max() < 6e-4
    assert np.abs(imu.gyro - gyro).max() < 1e-4


@pytest.mark.parametrize(
    ("unit", "kind", "value"),
    [
        ("1e-7 deg", "angle", np.radians(1e-7)),
        ("0.1 mg", "acceleration", 1e-4 * 9.80665),
        ("LSB 16384/g", "acceleration", 9.80665 / 16384),
        ("131 LSB/(deg/s)", "angular rate", np.radians(1 / 131)),
        ("mm/s", "velocity", 1e-3),
    ],
)
def test_units_with_factors_and_counts(unit: str, kind: str, value: float) -> None:
    assert scale(unit, kind) == pytest.approx(value, rel=1e-12)


def test_a_sensor_under_an_unknown_name_is_not_missed_in_silence(tmp_path: Path) -> None:
    gyro, accel = rest()
    head = "time_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,q1_m_s2,q2_m_s2,q3_m_s2"
    path = write(tmp_path / "a.csv", TIME, gyro, accel, head)
    with pytest.raises(InputError, match=r"no column for accel, but not used.*q1_m_s2"):
        read_imu(path)
    imu = read_imu(path, columns={"accel_x": None})
    assert np.isnan(imu.accel).all()
    assert any("q1_m_s2" in x for x in imu.assumptions)


# --- time -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("top", "unit", "steps"),
    [(2.0**32, "us", 1e4), (2.0**16, "ms", 10.0), (604800.0, "s", 0.01), (86400.0, "s", 0.01)],
)
def test_clocks_that_wrap_round(tmp_path: Path, top: float, unit: str, steps: float) -> None:
    gyro, accel = rest()
    ticks = (top - 200 * steps + np.arange(N) * steps) % top
    path = write(tmp_path / "a.csv", ticks, gyro, accel)
    imu = read_imu(path, time_unit=unit)
    assert imu.size == N
    assert np.allclose(imu.time - imu.time[0], TIME, atol=1e-6)
    assert any("wraps round" in x for x in imu.assumptions)


def test_packets_and_restarts(tmp_path: Path) -> None:
    gyro, accel = rest()
    packets = write(tmp_path / "a.csv", np.repeat(TIME[9::10], 10), gyro, accel)
    with pytest.raises(InputError, match=r"packets of 10 samples share one stamp.*rate="):
        read_imu(packets)
    imu = read_imu(packets, repair=True)
    assert np.allclose(imu.time, TIME, atol=1e-9)
    restarted = write(tmp_path / "b.csv", np.where(TIME < 3.0, TIME, TIME - 3.0), gyro, accel)
    with pytest.raises(InputError, match=r"goes backwards.*the clock starts again"):
        read_imu(restarted)
    imu = read_imu(restarted, repair=True)
    assert np.allclose(imu.time, TIME, atol=1e-9)
    assert any("the pause between them is not known" in x for x in imu.assumptions)


def test_repair_does_not_throw_a_recording_away(tmp_path: Path) -> None:
    gyro, accel = rest()
    time = TIME.copy()
    time[50:250:2] -= 0.05
    path = write(tmp_path / "a.csv", time, gyro, accel)
    with pytest.raises(InputError, match=r"of 600 rows: too many to leave out"):
        read_imu(path, repair=True)


def test_counter_shows_lost_samples(tmp_path: Path) -> None:
    gyro, accel = rest()
    kept = np.r_[0:100, 140:N]
    path = tmp_path / "a.csv"
    lines = [f"{(65400 + k) % 65536}," + ",".join(f"{x:.9f}" for x in (*gyro[k], *accel[k]))
             for k in kept]  # fmt: skip
    head = "# Sample rate: 100 Hz\nPacketCounter,gx,gy,gz,ax,ay,az\n"
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    imu = read_imu(path)
    assert np.allclose(imu.time, TIME[kept])
    assert any("40 samples are missing" in x for x in imu.assumptions)


@pytest.mark.parametrize(
    ("first", "how", "wanted"),
    [
        ("2025-07-08T20:40:00.{:03d}+02:00", {}, 1752000000.0),
        ("2025-07-08T13:40:00.{:03d}-0500", {}, 1752000000.0),
        ("08.07.2025 18:40:00,{:03d}", {}, 1752000000.0),
        ("07/08/2025 06:40:00.{:03d} PM", {}, 1752000000.0),
        ("08-Jul-2025 18:40:00.{:03d}", {}, 1752000000.0),
        ("08/07/2025 18:40:00.{:03d}", {"time_unit": "%d/%m/%Y %H:%M:%S%.f"}, 1752000000.0),
        ("08/07/2025 18:40:00.{:03d}", {}, None),
    ],
)
def test_dates(tmp_path: Path, first: str, how: dict[str, str], wanted: float | None) -> None:
    gyro, accel = rest()
    path = tmp_path / "a.csv"
    lines = [f"{first.format(10 * k)};" + ";".join(f"{x:.9f}" for x in (*gyro[k], *accel[k]))
             for k in range(100)]  # fmt: skip
    path.write_text("time;gx;gy;gz;ax;ay;az\n" + "\n".join(lines) + "\n", encoding="utf-8")
    if wanted is None:
        with pytest.raises(SchulerError, match=r"does not tell the day from the month.*time_unit="):
            read_imu(path)
        return
    imu = read_imu(path, **how)
    assert imu.time[0] == pytest.approx(wanted, abs=1e-6)
    assert imu.rate == pytest.approx(100.0, rel=1e-4)


# --- tables -----------------------------------------------------------------------------------


def test_tables_as_they_come(tmp_path: Path) -> None:
    gyro, accel = rest()
    path = tmp_path / "a.csv"
    rows = [f"{t:.3f}\t3D\t" + "\t".join(f"{x:.9f}" for x in (*w, *f)) + "\t0x1F\t"
            for t, w, f in zip(TIME, gyro, accel, strict=True)]  # fmt: skip
    names = "time\tfix\tgx\tgy\tgz\tax\tay\taz\tstatus\tnote"
    units = "s\tno_units\trad/s\trad/s\trad/s\tm/(s^2)\tm/(s^2)\tm/(s^2)\tmV\t"
    lines = ["Serial\t12", "Gain\t1.0", names, units, *rows[:300], names, *rows[300:]]
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode("utf-16"))
    imu = read_imu(path)
    assert imu.size == N
    assert np.allclose(imu.gyro, gyro, atol=1e-8)
    assert "decoded from UTF-16-LE" in imu.history


def test_thousands_and_commas(tmp_path: Path) -> None:
    gyro, accel = rest()
    path = tmp_path / "a.csv"
    rows = [f"{1000 + 10 * k:,}".replace(",", ".") + ";" + ";".join(
        f"{x:.6f}".replace(".", ",") for x in (*gyro[k], *accel[k])) for k in range(N)]  # fmt: skip
    path.write_text("t_ms;gx;gy;gz;ax;ay;az\n" + "\n".join(rows) + "\n", encoding="utf-8")
    imu = read_imu(path)
    assert np.allclose(imu.time, 1.0 + TIME, atol=1e-9)
    assert np.allclose(imu.gyro, gyro, atol=1e-6)


# --- GNSS against itself ----------------------------------------------------------------------


def drive(n: int = 200) -> dict[str, np.ndarray]:
    t = np.arange(float(n))
    heading = 0.03 * t
    north, east = 10.0 * np.cos(heading), 10.0 * np.sin(heading)
    radius = 6.371e6
    lat = np.radians(48.0) + np.cumsum(north - 0.5 * np.gradient(north)) / radius
    lon = np.radians(11.0) + np.cumsum(east) / radius / np.cos(np.radians(48.0))
    height = 500.0 + 20.0 * np.sin(0.1 * t)
    return {"time_s": t, "lat": np.degrees(lat), "lon": np.degrees(lon), "h": height,
            "vn": north, "ve": east, "vd": -2.0 * np.cos(0.1 * t)}  # fmt: skip


def csv(path: Path, columns: dict[str, np.ndarray]) -> Path:
    lines = [",".join(f"{x:.11g}" for x in r) for r in zip(*columns.values(), strict=True)]
    path.write_text(",".join(columns) + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({}, ""),
        ({"vn": 3.6, "ve": 3.6, "vd": 3.6}, "velocity is in km/h.*velocity_unit='km/h'"),
        ({"vn": 1.943844, "ve": 1.943844, "vd": 1.943844}, "velocity is in knots"),
        ({"vn": 1e3, "ve": 1e3, "vd": 1e3}, "velocity is in mm/s"),
        ({"vn": -1.0}, "north velocity has the wrong sign"),
        ({"vd": -1.0}, "vertical velocity has the other sign.*velocity_up"),
        ("velocities", "north and east velocity are exchanged"),
        ("positions", "latitude and longitude are swapped"),
        ("radians", "radians, or degrees near 0, 0.*angle_unit='rad'"),
    ],
)
def test_velocity_against_positions(tmp_path: Path, change: Any, said: str) -> None:
    columns = drive()
    if change == "velocities":
        columns["vn"], columns["ve"] = columns["ve"], columns["vn"]
    elif change == "positions":
        columns["lat"], columns["lon"] = columns["lon"], columns["lat"]
    elif change == "radians":
        columns["lat"], columns["lon"] = np.radians(columns["lat"]), np.radians(columns["lon"])
    else:
        for name, factor in change.items():
            columns[name] = columns[name] * factor
    path = csv(tmp_path / "a.csv", columns)
    if not said:
        assert read_gnss(path).size == 200
        return
    with pytest.raises(InputError, match=said):
        read_gnss(path)


def test_held_fixes_and_zeros_are_left_out_and_counted(tmp_path: Path) -> None:
    columns = {n: np.repeat(c, 5) for n, c in drive().items()}
    columns["time_s"] = np.arange(1000) * 0.2
    for name in ("lat", "lon", "h", "vn", "ve", "vd"):
        columns[name][:20] = 0.0
    gnss = read_gnss(csv(tmp_path / "a.csv", columns))
    assert gnss.size == 196
    assert "left out 20 epochs at 0, 0: no fix yet" in gnss.assumptions
    assert any("epochs that repeat the fix before" in x for x in gnss.assumptions)


def test_whole_numbers_of_a_receiver(tmp_path: Path) -> None:
    columns = drive()
    whole = {"timestamp": columns["time_s"] * 1e6 + 1e8,
             "lat": np.round(columns["lat"] * 1e7), "lon": np.round(columns["lon"] * 1e7),
             "alt": np.round(columns["h"] * 1e3)}  # fmt: skip
    gnss = read_gnss(csv(tmp_path / "a.csv", whole))
    assert np.allclose(np.degrees(gnss.position[:, 0]), columns["lat"], atol=1e-7)
    assert np.allclose(gnss.position[:, 2], columns["h"], atol=1e-3)
    assert any("1e-7 deg" in x for x in gnss.assumptions)
