"""Recordings: means over the intervals, and errors that are what was asked for."""

from __future__ import annotations

import time as clock

import numpy as np
import pytest
from scipy.integrate import quad_vec

from schuler import earth
from schuler import simulation as simulate
from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError
from schuler.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
from schuler.rotations import dcm_from_rotation_vector, rotation_vector_from_dcm
from schuler.simulation.motions.drives import KNOT_SPACING

QUIET = 1e-4


def noise_model(**changed) -> NoiseModel:
    white = {c: WhiteNoise(QUIET if c.startswith("gyro") else 1e-3) for c in CHANNELS}
    return NoiseModel({**white, **changed})


@pytest.fixture(scope="module")
def drive() -> simulate.Profile:
    return simulate.car_urban(150.0, 2, standstill=20.0)


@pytest.mark.parametrize("rate", [5.0, 100.0, 123.4])
def test_samples_are_means_over_the_interval_that_ends_at_the_stamp(drive, rate) -> None:
    imu = simulate.ideal_imu(drive, rate)
    assert imu.time[0] == pytest.approx(1.0 / rate)
    for k in np.linspace(5, imu.size - 1, 7).astype(int):

        def both(t):
            return np.concatenate([x[0] for x in drive.rates(t)])

        knots = np.arange(0.0, 150.1, KNOT_SPACING)
        integral, _ = quad_vec(
            both, imu.time[k] - 1.0 / rate, imu.time[k], epsabs=1e-13, points=knots
        )
        mean = integral * rate
        # an interval of 0.2 s spans a knot, where the third derivative of the rates steps
        tolerance = 1e-5 if rate < 20.0 else 1e-9
        np.testing.assert_allclose(imu.gyro[k], mean[:3], atol=tolerance)
        np.testing.assert_allclose(imu.accel[k], mean[3:], atol=5 * tolerance)


def test_increments_with_coning_correction_carry_the_attitude_to_the_truth(drive) -> None:
    profile, imu = drive, simulate.ideal_imu(drive, 100.0)
    first, last = 2000, 12000
    truth = profile.trajectory(imu.time)
    angle = imu.gyro[first + 1 : last + 1] / 100.0
    before = imu.gyro[first:last] / 100.0
    body = dcm_from_rotation_vector(angle + np.cross(before, angle) / 12.0)
    middle = profile.motion(imu.time[first:last] + 0.005)
    w_in = earth.earth_rate_ned(middle.position[:, 0]) + earth.transport_rate_ned(
        middle.position, middle.velocity
    )
    frame = dcm_from_rotation_vector(-w_in / 100.0)
    c = truth.rotation[first]
    for k in range(last - first):
        c = frame[k] @ c @ body[k]
    error = rotation_vector_from_dcm(c @ truth.rotation[last].T)
    assert np.linalg.norm(error) < 1e-7


def test_chunks_leave_no_seams_and_an_hour_is_quick() -> None:
    profile = simulate.car_urban(3600.0, 1)
    before = clock.process_time()
    imu = simulate.ideal_imu(profile, 100.0)
    assert clock.process_time() - before < 4.0
    assert imu.size == 360_000
    at = np.arange(3, 80) * simulate.imu.CHUNK
    middle = profile.rates(imu.time[at] - 0.005)
    np.testing.assert_allclose(imu.gyro[at], middle[0], atol=2e-5)
    np.testing.assert_allclose(imu.accel[at], middle[1], atol=2e-4)


def test_static_recording_shows_gravity_and_earth_rate() -> None:
    imu = simulate.simulate_static(None, 10.0, 50.0, np.random.default_rng(1),
                                   position=(0.8, 0.1, 300.0))  # fmt: skip
    assert imu.size == 500
    assert imu.rate == pytest.approx(50.0)
    np.testing.assert_allclose(imu.accel, [[0, 0, -earth.gravity(0.8, 300.0)]] * 500, atol=1e-9)
    np.testing.assert_allclose(imu.gyro, [earth.earth_rate_ned(0.8)] * 500, atol=1e-13)


def test_noise_has_the_density_of_the_model() -> None:
    n, rate = 200_000, 100.0
    imu = simulate.simulate_static(noise_model(), n / rate, rate, np.random.default_rng(2))
    deviation = np.std(imu.signals(), axis=0)
    expected = np.array([QUIET] * 3 + [1e-3] * 3) * np.sqrt(rate)
    # relative sd of a standard deviation: 1 / sqrt(2 n) = 0.0016
    np.testing.assert_allclose(deviation, expected, rtol=0.008)


