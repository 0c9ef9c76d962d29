"""What `python -m benchmarks.golden` runs: recordings cut short, twins, and commands.

Commands and the names of `import schuler` alone, so that every move of a module is outlived.
"""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from importlib import import_module
from io import StringIO
from itertools import product
from pathlib import Path
from runpy import run_module
from typing import Any

import numpy as np
import polars as pl

import schuler

Record = dict[str, Any]
Case = str | Callable[[Path], Record]

TRACK = "--json result.json --out track.parquet"

NOISE = """\
source: fixed
rate: 100 Hz
channels:
""" + "".join(
    f"  {sensor}_{axis}:\n"
    f"    - white_noise: {{density: {white}}}\n"
    f"    - gauss_markov: {{sigma: {sigma}, correlation_time: 200 s}}\n"
    f"    - random_walk: {{density: {walk}}}\n"
    for sensor, white, sigma, walk in (
        ("gyro", 2.5e-4, 1e-4, 5e-6),
        ("accel", 3e-3, 5e-3, 2e-4),
    )
    for axis in "xyz"
)


def call(command: str, folder: Path) -> tuple[int, str]:
    """One command of the program in this process: exit code, and what it said of an error.

    A `~` in the command is a blank inside a word.
    """
    os.chdir(folder)
    before, said = sys.argv, StringIO()
    sys.argv = ["schuler", *(w.replace("~", " ") for w in command.split())]
    code = 0
    try:
        with redirect_stdout(StringIO()), redirect_stderr(said):
            run_module("schuler", run_name="__main__")
    except SystemExit as end:
        code = int(end.code or 0)
    finally:
        sys.argv = before
    return code, said.getvalue().strip() if code >= 2 else ""


TWINS = (
    "simulate --out car --duration 150 --seed 5 --rate 50 --grade consumer --gnss code "
    "--vibration 1 --velocity",
    "simulate --out four --array 4 --duration 120 --seed 3 --rate 50",
)
# what heading, barometer and magnetometer see is drawn from a trajectory
TRAJECTORIES = {
    "thor": ("thor-flight/onboard_ekf.parquet", ("roll_rad", "pitch_rad", "yaw_rad"), 1.0),
    "car": ("car/truth.parquet", ("roll_deg", "pitch_deg", "heading_deg"), math.pi / 180.0),
}
FIELD = np.array([18.0, 1.2, 47.0])


def cut(source: Path, target: Path, begin: float, length: float, origin: float) -> None:
    target.parent.mkdir(exist_ok=True)
    inside = pl.col("time_s").is_between(origin + begin, origin + begin + length)
    pl.read_parquet(source).filter(inside).write_parquet(target)


def write_sensors(frame: pl.DataFrame, angles: Iterable[str], unit: float, target: Path) -> None:
    """Two readings a second of a heading, a barometer and a magnetometer along a trajectory."""
    time = frame["time_s"].to_numpy()
    at = np.arange(time[0] + 1.0, time[-1] - 1.0, 0.5)
    rng = np.random.default_rng(21)

    def interpolated(values: Any) -> Any:
        return np.interp(at, time, values)

    roll, pitch, yaw = (interpolated(np.unwrap(frame[a].to_numpy() * unit)) for a in angles)
    height = interpolated(frame["height_m"].to_numpy()) + 37.0 + 0.2 * rng.standard_normal(at.size)
    heading = np.degrees(yaw) + 0.5 * rng.standard_normal(at.size)
    ahead = FIELD[0] * np.cos(yaw) + FIELD[1] * np.sin(yaw)
    right = FIELD[1] * np.cos(yaw) - FIELD[0] * np.sin(yaw)
    up_front = ahead * np.sin(pitch) + FIELD[2] * np.cos(pitch)
    seen = (
        ahead * np.cos(pitch) - FIELD[2] * np.sin(pitch) + 6.0,
        right * np.cos(roll) + up_front * np.sin(roll) - 9.0,
        up_front * np.cos(roll) - right * np.sin(roll) + 4.0,
    )
    tables: dict[str, dict[str, Any]] = {
        "heading": {"heading_deg": heading % 360.0},
        "barometer": {"height_m": height},
        "magnetometer": {
            f"mag_{axis}_uT": values + 0.5 * rng.standard_normal(at.size)
            for axis, values in zip("xyz", seen, strict=True)
        },
    }
    for name, table in tables.items():
        pl.DataFrame({"time_s": at} | table).write_parquet(target / f"{name}.parquet")


