"""Error models on the same windows: the comparison adds nothing of its own, and hides nothing."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from schuler.data import CHANNELS, GnssRecording, ImuRecording
from schuler.errors import InputError
from schuler.evaluation.error_model_comparison import ErrorModelComparison, compare_error_models
from schuler.evaluation.outages import evaluate_outages
from schuler.navigation.error_models.allan_readings import allan_readings
from schuler.navigation.error_models.catalogue import error_model
from schuler.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
from schuler.simulation import car_urban, ideal_imu, simulate_gnss, simulate_imu

ACCEL = WhiteNoise(3e-3) + GaussMarkov(2e-3, 20.0) + RandomWalk(2e-4, initial_sd=0.03)
GYRO = WhiteNoise(3e-4) + GaussMarkov(1e-4, 60.0) + RandomWalk(5e-6, initial_sd=1e-3)
NOISE = NoiseModel(
    processes={c: GYRO if c.startswith("gyro") else ACCEL for c in CHANNELS}, source="twin"
)
WINDOWS = ((100.0, 20.0), (115.0, 20.0), (200.0, 30.0))
NAMES = ("15AV", "18AVWD", "own")


def models() -> list:
    readings = allan_readings(NOISE)
    return [error_model(n, readings, noise_model=NOISE) for n in NAMES]


@pytest.fixture(scope="module")
def drive() -> tuple[ImuRecording, GnssRecording]:
    profile = car_urban(260.0, 3, standstill=20.0)
    rng = np.random.default_rng(12)
    imu = simulate_imu(ideal_imu(profile, 50.0), NOISE, rng)
    return imu, simulate_gnss(profile, 2.0, position_sd=0.2, velocity_sd=0.05, rng=rng)


@pytest.fixture(scope="module")
def comparison(drive: tuple[ImuRecording, GnssRecording]) -> ErrorModelComparison:
    return compare_error_models(
        *drive, models(), base=NOISE, windows=WINDOWS, smooth=True, time_offset=0.0
    )


def test_the_own_model_is_what_navigation_alone_gives(
    drive: tuple[ImuRecording, GnssRecording], comparison: ErrorModelComparison
) -> None:
    alone = evaluate_outages(*drive, NOISE, windows=WINDOWS, time_offset=0.0)
    own = comparison["own"]
    for one, two in ((own.causal[0], alone.causal), (own.smoothed[0], alone.smoothed)):
        for a, b in zip(one.windows, two.windows, strict=True):
            assert a.to_dict() == b.to_dict()
    assert own.nis[0] == pytest.approx(np.mean([r["nis_over_degrees"] for r in alone.runs]))


def test_nothing_looks_into_the_windows(
    drive: tuple[ImuRecording, GnssRecording], comparison: ErrorModelComparison
) -> None:
    imu, gnss = drive
    since = gnss.time - gnss.time[0]
    hidden = (since >= 100.0) & (since < 120.0)
    position = np.array(gnss.position)
    position[hidden, 0] += 2.0 / 6.37e6  # less than what is no truth
    other = compare_error_models(
        imu,
        replace(gnss, position=position),
        models(),
        base=NOISE,
        windows=WINDOWS[:1],
        time_offset=0.0,
    )
    same = compare_error_models(
        imu, gnss, models(), base=NOISE, windows=WINDOWS[:1], time_offset=0.0
    )
    for name in NAMES:
        one, two = (c[name].causal[0].windows[0].error_ned for c in (other, same))
        moved = one - two
        # the judge sees the two metres, the solution has not moved
        np.testing.assert_allclose(moved[:, 0], -2.0, rtol=2e-3)
        np.testing.assert_allclose(moved[:, 1], 0.0, atol=1e-3)


def test_windows_carry_their_floor_and_statistics_are_what_they_say(
    comparison: ErrorModelComparison,
) -> None:
    stats = comparison["own"].causal[0]
    last = stats.windows[2]
    t = last.time[-1] - last.start_s
    wanted = np.sqrt(2.0 * ((9.806 * 3e-4) ** 2 * t**5 / 20.0 + 3e-3**2 * t**3 / 3.0))
    assert last.floor_m == pytest.approx(wanted, rel=0.02)
    errors = np.concatenate([w.horizontal_m for w in stats.windows])
    assert stats.rms_m == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert np.mean(errors <= stats.circular_error_m(0.5)) == pytest.approx(0.5, abs=0.02)
    claims = np.concatenate([np.trace(w.covariance, axis1=1, axis2=2) for w in stats.windows])
    ratio = np.sqrt(np.mean(claims) / np.mean(errors**2))
    assert stats.claimed_over_real == pytest.approx(ratio)


def test_tracks_begin_together_and_part_by_the_errors(comparison: ErrorModelComparison) -> None:
    assert len(comparison.tracks) == 3
    for number, track in enumerate(comparison.tracks):
        assert set(track) == {"time", "reference", *NAMES}
        np.testing.assert_array_equal(track["reference"][0], 0.0)
        for name in NAMES:
            gap = np.linalg.norm(track[name] - track["reference"], axis=1)
            window = comparison[name].causal[0].windows[number]
            np.testing.assert_allclose(gap, window.horizontal_m, rtol=1e-9)


def test_everything_is_json(comparison: ErrorModelComparison) -> None:
    back = json.loads(json.dumps(comparison.to_dict(), allow_nan=False))
    assert set(back["models"]) == set(NAMES)
    assert back["models"]["15AV"]["states"] == 15
    assert len(back["pairs"]) == 4 * 3
    assert "ratio of sums" in back["percentages"]
    assert back["models"]["own"]["causal"]["windows"][0]["white_noise_floor_m"] > 0.0


def test_bad_requests_are_refused(drive: tuple[ImuRecording, GnssRecording]) -> None:
    twice = [models()[0], models()[0]]
    for chosen, windows in (([], WINDOWS), (twice, WINDOWS), (models(), ())):
        with pytest.raises(InputError):
            compare_error_models(*drive, chosen, base=NOISE, windows=windows)
    with pytest.raises(InputError, match="outside the run"):
        compare_error_models(*drive, models(), base=NOISE, windows=((250.0, 60.0),))
