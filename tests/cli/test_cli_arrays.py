"""Arrays on the command line: one mechanization, all side by side, observability, bad input."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from outcome import Outcome

from schuler.arrays.calibration.result import ArrayCalibration
from schuler.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
from schuler.rotations import dcm_from_euler
from schuler.simulation import motorcycle, simulate_array, simulate_gnss

Call = Callable[..., Outcome]

LEVER = "0.2,-0.1,-0.9"
YAW = 30.0


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("array")
    rng = np.random.default_rng(4)
    profile = motorcycle(120.0, 4, standstill=40.0)
    gyro = WhiteNoise(5e-4) + GaussMarkov(2e-4, 100.0) + RandomWalk(1e-6, 1e-3)
    accel = WhiteNoise(2e-3) + RandomWalk(1e-4, 0.02)
    noise = NoiseModel(
        {f"{s}_{a}": p for s, p in (("gyro", gyro), ("accel", accel)) for a in "xyz"}
    )
    rotations = [dcm_from_euler(0.0, 0.0, np.radians(a)) for a in (0.0, YAW)]
    places = [[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]]
    recordings = simulate_array(profile, rotations, places, noise, 50.0, rng)
    files = {}
    for i, recording in enumerate(recordings):
        files[f"imu{i + 1}"] = folder / f"imu{i + 1}.parquet"
        recording.to_parquet(files[f"imu{i + 1}"])
    files["gnss"], files["noise"] = folder / "gnss.parquet", folder / "noise.yaml"
    lever = [float(v) for v in LEVER.split(",")]
    simulate_gnss(
        profile, 1.0, position_sd=0.05, velocity_sd=0.03, lever_arm=lever, rng=rng
    ).to_parquet(files["gnss"])
    noise.save(files["noise"])
    return files


def arguments(drive: dict[str, Path], *more: str) -> list[str]:
    return [
        "--array", str(drive["imu1"]), "--array", str(drive["imu2"]),
        "--gnss", str(drive["gnss"]), "--noise", str(drive["noise"]), "--lever-arm", LEVER,
        "--mount", "0,0,0,0.1,0,0", "--mount", f"0,0,{YAW},-0.1,0,0", "--time-offset", "0", *more,
    ]  # fmt: skip


def test_all_mechanizations_stand_side_by_side(
    drive: dict[str, Path], call: Call, tmp_path: Path
) -> None:
    out, page = tmp_path / "all.json", tmp_path / "all.html"
    done = call(
        "navigate",
        *arguments(drive, "--mechanization", "all", "--window", "70:10", "--json", str(out),
                   "--report", str(page)),
    )  # fmt: skip
    assert done.code == 0, done.err
    found = json.loads(out.read_text(encoding="utf-8"))["mechanizations"]
    labels = [m["label"] for m in found]
    assert labels[-4:] == ["synthetic", "extended", "constrained", "system"]
    # positions of an antenna a metre away: a lever or a mounting with the wrong sign shows
    for m in found:
        assert m["outages"]["windows"][0]["max_m"] < 6.0
        assert 0.3 < m["nis_over_degrees"] < 1.5
        assert m["label"] in done.out
    assert [m["states"] for m in found[-4:]] == [
        12 + 9,  # three slow errors of GNSS beside those of the sensors
        12 + 18,
        2 * 18 + 6,  # the constrained filter takes errors of GNSS for white
        2 * 21,
    ]
    text = page.read_text(encoding="utf-8")
    assert "Biases of every sensor" in text
    assert "Claimed uncertainty" in text


def test_one_mechanization_writes_a_trajectory(
    drive: dict[str, Path], call: Call, tmp_path: Path
) -> None:
    track, out = tmp_path / "track.csv", tmp_path / "one.json"
    done = call("navigate", *arguments(drive, "--smooth", "--out", str(track), "--json", str(out)))
    assert done.code == 0, done.err
    assert len(track.read_text(encoding="utf-8").splitlines()) > 5000
    assert json.loads(out.read_text(encoding="utf-8"))["settings"]["mechanization"] == "extended"


@pytest.mark.parametrize("name", ["single", "synthetic", "constrained", "system"])
def test_every_mechanization_is_one_answer(
    drive: dict[str, Path], call: Call, tmp_path: Path, name: str
) -> None:
    track, out = tmp_path / "track.csv", tmp_path / "one.json"
    files = ("--out", str(track), "--json", str(out), "--report", str(tmp_path / "one.html"))
    done = call("navigate", *arguments(drive, "--mechanization", name, *files))
    assert done.code == 0, done.err
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["settings"]["mechanization"] == name
    assert isinstance(found["findings"], list)
    assert found["settings"]["updates_refused"] >= 0


def test_observability_says_what_is_hidden(
    drive: dict[str, Path], call: Call, tmp_path: Path
) -> None:
    out, page = tmp_path / "seen.json", tmp_path / "seen.html"
    done = call("observability", *arguments(drive, "--json", str(out), "--report", str(page)))
    assert done.code == 0, done.err
    synthetic, extended, parity = json.loads(out.read_text(encoding="utf-8"))["filters"]
    assert extended["rank"] == synthetic["rank"] == synthetic["states"]
    assert parity["rank"] == parity["states"] == extended["states"]
    assert "cancel in the fused measurement" in done.out
    assert "Singular values" in page.read_text(encoding="utf-8")
    alone = call(
        "observability", "--imu", str(drive["imu1"]), "--gnss", str(drive["gnss"]),
        "--noise", str(drive["noise"]), "--time-offset", "0",
    )  # fmt: skip
    assert alone.code == 0, alone.err
    assert "Nothing is hidden" in alone.out


@pytest.mark.parametrize("name", ["constrained", "system"])
def test_several_solutions_have_a_summary_like_any_other(
    drive: dict[str, Path], call: Call, tmp_path: Path, name: str
) -> None:
    out, page = tmp_path / "one.json", tmp_path / "one.html"
    told = ("--mechanization", name, "--json", str(out), "--report", str(page))
    done = call("navigate", *arguments(drive, *told))
    assert done.code == 0, done.err
    found = json.loads(out.read_text(encoding="utf-8"))
    assert found["findings"] == []
    assert found["settings"]["mechanization"] == name
    assert 0.3 < found["updates"]["GNSS velocity"]["mean_nis_per_degree"] < 1.5
    assert page.stat().st_size > 10_000


def test_the_lag_of_an_array_is_taken(drive: dict[str, Path], call: Call, tmp_path: Path) -> None:
    out, found = tmp_path / "one.json", {}
    for how in ((), ("--lag", "3"), ("--smooth",)):
        told = ("--mechanization", "system", "--json", str(out), *how)
        done = call("navigate", *arguments(drive, *told))
        assert done.code == 0, done.err
        found[how[:1]] = json.loads(out.read_text(encoding="utf-8"))["smoothed"]
    assert found[()] is None
    lagged, smoothed = found["--lag",], found["--smooth",]
    assert (lagged["smoothing"], lagged["lag_s"]) == ("fixed lag", 3.0)
    assert smoothed["smoothing"] == "fixed interval"
    assert smoothed["velocity_sd_median_m_s"] < lagged["velocity_sd_median_m_s"]
    both = call("navigate", *arguments(drive, "--lag", "3", "--smooth"))
    assert both.code == 2
    assert "--smooth and --lag" in both.one_line()


def board(path: Path, count: int = 2) -> Path:
    """The calibration of the array as it was made: turned, 0.1 m from the middle, one biased."""
    turned = np.stack([dcm_from_euler(0.0, 0.0, np.radians(a)) for a in (0.0, YAW)])
    nominal = turned[np.arange(count) % 2]
    triad, zero = np.zeros((count, 3, 3)), np.zeros((count, 3))
    ArrayCalibration(
        names=tuple(f"imu{i + 1}" for i in range(count)), nominal=nominal,
        gyro_sensor=nominal.transpose(0, 2, 1), gyro_deviation_sd=triad,
        gyro_bias=zero, gyro_bias_sd=zero,
        accel_sensor=nominal.transpose(0, 2, 1), accel_deviation_sd=triad,
        accel_bias=zero, accel_bias_sd=zero,
        position=np.array([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]])[np.arange(count) % 2],
        position_sd=zero, delay=np.zeros(count), delay_sd=np.zeros(count), period=None,
        beat=np.zeros(count), noise=1e-3,
    ).save(path)  # fmt: skip
    return path


def calibrated(drive: dict[str, Path], calibration: Path | None, *more: str) -> list[str]:
    """Without --mount."""
    given = ["--calibration", str(calibration)] if calibration else []
    return [
        "--array", str(drive["imu1"]), "--array", str(drive["imu2"]), "--lever-arm", LEVER,
        "--gnss", str(drive["gnss"]), "--noise", str(drive["noise"]), "--time-offset", "0",
        *given, *more,
    ]  # fmt: skip


def test_a_calibration_takes_the_place_of_the_mounting(
    drive: dict[str, Path], call: Call, tmp_path: Path
) -> None:
    yaml, out = board(tmp_path / "board.yaml"), tmp_path / "one.json"
    found = []
    for args in (arguments(drive), calibrated(drive, yaml)):
        done = call("navigate", *args, "--mechanization", "synthetic", "--json", str(out))
        assert done.code == 0, done.err
        found.append(json.loads(out.read_text(encoding="utf-8")))
    mounted, told = (np.array(f["causal"]["last_position_rad_m"]) for f in found)
    # sensors of equal noise on every axis: the axes they are written in make no difference
    assert np.linalg.norm((told - mounted) * [6.37e6, 4.5e6, 1.0]) < 1e-3
    untold = call("navigate", *calibrated(drive, None), "--mechanization", "synthetic")
    assert untold.code == 2 and f"rates of imu2 by {abs(YAW):.1f} deg" in untold.one_line()
    seen = tmp_path / "seen.json"
    done = call("observability", *calibrated(drive, yaml), "--json", str(seen))
    assert done.code == 0, done.err
    ranks = [f["rank"] for f in json.loads(seen.read_text(encoding="utf-8"))["filters"]]
    done = call("observability", *arguments(drive), "--json", str(seen))
    assert ranks == [f["rank"] for f in json.loads(seen.read_text(encoding="utf-8"))["filters"]]


@pytest.mark.parametrize("verb", ["navigate", "observability"])
def test_a_calibration_that_does_not_fit_is_one_line(
    drive: dict[str, Path], call: Call, tmp_path: Path, verb: str
) -> None:
    three = board(tmp_path / "three.yaml", 3)
    for args, words in (
        (calibrated(drive, three), "a calibration of 3 IMUs and an array of 2"),
        (calibrated(drive, tmp_path / "none.yaml"), "none.yaml"),
        (calibrated(drive, drive["noise"]), "noise.yaml"),
        (arguments(drive, "--calibration", str(three)), "--mount and --calibration together"),
    ):
        done = call(verb, *args)
        assert done.code == 2
        assert words in done.one_line()
    alone = ("--imu", str(drive["imu1"]), "--gnss", str(drive["gnss"]))
    done = call(verb, *alone, "--calibration", str(three))
    assert done.code == 2
    assert "this is no calibration of one IMU" in done.one_line()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--imu", "x.csv"), "--imu and --array together"),
        (("--mount", "0,0,0"), "3 mountings for 2 IMUs"),
        (("--mechanization", "federated"), "mechanization 'federated'"),
        (("--mechanization", "all", "--smooth"), "--smooth with --mechanization all"),
        (("--mechanization", "all", "--lag", "2"), "--lag with --mechanization all"),
        (("--mechanization", "all", "--update", "huber"), "--update, --adaptive or --gnss-corr"),
        (("--mechanization", "constrained", "--adaptive"), "--adaptive) with the constrained"),
        (
            ("--mechanization", "constrained", "--smooth"),
            "--lag) with the constrained",
        ),
    ],
)
def test_bad_input_is_one_line(
    drive: dict[str, Path], call: Call, more: tuple[str, ...], words: str
) -> None:
    done = call("navigate", *arguments(drive, *more))
    assert done.code == 2
    assert words in done.one_line()


def test_no_imu_at_all_is_said(drive: dict[str, Path], call: Call) -> None:
    done = call("navigate", "--gnss", str(drive["gnss"]))
    assert done.code == 2
    assert "no IMU" in done.err


def test_faults_can_be_left_alone_and_weights_are_named(
    drive: dict[str, Path], call: Call, tmp_path: Path
) -> None:
    out, judged = tmp_path / "one.json", []
    for more in ((), ("--without-faults", "--weights", "constant")):
        done = call("navigate", *arguments(drive), *more, "--json", str(out))
        assert done.code == 0, done.err
        told = json.loads(out.read_text(encoding="utf-8"))["settings"]["sensor_faults"]
        judged.append(told["judged"])
        assert told["taken_out"] == []
    assert judged == [True, False]
    wrong = call("navigate", *arguments(drive, "--weights", "loud"))
    assert wrong.code == 2 and "weights 'loud'" in wrong.one_line()
    other = call("navigate", *arguments(drive, "--weights", "ewma", "--mechanization", "system"))
    assert other.code == 2 and "--weights" in other.one_line()
