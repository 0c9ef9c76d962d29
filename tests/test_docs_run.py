"""Every command and every block of Python in the guide runs as printed.

A page is run from top to bottom in a folder with the recordings it speaks of, which are small. What
is not run stands in `LEFT`, with where it is run instead or why not; what is made smaller in
`SMALLER`.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars
import pytest

import schuler
from schuler.cli import main
from schuler.io.registry import trajectory_format
from schuler.rotations import dcm_from_euler, dcm_from_rotation_vector
from schuler.simulation import RTK_FIXED
from test_docs import PAGES, blocks, commands

RATE = 20.0
LEFT = {
    "README": {"": "the same as on the page index"},
    "error-models": {
        "outages": "15 s; test_cli_outage_models",
        "import schuler": "7 s; test_error_model_comparison",
    },
    "extending": {"from dataclasses": "test_extending", "from tides": "test_extending"},
    "first-hour": {"": "test_notebooks"},
    "fleets-and-long-logs": {
        "from concurrent.futures import Executor": "needs Ray",
        "class SparkExecutor": "needs Spark",
        "from schuler.estimation.gmwm.fit": "needs 66 000 samples; test_long_record",
    },
    "formats": {"from schuler.io import Format": "test_extending_formats"},
    "index": {"outages": "6 s; test_cli_verbs"},
    "mechanizations": {
        "navigate --array imu1.csv": "3 s; test_cli_arrays",
        "navigate --array quad-4imu": "benchmarks.mechanizations",
    },
    "methods": {"characterize static.csv --method all": "seconds; test_cli_methods"},
    "navigation-robustness": {
        "@dataclass": "test_extending_aiding",
        "navigate --imu town": "2 s; test_cli_simulate",
    },
    "reproduce": {"reproduce": "tests/papers", "from schuler_papers": "tests/papers"},
    "simulation": {"navigate": "5 s; test_cli_simulate", "outages": "the same"},
    "tuning": {"tune": "6 s; test_cli_tune"},
    "vehicle": {"navigate": "13 s; test_cli_vehicle"},
    "window": {"view": "tests/view"},
}
"""Beginnings of commands and blocks that are not run here, and where they are."""
SMALLER = {"runs=1000": "runs=2", "--motion car_urban": "--rate 20"}  # fmt: skip
"""What would take too long, and what is run in its place."""


def noise() -> schuler.NoiseModel:
    gyro = schuler.WhiteNoise(9e-5) + schuler.GaussMarkov(6e-5, 100.0)
    accel = schuler.WhiteNoise(7.5e-4) + schuler.GaussMarkov(1.4e-3, 15.0)
    return replace(schuler.NoiseModel.isotropic(gyro, accel), rate=RATE)


def turned_by_hand(count: int, poses: int = 14) -> schuler.ImuArray:
    """Rests in many poses and turns between them, seen by IMUs side by side."""
    rng, rate = np.random.default_rng(7), 50.0
    attitude, gyro, accel = np.eye(3), [], []
    for _ in range(poses):
        vector = rng.standard_normal(3)
        shares = np.concatenate([np.zeros(200), np.sin(np.pi * (np.arange(100) + 0.5) / 100.0)])
        for share in shares * np.pi / 200.0:
            gyro.append(share * rate * vector)
            accel.append(attitude.T @ (0.0, 0.0, 9.80665))
            attitude = attitude @ dcm_from_rotation_vector(share * vector)
    size = (len(gyro), count, 3)
    turn = dcm_from_rotation_vector(0.02 * rng.standard_normal((count, 3)))
    seen = (np.einsum("kij,ni->nkj", turn, np.array(a)) for a in (gyro, accel))
    sd = (1e-3, 1e-2)
    rates, forces = (s + d * rng.standard_normal(size) for s, d in zip(seen, sd, strict=True))
    return schuler.ImuArray(
        np.arange(len(gyro)) / rate, rates, forces, schuler.Mounting.aligned(count)
    )


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recordings that pages speak of, under their names."""
    here = tmp_path_factory.mktemp("guide")
    rng, model = np.random.default_rng(5), noise()
    model.save(here / "noise.yaml")
    log = schuler.simulate_static(model, 200.0, RATE, rng)
    scenario = schuler.Scenario("car_urban", model, RTK_FIXED, duration=390.0, rate=RATE)
    drive = schuler.simulate_drive(scenario, seed=3)
    write = trajectory_format("rtklib").write_trajectory
    assert write is not None
    for place in (here, here / "drive"):
        place.mkdir(exist_ok=True)
        drive.imus[0].to_polars().write_csv(place / "imu.csv")
        drive.gnss.to_polars().write_csv(place / "gnss.csv")
        fixes = drive.gnss
        sd = {
            f"{name}_{d}_{unit}": values[:, k]
            for k, d in enumerate(("north", "east", "down"))
            for name, unit, values in (
                ("pos_std", "m", fixes.position_sd),
                ("vel_std", "m_s", fixes.velocity_sd),
            )
        }
        track = schuler.Track(fixes.time, fixes.position, fixes.velocity)
        write(place / "gnss.pos", track.to_columns() | sd)
    drive.truth.to_parquet(here / "truth.parquet")
    log.to_polars().write_csv(here / "static.csv")
    log.to_parquet(here / "static.parquet")
    return here


