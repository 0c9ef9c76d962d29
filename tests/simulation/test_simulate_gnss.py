"""GNSS twins: where the antenna is, how it moves, and the statistics of its noise."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import earth
from schuler import simulation as simulate
from schuler.errors import InputError
from schuler.simulation.motions import paths

SILENT = 1e-9


def errors_ned(gnss, position):
    north, east = earth.metres_per_radian(position)
    return (gnss.position - position) * np.stack([north, east, -np.ones(gnss.size)], axis=-1)


def circle() -> simulate.Profile:
    """Turning to the right at 0.2 rad/s with 8 m/s (peak of a long soft turn)."""
    return simulate.drive(
        [
            simulate.Manoeuvre(10.0, 8.0),
            simulate.Manoeuvre(40.0, 8.0, 0.2 * 40.0 / paths.STEEPEST),
        ],
        suspension=simulate.Suspension(0.0, 0.0),
    )


def test_antenna_ahead_of_a_car_that_turns_right_swings_to_the_right() -> None:
    profile, lever = circle(), np.array([2.0, 0.0, -1.5])
    gnss = simulate.simulate_gnss(
        profile, 1.0, position_sd=SILENT, velocity_sd=SILENT, lever_arm=lever,
        rng=np.random.default_rng(1),
    )  # fmt: skip
    k = 30  # the middle of the turn: peak rate
    assert gnss.time[k] == 30.0
    truth = profile.trajectory(gnss.time)
    into_body = truth.rotation[k].T
    swing = into_body @ (gnss.velocity[k] - truth.velocity[k])
    np.testing.assert_allclose(swing, [0.0, 0.2 * 2.0, 0.0], atol=1e-3)
    offset = into_body @ earth.ned_from_geodetic(gnss.position[k], truth.position[k])
    np.testing.assert_allclose(offset, lever, atol=1e-7)


def test_antenna_velocity_is_the_derivative_of_its_position() -> None:
    profile, h = simulate.car_urban(200.0, 6, standstill=20.0), 1e-3
    t, lever = np.linspace(25.0, 190.0, 300), np.array([1.0, -0.7, -1.4])
    position, velocity = simulate.antenna_motion(profile, t, lever)
    after, _ = simulate.antenna_motion(profile, t + h, lever)
    before, _ = simulate.antenna_motion(profile, t - h, lever)
    north, east = earth.metres_per_radian(position)
    finite = (after - before) / (2 * h) * np.stack([north, east, -np.ones(300)], axis=-1)
    np.testing.assert_allclose(velocity, finite, atol=5e-6)
    lever_part = velocity - profile.trajectory(t).velocity
    assert np.abs(lever_part).max() > 0.1


def test_noise_is_white_with_the_given_deviations() -> None:
    profile = simulate.static(20000.0)
    gnss = simulate.simulate_gnss(
        profile, 1.0, position_sd=2.0, velocity_sd=(0.03, 0.05, 0.1), rng=np.random.default_rng(2),
        claimed_scale=0.5,
    )  # fmt: skip
    position = errors_ned(gnss, profile.trajectory(gnss.time).position)
    np.testing.assert_allclose(position.std(axis=0), [2.0, 2.0, 3.0], rtol=0.025)
    np.testing.assert_allclose(gnss.velocity.std(axis=0), [0.03, 0.05, 0.1], rtol=0.025)
    np.testing.assert_allclose(position.mean(axis=0), 0.0, atol=4 * 3.0 / np.sqrt(20000))
    np.testing.assert_array_equal(gnss.position_sd[7], [1.0, 1.0, 1.5])
    np.testing.assert_array_equal(gnss.velocity_sd[7], [0.015, 0.025, 0.05])
    everything = np.hstack([position, gnss.velocity])
    assert np.abs(np.corrcoef(everything.T) - np.eye(6)).max() < 0.03
    neighbours = [np.corrcoef(x[1:], x[:-1])[0, 1] for x in everything.T]
    assert np.abs(neighbours).max() < 0.03


def test_correlated_noise_has_its_deviation_and_correlation_time() -> None:
    profile = simulate.static(40000.0)
    gnss = simulate.simulate_gnss(
        profile, 1.0, position_sd=(2.0, 2.0, 2.0), velocity_sd=0.1, correlation_time=10.0,
        rng=np.random.default_rng(3),
    )  # fmt: skip
    position = errors_ned(gnss, profile.trajectory(gnss.time).position)
    # variance of a variance: 2 sigma^4 * 10 s / 40000 s, three axes
    assert np.mean(position**2) == pytest.approx(4.0, rel=0.06)
    for lag in (1, 10, 20):
        products = np.mean(position[lag:] * position[:-lag]) / np.mean(position**2)
        assert products == pytest.approx(np.exp(-lag / 10.0), abs=0.05)
    velocity = gnss.velocity[:, 0]
    assert abs(np.corrcoef(velocity[1:], velocity[:-1])[0, 1]) < 0.03


def test_correlated_noise_starts_stationary() -> None:
    profile = simulate.static(3.0)
    starts = [
        errors_ned(
            simulate.simulate_gnss(
                profile, 1.0, position_sd=(1.0, 1.0, 1.0), velocity_sd=None, correlation_time=60.0,
                rng=rng,
            ),
            profile.trajectory(np.arange(4.0)).position,
        )[[0, -1]]
        for rng in np.random.default_rng(4).spawn(300)
    ]  # fmt: skip
    deviation = np.std(starts, axis=(0, 2))
    np.testing.assert_allclose(deviation, 1.0, atol=0.1)  # 900 draws: sd 0.024


def test_latency_shows_the_past() -> None:
    profile = circle()
    gnss = simulate.simulate_gnss(
        profile, 2.0, position_sd=SILENT, velocity_sd=SILENT, latency=0.1, velocity_latency=0.25,
        rng=np.random.default_rng(5),
    )  # fmt: skip
    assert gnss.time[0] == pytest.approx(0.25)
    past = profile.trajectory(gnss.time - 0.1).position
    np.testing.assert_allclose(errors_ned(gnss, past), 0.0, atol=2e-8)
    np.testing.assert_allclose(
        gnss.velocity, profile.trajectory(gnss.time - 0.25).velocity, atol=1e-8
    )


def test_epochs_start_and_outages() -> None:
    gnss = simulate.simulate_gnss(
        simulate.static(100.0), 1.0, position_sd=1.0, velocity_sd=None, start=10.5,
        outages=[(20.5, 30.0)], rng=np.random.default_rng(6),
    )  # fmt: skip
    assert gnss.time[0] == 10.5
    assert gnss.velocity is None
    np.testing.assert_array_equal(gnss.time[9:11], [19.5, 50.5])
    assert gnss.time[-1] == 99.5


def test_same_seed_same_noise_and_velocity_does_not_disturb_position() -> None:
    def make(seed, velocity_sd=0.1):
        return simulate.simulate_gnss(
            circle(), 1.0, position_sd=1.0, velocity_sd=velocity_sd,
            rng=np.random.default_rng(seed),
        )  # fmt: skip

    np.testing.assert_array_equal(make(1).position, make(1).position)
    np.testing.assert_array_equal(make(1).velocity, make(1).velocity)
    np.testing.assert_array_equal(make(1).position, make(1, None).position)
    assert np.abs(make(1).position - make(2).position).max() > 1e-8


def test_longitudes_do_not_jump_at_the_date_line() -> None:
    profile = simulate.drive(
        [simulate.Manoeuvre(10.0, 10.0), simulate.Manoeuvre(60.0, 10.0)],
        origin=(0.5, np.pi - 2e-5, 0.0),
        heading=np.pi / 2,
    )
    gnss = simulate.simulate_gnss(
        profile, 1.0, position_sd=0.01, velocity_sd=None, lever_arm=(1.0, 0, 0),
        rng=np.random.default_rng(7),
    )  # fmt: skip
    assert gnss.position[-1, 1] > np.pi
    assert np.diff(gnss.position[:, 1]).min() > -1e-8


def test_what_cannot_be_received_is_refused() -> None:
    still, rng = simulate.static(10.0), np.random.default_rng(1)
    with pytest.raises(InputError, match="one positive number"):
        simulate.simulate_gnss(still, position_sd=0.0, velocity_sd=None, rng=rng)
    with pytest.raises(InputError, match="positive numbers"):
        simulate.simulate_gnss(still, 0.0, position_sd=1.0, velocity_sd=None, rng=rng)
    with pytest.raises(InputError, match="positive time"):
        simulate.simulate_gnss(
            still, position_sd=1.0, velocity_sd=None, rng=rng, correlation_time=0.0
        )
    with pytest.raises(InputError, match="no GNSS epoch"):
        simulate.simulate_gnss(still, position_sd=1.0, velocity_sd=None, rng=rng, start=11.0)