def write_inputs(data: Path, folder: Path) -> None:
    (folder / "noise.yaml").write_text(NOISE, encoding="utf-8")
    for name, source, begin, length in (
        ("drive", "rtk-drive", 0.0, 180.0),
        ("walk", "rtk-walk", 0.0, 134.0),
        ("thor", "thor-flight", 150.0, 270.0),
        ("glitch", "f450-glitch", 0.0, 1000.0),
    ):
        origin = pl.read_parquet(data / source / "imu.parquet")["time_s"][0]
        for kind in ("imu", "gnss"):
            file = f"{kind}.parquet"
            cut(data / source / file, folder / name / file, begin, length, origin)
    for name, source, rows in (
        ("adis", "adis16405-static/imu1", 15_000),
        ("adis-long", "adis16405-static/imu4", 60_000),
        ("mtig", "mtig-gyro-static/gyro_x", 40_000),
    ):
        table = pl.read_parquet(data / f"{source}.parquet").head(rows)
        stamped = table.select(pl.Series("time_s", np.arange(rows) / 100.0), pl.all())
        stamped.write_parquet(folder / f"{name}.parquet")
    # rest in many poses, and half of the rotation
    cut(data / "mimu8-array/run4.parquet", folder / "mimu.parquet", 350.0, 200.0, 0.0)
    cut(data / "quad-4imu/path02_imu.parquet", folder / "quad.parquet", 0.0, 44.0, 0.0)
    truth = pl.read_parquet(data / "quad-4imu/path02_truth.parquet")
    clock = truth["time_s"].to_numpy()
    moved = {a: truth[f"{a}_m"].to_numpy() for a in ("north", "east", "down")}
    east = moved["east"] / (6.38e6 * math.cos(math.radians(32.8)))
    pl.DataFrame(
        {
            "time_s": clock,
            "latitude_deg": 32.8 + np.degrees(moved["north"] / 6.36e6),
            "longitude_deg": 35.0 + np.degrees(east),
            "height_m": 100.0 - moved["down"],
        }
        | {f"vel_{a}_m_s": np.gradient(values, clock) for a, values in moved.items()}
    ).write_parquet(folder / "quad-gnss.parquet")
    for command in TWINS:
        code, error = call(command, folder)
        if code:
            raise SystemExit(f"{command}: exit code {code}: {error}")
    for name, (file, angles, unit) in TRAJECTORIES.items():
        frame = pl.read_parquet((folder if name == "car" else data) / file)
        write_sensors(frame, angles, unit, folder / name)


# --- cases ---------------------------------------------------------------------------------------


def stream(folder: Path) -> Record:
    """`NavigationFilter` fed sample by sample, beside the batch filter: fixes late, with a lag."""
    # where the guide to real time says it is
    prepare = getattr(schuler, "prepare", None) or import_module("schuler.navigate").prepare
    recording, fixes = schuler.read_imu(folder / "drive"), schuler.read_gnss(folder / "drive")
    noise = schuler.NoiseModel.load(folder / "noise.yaml")
    aiding = ("nhc", "zupt")
    imu, setup = prepare(recording, fixes, noise, aiding=aiding)
    filter_ = schuler.NavigationFilter.from_setup(setup, imu, fixes, late=1.0, lag=3.0)
    columns = (fixes.position, fixes.position_sd, fixes.velocity, fixes.velocity_sd)
    waiting, kept, smoothed = 0, [], []
    for k, now in enumerate(imu.time.tolist()):
        filter_.add_imu(now, imu.gyro[k], imu.accel[k])
        while waiting < fixes.time.size and fixes.time[waiting] + 0.6 <= now:
            fix = tuple(f[waiting] for f in columns if f is not None)
            filter_.add_gnss(fixes.time[waiting], *fix)
            waiting += 1
        if k % 50 == 49:
            kept.append(filter_.state())
        if k % 500 == 499:
            smoothed.append(filter_.smoothed_state())
    batch = schuler.navigate(recording, fixes, noise, aiding=aiding)
    last = kept[-1]
    at = int(np.searchsorted(batch.trajectory.time, last.time))
    record: Record = {"late": filter_.late_fixes_refused, "likelihood": filter_.log_likelihood}
    for name, states in (("stream", kept), ("smoothed", [s for s in smoothed if s is not None])):
        for field in ("time", "position", "velocity", "rotation", "sensor_state", "covariance"):
            record[f"{name}/{field}"] = np.array([getattr(s, field) for s in states])
    record["batch/position"] = batch.trajectory.position[at]
    # not a value of its own: rounding would decide it
    record["equal"] = bool(np.allclose(last.position, batch.trajectory.position[at], atol=1e-9))
    return record