def for_array_calibration(here: Path) -> dict[str, object]:
    array = turned_by_hand(3)
    for name in ("run1", "run4"):
        array.to_parquet(here / f"{name}.parquet")
    (here / "folder").mkdir()
    one = [array.imu(k).to_polars() for k in range(3)]
    for k, frame in enumerate(one):
        frame.write_csv(here / "folder" / f"imu{k + 1}.csv")
    one[0].write_csv(here / "left.csv")
    one[1].write_csv(here / "right.csv")
    long = [frame.with_columns(imu=polars.lit(k)) for k, frame in enumerate(one)]
    polars.concat(long).write_csv(here / "flight.csv")
    turned_by_hand(1).imu(0).to_polars().write_csv(here / "imu.csv")
    return {"rotations": array.mounting.rotation, "positions": array.mounting.position}


def for_error_models(here: Path) -> dict[str, object]:
    imu, gnss = schuler.read_imu(here / "imu.csv"), schuler.read_gnss(here / "gnss.csv")
    return {"noise": noise(), "imu": imu, "gnss": gnss}


def for_fleets(here: Path) -> dict[str, object]:
    for name in ("week", "monday", "tuesday"):
        shutil.copy(here / "static.parquet", here / f"{name}.parquet")
    (here / "sensors" / "SN42").mkdir(parents=True)
    (here / "week").mkdir()
    noise().save(here / "sensors" / "SN42" / "noise.yaml")
    lines = ["file,sensor,serial,date,gnss", "static.csv,imu,SN42,2026-03-01,"]
    lines += ["imu.csv,imu,SN42,2026-03-02,gnss.csv", ""]
    (here / "logs.csv").write_text("\n".join(lines))
    return {}


def for_judging(here: Path) -> dict[str, object]:
    shutil.copy(here / "gnss.pos", here / "reference.pos")
    fixes = schuler.read_gnss(here / "gnss.csv")
    still = np.tile(np.eye(3), (fixes.size, 1, 1))
    track = schuler.Track(fixes.time, fixes.position, fixes.velocity, still)
    write = trajectory_format("tum").write_trajectory
    assert write is not None
    write(here / "odometry.tum", track.to_columns())
    for name in ("before", "after"):
        command = f"evaluate odometry.tum --truth reference.pos --json {name}.json"
        assert main(command.split()) == 0
    return {}


def for_mechanizations(here: Path) -> dict[str, object]:
    turns = dcm_from_euler(0.0, 0.0, np.radians([0.0, 90.0]))
    two = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    scenario = schuler.Scenario(
        "motorcycle", noise(), RTK_FIXED, duration=160.0, rate=RATE,
        array_rotations=turns, array_positions=two,
    )  # fmt: skip
    ride = schuler.simulate_drive(scenario, seed=4)
    for k, imu in enumerate(ride.imus):
        imu.to_polars().write_csv(here / f"imu{k + 1}.csv")
    ride.gnss.to_polars().write_csv(here / "gnss.csv")
    return {}


def for_methods(here: Path) -> dict[str, object]:
    return {"signal": schuler.read_imu(here / "static.csv").channel("gyro_x"), "rate": RATE}