def test_channels_are_independent_and_reproducible() -> None:
    make = lambda seed, model=None: simulate.simulate_static(  # noqa: E731
        model or noise_model(), 100.0, 100.0, np.random.default_rng(seed)
    )
    one, again, other = make(3), make(3), make(4)
    np.testing.assert_array_equal(one.signals(), again.signals())
    everything = np.hstack([one.signals(), other.signals()])
    correlation = np.corrcoef(everything.T) - np.eye(12)
    assert np.abs(correlation).max() < 0.05  # 66 pairs of sd 0.01
    # another process on one channel leaves the draws of the others as they are
    changed = make(3, noise_model(gyro_y=WhiteNoise(QUIET) + RandomWalk(1e-4)))
    for channel in CHANNELS:
        same = np.array_equal(changed.channel(channel), one.channel(channel))
        assert same == (channel != "gyro_y")


def test_a_recording_does_not_depend_on_what_is_drawn_around_it() -> None:
    ideal = simulate.ideal_imu(simulate.static(20.0), 100.0)
    children = np.random.default_rng(5).spawn(3)
    forward = [simulate.simulate_imu(ideal, noise_model(), c).gyro for c in children]
    children = np.random.default_rng(5).spawn(3)
    backward = [simulate.simulate_imu(ideal, noise_model(), c).gyro for c in children[::-1]]
    np.testing.assert_array_equal(forward, backward[::-1])


def test_slow_processes_start_stationary() -> None:
    model = NoiseModel({"accel_x": GaussMarkov(sigma=2e-3, correlation_time=1000.0)})
    starts = [
        simulate.simulate_static(model, 0.1, 100.0, rng).accel[0, 0]
        for rng in np.random.default_rng(6).spawn(400)
    ]
    assert 0.89 < np.std(starts) / 2e-3 < 1.11  # three times 1 / sqrt(800)
    one = simulate.simulate_static(model, 1.0, 100.0, np.random.default_rng(7))
    assert np.ptp(one.accel[:, 1]) == 0.0  # a channel without a process has no noise


def test_bias_scale_misalignment_saturation_and_steps() -> None:
    ideal = simulate.ideal_imu(simulate.static(1.0, pitch=0.3), 100.0)
    g = earth.gravity(np.pi / 4, 250.0)
    matrix = np.array([[0.01, 0.0, 0.002], [0.0, 0.0, 0.0], [0.0, 0.0, -0.02]])
    errors = simulate.TriadErrors(bias=(0.1, -0.2, 0.3), matrix=matrix)
    rng = np.random.default_rng(8)
    seen = simulate.simulate_imu(ideal, None, rng, accel_errors=errors)
    f_x, f_z = g * np.sin(0.3), -g * np.cos(0.3)
    expected = [1.01 * f_x + 0.002 * f_z + 0.1, -0.2, 0.98 * f_z + 0.3]
    np.testing.assert_allclose(seen.accel[10], expected, atol=1e-9)
    np.testing.assert_array_equal(seen.gyro, ideal.gyro)

    coarse = simulate.TriadErrors(saturation=8.0, quantization_step=0.5)
    limited = simulate.simulate_imu(ideal, None, rng, accel_errors=coarse)
    np.testing.assert_allclose(limited.accel[10], [3.0, 0.0, -8.0], atol=1e-12)
    assert ideal.accel[10, 0] == pytest.approx(f_x, abs=1e-9)  # the input is left alone


def test_what_cannot_be_recorded_is_refused() -> None:
    with pytest.raises(InputError, match="positive rate"):
        simulate.ideal_imu(simulate.static(1.0), 0.0)
    with pytest.raises(InputError, match="at least two samples"):
        simulate.ideal_imu(simulate.static(1.0), 1.0)
    with pytest.raises(InputError, match="positive saturation"):
        simulate.TriadErrors(saturation=0.0)
    ideal = simulate.ideal_imu(simulate.static(1.0), 100.0)
    uneven = ImuRecording(
        np.concatenate([ideal.time[:50], ideal.time[50:] + 0.5]), ideal.gyro, ideal.accel
    )
    with pytest.raises(InputError, match="evenly sampled"):
        simulate.simulate_imu(uneven, None, np.random.default_rng(1))
