"""Trajectories in the forms of other programs, each read back."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from schuler.earth import ned_from_geodetic
from schuler.io import read_gnss
from schuler.io.registry import formats, trajectory_format

N = 200
START = 1752000000.0


def track(start: float = START) -> dict[str, np.ndarray]:
    t = np.arange(N) / 20.0
    columns = {"time_s": start + t, "latitude_deg": 48.1 + 1e-5 * np.sin(t),
               "longitude_deg": 11.5 + 2e-5 * t, "height_m": 520.0 + 0.1 * t}  # fmt: skip
    angles = [np.radians(columns[f"{n}_deg"]) for n in ("latitude", "longitude")]
    place = np.column_stack([*angles, columns["height_m"]])
    speed = np.gradient(np.asarray(ned_from_geodetic(place, place[0])), t, axis=0)
    for k, axis in enumerate(("north", "east", "down")):
        columns[f"vel_{axis}_m_s"] = speed[:, k]
        columns[f"pos_std_{axis}_m"] = np.full(N, 0.1 * (k + 1))
        columns[f"vel_std_{axis}_m_s"] = np.full(N, 0.05)
    return columns | {"roll_deg": np.full(N, 2.0), "pitch_deg": np.full(N, -1.0),
                      "heading_deg": np.linspace(0.0, 170.0, N)}  # fmt: skip


def written(path: Path, start: float = START) -> Path:
    write = trajectory_format(path.suffix).write_trajectory
    assert write is not None
    write(path, track(start))
    return path


@pytest.mark.parametrize(
    "name", ["a.csv", "a.parquet", "a.pos", "a.sbet", "a.nmea", "a.mat", "a.mcap"]
)
def test_what_we_also_read_comes_back(tmp_path: Path, name: str) -> None:
    if name == "a.mcap":
        pytest.importorskip("rosbags")
    gnss = read_gnss(written(tmp_path / name))
    known = track()
    t = known["time_s"] - START
    for k, column in enumerate(("latitude_deg", "longitude_deg")):
        wanted = np.interp(gnss.time - gnss.time[0], t, known[column])
        assert np.abs(np.degrees(gnss.position[:, k]) - wanted).max() < 3e-9
    if gnss.velocity is not None and name != "a.nmea":
        assert np.abs(gnss.velocity[:, 0] - known["vel_north_m_s"]).max() < 1e-5
    if name in ("a.pos", "a.sbet"):
        assert gnss.time[0] == pytest.approx((START - 315964800.0 + 18.0) % 604800.0)
    elif name != "a.mat":
        assert gnss.time[0] == pytest.approx(START, abs=1e-3)


def test_forms_of_the_odometry_world(tmp_path: Path) -> None:
    tum = written(tmp_path / "a.tum").read_text(encoding="utf-8").splitlines()
    rows = [line for line in tum if not line.startswith("#")]
    assert all(len(r.split(" ")) == 8 for r in rows)
    table = np.array([[float(x) for x in r.split(" ")] for r in rows])
    assert "latitude_deg 48.1" in tum[1]
    # east is x, north is y; heading 0 looks along y, so that x of the body turns by +90 deg
    assert table[-1, 1] > 10.0 > table[-1, 2]
    assert np.allclose(np.linalg.norm(table[:, 4:], axis=1), 1.0, atol=1e-8)
    x, y, z, w = table[0, 4:]
    assert np.degrees(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2))) == pytest.approx(
        90.0, abs=0.1
    )
    kitti = np.loadtxt(written(tmp_path / "a.kitti"))
    assert kitti.shape == (N, 12)
    assert np.allclose(kitti[:, 3::4], table[:, 1:4], atol=1e-5)
    turn = kitti[5].reshape(3, 4)[:, :3]
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-8)
    euroc = written(tmp_path / "a.euroc").read_text(encoding="utf-8").splitlines()
    assert euroc[1].split(",")[0] == str(int(START) * 10**9)
    assert len(euroc[1].split(",")) == 17
    beside = trajectory_format("tum").beside
    assert beside is not None
    assert json.loads(beside(track()))["origin"]["height_m"] == pytest.approx(520.0)


def test_maps_and_nav(tmp_path: Path) -> None:
    kml = ET.parse(written(tmp_path / "a.kml")).getroot()
    names = [e.tag.rpartition("}")[2] for e in kml.iter()]
    assert names.count("when") == names.count("coord") == 50
    gpx = ET.parse(written(tmp_path / "a.gpx")).getroot()
    first = next(e for e in gpx.iter() if e.tag.endswith("trkpt"))
    assert float(first.attrib["lat"]) == pytest.approx(48.1)
    line = json.loads(written(tmp_path / "a.geojson").read_text(encoding="utf-8"))
    assert line["features"][0]["geometry"]["coordinates"][0][:2] == [11.5, 48.1]
    nav = np.loadtxt(written(tmp_path / "a.nav"))
    assert nav.shape == (N, 11)
    assert np.allclose(nav[:, 10], track()["heading_deg"])
    assert sum(f.write_trajectory is not None for f in formats()) >= 12
