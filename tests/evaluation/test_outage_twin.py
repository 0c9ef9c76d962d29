"""Error models on twins: honest with their own truth, and in the order of spec 8.4 with S004's.

Noise of S004 table 4 with the bias instability that its curves bear (E-004-9), flicker as a sum of
Gauss-Markov noises, turn-on biases of 0.02 m/s² and 0.05 deg/s. Nothing was tuned on the windows.
"""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from schuler.data import CHANNELS
from schuler.evaluation.error_model_comparison import ErrorModelComparison, group_by_model
from schuler.evaluation.outage_twin import (
    OutageTwin,
    draw_outage_twin,
    outage_twin,
    run_outages,
)
from schuler.navigation.error_models.allan_readings import AllanReading
from schuler.navigation.error_models.autoregressive_fits import autoregressive_fits
from schuler.navigation.error_models.catalogue import ErrorModel, error_model
from schuler.noise import (
    Autoregressive,
    BiasInstability,
    NoiseModel,
    ProcessSum,
    RandomWalk,
    TurnOnBias,
    WhiteNoise,
)
from schuler.simulation import Profile, simulate_static
from schuler.simulation.motions.set_pieces import SetPiece, car_with_set_pieces
from schuler.units import parse

TURN_ON_ACCEL, TURN_ON_GYRO = 0.02, float(np.radians(0.05))
PIECES = (
    SetPiece(60.0, 11.7, share=0.2),
    SetPiece(30.0, 9.0, np.pi / 2, share=0.06),
    SetPiece(60.0, 13.0, share=0.06),
)
ORDER_SEEDS, OWN_SEEDS = 24, 8


def read(kind: str, n: str, b: str, time: float, k: str = "") -> AllanReading:
    return AllanReading(
        parse(n, f"{kind} white noise"),
        parse(b, f"{kind} bias instability"),
        time,
        parse(k, f"{kind} random walk") if k else 0.0,
    )


# S004 tables 4 and 5
READINGS = {
    "gyro_x": read("gyro", "2.42 deg/sqrt(h)", "44.533 deg/h", 490.89),
    "gyro_y": read("gyro", "1.988 deg/sqrt(h)", "38.81 deg/h", 623.25),
    "gyro_z": read("gyro", "2.164 deg/sqrt(h)", "31.717 deg/h", 735.17),
    "accel_x": read("accel", "0.045 m/s/sqrt(h)", "5.1581 m/s/h", 4.56, "166.3 m/s/h^1.5"),
    "accel_y": read("accel", "0.045 m/s/sqrt(h)", "4.5507 m/s/h", 7.26, "24.95 m/s/h^1.5"),
    "accel_z": read("accel", "0.047 m/s/sqrt(h)", "1.8336 m/s/h", 20.74, "13.53 m/s/h^1.5"),
}
# spec 2.4 b: the crossing of N and K taken out
TRUE_B = {"accel_x": "2.65 m/s/h", "accel_y": "4.22 m/s/h", "accel_z": "1.30 m/s/h"}
TRUE = {
    c: replace(r, bias_instability=parse(TRUE_B[c], "accel bias instability")) if c in TRUE_B else r
    for c, r in READINGS.items()
}


def sensor(*, turn_on: bool) -> NoiseModel:
    processes = {}
    for c, r in TRUE.items():
        parts = [WhiteNoise(r.white_noise), BiasInstability(r.bias_instability, 0.1, 1e4)]
        if r.random_walk:
            parts.append(RandomWalk(r.random_walk))
        if turn_on:
            parts.append(TurnOnBias(TURN_ON_ACCEL if c in TRUE_B else TURN_ON_GYRO))
        processes[c] = ProcessSum(tuple(parts))
    return NoiseModel(processes, source="S004 twin")


@functools.cache
def drive() -> tuple[Profile, tuple[tuple[float, float], ...]]:
    profile, windows = car_with_set_pieces(520.0, PIECES, 0, standstill=30.0)
    return profile, tuple((start - 1.0, seconds) for start, seconds in windows)


@functools.cache
def fits() -> dict[int, dict[str, Autoregressive]]:
    static = simulate_static(sensor(turn_on=False), 3600.0, 100.0, np.random.default_rng(1))
    return autoregressive_fits(static)


def models(*names: str) -> list[ErrorModel]:
    order = {"15AR": 1, "27AR": 3}
    return [
        error_model(
            n,
            TRUE if n.startswith("flicker4") else READINGS,
            autoregressive=fits()[order[n]] if n in order else None,
        )
        for n in names
    ]


@pytest.fixture(scope="module")
def comparison() -> ErrorModelComparison:
    twin = outage_twin(
        drive()[0],
        sensor(turn_on=True),
        drive()[1],
        turn_on_accel=TURN_ON_ACCEL,
        turn_on_gyro=TURN_ON_GYRO,
    )
    chosen = models("18AV", "18AVWD", "15AR", "27AR", "flicker4")
    draws = [
        run_outages(twin, chosen, draw_outage_twin(twin, np.random.default_rng([7, seed])))
        for seed in range(ORDER_SEEDS)
    ]
    return ErrorModelComparison(group_by_model(chosen, draws))