def for_robustness(here: Path) -> dict[str, object]:
    truth = schuler.read_track(here / "truth.parquet")
    assert truth.rotation is not None
    time, height = truth.time[::4], truth.position[::4, 2]
    field = schuler.earth_field(np.radians(4.0), np.radians(63.0), 48.0)
    seen = np.einsum("nji,j->ni", truth.rotation[::4], field)
    heading = np.degrees(np.arctan2(truth.rotation[::4, 1, 0], truth.rotation[::4, 0, 0])) % 360.0
    rng = np.random.default_rng(6)
    files: dict[str, dict[str, object]] = {
        "antennas": {"heading_deg": heading + 0.5 * rng.standard_normal(time.size), "sd_deg": 0.5},
        "baro": {"height_m": height + 0.3 * rng.standard_normal(time.size)},
        "mag": {f"mag_{a}_uT": seen[:, k] + 0.5 * rng.standard_normal(time.size)
                for k, a in enumerate("xyz")},
    }  # fmt: skip
    for name, columns in files.items():
        polars.DataFrame({"time_s": time} | columns).write_csv(here / "drive" / f"{name}.csv")
    return {}


def for_real_time(here: Path) -> dict[str, object]:
    imu, gnss = schuler.read_imu(here / "imu.csv"), schuler.read_gnss(here / "gnss.csv")
    after = imu.time[-1] + 1.0 / RATE
    fix = ("position", "position_sd", "velocity", "velocity_sd")
    names: dict[str, object] = {name: getattr(gnss, name)[-1] for name in fix}
    names |= {"time": after, "gyro": imu.gyro[-1], "accel": imu.accel[-1]}
    return names | {"recording": imu, "fixes": gnss, "noise_model": noise()}


def for_redundant(here: Path) -> dict[str, object]:
    array = turned_by_hand(4)
    (here / "array").mkdir()
    for k in range(4):
        array.imu(k).to_polars().write_csv(here / "array" / f"imu{k + 1}.csv")
    for name in ("ride", "other"):
        array.to_parquet(here / f"{name}.parquet")
    schuler.calibrate_array(array).save(here / "array.yaml")
    return {"time": array.time[0], "gyro": array.gyro[0], "accel": array.accel[0], "live": None}


def for_vehicles(here: Path) -> dict[str, object]:
    truth = schuler.read_track(here / "truth.parquet")
    assert truth.velocity is not None
    speed = np.linalg.norm(truth.velocity, axis=1)
    wheels = {"time_s": truth.time[::2], "speed_m_s": speed[::2]}
    polars.DataFrame(wheels).write_csv(here / "wheels.csv")
    return {}


MAKE: dict[str, Callable[[Path], dict[str, object]]] = {
    "array-calibration": for_array_calibration,
    "error-models": for_error_models,
    "fleets-and-long-logs": for_fleets,
    "judge": for_judging,
    "mechanizations": for_mechanizations,
    "methods": for_methods,
    "navigation-robustness": for_robustness,
    "real-time": for_real_time,
    "redundant-imus": for_redundant,
    "vehicle": for_vehicles,
}
"""What single pages need besides, and the names that their Python takes as given."""
EXPECTED = {"faults": {0, 1}}
NEEDED = {"results": ("pandas", "matplotlib")}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_a_page_runs_as_printed(
    page: Path,
    world: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for package in NEEDED.get(page.stem, ()):
        pytest.importorskip(package)
    here = tmp_path / "here"
    shutil.copytree(world, here)
    monkeypatch.chdir(here)
    left, names, met = LEFT.get(page.stem, {}), dict[str, object](), set[str]()
    if page.stem in MAKE:
        names = MAKE[page.stem](here)
    for language, block in blocks(page):
        lines = [block] if language == "python" else [" ".join(x) for x in commands(block)]
        for text in lines:
            skip = {start for start in left if text.startswith(start)}
            met |= skip
            if skip:
                continue
            for long, short in SMALLER.items():
                text = re.sub(long, short, text)
            if language == "python":
                exec(compile(text, page.name, "exec"), names)
            else:
                code = main([*text.split(), "--force"])
                assert code in EXPECTED.get(text.split()[0], {0}), (text, capsys.readouterr().err)
    assert met == set(left), "something in LEFT is on the page no more"
