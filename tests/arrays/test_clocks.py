"""Clocks of several recordings, delays within an array, and jumps of whole samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler import simulation as simulate
from schuler.arrays.clocks.alignment import fit_clock
from schuler.arrays.clocks.delays import estimate_delays
from schuler.arrays.clocks.jumps import find_jumps, undo_jumps
from schuler.arrays.clocks.resampling import resample
from schuler.arrays.clocks.synchronization import synchronize
from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import CHANNELS, ImuArray, ImuRecording
from schuler.errors import EstimationError
from schuler.kernels.noise.viterbi import rare_changes
from schuler.noise import NoiseModel, WhiteNoise
from schuler.rotations import dcm_from_euler, rotation_vector_from_dcm

MODEL = NoiseModel({c: WhiteNoise(2e-4 if c[0] == "g" else 2e-3) for c in CHANNELS})
RATE = 100.0


@pytest.fixture(scope="module")
def ride() -> simulate.Profile:
    return simulate.motorcycle(300.0, 3, standstill=10.0)


def pair(ride: simulate.Profile, seed: int) -> tuple[ImuRecording, ImuRecording, np.ndarray]:
    rng = np.random.default_rng(seed)
    rotations = dcm_from_euler(*rng.uniform(-1.5, 1.5, (3, 2)))
    errors = simulate.TriadErrors(bias=rng.normal(0.0, 0.01, 3))
    a, b = simulate.simulate_array(
        ride, rotations, np.zeros((2, 3)), MODEL, RATE, rng, gyro_errors=errors
    )
    return a, b, rotations


def test_offset_and_rate_are_found_within_their_errors(ride) -> None:
    scores = []
    for seed in range(6):
        a, b, rotations = pair(ride, seed)
        rng = np.random.default_rng(100 + seed)
        ahead, gain = rng.uniform(-50.0, 50.0), rng.choice([-1.0, 1.0]) * 1e-4
        errors = simulate.StampErrors(offset=ahead, rate_error=gain, jitter=3e-4, lost=1e-3)
        clock, rotation = fit_clock(a, simulate.restamp(b, errors, rng))
        true = (clock.epoch - ahead + gain * b.time[0]) / (1.0 + gain) - clock.epoch
        scores.append((clock.offset - true) / clock.offset_sd)
        scores.append((clock.rate_error - gain / (1.0 + gain)) / clock.rate_error_sd)
        assert clock.offset_sd < 2e-4 and clock.rate_error_sd < 3e-6
        turn = rotation_vector_from_dcm(rotation @ rotations[1].T @ rotations[0])
        assert np.linalg.norm(turn) < 1e-3
    # 12 scores of unit variance: their mean square is within 0.25 and 2.3 in 99.9 %
    assert 0.25 < np.mean(np.square(scores)) < 2.3
    assert np.abs(scores).max() < 3.5


def test_recordings_become_one_array_on_one_clock(ride) -> None:
    a, _, rotations = pair(ride, 11)
    (b,) = simulate.simulate_array(
        ride, rotations[1:], np.zeros((1, 3)), MODEL, 97.0, np.random.default_rng(12)
    )
    late = simulate.restamp(
        b, simulate.StampErrors(offset=-3.7, rate_error=1e-4), np.random.default_rng(1)
    )
    dropped = replace(
        late, time=np.delete(late.time, slice(9000, 9400)),
        gyro=np.delete(late.gyro, slice(9000, 9400), axis=0),
        accel=np.delete(late.accel, slice(9000, 9400), axis=0),
    )  # fmt: skip
    result = synchronize([a, dropped])
    array = result.array
    np.testing.assert_array_equal(array.time, a.time)
    np.testing.assert_array_equal(array.gyro[:, 0], a.gyro)
    gap = np.isnan(array.gyro[:, 1, 0])
    assert abs(np.count_nonzero(gap) - 400 * RATE / 97.0) < 10
    truth = simulate.ideal_imu(ride, RATE).gyro
    error = array.gyro[:, 1] - truth @ rotations[1]
    error -= np.nanmedian(error, axis=0)
    # all fractions of a sample are passed through: the noise is lower by the mean gain
    white = 2e-4 * np.sqrt(97.0)
    assert 0.75 < result.noise_gain[1] < 0.9
    assert np.nanstd(error) == pytest.approx(white * np.sqrt(result.noise_gain[1]), rel=0.03)
    assert "ppm" in array.history[-1] and "variance of white noise" in array.history[-1]


def test_a_lost_sample_that_the_counter_does_not_see_is_found(ride) -> None:
    a, b, _ = pair(ride, 5)
    truth = simulate.ideal_imu(ride, RATE).gyro
    # where the rate changes fastest: there one sample is seen best
    row = int(np.argmax(np.convolve(np.linalg.norm(np.diff(truth, axis=0), axis=1), np.ones(50),
                                    mode="same")[8000:22000])) + 8000  # fmt: skip
    lost = replace(
        b, time=b.time[:-1] + 12.5, gyro=np.delete(b.gyro, row, axis=0),
        accel=np.delete(b.accel, row, axis=0),
    )  # fmt: skip
    clock, _ = fit_clock(a, lost)
    assert [s for _, s in clock.jumps] == [1]
    result = synchronize([a, lost])
    ((start, samples),) = result.clocks[0].jumps
    assert samples == 1
    assert start == pytest.approx(b.time[row] + 12.5, abs=0.05)
    assert abs(result.clocks[0].rate_error) < 5e-6


def test_different_bodies_and_rest_are_refused(ride) -> None:
    a, b, _ = pair(ride, 1)
    other = simulate.ideal_imu(simulate.ski(60.0, 200.0, 9), RATE)
    with pytest.raises(EstimationError, match="share no motion"):
        fit_clock(a, other)
    with pytest.raises(EstimationError, match=r"share no motion|0 window"):
        synchronize([a.between(0.0, 100.0), replace(b, time=b.time + 400.0).between(600.0, 700.0)])
    with pytest.raises(EstimationError, match="nothing to compare"):
        estimate_delays(ImuArray.from_recordings([a]))


def shaken(count: int, delays: np.ndarray, seed: int, noise: float = 2e-3) -> ImuArray:
    """Hand-held shaking about all axes, sampled by IMUs that lag behind their stamps."""
    rng = np.random.default_rng(seed)
    time = np.arange(6000) / RATE
    frequency, phase = rng.uniform(0.3, 3.0, (8, 3)), rng.uniform(0.0, 6.28, (8, 3))
    rates = np.stack(
        [np.sin(2 * np.pi * frequency * (t[:, None, None]) + phase).sum(axis=1)
         for t in (time - d for d in delays)], axis=1,
    )  # fmt: skip
    turns = dcm_from_euler(*rng.normal(0.0, 0.03, (3, count)))
    rates = np.einsum("kji,nkj->nki", turns, rates) + noise * rng.standard_normal(rates.shape)
    still = np.zeros((time.size, 3))
    return ImuArray.from_recordings([ImuRecording(time, rates[:, i], still) for i in range(count)])


def test_delays_against_the_mean_within_their_errors() -> None:
    scores = []
    for seed in range(8):
        true = np.random.default_rng(seed).normal(0.0, 3e-3, 4)
        found = estimate_delays(shaken(4, true, seed))
        scores.append((found.delay - (true - true.mean())) / found.standard_deviation)
        assert found.standard_deviation.max() < 2e-5
    mean_square = np.mean(np.square(scores))
    # 24 independent scores; the errors come from 30 windows each
    assert 0.5 < mean_square < 1.9


def test_jumps_are_found_to_the_sample_and_undone() -> None:
    array = shaken(3, np.array([0.0, 2e-3, -1e-3]), 3)
    gyro = np.array(array.gyro)
    gyro[2000:3500, 1] = array.gyro[2001:3501, 1]  # one too early for 15 s
    gyro[4200:, 2] = array.gyro[4198:-2, 2]  # two too late from there on
    jumps = find_jumps(replace(array, gyro=gyro))
    assert [(j.imu, j.samples) for j in jumps] == [(1, 1), (2, -2)]
    assert abs(jumps[0].first - 2000) <= 2 and abs(jumps[0].stop - 3500) <= 2
    assert abs(jumps[1].first - 4200) <= 2 and jumps[1].stop == 6000
    assert "too early" in str(jumps[0]) and "too late" in str(jumps[1])
    back = undo_jumps(replace(array, gyro=gyro), jumps)
    wrong = np.flatnonzero(~(back.gyro == array.gyro).all(axis=(1, 2)))
    assert wrong.size <= 12
    assert find_jumps(array) == ()


def test_noise_of_a_calm_ride_is_no_jump_and_true_jumps_are_found(ride) -> None:
    """Most of a ride turns slowly: there the noise of the others, shifted, fitted by chance."""
    place = tetrahedron_mounting(0.05)
    imus = simulate.simulate_array(
        ride, place.rotation, place.position, MODEL, 50.0, np.random.default_rng(42)
    )
    array = ImuArray.from_recordings(imus, place)
    assert find_jumps(array) == ()
    gyro = np.array(array.gyro)
    gyro[9000:, 2] = array.gyro[8998:-2, 2]
    (jump,) = find_jumps(replace(array, gyro=gyro))
    assert (jump.imu, jump.samples, jump.stop) == (2, -2, array.size)


def test_the_path_of_states_is_the_best_of_all() -> None:
    rng = np.random.default_rng(4)
    likelihood = rng.normal(0.0, 2.0, (7, 3))
    best, best_path = -np.inf, None
    for code in range(3**7):
        states = np.array([code // 3**k % 3 for k in range(7)])
        value = likelihood[np.arange(7), states].sum() - 1.5 * np.count_nonzero(np.diff(states))
        if value > best:
            best, best_path = value, states
    path = np.zeros(7, dtype=np.int64)
    rare_changes(likelihood, 1.5, path)
    np.testing.assert_array_equal(path, best_path)


def test_real_flights_show_the_lost_sample_and_no_other(data_folder) -> None:
    """Row by row, IMU 4 of path 3 loses a sample at 16.44 s; by its stamps it does not."""
    from schuler.io import read_imus

    file = data_folder / "quad-4imu" / "path03_imu.parquet"
    rows = ImuArray.from_recordings(read_imus(file, rate=120.005))
    delays = estimate_delays(rows, bandwidth=8.0)
    jumps = find_jumps(rows, delays, bandwidth=15.0)
    assert len(jumps) == 1 and jumps[0].imu == 3 and abs(jumps[0].samples) == 1
    edge = jumps[0].stop if jumps[0].first == 0 else jumps[0].first
    # the stamps say row 1973; low-passed to 15 Hz the end is known to half a period, 4 samples
    assert abs(edge - 1973) <= 8
    stamped = ImuArray.from_recordings(read_imus(file))
    assert find_jumps(stamped, bandwidth=15.0) == ()
    assert resample(stamped.time, stamped.gyro[:, 3], stamped.time[1973:1974]).values.shape == (
        1,
        3,
    )
