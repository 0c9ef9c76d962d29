"""Bad input: one clear line with file and place, what was expected, what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars
import pytest

from schuler.errors import InputError
from schuler.io import read_gnss, read_imu

HEADER = "time_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,accel_x_m_s2,accel_y_m_s2,accel_z_m_s2"
ROWS = [f"{k / 100:.2f},0.01{k % 7},0.02{k % 5},0.03{k % 3},0.1{k % 9},0.2{k % 8},9.8{k % 4}"
        for k in range(100)]  # fmt: skip


def edited(row: int, text: str) -> list[str]:
    return [*ROWS[:row], text, *ROWS[row + 1 :]]


def cell(row: int, column: int, text: str) -> list[str]:
    fields = ROWS[row].split(",")
    fields[column] = text
    return edited(row, ",".join(fields))


def lines(rows: list[str], header: str = HEADER, end: str = "\n") -> str:
    return "\n".join([header, *rows]) + end


CASES: dict[str, tuple[str, tuple[str, ...]]] = {
    "empty file": ("", ("bad.csv", "empty")),
    "blank file": ("\n\n \n", ("bad.csv", "no line of numbers")),
    "header only": (HEADER + "\n", ("bad.csv", "no line of numbers")),
    "no such columns": ("a,b,c\n1,2,3\n2,3,4\n", ("bad.csv", "a, b, c", "columns=")),
    "text in a number": (lines(cell(40, 3, "oops")), ("line 42", "gyro_z_rad_s", "'oops'")),
    "text in time": (lines(cell(40, 0, "late")), ("line 42", "time_s", "'late'")),
    "two points in a number": (lines(cell(5, 6, "9.8.1")), ("line 7", "accel_z_m_s2", "'9.8.1'")),
    "nan": (lines(cell(40, 2, "nan")), ("line 42", "gyro_y_rad_s", "repair=True")),
    "nothing in a cell": (lines(cell(40, 2, "")), ("line 42", "gyro_y_rad_s", "1 of 100 rows")),
    "infinite": (lines(cell(40, 2, "inf")), ("line 42", "gyro_y_rad_s")),
    "time backwards": (lines(cell(40, 0, "0.11")), ("line 42", "time goes backwards", "0.39")),
    "time repeated": (lines(cell(40, 0, "0.39")), ("line 42", "time repeats", "repair=True")),
    "too few fields": (lines(edited(40, "0.40,1,2,3")), ("line 42",)),
    "too many fields": (lines(edited(40, ROWS[40] + ",7")), ("line 42", "8 fields", "7")),
    "cut in a line": (lines([*ROWS, "1.00,0.01"], end=""), ("line 102", "2 of 7 fields")),
    "cut in a number": (
        lines([*ROWS, "1.00,0.010,0.020,0.030,0.10,0.20,9."], end=""),
        ("line 102",),
    ),
    "cut before the last digit": (
        lines([*ROWS, "1.00,0.010,0.020,0.030,0.10,0.20,9.8"], end=""),
        ("line 102", "middle of a line"),
    ),
    "one sample": (lines(ROWS[:1]), ("bad.csv", "1 sample:", "rate", "at least 3")),
    "two samples": (lines(ROWS[:2]), ("bad.csv", "2 samples:", "rate", "at least 3")),
    "an axis of zeros": (
        lines([",".join([*r.split(",")[:3], "0.0", *r.split(",")[4:]]) for r in ROWS]),
        ("bad.csv", "gyro_z_rad_s", "zero in all 100 rows"),
    ),
    "packets of samples, no rate": (
        lines(
            [
                f"{k // 5 * 0.05 + k % 5 * 1e-4:.4f}," + r.split(",", 1)[1]
                for k, r in enumerate(ROWS)
            ]
        ),
        ("time_s", "no sampling rate can be found", "0.0001 s to 0.0496 s"),
    ),
    "same name twice": (lines(ROWS, HEADER.replace("gyro_y", "gyro_x")), ("gyro_x_rad_s", "two")),
    "only text": ("This is a letter.\nIt has lines.\n", ("bad.csv", "no line of numbers")),
}


@pytest.mark.parametrize("case", CASES)
def test_one_clear_line(tmp_path: Path, case: str) -> None:
    text, said = CASES[case]
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_imu(path)
    message = str(caught.value)
    assert str(path) in message
    assert message.count(str(path)) == 1
    assert "\n" not in message
    for part in said:
        assert part in message, message


def test_the_unspoilt_table_is_good(tmp_path: Path) -> None:
    path = tmp_path / "good.csv"
    for end in ("\n", ""):  # a missing end of the last line alone is no fault
        path.write_text(lines(ROWS, end=end), encoding="utf-8")
        imu = read_imu(path)
        assert imu.size == 100
        assert imu.accel[99, 2] == 9.83
    path.write_text(lines([*ROWS[:50], "", *ROWS[50:], "", ""]), encoding="utf-8")
    assert read_imu(path).size == 100


def test_line_numbers_count_comments_and_blank_lines(tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    rows = cell(40, 3, "oops")
    rows[10:10] = ["# a remark", ""]
    path.write_text("# made by hand\n" + lines(rows), encoding="utf-8")
    with pytest.raises(InputError, match="line 45"):
        read_imu(path)
    rows = cell(40, 2, "nan")
    rows[10:10] = ["# a remark", ""]
    path.write_text("# made by hand\n" + lines(rows), encoding="utf-8")
    with pytest.raises(InputError, match="line 45"):
        read_imu(path)


def test_repair_leaves_out_bad_rows_and_says_how_many(tmp_path: Path) -> None:
    rows = list(ROWS)
    rows[20] = cell(20, 2, "nan")[20]
    rows[30] = cell(30, 0, "0.29")[30]
    rows[40] = cell(40, 0, "0.05")[40]
    path = tmp_path / "bad.csv"
    path.write_text(lines([*rows, "1.00,0.01"], end=""), encoding="utf-8")
    imu = read_imu(path, repair=True)
    assert imu.size == 98  # the stamp that repeats has a gap of two steps behind it
    kept = np.delete(np.arange(100), [20, 40]) / 100
    assert np.allclose(imu.time, kept, atol=1e-12)
    text = "; ".join(imu.history)
    assert "left out the last line, which was cut off" in text
    assert "left out 1 rows with NaN or no value" in text
    assert "left out 1 rows whose time repeats or goes backwards" in text
    assert "left out 1 rows whose time repeats or goes backwards" in imu.assumptions


def parquet_cut(path: Path) -> None:
    polars.DataFrame({"time_s": np.arange(999.0), "gyro_x_rad_s": np.ones(999)}).write_parquet(path)
    path.write_bytes(path.read_bytes()[:-200])


def parquet_nan(path: Path) -> None:
    x = np.linspace(1, 2, 100)
    x[7] = np.nan
    polars.DataFrame({"time_s": np.arange(100) / 10, "gyro_x_rad_s": x}).write_parquet(path)


def parquet_text(path: Path) -> None:
    polars.DataFrame({"time_s": [1.0, 2.0], "gyro_x_rad_s": ["a", "b"]}).write_parquet(path)


def npz_objects(path: Path) -> None:
    np.savez(path, gyro=np.array([{"a": 1}], dtype=object))


def npz_lengths(path: Path) -> None:
    np.savez(path, time=np.arange(9.0), gyro=np.ones((8, 3)))


def npz_cut(path: Path) -> None:
    np.savez(path, time=np.arange(999.0), gyro=np.ones((999, 3)))
    path.write_bytes(path.read_bytes()[:3000])


def npz_coarse_time(path: Path) -> None:
    time = (1.75e9 + np.arange(100) / 100).astype(np.float32)
    np.savez(path, time=time, gyro=np.random.default_rng(1).normal(size=(100, 3)))


def garbage(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 20)


def broken_bag(path: Path) -> None:
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x00" * 500)


def broken_database(path: Path) -> None:
    path.write_bytes(b"SQLite format 3\x00" + b"\x07" * 2000)


def broken_ros1(path: Path) -> None:
    path.write_bytes(b"#ROSBAG V2.0\n" + b"\x09" * 500)


@pytest.mark.parametrize(
    ("name", "make", "said"),
    [
        ("a.parquet", parquet_cut, "cut short"),
        ("a.parquet", parquet_nan, "row 7, column 'gyro_x_rad_s'"),
        ("a.parquet", parquet_text, "holds text"),
        ("a.parquet", garbage, "the name says a Parquet file"),
        ("a.npz", npz_objects, "Python objects"),
        ("a.npz", npz_lengths, "differ in length"),
        ("a.npz", npz_cut, "cut short"),
        ("a.npz", npz_coarse_time, "32-bit"),
        ("a.csv", garbage, "not text"),
        ("a.mcap", broken_bag, "damaged"),
        ("a.db3", broken_database, "damaged"),
        ("a.bag", broken_ros1, "damaged"),
        ("a.mcap", garbage, "the name says a ROS 1 or ROS 2 bag"),
    ],
)
def test_binary_files(tmp_path: Path, name: str, make: Callable[[Path], None], said: str) -> None:
    path = tmp_path / name
    make(path)
    with pytest.raises(InputError) as caught:
        read_imu(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_folder_and_option(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_imu(tmp_path / "nowhere.csv")
    with pytest.raises(InputError, match=r"holds no imu\.\*"):
        read_imu(tmp_path)
    with pytest.raises(InputError, match=r"no option 'untis'; expected .*gyro_unit"):
        read_imu(tmp_path / "nowhere.csv", untis="deg")


GNSS = "time_s,latitude_deg,longitude_deg,height_m,pos_std_north_m,pos_std_east_m,pos_std_down_m\n"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("1,48,11,500,0.1,0.1,0.2\n2,48,11,500,0.1,0,0.2\n", "zero or negative in 1 of 2"),
        ("1,48,11,500,0.1,0.1,0.2\n2,,11,500,0.1,0.1,0.2\n", "line 3"),
        ("1,48,11,500,0.1,0.1,0.2\n1,48,11,500,0.1,0.1,0.2\n", "time repeats"),
        ("1,4800,11,500,0.1,0.1,0.2\n", "out of range"),
        ("1,48,x11,500,0.1,0.1,0.2\n2,48,11,500,0.1,0.1,0.2\n", "x11"),
    ],
)
def test_bad_gnss(tmp_path: Path, body: str, said: str) -> None:
    path = tmp_path / "gnss.csv"
    path.write_text(GNSS + body, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_gnss(path)
    assert said in str(caught.value), str(caught.value)
    assert str(path) in str(caught.value)


def test_gnss_without_position(tmp_path: Path) -> None:
    path = tmp_path / "gnss.csv"
    path.write_text("time_s,latitude_deg,height_m\n1,48,500\n", encoding="utf-8")
    with pytest.raises(InputError, match="no column for longitude"):
        read_gnss(path)
