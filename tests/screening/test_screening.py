"""Screening: what is put into a recording is found, and nothing that is not there."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.io import read_imu
from schuler.screening.screen import Screening, clean_segments, repair, screen

DEG = math.pi / 180.0
RATE = 100.0


def static(rows: int = 60_000, seed: int = 7, white: float = 1.0) -> ImuRecording:
    """White noise of a consumer sensor at rest, z up."""
    rng = np.random.default_rng(seed)
    gyro = white * rng.normal(0.0, 0.004, (rows, 3)) + [0.01, -0.02, 0.005]
    accel = white * rng.normal(0.0, 0.03, (rows, 3)) + [0.1, -0.2, 9.79]
    return ImuRecording(np.arange(rows) / RATE, gyro, accel, name="static")


def moving(rows: int = 60_000, seed: int = 8) -> ImuRecording:
    """As `static`, but rocking by up to 1 rad/s except in the first and last 100 s."""
    imu = static(rows, seed)
    t = imu.time
    swing = np.sin(0.7 * t) * ((t > 100.0) & (t < t[-1] - 100.0))
    gyro = imu.gyro + np.outer(swing, [1.0, 0.5, 0.2])
    accel = imu.accel + np.outer(2.0 * swing + 0.5 * swing * np.sin(9 * t), [1.0, 1.0, 0.3])
    return replace(imu, gyro=gyro, accel=accel, name="moving")


def kinds(screening: Screening, severity: str) -> set[str]:
    return {f.kind for f in screening.findings if f.severity == severity}


def test_a_good_static_recording_has_nothing_wrong() -> None:
    for seed in range(3):
        imu = static(seed=seed)
        screening = screen(imu)
        assert screening.static
        assert kinds(screening, "error") == set()
        assert kinds(screening, "warning") == set()
        assert screening.rate == pytest.approx(100.0)
        assert screening.jitter < 1e-9
        assert screening.rest == ((0.0, imu.time[-1]),)
        assert repair(imu, screening, close_up=True) is imu
        screening.require_usable()
        gravity = screening.of_kind("gravity")[0]
        assert gravity.value == pytest.approx(9.79, abs=0.01)
        assert "z axis points up" in gravity.message


def test_motion_is_no_fault_and_rest_is_found() -> None:
    imu = moving()
    screening = screen(imu)
    assert not screening.static
    assert kinds(screening, "warning") == set()
    assert screening.disturbed == ()
    first, last = screening.rest[0], screening.rest[-1]
    assert first[0] == pytest.approx(0.0, abs=1e-9)
    assert first[1] == pytest.approx(100.0, abs=2.0)
    assert last[0] == pytest.approx(imu.time[-1] - 100.0, abs=2.0)
    total = sum(b - a for a, b in screening.rest)
    assert total == pytest.approx(200.0, abs=6.0)


def test_jitter_and_gaps() -> None:
    imu = static()
    rng = np.random.default_rng(1)
    keep = np.ones(imu.size, dtype=bool)
    keep[1000:1010] = False
    keep[5000] = False
    time = imu.time + rng.uniform(-1e-3, 1e-3, imu.size)
    part = replace(imu, time=time[keep], gyro=imu.gyro[keep], accel=imu.accel[keep])
    screening = screen(part)
    # The difference of two uniform errors of +-1 ms has a standard deviation of sqrt(2/3) ms.
    assert screening.jitter == pytest.approx(math.sqrt(2.0 / 3.0) * 1e-3, rel=0.02)
    assert screening.rate == pytest.approx(100.0, rel=1e-3)
    assert screening.gaps == (1000, 4990)
    gap = screening.of_kind("gap")[0]
    assert "2 gaps, about 11 samples missing" in gap.message
    assert gap.value == pytest.approx(0.11, abs=3e-3)
    pieces = clean_segments(part, screening)
    assert [p.size for p in pieces] == [part.size - 4990, 3990, 1000]
    assert np.array_equal(pieces[1].time, part.time[1000:4990])


@pytest.mark.parametrize("share", [0.02, 0.34])
def test_repeated_rows_are_counted_and_left_out(share: float) -> None:
    imu = moving()
    rng = np.random.default_rng(2)
    source = np.arange(imu.size)
    repeats = np.flatnonzero(rng.random(imu.size) < share)
    repeats = repeats[repeats > 0]
    for k in repeats:  # a repeat of a repeat is one as well
        source[k] = source[k - 1]
    spoilt = replace(imu, gyro=imu.gyro[source], accel=imu.accel[source])
    screening = screen(spoilt)
    assert np.array_equal(np.flatnonzero(screening.repeated), repeats)
    assert screening.of_kind("repeated rows")[0].value == pytest.approx(repeats.size / imu.size)
    repaired = repair(spoilt, screening)
    assert repaired.size == imu.size - repeats.size
    kept = np.delete(np.arange(imu.size), repeats)
    assert np.array_equal(repaired.time, imu.time[kept])
    assert np.array_equal(repaired.gyro, imu.gyro[kept])
    assert f"left out {repeats.size} rows" in repaired.history[-1]
    assert not screen(repaired).repeated.any()


def test_coarse_quantisation_is_no_repetition_and_its_grid_is_found() -> None:
    imu = static()
    step_gyro, step_accel = 0.05 * DEG, 3.33e-3 * 9.80665
    coarse = replace(
        imu,
        gyro=np.round(imu.gyro / step_gyro) * step_gyro,
        accel=np.round(imu.accel / step_accel) * step_accel,
    )
    screening = screen(coarse)
    assert kinds(screening, "warning") == set()
    found = {f.channels[0]: f.value for f in screening.of_kind("grid")}
    assert found["gyro_x"] == pytest.approx(step_gyro, rel=1e-6)
    assert found["accel_x"] == pytest.approx(step_accel, rel=1e-6)
    assert screen(imu).of_kind("grid") == ()


def test_noise_below_the_grid_is_no_knock() -> None:
    imu = static()
    step = 0.02  # five times the noise: hardly ever a step, and then one only
    screening = screen(replace(imu, gyro=np.round(imu.gyro / step) * step))
    assert screening.static
    assert screening.disturbed == ()
    assert kinds(screening, "warning") == set()


def test_saturation_is_found_on_its_axis_only() -> None:
    imu = moving()
    gyro = imu.gyro.copy()
    gyro[:, 1] = np.clip(gyro[:, 1], -0.45, 0.45)
    screening = screen(replace(imu, gyro=gyro))
    (finding,) = screening.of_kind("saturation")
    assert finding.channels == ("gyro_y",)
    assert finding.value == np.sum(np.abs(gyro[:, 1]) == 0.45)


@pytest.mark.parametrize(("value", "said"), [(0.0, "is zero"), (9.81, "is 9.81")])
def test_stuck_axis_is_an_error(value: float, said: str) -> None:
    imu = static()
    accel = imu.accel.copy()
    accel[:, 1] = value
    screening = screen(replace(imu, accel=accel))
    (finding,) = [f for f in screening.findings if f.severity == "error"]
    assert finding.channels == ("accel_y",)
    assert said in finding.message
    assert screening.findings[0] is finding
    with pytest.raises(InputError, match="accel_y"):
        screening.require_usable()


@pytest.mark.parametrize(
    ("gyro", "accel", "said"),
    [
        (1.0, 1.0 / 9.80665, "seems to hold g "),
        (1.0, 1000.0 / 9.80665, "seems to hold mg"),
        (1.0, 9.80665, "multiplied by g twice"),
        (1.0, 0.7, "not near gravity"),
        (1.0 / DEG, 1.0, "gyro_unit='deg/s'"),
    ],
)
def test_wrong_units_are_suspected(gyro: float, accel: float, said: str) -> None:
    imu = static()
    # Bias of this sensor: 1.1 deg/s, so that deg/s read as rad/s are far beyond any gyro at rest.
    screening = screen(replace(imu, gyro=imu.gyro * gyro, accel=imu.accel * accel))
    assert any(said in f.message for f in screening.of_kind("units")), screening.lines
    assert screen(imu).of_kind("units") == ()


def test_knocks_are_found_cut_out_and_time_closed_up() -> None:
    imu = static()
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    ring = np.exp(-np.arange(60) / 15.0) * np.cos(np.arange(60))
    gyro[20_000:20_060, 0] += 0.3 * ring
    accel[20_000:20_060, 2] += 5.0 * ring
    gyro[40_000, 2] += 0.2
    knocked = replace(imu, gyro=gyro, accel=accel)
    screening = screen(knocked)
    assert [f.kind for f in screening.findings[:2]] == ["knock", "outlier"]
    (a, b), (c, d) = screening.disturbed
    assert 19_970 <= a <= 20_000
    assert 20_030 <= b <= 20_090
    assert (c, d) == (39_975, 40_026)
    assert repair(knocked, screening) is knocked  # time stays as it is unless asked for
    closed = repair(knocked, screening, close_up=True)
    assert closed.size == imu.size - (b - a) - (d - c)
    assert np.diff(closed.time) == pytest.approx(0.01, abs=1e-9)
    assert "cut out" in closed.history[-1]
    assert screen(closed).disturbed == ()
    # What is left has the spread of the clean noise; with the knock it is 9 % larger.
    assert closed.accel[:, 2].std() == pytest.approx(0.03, rel=0.02)
    pieces = clean_segments(knocked, screening)
    assert [p.size for p in pieces] == sorted([a, c - b, imu.size - d], reverse=True)


def test_heavy_tails_are_no_knocks() -> None:
    imu = static()
    rng = np.random.default_rng(3)
    gyro = imu.gyro.copy()
    bad = rng.random(imu.size) < 0.1
    gyro[bad, 0] += rng.normal(0.0, 0.05, int(bad.sum()))
    screening = screen(replace(imu, gyro=gyro))
    (finding,) = screening.of_kind("heavy tails")
    assert finding.channels == ("gyro_x",)
    # 10 % contaminated with 12 times the spread: three quarters of that lie beyond 4 sigma.
    assert finding.value == pytest.approx(0.075, abs=0.01)
    assert screening.disturbed == ()


def test_missing_channels_are_left_out_and_json_is_plain() -> None:
    imu = static(5000)
    alone = replace(imu, accel=np.full((imu.size, 3), np.nan))
    screening = screen(alone)
    assert screening.of_kind("channels")[0].channels == ("accel_x", "accel_y", "accel_z")
    text = json.dumps(screening.to_dict(), allow_nan=False)
    assert json.loads(text)["samples"] == 5000
    with pytest.raises(InputError, match="4000"):
        repair(static(4000), screening)


def test_a_very_short_recording_is_screened() -> None:
    for rows in (3, 10, 250):
        screening = screen(static(rows))
        assert screening.rate == pytest.approx(100.0)
        assert kinds(screening, "error") == set()


def test_knocks_of_run_four(data_folder: Path) -> None:
    imu = read_imu(data_folder / "adis16405-static" / "imu4.parquet")
    screening = screen(imu)
    assert screening.static
    for first, last in (
        (11_710, 11_898),
        (404_536, 404_637),
        (333_584, 333_584),
        (514_653, 514_653),
    ):
        assert any(a <= first and last < b for a, b in screening.disturbed), (first, last)
    cut = sum(b - a for a, b in screening.disturbed)
    assert cut < 1000
    closed = repair(imu, screening, close_up=True)
    assert closed.size == imu.size - cut
    assert np.abs(closed.gyro - np.median(closed.gyro, axis=0)).max() < 3.5 * DEG
    assert np.abs(imu.gyro).max() / DEG == pytest.approx(17.4, abs=0.5)
    assert np.diff(closed.time) == pytest.approx(0.01, abs=1e-8)
    grids = {f.channels[0][:4]: f.value for f in screening.of_kind("grid")}
    assert grids["gyro"] == pytest.approx(0.05 * DEG, rel=1e-6)
    assert grids["acce"] == pytest.approx(3.33e-3 * 9.80665, rel=1e-6)


@pytest.mark.parametrize("run", [2, 3, 5])
def test_quiet_runs_have_no_knocks(data_folder: Path, run: int) -> None:
    screening = screen(read_imu(data_folder / "adis16405-static" / f"imu{run}.parquet"))
    assert screening.disturbed == ()
    assert kinds(screening, "warning") == {"source of rate"}


@pytest.mark.parametrize(
    ("folder", "share", "rate"), [("rtk-drive", 0.02, 98), ("rtk-walk", 0.34, 100)]
)
def test_repeats_of_the_real_logs(
    data_folder: Path, folder: str, share: float, rate: float
) -> None:
    imu = read_imu(data_folder / folder)
    screening = screen(imu)
    assert float(screening.repeated.mean()) == pytest.approx(share, abs=0.006)
    repaired = repair(imu, screening)
    assert (repaired.size - 1) / repaired.duration == pytest.approx(rate, abs=1.0)
    assert not screening.static
    assert screening.of_kind("gravity")[0].value == pytest.approx(9.9, abs=0.05)


def test_contamination_of_the_mtig(data_folder: Path) -> None:
    screening = screen(read_imu(data_folder / "mtig-gyro-static"))
    assert screening.of_kind("heavy tails")[0].value == pytest.approx(0.14, abs=0.005)
    assert screening.disturbed == ()


def test_saturation_of_the_array(data_folder: Path) -> None:
    screening = screen(read_imu(data_folder / "mimu8-array" / "run1.parquet"))
    found = screening.of_kind("saturation")
    assert {c for f in found for c in f.channels} == {"gyro_x", "gyro_y", "gyro_z"}
    # The eight IMUs have 7500 to 8200 saturated counts together.
    assert sum(f.value or 0.0 for f in found) == pytest.approx(7850 / 8, rel=0.1)
    assert len(screening.rest) >= 20


def test_smooth_driving_is_not_taken_for_rest(data_folder: Path) -> None:
    screening = screen(read_imu(data_folder / "phone-highway"))
    assert screening.rest == ()
    assert not screening.static