def test_allan_models_beat_ar1_and_ar1_beats_ar3(comparison: ErrorModelComparison) -> None:
    # spec 8.4: the order of the 60 s errors; AR(1) is 10 to 20 % worse, which takes 50 draws of
    # both drives of the study to be two standard errors, AR(3) four times
    for better, worse, apart in (
        ("18AV", "15AR", 1.0),
        ("18AVWD", "15AR", 1.0),
        ("15AR", "27AR", 3.0),
    ):
        pair = comparison.paired(better, worse, "end_m", windows=(0, 2))
        assert pair.standard_errors_apart < -apart, (better, worse, pair)


def test_denoising_changes_nothing_on_the_straight(comparison: ErrorModelComparison) -> None:
    # abs(18AVWD/18AV - 1) < 2 % of the rms, straight windows
    one, two = (comparison[n].values("end_m")[:, (0, 2)] for n in ("18AVWD", "18AV"))
    assert np.sqrt((one**2).mean() / (two**2).mean()) == pytest.approx(1.0, abs=0.02)
    # in the bend of 90 deg in ten seconds at 9 m/s the band of 0.39 Hz still holds the motion
    turn = (comparison[n].values("end_m")[:, 1] for n in ("18AVWD", "18AV"))
    one, two = turn
    assert np.sqrt((one**2).mean() / (two**2).mean()) == pytest.approx(1.0, abs=0.1)


def test_who_knows_how_wrong_it_is(comparison: ErrorModelComparison) -> None:
    # single channel at 60 s (spec 8.4): AV 0.57, flicker4 0.9 to 1.0, 27AR 0.16. In three
    # dimensions, over 50 draws: docs/error-models.md. Here 48 windows, 7 % of scatter.
    ratio = {}
    for name in comparison.names:
        windows = [w for s in comparison[name].causal for w in (s.windows[0], s.windows[2])]
        claimed = np.mean([w.end_claimed_sd_m**2 for w in windows])
        ratio[name] = float(np.sqrt(claimed / np.mean([w.end_m**2 for w in windows])))
    assert 0.45 < ratio["18AV"] < 0.85
    assert ratio["18AVWD"] == pytest.approx(ratio["18AV"], rel=0.03)
    assert ratio["27AR"] < 0.3
    assert 0.8 < ratio["flicker4"] < 1.3
    # NIS hides what outages show, but for the worst
    assert np.mean(comparison["18AV"].nis) == pytest.approx(1.04, abs=0.04)
    assert np.mean(comparison["flicker4"].nis) == pytest.approx(1.0, abs=0.02)
    assert np.mean(comparison["27AR"].nis) > 1.5


def test_no_model_is_better_than_the_floor(comparison: ErrorModelComparison) -> None:
    for name in comparison.names:
        result = comparison[name]
        stats = result.all_causal
        assert stats.floor_m is not None
        # the rms of 72 windows scatters by 6 %
        assert stats.end_rms_m > 0.8 * stats.floor_m


def test_the_same_seed_is_the_same_draw() -> None:
    profile, windows = drive()
    twin = outage_twin(profile, sensor(turn_on=True), windows)
    a, b, c = (draw_outage_twin(twin, np.random.default_rng(s)) for s in (3, 3, 4))
    np.testing.assert_array_equal(a.imu.gyro, b.imu.gyro)
    np.testing.assert_array_equal(a.gnss.position, b.gnss.position)
    assert np.abs(a.imu.gyro - c.imu.gyro).min() > 0.0


OWN = ("15AV", "18AV", "15AR", "27AR", "flicker4")


@pytest.mark.parametrize("name", OWN)
def test_every_model_is_honest_with_its_own_truth(name: str) -> None:
    """NIS and NEES bands with a sensor that does exactly what the filter is told."""
    (model,) = models(name)
    profile, windows = drive()
    twin: OutageTwin = outage_twin(profile, model.noise_model, windows)
    nis, nees = [], []
    for seed in range(OWN_SEEDS):
        stats, mean = run_outages(
            twin, [model], draw_outage_twin(twin, np.random.default_rng([9, seed]))
        )[name]
        nis.append(mean)
        for w in stats.windows:
            error = w.error_ned[-1, :2]
            nees.append(float(error @ np.linalg.solve(w.covariance[-1], error)))
    fixes = 520 - 150 - 1
    degrees = OWN_SEEDS * 6 * fixes
    tail = chi2.ppf([5e-4, 1.0 - 5e-4], degrees) / degrees
    # the first fix, 6 of 6 * fixes degrees, is the start itself
    assert tail[0] - 1.0 / fixes < np.mean(nis) < tail[1]
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], 2 * len(nees)) / 2
    assert low < np.sum(nees) / 2 < high, np.mean(nees) / 2


def test_channels_all_have_readings() -> None:
    assert set(READINGS) == set(CHANNELS)
