"""GNSS that is worse than it says, slow errors of GNSS, and other sensors beside it.

Twins in which the error of every sensor is drawn from what the filter is told: innovations and
errors follow the chi-square law. Frozen figures of the unweighted filter are measured ones.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2
from twins import LEVER, Twin, draw_twin, navigation_errors, perfect

from schuler import earth
from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.errors import InputError
from schuler.kernels.navigation.attitude_aiding import heading_model, magnetic_model
from schuler.navigation.aiding.barometer import Barometer, height_of_pressure
from schuler.navigation.aiding.gnss import CorrelatedGnss
from schuler.navigation.aiding.heading import Heading
from schuler.navigation.aiding.magnetometer import Magnetometer, earth_field
from schuler.navigation.aiding.options import WHITE_ERRORS, GnssWeighting, MeasurementOptions
from schuler.navigation.aiding.schedule import PlacedAiding
from schuler.navigation.run import run
from schuler.rotations import dcm_from_rotation_vector
from schuler.simulation import Profile, antenna_motion, car_urban, simulate_gnss

Array = np.ndarray


@cache
def a_drive() -> tuple[Profile, ImuRecording]:
    profile = car_urban(150.0, 3, standstill=15.0)
    return profile, perfect(profile, 50.0)


def twin(seed: int) -> Twin:
    return draw_twin(*a_drive(), seed)


def solved(drawn: Twin, gnss: GnssRecording, options: MeasurementOptions) -> NavigationSolution:
    model, placed = options.placed(drawn.setup.model)
    return run(drawn.imu, gnss, replace(drawn.setup, model=model, measurements=placed)).causal


def squares(solution: NavigationSolution, time: Array) -> Array:
    """Normalised squares (times, 9)."""
    path = solution.trajectory
    k = np.searchsorted(path.time, time - 1e-6)
    e = navigation_errors(
        a_drive()[0], path.time[k], path.position[k], path.velocity[k], path.rotation[k]
    )
    sd = np.hstack([solution.position_sd, solution.velocity_sd, solution.attitude_sd])[k]
    return np.asarray((e / sd) ** 2)


@pytest.mark.parametrize("model", [heading_model, magnetic_model])
def test_jacobians_by_finite_differences(model) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(1)
    for _ in range(5):
        rotation = dcm_from_rotation_vector(rng.standard_normal(3))
        arm, value = rng.standard_normal(3), rng.standard_normal(3)

        def residual(psi: Array) -> Array:
            left, design = np.zeros(3), np.zeros((3, 12))
            turned = np.ascontiguousarray(dcm_from_rotation_vector(-psi) @ rotation)  # noqa: B023
            model(value, arm, turned, left, design)  # noqa: B023
            return left

        design = np.zeros((3, 12))
        model(value, arm, np.ascontiguousarray(rotation), np.zeros(3), design)
        steps = 1e-6 * np.eye(3)
        numeric = np.column_stack([(residual(s) - residual(-s)) / 2e-6 for s in steps])
        np.testing.assert_allclose(design[:, 6:9], numeric, atol=1e-7)
        assert not design[:, :6].any()
        assert not design[:, 9:].any()


HEADING_OFFSET = np.radians(3.0)
FIELD = earth_field(np.radians(4.0), np.radians(63.0), 48.0)


def source_of(kind: str, seed: int) -> tuple[PlacedAiding, Array]:
    """A sensor with errors drawn from its own prior, and the true values of its states."""
    rng = np.random.default_rng(1000 + seed)
    profile, _ = a_drive()
    if kind == "height by barometer":
        time = np.arange(0.5, 149.0, 0.2)
        walk = np.cumsum(0.03 * np.sqrt(0.2) * rng.standard_normal(time.size))
        # the state is of the down component: positive where the height is too low
        offset = 100.0 * rng.standard_normal() + walk
        height = profile.trajectory(time).position[:, 2] - offset
        noise = 0.3 * rng.standard_normal(time.size)
        return Barometer(time, height + noise, 0.3), offset[-1:]
    time = np.arange(0.5, 149.0, 1.0)
    rotation = profile.trajectory(time).rotation
    if kind == "heading":
        baseline = np.array([0.8, 0.6, 0.1])
        ahead = rotation @ baseline
        offset = HEADING_OFFSET * rng.standard_normal()
        noise = np.radians(0.5) * rng.standard_normal(time.size)
        seen = np.arctan2(ahead[:, 1], ahead[:, 0]) + offset + noise
        return Heading(time, seen, np.radians(0.5), baseline, HEADING_OFFSET), np.array([offset])
    iron = 5.0 * rng.standard_normal(3)
    seen = np.einsum("kij,i->kj", rotation, FIELD) + iron + rng.standard_normal((time.size, 3))
    return Magnetometer(time, seen, FIELD, 1.0, 5.0), iron


@pytest.mark.parametrize("kind", ["heading", "height by barometer", "magnetic field"])
def test_every_kind_is_as_good_as_it_claims(kind: str) -> None:
    seeds = 16
    nis, degrees, states, own = 0.0, 0, [], []
    for seed in range(seeds):
        drawn = twin(seed)
        source, truth = source_of(kind, seed)
        solution = solved(drawn, drawn.gnss, MeasurementOptions(correlated=None, sources=(source,)))
        part = solution.innovations.of_kind(kind)
        assert part.accepted.all()
        nis += float(part.nis.sum())
        degrees += int(part.degrees.sum())
        n = truth.size
        left = solution.sensor_errors[-1, -n:] - truth
        own.append((left / solution.sensor_errors_sd[-1, -n:]) ** 2)
        states.append(squares(solution, np.array([60.0, 100.0, 145.0])))
        # the states are observed: much is learnt of them
        prior = {"heading": HEADING_OFFSET, "height by barometer": 100.0, "magnetic field": 5.0}
        assert np.all(solution.sensor_errors_sd[-1, -n:] < 0.7 * prior[kind])
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], degrees) / degrees
    assert low < nis / degrees < high
    total = np.concatenate([o.ravel() for o in own])
    low, high = chi2.ppf([5e-4, 1.0 - 5e-4], total.size) / total.size
    assert low < total.mean() < high
    mean = np.mean(states, axis=(0, 1))
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], seeds) / seeds
    assert np.all((mean > low) & (mean < high)), mean


def test_a_heading_makes_the_heading_good_while_standing() -> None:
    drawn = twin(3)
    time = np.arange(0.5, 149.0, 1.0)
    ahead = a_drive()[0].trajectory(time).rotation[:, :, 0]
    seen = np.arctan2(ahead[:, 1], ahead[:, 0])
    rng = np.random.default_rng(5)
    source = Heading(time, seen + np.radians(0.2) * rng.standard_normal(time.size), np.radians(0.2))
    alone = solved(drawn, drawn.gnss, WHITE_ERRORS)
    aided = solved(drawn, drawn.gnss, MeasurementOptions(correlated=None, sources=(source,)))
    k = np.searchsorted(alone.trajectory.time, 14.0)
    assert aided.attitude_sd[k, 2] < 0.2 * alone.attitude_sd[k, 2]
    assert squares(aided, np.array([14.0]))[0, 8] < 12.0


def test_slow_errors_of_gnss_are_not_averaged_away() -> None:
    profile, _ = a_drive()
    with_states, without, nis = [], [], []
    for seed in range(16):
        drawn = twin(seed)
        gnss = simulate_gnss(
            profile,
            1.0,
            position_sd=0.3,
            velocity_sd=0.05,
            correlated_sd=1.5,
            correlation_time=30.0,
            lever_arm=LEVER,
            rng=np.random.default_rng(500 + seed),
        )
        options = MeasurementOptions(correlated=CorrelatedGnss(1.5, 30.0))
        told = solved(drawn, gnss, options)
        with_states.append(squares(told, np.array([80.0, 140.0]))[:, :3])
        nis.append(told.innovations.of_kind("GNSS position").nis[2:].mean() / 3.0)
        without.append(squares(solved(drawn, gnss, WHITE_ERRORS), np.array([80.0, 140.0])))
    # 96 squares, the two times nearly independent
    assert 0.6 < np.mean(with_states) < 1.5
    # 145 epochs of 3 components a seed
    assert np.mean(nis) == pytest.approx(1.0, abs=0.05)
    # white noise of the same size is believed to be averaged: errors twice as large as claimed
    assert np.mean(np.array(without)[:, :, :2]) > 2.5


def moved(gnss: GnssRecording, metres: Array) -> GnssRecording:
    north, east = earth.metres_per_radian(gnss.position)
    scale = np.stack([north, east, -np.ones(gnss.size)], axis=-1)
    return replace(gnss, position=gnss.position + metres / scale)


def judged(weighting: GnssWeighting, spoil, seeds: int = 6) -> tuple[float, float, float]:  # type: ignore[no-untyped-def]
    """Horizontal root mean square in m, mean normalised square of position, share refused."""
    errors, normalised, refused = [], [], []
    time = np.arange(40.0, 149.0, 1.0)
    for seed in range(seeds):
        drawn = twin(seed)
        gnss = spoil(drawn.gnss, np.random.default_rng(100 + seed))
        solution = solved(drawn, gnss, MeasurementOptions(weighting, correlated=None))
        path = solution.trajectory
        k = np.searchsorted(path.time, time)
        e = navigation_errors(
            a_drive()[0], path.time[k], path.position[k], path.velocity[k], path.rotation[k]
        )
        errors.append(np.mean(np.sum(e[:, :2] ** 2, axis=1)))
        normalised.append(squares(solution, time)[:, :3].mean())
        refused.append(np.mean(~solution.innovations.gnss.accepted))
    return float(np.sqrt(np.mean(errors))), float(np.mean(normalised)), float(np.mean(refused))


def as_it_is(gnss: GnssRecording, _: np.random.Generator) -> GnssRecording:
    return gnss


def with_outliers(gnss: GnssRecording, rng: np.random.Generator) -> GnssRecording:
    """One fix in ten is some 15 m off in each direction."""
    bad = rng.random((gnss.size, 1)) < 0.1
    return moved(gnss, bad * 15.0 * rng.standard_normal((gnss.size, 3)))


def with_heavy_tails(gnss: GnssRecording, rng: np.random.Generator) -> GnssRecording:
    """Position errors of Student's distribution with three degrees of freedom."""
    position, _ = antenna_motion(a_drive()[0], gnss.time, LEVER)
    stretch = np.sqrt(3.0 / rng.chisquare(3, (gnss.size, 1)))
    noise = rng.standard_normal((gnss.size, 3)) * stretch * [0.5, 0.5, 0.75]
    return moved(replace(gnss, position=position), noise)