def library(folder: Path) -> Record:
    """Curves and fits that the command line reaches in part only."""
    imu = schuler.read_imu(folder / "adis.parquet")
    x = imu.gyro[:, 0]
    record: Record = {
        f"allan/{kind}": schuler.allan_deviation(x, 100.0, kind=kind)
        for kind in ("overlapping", "nonoverlapping", "modified", "hadamard", "total")
    }
    for name in ("power_spectral_density", "autocorrelation", "wavelet_variance"):
        more = {"onesided": True} if name.startswith("power") else {}
        record[name] = getattr(schuler, name)(x, 100.0, **more)
    record["denoise"] = schuler.denoise(x, rate=100.0)
    record["arma-garch"] = schuler.fit_arma_garch(x[:6000], 1, 1, joint=True, rate=100.0)
    array = schuler.read_array(folder / "quad.parquet")
    record["jumps"] = schuler.find_jumps(array)
    record["volatility"] = schuler.averaged_volatility(array)
    return record


def navigation_cases() -> Iterator[tuple[str, Case]]:
    """Every run with every aiding, causal, a few seconds late, and smoothed."""
    noise = "--noise ../noise.yaml"
    files = {
        "drive": f"--imu ../drive --gnss ../drive {noise}",
        "walk": f"--imu ../walk --gnss ../walk {noise}",
        "thor": f"--imu ../thor --gnss ../thor {noise} --gnss-position-sd 2 --gnss-velocity-sd 0.3",
        "car": f"--imu ../car/imu.parquet --gnss ../car/gnss.parquet {noise}",
    }
    heading, barometer = "--heading-file ../{}/heading.parquet --heading-sd 0.5", "--barometer "
    barometer += "../{}/barometer.parquet --barometer-sd 0.2"
    magnetometer = "--magnetometer ../{}/magnetometer.parquet --magnetometer-sd 0.5 "
    magnetometer += "--earth-field 3.8,69,50.3"
    sensors = f"{heading} --heading-offset-sd 3 {barometer} {magnetometer}"
    aids = {
        "drive": {
            "plain": "",
            "nhc": "--aid nhc",
            "zupt": "--aid zupt",
            "wheel": "--aid nhc --aid wheel",
            "vehicle": "--aid nhc --aid zupt --aid wheel",
            "huber": "--update huber",
            "student": "--update student-t",
            "adaptive": "--adaptive",
            "correlated": "--gnss-correlated 0.5:60",
            "robust": "--update student-t --adaptive --gnss-correlated 0.5:60 --aid nhc",
        },
        "walk": {"plain": "", "zupt": "--aid zupt"},
        "thor": {
            "plain": "",
            "heading": heading,
            "barometer": barometer,
            "magnetometer": magnetometer,
            "sensors": sensors,
            "robust": "--update huber --adaptive --gnss-correlated 2:100",
        },
        "car": {"all": f"{sensors} --aid nhc --aid zupt --aid wheel --lever-arm 0.3,0.1,-0.5"},
    }
    modes = {"causal": "", "lag": "--lag 3", "smooth": "--smooth"}
    for run, aiding in aids.items():
        for (name, aid), (mode, option) in product(aiding.items(), modes.items()):
            options = f"{files[run]} {aid.format(run, run, run)} {option}"
            yield f"navigate/{run}/{name}/{mode}", f"navigate {options} {TRACK}"
    yield "navigate/drive/untuned", f"navigate --imu ../drive --gnss ../drive {TRACK}"
    known = "--time-offset 0.26,0.13 --mounting 180,0,180 --lever-arm 0,-0.05,0 --no-tune-noise"
    yield "navigate/drive/known", f"navigate {files['drive']} {known} {TRACK}"
    glitch = "--imu ../glitch --gnss ../glitch --gnss-position-sd 2 --gnss-velocity-sd 0.3"
    yield "navigate/glitch/smooth", f"navigate {glitch} {noise} --update huber --smooth {TRACK}"
    outages = f"outages {files['drive']} --json result.json"
    yield "outages/windows", f"{outages} --window 70:20 --window 120:20"
    yield "outages/vehicle", f"{outages} --window 70:20 --window 120:20 {aids['drive']['vehicle']}"
    yield "outages/lag", f"{outages} --aid nhc --lag 4 --sweep 15:60"
    models = "own,15AV,18AV+turn-on,18AVWD,15AR,27AR,flicker4,18AV+corrected,own+garch"
    yield "outages/models", f"{outages} --models {models} --static ../adis.parquet --window 120:20"
    yield "tune", f"tune {files['walk']} --json result.json --noise-out tuned.yaml"
    yield "observability/drive", f"observability {files['drive']} --aid nhc --json result.json"


