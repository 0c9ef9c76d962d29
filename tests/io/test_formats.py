"""Parquet, NPZ, RTKLIB and ROS bags: numbers written by others come back exactly."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import polars
import pytest

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.io import read_gnss, read_imu, read_imus

DEG = math.pi / 180.0


def recording(rows: int = 50, seed: int = 3) -> ImuRecording:
    rng = np.random.default_rng(seed)
    time = 1_700_000_000.0 + np.arange(rows) * 0.0078125  # exact in binary
    gyro, accel = rng.normal(size=(rows, 3)), rng.normal(9.8, 1.0, size=(rows, 3))
    return ImuRecording(time, gyro, accel, temperature=rng.normal(20, 1, rows))


def assert_same(a: ImuRecording, b: ImuRecording) -> None:
    assert np.array_equal(a.time, b.time)
    assert np.array_equal(a.gyro, b.gyro)
    assert np.array_equal(a.accel, b.accel)


def test_parquet_comes_back_exactly(tmp_path: Path) -> None:
    imu = recording()
    imu.to_parquet(tmp_path / "a.parquet")
    back = read_imu(tmp_path / "a.parquet")
    assert_same(back, imu)
    assert np.array_equal(back.temperature, imu.temperature)


def test_parquet_with_dates_and_missing_channels(tmp_path: Path) -> None:
    imu = recording()
    stamps = np.datetime64("2025-01-01T00:00:00", "ns") + np.arange(50) * np.timedelta64(
        10_000_000, "ns"
    )
    frame = polars.DataFrame({"timestamp": stamps, "gyro_z_deg_s": imu.gyro[:, 2]})
    frame.write_parquet(tmp_path / "a.parquet")
    back = read_imu(tmp_path / "a.parquet")
    assert back.channels == ("gyro_z",)
    assert np.isnan(back.gyro[:, :2]).all()
    assert np.isnan(back.accel).all()
    assert back.gyro[:, 2] == pytest.approx(imu.gyro[:, 2] * DEG, rel=1e-14)
    assert back.time[0] == 20089 * 86400.0
    assert back.rate == pytest.approx(100.0, rel=1e-4)


def test_parquet_states_its_rate(tmp_path: Path) -> None:
    frame = polars.DataFrame({"gyro_x_rad_s": np.random.default_rng(1).normal(size=20)})
    frame.write_parquet(tmp_path / "a.parquet", metadata={"sampling_rate": "400"})
    assert read_imu(tmp_path / "a.parquet").rate == pytest.approx(400.0)


def test_npz_arrays_of_three_columns(tmp_path: Path) -> None:
    imu = recording()
    np.savez(tmp_path / "a.npz", time=imu.time, gyro=imu.gyro, accel=imu.accel)
    assert_same(read_imu(tmp_path / "a.npz"), imu)
    np.savez(tmp_path / "b.npz", fs=200.0, gyro_deg_s=imu.gyro, accel_g=imu.accel)
    back = read_imu(tmp_path / "b.npz")
    assert back.rate == pytest.approx(200.0)
    assert back.gyro == pytest.approx(imu.gyro * DEG, rel=1e-14)
    assert back.accel == pytest.approx(imu.accel * 9.80665, rel=1e-14)
    lla = np.column_stack([np.linspace(1, 1.5, 9), np.linspace(2, 3, 9), np.zeros(9)])
    ned = np.arange(27.0).reshape(9, 3)
    np.savez(
        tmp_path / "c.npz", t=np.arange(9.0), position_rad=lla, velocity=ned, position_sd=ned + 1
    )
    gnss = read_gnss(tmp_path / "c.npz")
    assert np.array_equal(gnss.position[:, :2], lla[:, :2] * 1.0)
    assert np.array_equal(gnss.velocity, ned)
    assert np.array_equal(gnss.position_sd, ned + 1)


def test_several_imus_side_by_side_and_below_each_other(tmp_path: Path) -> None:
    one, two = recording(seed=1), recording(seed=2)
    units = {"gyro": "rad_s", "accel": "m_s2"}
    wide = {"time_s": one.time}
    for k, imu in ((1, one), (2, two)):
        for name, values in (("gyro", imu.gyro), ("accel", imu.accel)):
            wide |= {f"imu{k}_{name}_{a}_{units[name]}": values[:, j] for j, a in enumerate("xyz")}
    polars.DataFrame(wide).write_parquet(tmp_path / "wide.parquet")
    frames = []
    for k, imu in ((1, one), (2, two)):
        columns = {"time_s": imu.time, "imu": np.full(imu.size, k)}
        for name, values in (("gyro", imu.gyro), ("accel", imu.accel)):
            columns |= {f"{name}_{a}_{units[name]}": values[:, j] for j, a in enumerate("xyz")}
        frames.append(polars.DataFrame(columns))
    polars.concat(frames).write_parquet(tmp_path / "long.parquet")
    for name in ("wide", "long"):
        path = tmp_path / f"{name}.parquet"
        first, second = read_imus(path)
        assert_same(first, one)
        assert_same(second, two)
        assert_same(read_imu(path, imu=2), two)
        chosen = read_imu(path)
        assert_same(chosen, one)
        assert any("IMU 1 of 2" in line for line in chosen.history)
        with pytest.raises(InputError, match="no IMU 3; expected one of 1, 2"):
            read_imu(path, imu=3)


POS = """% program   : RTKPOST ver.2.4.3
% inp file  : rover.obs
%
% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float,4:dgps,5:single,ns=# of satellites)
%  {scale}  {columns}  Q  ns  sdn(m)  sde(m)  sdu(m)  sdne(m) sdeu(m) sdun(m) age(s)  ratio
"""


def test_rtklib_solution(tmp_path: Path) -> None:
    header = POS.format(scale="GPST", columns="latitude(deg) longitude(deg)  height(m)")
    path = tmp_path / "a.pos"
    path.write_text(
        header + "2025/07/08 19:34:18.499   40.096626800 -105.147448300  1585.4740   1  21"
        "   0.0099   0.0098   0.0100   0.0010   0.0000   0.0000   0.00   12.3\n"
        "2025/07/08 19:34:18.749   40.096626900 -105.147448400  1585.4760   2  21"
        "   0.0199   0.0198   0.0200   0.0010   0.0000   0.0000   0.00    1.3\n",
        encoding="utf-8",
    )
    gnss = read_gnss(path)
    # Tuesday: two days of the week, 19 h 34 min 18.499 s.
    assert gnss.time[0] == pytest.approx(2 * 86400 + 19 * 3600 + 34 * 60 + 18.499, abs=1e-6)
    assert gnss.position[0] == pytest.approx(
        [40.0966268 * DEG, -105.1474483 * DEG, 1585.474], rel=1e-14
    )
    assert gnss.position_sd[1] == pytest.approx([0.0199, 0.0198, 0.02])
    assert list(gnss.quality) == [1, 2]
    assert "week 2374" in " ".join(gnss.history)
    path.write_text(path.read_text("utf-8")[:-60], "utf-8")
    with pytest.raises(InputError, match=r"a\.pos, line 7: this line has 8 fields; expected 15"):
        read_gnss(path)


def test_rtklib_weeks_degrees_minutes_seconds_and_velocity(tmp_path: Path) -> None:
    path = tmp_path / "a.pos"
    header = POS.format(scale="GPST", columns="latitude(d'\")   longitude(d'\")    height(m)")
    header = header.rstrip() + "  vn(m/s)  ve(m/s)  vu(m/s)\n"
    path.write_text(
        header + "2374 243258.499  40 05 47.85648 -105 08 50.81388 1585.474 1 21 0.0099 0.0098 0.01"
        " 0.001 0 0 0.00 12.3 1.5 -2.5 0.5\n",
        encoding="utf-8",
    )
    gnss = read_gnss(path)
    assert gnss.time[0] == 243258.499
    assert gnss.position[0, :2] == pytest.approx([40.0966268 * DEG, -105.1474483 * DEG], rel=1e-12)
    assert gnss.velocity[0] == pytest.approx([1.5, -2.5, -0.5])


def test_rtklib_earth_fixed(tmp_path: Path) -> None:
    path = tmp_path / "a.pos"
    header = POS.format(scale="UTC", columns="x-ecef(m) y-ecef(m) z-ecef(m)")
    header = header.replace("sdn(m)  sde(m)  sdu(m)", "sdx(m)   sdy(m)   sdz(m)")
    path.write_text(
        header + "2025/07/08 19:34:18.499 0.0 -6378147.0 0.0 1 21 0.01 0.01 0.01 0 0 0 0 1\n",
        encoding="utf-8",
    )
    gnss = read_gnss(path)
    assert gnss.position[0] == pytest.approx([0.0, -math.pi / 2, 10.0], abs=1e-6)
    assert np.isnan(gnss.position_sd).all()


def write_bag(path: Path, imu: ImuRecording, topics: list[str], storage: str) -> Path:
    """Write sensor_msgs/Imu and NavSatFix with the reference writer of the package rosbags."""
    from rosbags.typesys import Stores, get_typestore

    ros1 = storage == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    types = store.types
    vector, quaternion = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    time_type, header_type = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    if ros1:
        from rosbags.rosbag1 import Writer

        writer = Writer(path)
        serialize = store.serialize_ros1
    else:
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2

        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        serialize = store.serialize_cdr
    with writer:
        for topic in topics:
            kind = "sensor_msgs/msg/NavSatFix" if "fix" in topic else "sensor_msgs/msg/Imu"
            connection = writer.add_connection(topic, kind, typestore=store)
            for k in range(imu.size):
                nanoseconds = 1_700_000_000 * 10**9 + k * 7_812_500
                stamp = time_type(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
                extra = {"seq": k} if ros1 else {}
                header = header_type(stamp=stamp, frame_id="imu", **extra)
                if "fix" in topic:
                    message = types[kind](
                        header=header,
                        status=types["sensor_msgs/msg/NavSatStatus"](
                            status=-1 if k == 3 else 0, service=1
                        ),
                        latitude=48.0 + k * 1e-5,
                        longitude=-11.0,
                        altitude=500.0 + k,
                        position_covariance=np.diag([4.0, 9.0, 25.0]).ravel(),
                        position_covariance_type=2,
                    )
                else:
                    message = types[kind](
                        header=header,
                        orientation=quaternion(x=0.0, y=0.0, z=0.0, w=1.0),
                        orientation_covariance=np.zeros(9),
                        angular_velocity=vector(**dict(zip("xyz", imu.gyro[k], strict=True))),
                        angular_velocity_covariance=np.zeros(9),
                        linear_acceleration=vector(**dict(zip("xyz", imu.accel[k], strict=True))),
                        linear_acceleration_covariance=np.zeros(9),
                    )
                writer.write(connection, nanoseconds + 5_000_000, serialize(message, kind))
    return path


@pytest.mark.parametrize("storage", ["ros1", "sqlite", "mcap"])
def test_bags_come_back_exactly(tmp_path: Path, storage: str) -> None:
    pytest.importorskip("rosbags")
    imu = recording()
    path = write_bag(
        tmp_path / ("a.bag" if storage == "ros1" else "bag"), imu, ["/imu/data", "/fix"], storage
    )
    files = [path]
    if storage != "ros1":
        files += [f for f in path.iterdir() if f.suffix in (".db3", ".mcap")]
        assert len(files) == 2
    for file in files:
        assert_same(read_imu(file), imu)
        gnss = read_gnss(file)
        assert gnss.size == imu.size - 1
        assert np.array_equal(gnss.time, np.delete(imu.time, 3))
        assert gnss.position[0] == pytest.approx([48.0 * DEG, -11.0 * DEG, 500.0])
        # The message's covariance is east, north, up; ours north, east, down.
        assert gnss.position_sd[0] == pytest.approx([3.0, 2.0, 5.0])
        assert "left out 1 messages without a fix" in gnss.history
        recorded = read_imu(file, clock="bag")
        assert recorded.time == pytest.approx(imu.time + 0.005, abs=1e-6)


def test_bag_topics(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    imu = recording(8)
    two = write_bag(tmp_path / "two", imu, ["/left/imu", "/right/imu"], "mcap")
    with pytest.raises(InputError, match=r"2 topics .*: /left/imu, /right/imu; choose one"):
        read_imu(two)
    assert_same(read_imu(two, topic="/right/imu"), imu)
    with pytest.raises(InputError, match="no sensor_msgs/Imu on topic '/up'"):
        read_imu(two, topic="/up")
    none = write_bag(tmp_path / "none", imu, ["/fix"], "mcap")
    with pytest.raises(InputError, match=r"no topic of sensor_msgs/Imu; .*/fix"):
        read_imu(none)


def test_bag_without_the_package_says_how_to_install_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(b"#ROSBAG V2.0\n")
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(InputError, match=r"pip install 'schuler\[ros\]'"):
        read_imu(path)


def test_the_name_of_a_file_does_not_decide(tmp_path: Path) -> None:
    imu = recording()
    imu.to_parquet(tmp_path / "a.dat")
    assert_same(read_imu(tmp_path / "a.dat"), imu)


def test_shared_clock_corrects_only_what_the_others_prove(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    time = np.arange(100) * 0.01
    wrong = time.copy()
    wrong[40] = time[41]  # stamped one step late; the next row repeats the stamp

    def write(stamps: list[np.ndarray]) -> Path:
        frames = [
            polars.DataFrame(
                {
                    "time_s": t,
                    "imu": np.full(t.size, k + 1),
                    "gyro_x_rad_s": rng.normal(size=t.size),
                }
            )
            for k, t in enumerate(stamps)
        ]
        polars.concat(frames).write_parquet(tmp_path / "a.parquet")
        return tmp_path / "a.parquet"

    imu = read_imu(write([time, wrong, time]), imu=2)
    assert np.array_equal(imu.time, time)
    assert any("1 wrong time stamp" in line for line in imu.history)
    with pytest.raises(InputError, match=r"row 41, .*time repeats"):
        read_imu(write([wrong]))
    lost = np.delete(time, 40)
    with pytest.raises(InputError, match="time repeats"):
        read_imu(write([lost, wrong]), imu=2)