def too_sure(factor: float):  # type: ignore[no-untyped-def]
    def spoil(gnss: GnssRecording, _: np.random.Generator) -> GnssRecording:
        assert gnss.position_sd is not None
        assert gnss.velocity_sd is not None
        return replace(
            gnss, position_sd=gnss.position_sd / factor, velocity_sd=gnss.velocity_sd / factor
        )

    return spoil


def test_weights_cost_nothing_on_good_gnss_and_help_on_bad() -> None:
    gate, huber, student = (GnssWeighting(u) for u in ("gate", "huber", "student-t"))
    best, square, _ = judged(gate, as_it_is)
    for weighting in (huber, student):
        error, normalised, refused = judged(weighting, as_it_is)
        assert error < 1.08 * best
        assert normalised == pytest.approx(square, abs=0.15)
        assert refused == 0.0
    # outliers: nothing is refused, and they do little
    for weighting, most in ((gate, 1.15), (huber, 1.35), (student, 1.2)):
        error, normalised, _ = judged(weighting, with_outliers)
        assert error < most * best
        assert normalised < 1.5
    # heavy tails: the gate believes what it lets in, Student's weights do not
    plain, _, _ = judged(gate, with_heavy_tails)
    error, normalised, _ = judged(student, with_heavy_tails)
    assert error < plain
    assert normalised < 1.4