def array_cases() -> Iterator[tuple[str, Case]]:
    mounts = "".join(f" --mount 0,0,{yaw}" for yaw in (0, -1.8, -0.9, -1.0))
    sd = "--gnss-position-sd 0.1 --gnss-velocity-sd 0.2"
    quad = f"--array ../quad.parquet --gnss ../quad-gnss.parquet --noise ../noise.yaml {sd}{mounts}"
    four = "--array ../four --gnss ../four/gnss.parquet --noise ../four/noise.yaml"
    for name, files, window in (("quad", quad, "15:6"), ("four", four, "50:10")):
        run, table = f"navigate {files} --mechanization", "--out track.parquet"
        judged = f"--window {window} --json result.json"
        yield f"array/{name}/all", f"{run} all {judged}"
        for mechanization in ("single", "synthetic", "extended"):
            yield f"array/{name}/{mechanization}", f"{run} {mechanization} {TRACK}"
        for mechanization in ("constrained", "system"):
            # their summary as JSON ended in a KeyError when this was written
            yield f"array/{name}/{mechanization}", f"{run} {mechanization} {table}"
        for mechanization in ("synthetic", "extended"):
            yield f"array/{name}/{mechanization}-smooth", f"{run} {mechanization} --smooth {TRACK}"
        yield f"array/{name}/no-parity", f"{run} extended --parity=False {TRACK}"
    yield "observability/four", f"observability {four} --json result.json"
    calibrate = "calibrate ../mimu.parquet --json result.json --out board.yaml"
    yield "calibrate/mimu", calibrate
    yield "calibrate/quad", "calibrate ../quad.parquet --bandwidth 8 --model rotation --json r.json"
    again = "../mimu.parquet --calibration board.yaml"
    fused = "".join(
        f"\nfuse {again} --weights {w} --json {w}.json --out {w}.parquet --noise-out {w}.yaml"
        for w in ("auto", "equal", "inverse_variance", "averaged_volatility", "garch")
    )
    yield "fuse/mimu", calibrate + fused
    faults = f"{again} --json faults.json"
    yield "faults/mimu", f"{calibrate}\nfaults {faults}\nfuse {faults} --without-faults"
    yield "fuse/four", "fuse ../four --json result.json --out fused.parquet"
    yield "faults/four", "faults ../four --json result.json"


def other_cases() -> Iterator[tuple[str, Case]]:
    for name in ("adis", "mtig"):
        done = f"characterize ../{name}.parquet --json result.json --noise-out noise.yaml"
        yield f"characterize/{name}/all", f"{done} --method all"
    yield (
        "characterize/long",
        (
            "characterize ../adis-long.parquet --repair --json result.json --noise-out noise.yaml "
            "--kalibr kalibr.yaml\nexport noise.yaml imu.yaml --to kalibr\n"
            "export noise.yaml si.yaml --to si"
        ),
    )
    draw = "simulate --out . --duration 150 --seed 7"
    for motion in ("static", "car_mixed", "motorcycle", "ski", "walk", "drone"):
        yield f"simulate/{motion}", f"{draw} --motion {motion} --rate 50"
    yield "simulate/tetrahedron", f"{draw} --array tetrahedron --rate 50"
    yield (
        "simulate/harsh",
        (
            f"{draw} --grade phone --vibration 1 --scale-factor 500 --misalignment 0.2 "
            "--jitter 0.5 --g-sensitivity 0.05 --gyro-step 0.05 --accel-step 1 --warming 10 "
            "--clock 20 --repeated 0.02 --mounting 5,3,90 --latency 0.1,0.2 --outliers 0.01:20 "
            "--outage 110:5 --fault gap:90:1 --fault step:gyro_x:100:0.005 --fault fix:80:30\n"
            "navigate --imu imu.parquet --gnss gnss.parquet --noise noise.yaml --repair "
            "--update student-t --smooth --json result.json --out track.parquet\n"
            "export track.parquet track.csv"
        ),
    )
    yield "reproduce/S003", "reproduce S003 --item E-003-5 --processes 1 --json result.json"
    yield "reproduce/S003-figure", "reproduce S003 --item Fig.~1 --processes 1 --json result.json"
    yield "stream", stream
    yield "library", library


CASES: dict[str, Case] = dict([*other_cases(), *navigation_cases(), *array_cases()])
