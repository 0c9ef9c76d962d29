"""Parity tests against the chi-square laws, and S002's experiments again (spec 6.4, 6.5, 8.2)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from schuler.arrays.detection.operating import chi_square_power, operating_curve
from schuler.arrays.detection.thresholds import (
    chi_square_threshold,
    empirical_threshold,
    likelihood_statistics,
    likelihood_threshold,
    threshold_performance,
)
from schuler.arrays.geometry import Geometry, cone, orthogonal, tetrahedron
from schuler.arrays.synthesis.least_squares import least_squares, residuals
from schuler.errors import InputError

SIGMA = 0.0194


def test_the_statistic_is_chi_square_and_alarms_as_often_as_asked() -> None:
    rng = np.random.default_rng(1)
    axes = tetrahedron().axes
    # whatever moves the body leaves no trace
    motion = 30.0 * rng.standard_normal((100_000, 3)) @ axes.T
    f = residuals(motion + SIGMA * rng.standard_normal((100_000, 12)), axes)
    d = (f**2).sum(axis=1)
    assert kstest(d[::10] / SIGMA**2, chi2(9).cdf).pvalue > 0.01
    threshold = chi_square_threshold(SIGMA, 0.05, 9)
    assert np.mean(d > threshold) == pytest.approx(0.05, abs=0.003)
    # parity vector and residual have the same length
    v = np.linalg.svd(axes.T)[2][3:]
    values = rng.standard_normal(12)
    assert np.abs(v @ axes).max() < 1e-13
    assert np.sum((v @ values) ** 2) == pytest.approx(np.sum(residuals(values[None], axes) ** 2))


def test_the_thresholds_of_s002_do_not_belong_together() -> None:
    # E-002-3: 16.919; 0.169, 0.00637; the printed 0.0155 needs 0.0303 rad/s
    assert chi_square_threshold(1.0, 0.05, 9) == pytest.approx(16.919, abs=1e-3)
    assert chi_square_threshold(0.1, 0.05, 9) == pytest.approx(0.169, abs=5e-4)
    assert chi_square_threshold(SIGMA, 0.05, 9) == pytest.approx(0.00637, abs=5e-6)
    assert np.sqrt(0.0155 / 16.919) == pytest.approx(0.0303, abs=5e-5)
    assert chi2.sf(0.0155 / SIGMA**2, 9) == pytest.approx(4.6e-6, rel=0.03)
    # 3 x the threshold of 0.1 deg/s/sqrt(Hz) at 100 Hz
    assert 3 * chi_square_threshold(np.radians(0.1) * 10, 0.05, 9) == pytest.approx(
        0.01546, rel=1e-3
    )


@pytest.mark.parametrize(
    ("size", "power"), [(2, 0.173), (3, 0.382), (4, 0.661), (5, 0.879), (6, 0.975)]
)
def test_power_is_that_of_the_non_central_law(size: float, power: float) -> None:
    geometry = tetrahedron()
    assert chi_square_power(geometry, 4, size, 0.05) == pytest.approx(power, abs=0.001)
    rng = np.random.default_rng(size)
    noise = rng.standard_normal((100_000, 12))
    noise[:, 4] += size
    d = (residuals(noise, geometry.axes) ** 2).sum(axis=1)
    assert np.mean(d > chi2.isf(0.05, 9)) == pytest.approx(power, abs=0.005)


def test_likelihood_finds_more_and_says_who_it_was() -> None:
    # spec 6.5: power 0.444, 0.752, 0.937; right 0.88, 0.955, 0.985
    for size, power, right in ((3, 0.444, 0.88), (4, 0.752, 0.955), (5, 0.937, 0.985)):
        curve = operating_curve(tetrahedron(), size, axis=7, rates=[0.01, 0.05])
        assert curve.likelihood_power[1] == pytest.approx(power, abs=0.008)
        assert curve.right_axis[1] == pytest.approx(right, abs=0.01)
        assert curve.chi_square_power[1] < curve.likelihood_power[1]
        assert (curve.right_unit >= curve.right_axis).all()
        assert curve.likelihood_power[0] < curve.likelihood_power[1]


def test_unequal_noise_is_whitened() -> None:
    rng = np.random.default_rng(3)
    geometry = cone(6, 0.8)
    sigma = np.array([1.0, 3.0, 0.5, 1.0, 2.0, 1.0])
    noise = sigma * rng.standard_normal((100_000, 6))
    axis, unit = likelihood_statistics(noise, geometry, sigma**2)
    fit = least_squares(geometry.axes, sigma**2)
    d = ((noise @ fit.residual.T) ** 2 / sigma**2).sum(axis=1)
    assert kstest(d[::10], chi2(3).cdf).pvalue > 0.01
    for column in axis.T:
        assert np.mean(column) == pytest.approx(1.0, abs=0.02)
    np.testing.assert_allclose(axis, unit, rtol=1e-9)
    threshold = likelihood_threshold(geometry, 0.01, variances=sigma**2, seed=9)
    assert np.mean(axis.max(axis=1) > threshold) == pytest.approx(0.01, abs=0.0015)
    # Bonferroni is near for small rates, and on the safe side
    assert likelihood_threshold(geometry, 1e-5) == pytest.approx(chi2.isf(1e-5 / 6, 1))


def test_a_unit_is_blamed_with_three_degrees_of_freedom() -> None:
    rng = np.random.default_rng(4)
    geometry = tetrahedron()
    noise = rng.standard_normal((50_000, 12))
    axis, unit = likelihood_statistics(noise, geometry)
    assert kstest(unit[::10, 2], chi2(3).cdf).pvalue > 0.01
    noise[:, 6:9] += [3.0, -3.0, 3.0]
    _, unit = likelihood_statistics(noise, geometry)
    found = unit.max(axis=1) > likelihood_threshold(geometry, 0.05, fault="unit")
    assert np.mean(found) > 0.9
    assert np.mean(unit.argmax(axis=1)[found] == 2) > 0.97
    assert axis.shape == (50_000, 12)


def test_two_aligned_triads_show_a_fault_in_both() -> None:
    noise = np.zeros((1, 6))
    noise[0, 1] = 5.0
    axis, unit = likelihood_statistics(noise, orthogonal(2))
    assert axis[0, 1] == pytest.approx(axis[0, 4]) and axis[0, 1] == pytest.approx(12.5)
    assert unit[0, 0] == pytest.approx(unit[0, 1])


def s002_figure_7(noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """D of 12 axes, and where any of them is off by more than 3.5 deviations."""
    d = (residuals(noise, tetrahedron().axes) ** 2).sum(axis=1)
    return d, (np.abs(noise) > 3.5 * noise.std()).any(axis=1)


def test_labelling_the_tails_of_noise_is_no_fault_experiment() -> None:
    # spec 8.2: Gaussian noise, 0.556 % faults, all missed at T = 0.0155, count-optimal 99 %
    rng = np.random.default_rng(5)
    d, faulty = s002_figure_7(SIGMA * rng.standard_normal((400_000, 12)))
    assert faulty.mean() == pytest.approx(0.00556, rel=0.05)
    printed = threshold_performance(d, faulty, 0.0155)
    assert printed.missed_share > 0.97
    best = empirical_threshold(d, faulty)
    assert best.missed_share > 0.96
    assert best.cost <= min(1.0, printed.cost)
    # in probabilities the best threshold is far lower: T = 0.0047, 11 % missed
    fair = empirical_threshold(d, faulty, "probabilities")
    assert fair.threshold == pytest.approx(0.0047, abs=0.0003)
    assert fair.missed_share == pytest.approx(0.11, abs=0.03)


def test_heavy_tails_bring_the_rates_of_s002_nearer() -> None:
    # spec 8.2: t(6) noise: T = 0.0081, 54.6 % missed, false alarms over faults 15 %
    rng = np.random.default_rng(6)
    noise = rng.standard_t(6, (400_000, 12)) * SIGMA * np.sqrt(4 / 6)
    best = empirical_threshold(*s002_figure_7(noise))
    assert best.threshold == pytest.approx(0.0081, abs=0.0006)
    assert best.missed_share == pytest.approx(0.546, abs=0.03)
    assert best.false_alarms_per_fault == pytest.approx(0.15, abs=0.03)
    assert best.false_alarms_per_alarm < best.false_alarms_per_fault / 0.4
    assert best.cost < best.never_alarming


def test_questions_that_have_no_answer_are_refused() -> None:
    with pytest.raises(InputError, match="degrees of freedom"):
        chi_square_threshold(1.0, 0.05, 0)
    with pytest.raises(InputError, match="0 redundant axes"):
        likelihood_threshold(Geometry.from_axes(np.eye(3)), 0.05)
    with pytest.raises(InputError, match="some of both"):
        empirical_threshold(np.ones(5), np.zeros(5))
    with pytest.raises(InputError, match="labels"):
        empirical_threshold(np.ones(5), np.zeros(4))
