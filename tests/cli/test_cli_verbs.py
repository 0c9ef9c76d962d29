"""The verbs end to end on small recordings: their numbers are right and machine-readable."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars
import pytest
import yaml
from outcome import ACCEL_N, GYRO_N, Outcome

from schuler.noise import NoiseModel
from schuler.report.page import plotly_script


def test_characterize_finds_the_noise_that_was_put_in(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    names = ("report.html", "result.json", "noise.yaml", "imu.yaml")
    report, result, model, kalibr = (tmp_path / n for n in names)
    outcome = call(
        "characterize", recordings / "static.parquet", "--report", report, "--json", result,
        "--noise-out", model, "--kalibr", kalibr, "--topic", "/mine",
    )  # fmt: skip
    assert outcome.code == 0, outcome.err
    found = json.loads(result.read_text())
    assert sorted(found["channels"]) == [f"{s}_{a}" for s in ("accel", "gyro") for a in "xyz"]
    saved = NoiseModel.load(model)
    for channel, answer in found["channels"].items():
        truth = GYRO_N if channel.startswith("gyro") else ACCEL_N
        density = answer["parameters"]["white_noise.density"]
        # 30 000 samples: N is known to 0.4 % at best; the claim must hold within five sigma.
        assert 0.001 < density["standard_error"] / truth < 0.03, channel
        assert abs(density["value"] - truth) < 5.0 * density["standard_error"], channel
        assert saved.process(channel).parameters["white_noise.density"] == pytest.approx(
            density["value"], rel=1e-6
        )
    written = yaml.safe_load(kalibr.read_text())
    assert written["gyroscope_noise_density"] == pytest.approx(GYRO_N, rel=0.05)
    assert written["accelerometer_noise_density"] == pytest.approx(ACCEL_N, rel=0.05)
    assert written["rostopic"] == "/mine"
    assert written["update_rate"] == pytest.approx(50.0)
    page = report.read_text(encoding="utf-8")
    shown = re.search(r"White noise of the gyros: ([\d.]+) \(x\)", page)
    assert shown
    assert float(shown[1]) == pytest.approx(np.degrees(GYRO_N) * 60.0, rel=0.05)
    assert "static.parquet" in page
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(names)
    assert "white noise N" in outcome.out


def test_json_on_standard_output_is_alone_there(
    recordings: Path, call: Callable[..., Outcome]
) -> None:
    outcome = call("characterize", recordings / "static.parquet", "--json", "-")
    assert outcome.code == 0
    assert json.loads(outcome.out)["rate_hz"] == pytest.approx(50.0)
    assert "white noise N" in outcome.err


def test_a_terminal_without_unicode_is_no_reason_to_fail(recordings: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "schuler", "characterize", str(recordings / "static.parquet")],
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
    )
    assert done.returncode == 0, done.stderr
    assert b"white noise N" in done.stdout
    assert done.stdout.isascii()


@pytest.mark.skipif(os.name == "nt", reason="such names cannot exist there")
def test_a_hostile_file_name_is_only_a_name(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    name = "<img src=x onerror=alert(1)>[bold red]&amp;.parquet"
    log = tmp_path / name
    log.write_bytes((recordings / "static.parquet").read_bytes())
    report = tmp_path / "r.html"
    outcome = call("characterize", log, "--report", report)
    assert outcome.code == 0, outcome.err
    page = report.read_text(encoding="utf-8")
    assert "<img" not in page.replace(plotly_script(), "")
    assert "&lt;img src=x onerror=alert(1)&gt;[bold red]&amp;amp;" in page
    assert "[bold red]" in outcome.out


def test_strict_is_a_check(recordings: Path, tmp_path: Path, call: Callable[..., Outcome]) -> None:
    frame = polars.read_parquet(recordings / "static.parquet")
    knocked = frame["gyro_x_rad_s"].to_numpy().copy()
    knocked[15_000:15_010] += 0.5
    log = tmp_path / "knocked.parquet"
    frame.with_columns(polars.Series("gyro_x_rad_s", knocked)).write_parquet(log)
    looked = call("characterize", log)
    assert looked.code == 0
    assert "--repair cuts out" in looked.out
    failed = call("characterize", log, "--strict")
    assert failed.code == 1
    assert "check failed" in failed.err
    repaired = tmp_path / "repaired.json"
    done = call("characterize", log, "--strict", "--repair", "--json", repaired)
    assert done.code == 0
    assert "--repair cuts out" not in done.out
    density = json.loads(repaired.read_text())["channels"]["gyro_x"]["parameters"]
    assert density["white_noise.density"]["value"] == pytest.approx(GYRO_N, rel=0.05)


@pytest.fixture(scope="module")
def navigated(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from schuler.cli import main

    folder = tmp_path_factory.mktemp("navigated")
    drive = ["--imu", str(recordings / "imu.parquet"), "--gnss", str(recordings / "gnss.parquet")]
    options = ["--noise", str(recordings / "noise.yaml"), "--smooth"]
    for option, name in (("--out", "path.parquet"), ("--json", "n.json"), ("--report", "n.html")):
        options += [option, str(folder / name)]
    assert main(["navigate", *drive, *options]) == 0
    return folder


def test_navigate_writes_a_trajectory_as_good_as_it_claims(
    navigated: Path, recordings: Path
) -> None:
    path = polars.read_parquet(navigated / "path.parquet")
    gnss = polars.read_parquet(recordings / "gnss.parquet")
    time = path["time_s"].to_numpy()
    inside = (gnss["time_s"].to_numpy() >= time[0]) & (gnss["time_s"].to_numpy() <= time[-1])
    when = gnss["time_s"].to_numpy()[inside]
    metres = 6_371_000.0 * np.pi / 180.0
    for column, factor in (
        ("latitude_deg", metres),
        ("longitude_deg", metres * np.cos(np.radians(gnss["latitude_deg"][0]))),
    ):
        error = factor * (
            np.interp(when, time, path[column].to_numpy()) - gnss[column].to_numpy()[inside]
        )
        # GNSS is good to 0.5 m; the smoothed path is better, so the difference is GNSS's own.
        assert 0.4 < np.sqrt(np.mean(error**2)) < 0.65
    assert np.median(path["pos_std_north_m"].to_numpy()) < 0.5
    summary = json.loads((navigated / "n.json").read_text())
    assert summary["smoothed"]["position_sd_median_m"] < summary["causal"]["position_sd_median_m"]
    updates = summary["updates"]["GNSS position"]
    assert updates["updates"] == pytest.approx(inside.sum(), abs=2)
    # 150 epochs of 3 components: the mean of NIS over its degrees is within 1 +- 0.2.
    assert 0.75 < updates["mean_nis_per_degree"] < 1.25


def test_navigate_waits_for_a_lag_when_asked(
    recordings: Path, call: Callable[..., Outcome]
) -> None:
    drive = ("--imu", recordings / "imu.parquet", "--gnss", recordings / "gnss.parquet")
    known = ("--noise", recordings / "noise.yaml", "--time-offset", "0,0")
    done = call("navigate", *drive, *known, "--lag", "3", "--json", "-")
    assert done.code == 0
    summary = json.loads(done.out)
    assert summary["smoothed"]["smoothing"] == "fixed lag"
    assert summary["smoothed"]["lag_s"] == 3.0
    assert summary["smoothed"]["position_sd_median_m"] < summary["causal"]["position_sd_median_m"]
    refused = call("navigate", *drive, *known, "--lag", "-1")
    assert refused.code == 2
    assert "positive number of seconds" in refused.err


def test_export_of_a_trajectory_keeps_sensible_digits(
    navigated: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    target = tmp_path / "path.csv"
    assert call("export", navigated / "path.parquet", target).code == 0
    first, second = polars.read_parquet(navigated / "path.parquet"), polars.read_csv(target)
    assert second.columns == first.columns
    # 1e-10 deg are 0.01 mm; other columns have a hundredth of a millimetre or of a mm/s
    np.testing.assert_allclose(second.to_numpy(), first.to_numpy(), rtol=1e-9, atol=6e-6)
    places = ["latitude_deg", "longitude_deg"]
    np.testing.assert_allclose(
        second[places].to_numpy(), first[places].to_numpy(), rtol=0.0, atol=1e-10
    )


def test_export_of_a_noise_model(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    si = tmp_path / "si.yaml"
    assert call("export", recordings / "noise.yaml", si, "--to", "si").code == 0
    assert "rad/s/sqrt(Hz)" in si.read_text()
    again = NoiseModel.load(si)
    assert again.process("gyro_x").parameters["white_noise.density"] == pytest.approx(GYRO_N)
    kalibr = tmp_path / "imu.yaml"
    assert call("export", si, kalibr, "--to", "kalibr").code == 0
    written = yaml.safe_load(kalibr.read_text())
    assert written["gyroscope_noise_density"] == pytest.approx(GYRO_N)
    assert written["gyroscope_random_walk"] > 0.0  # Kalibr refuses zero


@pytest.fixture(scope="module")
def outage_files(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    from schuler.cli import main

    folder = tmp_path_factory.mktemp("outages")
    drive = ["--imu", str(recordings / "imu.parquet"), "--gnss", str(recordings / "gnss.parquet")]
    windows = ["--window", "70:20", "--window", "120:15"]
    outputs = ["--json", str(folder / "o.json"), "--report", str(folder / "o.html")]
    noise = ["--noise", str(recordings / "noise.yaml")]
    assert main(["outages", *drive, *windows, *noise, *outputs]) == 0
    assert main(["outages", *drive, *windows, *noise, "--limit", "1e-6"]) == 1
    return folder


def test_outages_have_the_promised_json(outage_files: Path) -> None:
    result = json.loads((outage_files / "o.json").read_text())
    for answer in ("causal", "smoothed"):
        part = result[answer]
        assert {"mean_of_max_m", "within_2_sigma", "windows"} <= set(part)
        assert [w["start_s"] for w in part["windows"]] == [70.0, 120.0]
        assert [w["duration_s"] for w in part["windows"]] == [20.0, 15.0]
        for window in part["windows"]:
            assert {"max_m", "mean_m", "claimed_sd_m"} <= set(window)
            assert 0.0 < window["mean_m"] <= window["max_m"] < 50.0
            assert window["claimed_sd_m"] > 0.0
        maxima = [w["max_m"] for w in part["windows"]]
        assert part["mean_of_max_m"] == pytest.approx(np.mean(maxima))
        assert 0.0 <= part["within_2_sigma"] <= 1.0
    assert result["smoothed"]["mean_of_max_m"] < result["causal"]["mean_of_max_m"]


def test_the_outage_report_holds_the_numbers_of_the_json(outage_files: Path) -> None:
    from schuler.report.numbers import number

    page = (outage_files / "o.html").read_text(encoding="utf-8")
    result = json.loads((outage_files / "o.json").read_text())
    text = re.sub(r"<[^>]+>", " ", page[page.index("Every window") :])
    for answer in ("causal", "smoothed"):
        for window in result[answer]["windows"]:
            assert number(window["max_m"]) in text
            assert number(window["claimed_sd_m"]) in text


def test_demo_on_recordings_goes_the_whole_way(
    recordings: Path, tmp_path: Path, call: Callable[..., Outcome]
) -> None:
    out = tmp_path / "new" / "demo"
    outcome = call("demo", "--data", recordings, "--out", out)
    assert outcome.code == 0, outcome.err
    names = ["imu.yaml", "noise.yaml", "outages.json", "report.html", "trajectory.parquet"]
    assert sorted(p.name for p in out.iterdir()) == names
    page = (out / "report.html").read_text(encoding="utf-8")
    for title in ("Noise", "Screening", "Track", "Innovations", "Outages", "provenance"):
        assert title in page
    assert "report.html" in outcome.out


WARMED = """
import sys
from schuler.cli import main

def compiled():
    found = set()
    for name, module in list(sys.modules.items()):
        if name.startswith("schuler.kernels."):
            for kernel in vars(module).values():
                found |= {(kernel.__name__, str(s)) for s in getattr(kernel, "signatures", ())}
    return found

folder = sys.argv[1]
drive = ["--imu", f"{folder}/imu.parquet", "--gnss", f"{folder}/gnss.parquet"]
assert main(["warm"]) == 0
before = compiled()
assert main(["characterize", f"{folder}/static.parquet"]) == 0
methods = [a for m in ("gmwm-robust", "ml", "psd", "arma", "ar") for a in ("--method", m)]
assert main(["characterize", f"{folder}/static.parquet", *methods]) == 0
assert main(["navigate", *drive, "--smooth", "--noise", f"{folder}/noise.yaml"]) == 0
assert main(["outages", *drive, "--window", "70:20"]) == 0
assert len(before) >= 4
print("@@", sorted(compiled() - before))
"""


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled")
def test_after_warm_no_verb_compiles_anything(recordings: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WARMED, str(recordings)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "@@ []"
