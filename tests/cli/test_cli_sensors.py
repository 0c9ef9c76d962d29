"""Heading, barometer and magnetometer from files: what they do to a drive, and bad ones."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars
import pytest
from outcome import Outcome

from schuler.errors import SchulerError
from schuler.io import read_sensor
from schuler.io.sensors import BAROMETERS, HEADINGS, MAGNETOMETERS
from schuler.navigation.aiding.barometer import height_of_pressure, pressure_per_height
from schuler.navigation.aiding.magnetometer import earth_field
from schuler.simulation import car_urban

Call = Callable[..., Outcome]
EARTH = "4,63,48"
IRON = np.array([6.0, -9.0, 4.0])
HEADING_SD, BAROMETER_OFFSET = 0.3, 37.0


@pytest.fixture(scope="module")
def files(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """What the three sensors see of the drive of the small recordings."""
    folder = tmp_path_factory.mktemp("sensors")
    profile = car_urban(180.0, np.random.default_rng(12), standstill=30.0)
    rng = np.random.default_rng(21)
    time = np.arange(0.5, 179.0, 0.5)
    path = profile.trajectory(time)
    ahead = path.rotation[:, :, 0]
    heading = np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0]))
    heading += HEADING_SD * rng.standard_normal(time.size)
    field = earth_field(np.radians(4.0), np.radians(63.0), 48.0)
    seen = np.einsum("kij,i->kj", path.rotation, field) + IRON
    seen += 0.5 * rng.standard_normal(seen.shape)
    # a pressure whose standard height is that of the drive, 37 m too high
    height = path.position[:, 2] + BAROMETER_OFFSET + 0.1 * rng.standard_normal(time.size)
    pressure = 1013.25 * (1.0 - height / 44330.77) ** (1.0 / 0.190263)
    tables = {
        "heading.csv": {"time_s": time, "heading_deg": heading % 360.0, "sd_deg": HEADING_SD},
        "baro.csv": {"time [ms]": 1e3 * time, "pressure [hPa]": pressure},
        "mag.parquet": {"time_s": time} | {f"mag_{a}_uT": seen[:, i] for i, a in enumerate("xyz")},
    }
    for name, table in tables.items():
        frame = polars.DataFrame(table)
        if name.endswith("csv"):
            frame.write_csv(folder / name)
        else:
            frame.write_parquet(folder / name)
    return {name: folder / name for name in tables}


def drive(folder: Path) -> list[str]:
    options = ["--time-offset", "0", "--noise", str(folder / "noise.yaml")]
    for kind in ("imu", "gnss"):
        options += ["--" + kind, str(folder / f"{kind}.parquet")]
    return options


def navigated(recordings: Path, call: Call, target: Path, *more: object) -> tuple[dict, np.ndarray]:  # type: ignore[type-arg]
    """Summary, and heights over the last two minutes less the true ones, m."""
    track, out = target / "track.parquet", target / "n.json"
    done = call("navigate", *drive(recordings), "--out", track, "--json", out, *more)
    assert done.code == 0, done.err
    frame = polars.read_parquet(track)
    time = frame["time_s"].to_numpy()
    profile = car_urban(180.0, np.random.default_rng(12), standstill=30.0)
    height = frame["height_m"].to_numpy() - profile.trajectory(time).position[:, 2]
    return json.loads(out.read_text()), height[time > 60.0]


def test_each_sensor_tells_what_it_measures(
    recordings: Path, files: dict[str, Path], call: Call, tmp_path: Path
) -> None:
    alone, height_alone = navigated(recordings, call, tmp_path)
    sd_alone = alone["causal"]["attitude_sd_median_rad"][2]

    aided, _ = navigated(recordings, call, tmp_path, "--heading-file", files["heading.csv"])
    assert aided["causal"]["attitude_sd_median_rad"][2] < 0.7 * sd_alone
    # 357 headings, of which a share of sqrt(2/357) = 0.075 is chance
    assert aided["updates"]["heading"]["mean_nis_per_degree"] == pytest.approx(1.0, abs=0.3)
    assert aided["updates"]["heading"]["rejected"] == 0

    pressed = ("--barometer", files["baro.csv"], "--barometer-sd", 0.1)
    aided, height = navigated(recordings, call, tmp_path, *pressed)
    assert np.std(height) < 0.6 * np.std(height_alone)
    offset = aided["causal"]["last_sensor_errors"]["barometer offset, down"]
    # a height that is too large is an error of down that is negative
    assert offset == pytest.approx(-BAROMETER_OFFSET, abs=0.5)

    drawn = ("--magnetometer", files["mag.parquet"], "--earth-field", EARTH)
    aided, _ = navigated(recordings, call, tmp_path, *drawn, "--magnetometer-sd", 0.5)
    assert aided["causal"]["attitude_sd_median_rad"][2] < 0.8 * sd_alone
    assert aided["updates"]["magnetic field"]["mean_nis_per_degree"] == pytest.approx(1.0, abs=0.2)
    last = aided["causal"]["last_sensor_errors"]
    iron = [last[f"hard iron {a}"] for a in "xyz"]
    np.testing.assert_allclose(iron, IRON * 1e-6, atol=0.5e-6)


def test_outages_use_the_sensors(
    recordings: Path, files: dict[str, Path], call: Call, tmp_path: Path
) -> None:
    found = []
    for more in ((), ("--heading-file", files["heading.csv"])):
        target = tmp_path / "o.json"
        done = call("outages", *drive(recordings), "--window", "80:30", "--json", target, *more)
        assert done.code == 0, done.err
        found.append(json.loads(target.read_text())["causal"]["windows"][0]["claimed_sd_m"])
    assert found[1] < found[0]


def test_units_come_from_names_or_from_the_user(files: dict[str, Path], tmp_path: Path) -> None:
    seen = read_sensor(files["heading.csv"], HEADINGS)
    assert seen.sd is not None
    assert seen.sd[0] == pytest.approx(np.radians(HEADING_SD))
    profile = car_urban(180.0, np.random.default_rng(12), standstill=30.0)
    ahead = profile.trajectory(seen.time).rotation[:, :, 0]
    off = np.exp(1j * (seen.values - np.arctan2(ahead[:, 1], ahead[:, 0])))
    assert np.std(np.angle(off)) == pytest.approx(np.radians(HEADING_SD), rel=0.15)
    seen = read_sensor(files["baro.csv"], BAROMETERS)
    assert seen.quantity == "pressure"
    assert 9e4 < seen.values.min() < seen.values.max() < 1.02e5
    assert seen.time[0] == pytest.approx(0.5)
    field = read_sensor(files["mag.parquet"], MAGNETOMETERS).values
    assert np.linalg.norm(field[0] - IRON * 1e-6) == pytest.approx(48e-6, rel=0.05)
    plain = tmp_path / "plain.csv"
    plain.write_text("t,bx,by,bz,sd\n0.0,200,0,430,10\n1.0,200,0,431,10\n")
    seen = read_sensor(plain, MAGNETOMETERS, unit="mGauss")
    np.testing.assert_allclose(seen.values[1], [2e-5, 0.0, 4.31e-5])
    assert seen.sd is not None
    assert seen.sd[0] == pytest.approx(1e-6)
    # 12 Pa a metre at sea level, and the slope of the very formula anywhere
    p = np.array([101325.0, 8e4])
    slope = -1.0 / ((height_of_pressure(p + 1.0) - height_of_pressure(p - 1.0)) / 2.0)
    np.testing.assert_allclose(pressure_per_height(p), slope, rtol=1e-5)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time_s,speed_m_s\n1,2\n2,3\n", "no column for heading"),
        ("time_s,heading\n1,2\n2,3\n", "does not say its unit"),
        ("time_s,heading_m\n1,2\n2,3\n", "unit for angle"),
        ("time_s,heading_deg,sd_deg\n1,2,0.1\n2,3,0\n", "line 3"),
        ("time_s,heading_deg,sd_deg\n1,,0.1\n2,3,0.1\n", "1 of 2 rows"),
        ("heading_deg,sd_deg\n2,0.1\n3,0.1\n", "no column for time"),
        ("time_s,heading_deg\n1,2\n2,north\n", "north"),
    ],
)
def test_bad_files_are_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "heading.csv"
    path.write_text(text)
    with pytest.raises(SchulerError) as error:
        read_sensor(path, HEADINGS)
    assert words in str(error.value)
    assert "heading.csv" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("verb", ["navigate", "outages"])
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--heading-file", "none.csv"), "there is no such file"),
        (("--heading-sd", "1"), "--heading-sd without --heading-file"),
        (("--barometer", "BARO"), "no standard deviations"),
        (("--barometer", "BARO", "--barometer-sd", "-1"), "--barometer-sd -1"),
        (("--magnetometer", "MAG"), "--earth-field"),
        (("--magnetometer", "MAG", "--earth-field", "4,63"), "'4,63' is not understood"),
        (("--heading-file", "LATE"), "no heading in the time of the IMU"),
    ],
)
def test_bad_options_are_one_line(
    recordings: Path,
    files: dict[str, Path],
    call: Call,
    tmp_path: Path,
    verb: str,
    more: tuple[str, ...],
    words: str,
) -> None:
    late = tmp_path / "late.csv"
    late.write_text("time_s,heading_deg,sd_deg\n1001,2,1\n1002,3,1\n")
    named = {"BARO": files["baro.csv"], "MAG": files["mag.parquet"], "LATE": late}
    window = ["--window", "80:30"] if verb == "outages" else []
    done = call(verb, *drive(recordings), *window, *(named.get(m, m) for m in more))
    assert done.code == 2
    assert words in done.one_line()
