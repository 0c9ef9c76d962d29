"""`schuler simulate`: files that the other verbs read, the truth in them, and what was put in."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars
import pytest
import yaml
from outcome import Outcome

from schuler.arrays.read import read_array
from schuler.io import read_gnss, read_imu
from schuler.noise import NoiseModel
from schuler.rotations import dcm_from_euler

Call = Callable[..., Outcome]


def test_a_folder_that_navigate_reads_by_name_with_the_truth_beside_it(
    tmp_path: Path, call: Call
) -> None:
    out = tmp_path / "drive"
    options = ["--mounting", "180,0,90", "--lever-arm", "0.5,0,-1", "--seed", 4, "--rate", 50]
    outcome = call(
        "simulate", out, "--motion", "car_urban", "--duration", 180, *options, "--json", "-"
    )
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert told == yaml.safe_load((out / "simulation.yaml").read_text())
    assert told["seed"] == 4
    outcome = call(
        "navigate", "--imu", out, "--gnss", out, "--noise", out / "noise.yaml",
        "--lever-arm", "0.5,0,-1", "--out", tmp_path / "t.parquet", "--json", tmp_path / "n.json",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    found = polars.read_parquet(tmp_path / "t.parquet").to_dict()
    truth = polars.read_parquet(out / "truth.parquet").to_dict()
    np.testing.assert_allclose(found["time_s"], truth["time_s"], atol=1e-9)
    late = found["time_s"].to_numpy() > 90.0
    # centimetres of an RTK receiver, turned and carried over the lever arm as they should be
    for name, metres in (("latitude_deg", 111.2e3), ("height_m", 1.0)):
        off = metres * (found[name] - truth[name]).to_numpy()[late]
        assert np.sqrt(np.mean(off**2)) < 0.08
    for name in ("roll_deg", "pitch_deg", "heading_deg"):
        off = ((found[name] - truth[name]).to_numpy()[late] + 180.0) % 360.0 - 180.0
        assert np.sqrt(np.mean(off**2)) < 0.6
    summary = json.loads((tmp_path / "n.json").read_text())
    assert summary["settings"]["nis_over_degrees"] < 1.4
    # errors of differential GNSS last, and that is told
    assert {f["kind"] for f in summary["findings"]} <= {"lasting errors"}
    # upside down and turned by 90 deg: z reads +g at rest, and the mounting is found again
    imu = read_imu(out)
    assert imu.accel[:1000, 2].mean() == pytest.approx(9.8, abs=0.2)
    found_mounting = dcm_from_euler(*np.radians(summary["settings"]["mounting_deg"]))
    np.testing.assert_allclose(
        found_mounting, dcm_from_euler(np.pi, 0.0, np.pi / 2), atol=np.radians(1.0)
    )


def test_the_same_seed_gives_the_same_bytes_and_the_receiver_leaves_the_imu_alone(
    tmp_path: Path, call: Call
) -> None:
    common = ["--motion", "motorcycle", "--duration", 120, "--seed", 9, "--format", "csv"]
    common += ["--vibration", "0.5", "--scale-factor", 500, "--gyro-step", "0.01", "--rate", 20]
    for name, more in (("a", []), ("b", []), ("c", ["--gnss", "code", "--latency", "0.1,0.3"])):
        assert call("simulate", tmp_path / name, *common, *more).code == 0
    for file in ("imu.csv", "gnss.csv", "truth.csv", "noise.yaml", "simulation.yaml"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert (tmp_path / "a/imu.csv").read_bytes() == (tmp_path / "c/imu.csv").read_bytes()
    assert (tmp_path / "a/gnss.csv").read_bytes() != (tmp_path / "c/gnss.csv").read_bytes()
    gyro = np.degrees(read_imu(tmp_path / "a").gyro)
    np.testing.assert_allclose(gyro, 0.01 * np.round(gyro / 0.01), atol=1e-8)


def test_an_array_is_read_as_one_and_its_imus_see_one_motion(tmp_path: Path, call: Call) -> None:
    out = tmp_path / "array"
    options = ["--array", "tetrahedron:0.05", "--mounting", "0,0,30", "--grade", "none"]
    outcome = call("simulate", out, "--motion", "drone", "--duration", 90, "--rate", 50, *options)
    assert outcome.code == 0, outcome.err
    array = read_array(out)
    assert array.count == 4
    one, *others = array.recordings()
    norm = np.linalg.norm(one.gyro, axis=1)
    assert norm.max() > 0.2
    for other in others:
        np.testing.assert_allclose(np.linalg.norm(other.gyro, axis=1), norm, atol=1e-12)
        # 5 cm from the centre: the size effect, and no more than it
        apart = np.linalg.norm(other.accel, axis=1) - np.linalg.norm(one.accel, axis=1)
        assert 1e-4 < np.abs(apart).max() < 1.0
    # the z axis of the first looks up
    assert one.accel[:200, 2].mean() == pytest.approx(9.8, abs=0.05)


def test_faults_are_put_in_where_they_were_asked_for(tmp_path: Path, call: Call) -> None:
    out = tmp_path / "faulty"
    faults = ["gap:60:2", "stuck:gyro_x:80:3", "fix:100:10000", "late:110:0.4:5"]
    outcome = call(
        "simulate", out, "--duration", 150, "--rate", 50, "--outage", "120:10",
        *(part for f in faults for part in ("--fault", f)),
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    imu, gnss = read_imu(out), read_gnss(out)
    gap = np.flatnonzero(np.diff(imu.time) > 1.0)
    assert imu.time[gap] == pytest.approx([59.98])
    rows = (imu.time >= 80.0) & (imu.time < 83.0)
    assert np.ptp(imu.gyro[rows, 0]) == 0.0
    assert np.ptp(imu.gyro[rows, 1]) > 0.0
    truth = polars.read_parquet(out / "truth.parquet")
    north = 111.2e3 * (
        np.degrees(gnss.position[:, 0])
        - np.interp(gnss.time, truth["time_s"], truth["latitude_deg"])
    )
    assert gnss.time[np.abs(north) > 100.0].tolist() == [100.0]
    assert north[gnss.time == 100.0] == pytest.approx(1e4, rel=0.01)
    assert gnss.time[(gnss.time > 109.0) & (gnss.time < 116.0)].tolist() == pytest.approx(
        [110.4, 111.4, 112.4, 113.4, 114.4, 115.0]
    )
    assert not np.any((gnss.time >= 120.0) & (gnss.time < 130.0))
    told = yaml.safe_load((out / "simulation.yaml").read_text())
    assert len(told["outcome"]["faults"]) == 4


def test_waypoints_and_tracks_give_the_motion(tmp_path: Path, call: Call) -> None:
    time = np.arange(0.0, 61.0, 5.0)
    table = polars.DataFrame(
        {
            "time_s": time,
            "latitude_deg": 48.0 + 1e-3 * np.sin(time / 20.0),
            "longitude_deg": 11.0 + 2e-5 * time,
            "height_m": 500.0 + 0.1 * time,
        }
    )
    table.write_csv(tmp_path / "way.csv")
    out = tmp_path / "way"
    outcome = call("simulate", out, "--waypoints", tmp_path / "way.csv", "--rate", 20)
    assert outcome.code == 0, outcome.err
    truth = polars.read_parquet(out / "truth.parquet")
    at = np.interp(time[1:], truth["time_s"], truth["latitude_deg"])
    np.testing.assert_allclose(at, table["latitude_deg"][1:], atol=1e-8)
    again = tmp_path / "again"
    outcome = call("simulate", again, "--track", out / "gnss.parquet", "--rate", 20)
    assert outcome.code == 0, outcome.err
    other = polars.read_parquet(again / "truth.parquet")
    inside = np.interp(time[2:-2], other["time_s"], other["latitude_deg"])
    assert 111.2e3 * np.abs(inside - table["latitude_deg"].to_numpy()[2:-2]).max() < 0.3


def test_a_noise_model_of_its_own_is_drawn_from(tmp_path: Path, call: Call) -> None:
    from schuler.noise import WhiteNoise

    processes = {f"{s}_{a}": WhiteNoise(1e-3) for s in ("gyro", "accel") for a in "xyz"}
    NoiseModel(processes).save(tmp_path / "n.yaml")
    out = tmp_path / "still"
    outcome = call(
        "simulate", out, "--motion", "static", "--duration", 200, "--noise", tmp_path / "n.yaml"
    )
    assert outcome.code == 0, outcome.err
    imu = read_imu(out)
    # N / sqrt(dt), of 20 000 samples
    np.testing.assert_allclose(imu.gyro.std(axis=0), 1e-2, rtol=0.03)
    assert not [f for f in out.iterdir() if f.suffix not in (".parquet", ".yaml")]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--fault", "gap:60"], "gap:START:SECONDS"),
        (["--fault", "melt:60:2"], "melt"),
        (["--fault", "stuck:gyro_q:60"], "gyro_q"),
        (["--fault", "fix:1e6:10"], "no epoch"),
        (["--mounting", "1,2"], "--mounting"),
        (["--latency", "a"], "--latency"),
        (["--grade", "golden"], "golden"),
        (["--array", "17x"], "--array"),
        (["--waypoints", "none.csv"], "none.csv"),
        (["--waypoints", "a.csv", "--track", "b.csv"], "together"),
        (["--duration", "10"], "10 s"),
        (["--motion", "static", "--vibration", "1"], "vibration"),
        (["--seed", "-1"], "--seed"),
        (["--outliers", "2:50"], "share"),
        (["--warming", "10", "--array", "4"], "array"),
    ],
)
def test_bad_options_end_in_one_line_and_leave_no_folder(
    options: list[str], words: str, tmp_path: Path, call: Call
) -> None:
    outcome = call("simulate", tmp_path / "out", *options)
    line = outcome.one_line()
    assert outcome.code == 2, line
    assert words in line
    assert not (tmp_path / "out").exists()
