"""Whole recordings: noise model, findings, and six real runs of one sensor."""

from __future__ import annotations

import json
import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

from schuler.data import ImuRecording
from schuler.errors import EstimationError
from schuler.estimation.characterization import characterize_imu, grid_step
from schuler.estimation.comparison.agreement import compare_runs
from schuler.estimation.identification import Identification
from schuler.estimation.identify import identify
from schuler.noise import GaussMarkov, RandomWalk, WhiteNoise

GYRO = WhiteNoise(6e-4) + RandomWalk(3e-6)
ACCEL = WhiteNoise(1e-3) + GaussMarkov(5e-4, 10.0)


def recording(samples: int, dt: float = 0.05, *, seed: int = 1, step: float = 0.0) -> ImuRecording:
    rng = np.random.default_rng(seed)
    gyro = np.column_stack([GYRO.simulate(samples, dt, rng) for _ in range(3)])
    accel = np.column_stack([ACCEL.simulate(samples, dt, rng) for _ in range(3)])
    if step:
        gyro = step * np.round(gyro / step)
    accel[:, 2] -= 9.81
    return ImuRecording(np.arange(samples) * dt, gyro, accel, name="bench")


def test_every_channel_gets_its_process_and_errors() -> None:
    result = characterize_imu(recording(150_000))
    assert tuple(result.channels) == ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
    assert result.noise_model.rate == pytest.approx(20.0)
    assert "bench" in result.noise_model.source
    for channel, found in result.channels.items():
        truth = GYRO if channel.startswith("gyro") else ACCEL
        assert found.parameters["white_noise.density"] == pytest.approx(
            truth.parameters["white_noise.density"], rel=0.02
        )
        assert result.noise_model.process(channel) == found.process
        assert dict(result.noise_model.standard_errors[channel]) == found.standard_errors
    alone = identify(recording(150_000).accel[:, 1], 20.0)
    assert alone.parameters == pytest.approx(result.channels["accel_y"].parameters, rel=1e-9)
    back = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert back["duration_s"] == pytest.approx(149_999 * 0.05)
    assert set(back["channels"]) == set(result.channels)


def test_findings_speak_of_crossing_limits_and_length() -> None:
    findings = characterize_imu(recording(150_000)).findings
    text = "\n".join(findings)
    assert all("\n" not in f for f in findings)
    assert "were recorded" in findings[0]
    crossings = [f for f in findings if "cross" in f]
    # the gyro has white noise and walk only; the accelerometer has a real Gauss-Markov noise
    assert crossings
    assert all(f.startswith("gyro") for f in crossings)
    assert "accel_x, accel_y, accel_z: no random walk was found" in text
    assert "grid" not in text


def test_rounded_values_are_found() -> None:
    step = math.radians(0.2)
    coarse = recording(20_000, 0.01, step=step)
    assert grid_step(coarse.gyro[:, 0]) == pytest.approx(step, rel=1e-6)
    assert grid_step(coarse.accel[:, 0]) is None
    assert grid_step(np.zeros(100)) is None
    finding = [f for f in characterize_imu(coarse).findings if "grid" in f]
    assert len(finding) == 1
    assert "0.2 deg/s" in finding[0]
    assert "gyro_x" in finding[0]
    assert "accel_x" not in finding[0]


def test_channels_that_were_not_recorded_are_left_out() -> None:
    whole = recording(5000)
    gyro = whole.gyro.copy()
    gyro[:, 1] = np.nan
    partial = ImuRecording(whole.time, gyro, np.full((5000, 3), np.nan), name="two axes")
    assert tuple(characterize_imu(partial).channels) == ("gyro_x", "gyro_z")


def test_a_stuck_channel_is_named() -> None:
    whole = recording(5000)
    accel = whole.accel.copy()
    accel[:, 2] = 0.0
    stuck = ImuRecording(whole.time, whole.gyro, accel, name="bench")
    with pytest.raises(EstimationError, match="bench, accel_z: signal does not vary"):
        characterize_imu(stuck)


def test_runs_of_one_model_agree_and_others_do_not() -> None:
    rng = np.random.default_rng(4)
    same = [identify(ACCEL.simulate(100_000, 0.1, rng), 10.0) for _ in range(12)]
    agreement = compare_runs(same, "gauss_markov.sigma")
    assert agreement.shared
    assert agreement.degrees_of_freedom == 11
    assert agreement.value == pytest.approx(5e-4, abs=4.0 * agreement.standard_error)
    # chi-square of 11: between its 0.1 % quantiles
    assert 1.5 < agreement.chi_square < 31.3
    louder = WhiteNoise(1e-3) + GaussMarkov(8e-4, 10.0)
    other = [identify(louder.simulate(100_000, 0.1, rng), 10.0) for _ in range(4)]
    mixed = compare_runs([*same[:4], *other], "gauss_markov.sigma")
    assert not mixed.shared
    # half at 5e-4 and half at 8e-4: 0.25 in the logarithm
    assert mixed.between == pytest.approx(0.25, abs=0.1)
    with pytest.raises(EstimationError):
        compare_runs(same, "random_walk.initial_sd")


@lru_cache(maxsize=1)
def six_runs(folder: Path) -> tuple[dict[str, Identification], ...]:
    """The gyros of the six static runs of an ADIS16405; knocks of run 4 repaired."""
    from schuler.io import read_imu
    from schuler.screening.screen import repair, screen

    runs = []
    for k in range(1, 7):
        imu = read_imu(folder / "adis16405-static" / f"imu{k}.parquet")
        if k == 4:
            imu = repair(imu, screen(imu), close_up=True)
        runs.append({c: identify(imu.channel(c), 100.0) for c in ("gyro_x", "gyro_y", "gyro_z")})
    return tuple(runs)


@pytest.mark.parametrize(
    ("channel", "expected"), [("gyro_x", 0.041), ("gyro_y", 0.043), ("gyro_z", 0.039)]
)
def test_white_noise_of_the_replicates(data_folder: Path, channel: str, expected: float) -> None:
    found = [
        math.degrees(run[channel].parameters["white_noise.density"])
        for run in six_runs(data_folder)
    ]
    assert found[0] == pytest.approx(expected, rel=0.05)
    assert np.mean(found) == pytest.approx(expected, rel=0.05)
    # read at 1 s, as the documentation of the data does
    curve = six_runs(data_folder)[0][channel].curve
    at_one_second = float(np.interp(1.0, curve.tau, curve.deviation))
    assert math.degrees(at_one_second) == pytest.approx(expected, rel=0.05)


def test_replicates_do_not_share_one_white_noise_level(data_folder: Path) -> None:
    # run 5 is louder by 7 %, twenty times its own error: one unit, but not one state
    runs = six_runs(data_folder)
    for channel in ("gyro_x", "gyro_y", "gyro_z"):
        agreement = compare_runs([r[channel] for r in runs], "white_noise.density")
        assert not agreement.shared
        assert 0.01 < agreement.between < 0.10