def test_noise_adapts_to_a_receiver_that_is_too_sure_or_not_sure_enough() -> None:
    best, _, _ = judged(GnssWeighting(), as_it_is, 4)
    for factor in (0.5, 1.0, 2.0, 5.0):
        error, normalised, refused = judged(GnssWeighting(adaptive=True), too_sure(factor), 4)
        assert error < 1.15 * best, factor
        # from a claim that is twice too large it comes down over a minute or two
        assert 0.4 < normalised < 1.5, factor
        assert refused < 0.06
    # without it the filter claims half of its error, and a gate refuses what is right
    _, normalised, refused = judged(GnssWeighting(), too_sure(2.0), 4)
    assert normalised > 2.5
    _, _, refused = judged(GnssWeighting(), too_sure(5.0), 4)
    assert refused > 0.3


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match="update"):
        GnssWeighting("hope")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="positive"):
        MeasurementOptions(correlated=CorrelatedGnss(-1.0, 60.0)).placed(twin(0).setup.model)
    with pytest.raises(InputError, match="deviation"):
        Heading([0.0, 1.0], [0.0, 0.1], -1.0).rows()
    with pytest.raises(InputError, match="shape"):
        Barometer([0.0, 1.0], [1.0, 2.0, 3.0]).rows()
    with pytest.raises(InputError, match="baseline"):
        Heading([0.0], [0.0], 0.1, (0.0, 0.0, 0.0)).rows()


def test_the_standard_atmosphere_and_the_field_of_the_earth() -> None:
    # ICAO: 898.75 hPa at 1000 m, 540.20 hPa at 5000 m
    np.testing.assert_allclose(
        height_of_pressure([101325.0, 89875.0, 54020.0]), [0.0, 1000.0, 5000.0], atol=1.5
    )
    field = earth_field(np.radians(4.0), np.radians(63.0), 48.0)
    assert np.linalg.norm(field) == pytest.approx(48.0)
    assert np.degrees(np.arctan2(field[1], field[0])) == pytest.approx(4.0)
    assert field[2] > 0.0


def test_measurements_in_any_order_are_used_at_their_own_time() -> None:
    drawn = twin(2)
    source, _ = source_of("heading", 2)
    assert isinstance(source, Heading)
    order = np.random.default_rng(3).permutation(np.size(source.time))
    mixed = replace(
        source, time=np.asarray(source.time)[order], heading=np.asarray(source.heading)[order]
    )
    one, two = (
        solved(drawn, drawn.gnss, MeasurementOptions(sources=(s,))).trajectory
        for s in (source, mixed)
    )
    np.testing.assert_array_equal(one.position, two.position)
    # a delay that is left in the stamps is no order: half a second late, it shows
    late = replace(source, time=np.asarray(source.time) + 0.5)
    told = solved(drawn, drawn.gnss, MeasurementOptions(sources=(late,)))
    right = solved(drawn, drawn.gnss, MeasurementOptions(correlated=None, sources=(source,)))
    nis = [s.innovations.of_kind("heading").nis.mean() for s in (right, told)]
    assert nis[1] > 3.0 * nis[0]
