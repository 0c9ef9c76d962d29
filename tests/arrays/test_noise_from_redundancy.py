"""Least squares, N-cornered hat and averaged volatility against theory (spec 5.3, 5.4, 6.2)."""

from __future__ import annotations

import numpy as np
import pytest

from schuler.arrays.geometry import cone, orthogonal, tetrahedron, tetrahedron_mounting
from schuler.arrays.synthesis.cornered_hat import cornered_hat
from schuler.arrays.synthesis.least_squares import fuse_constant, least_squares, residuals
from schuler.arrays.synthesis.volatility import averaged_volatility, window_volatility
from schuler.data import ImuArray, Mounting
from schuler.errors import EstimationError, InputError


def test_pi_is_a_left_inverse_and_its_covariance_that_of_the_errors() -> None:
    rng = np.random.default_rng(1)
    for axes in (tetrahedron().axes, cone(7, 0.8).axes):
        m = axes.shape[0]
        root = rng.normal(size=(m, m)) + 2 * np.eye(m)
        full = root @ root.T
        for covariance in (None, np.exp(rng.normal(size=m)), full):
            fit = least_squares(axes, covariance)
            assert np.abs(fit.pi @ axes - np.eye(3)).max() < 1e-13 * m
        p = np.linalg.inv(full)
        np.testing.assert_allclose(fit.pi, np.linalg.solve(axes.T @ p @ axes, axes.T @ p))
        draws = rng.standard_normal((200_000, m)) @ root.T
        sampled = np.cov((draws @ fit.pi.T).T)
        np.testing.assert_allclose(
            sampled, fit.covariance, atol=0.012 * np.abs(np.diag(fit.covariance)).max()
        )


def test_missing_axes_leave_the_others_their_best_weights() -> None:
    rng = np.random.default_rng(2)
    axes, truth = tetrahedron().axes, rng.normal(size=(50, 3))
    values = truth @ axes.T
    values[10, 2] = values[20:30, 3:6] = np.nan
    values[40, 3:] = np.nan
    values[41, 1:] = np.nan
    fused, solutions, which = fuse_constant(values, axes, np.ones(12))
    covariances = solutions @ np.swapaxes(solutions, 1, 2)
    keep = np.arange(50) != 41
    np.testing.assert_allclose(fused[keep], truth[keep], atol=1e-13)
    assert np.isnan(fused[41]).all() and np.isnan(covariances[which[41]]).all()
    np.testing.assert_allclose(np.diag(covariances[which[0]]), 1 / 4, atol=1e-12)
    np.testing.assert_allclose(np.diag(covariances[which[25]]), 1 / 3, atol=1e-12)
    np.testing.assert_allclose(np.diag(covariances[which[40]]), 1.0, atol=1e-12)


def test_covariances_that_are_none_are_refused() -> None:
    axes = orthogonal(2).axes
    copy = np.eye(6)
    copy[0, 3] = copy[3, 0] = 1.0
    with pytest.raises(InputError, match=r"singular.*copy of others"):
        least_squares(axes, copy)
    with pytest.raises(InputError, match="not positive"):
        least_squares(axes, [1, 1, 1, 0, 1, 1])
    with pytest.raises(InputError, match="one plane"):
        least_squares([[1, 0, 0], [0, 1, 0], [1, 1, 0]])


def test_raw_residuals_shrink_a_bad_sensor_and_the_hat_does_not() -> None:
    rng = np.random.default_rng(3)
    sigma = np.sqrt([100.0, 1.0, 1.0, 1.0])
    hat = cornered_hat(sigma * rng.standard_normal((100_000, 4)))
    # spec 5.4: seen as (56.4, 6.9, 6.9, 6.9)
    np.testing.assert_allclose(hat.residual_variances, [56.44, 6.94, 6.94, 6.94], rtol=0.02)
    np.testing.assert_array_less(np.abs(hat.variances - sigma**2), 4 * hat.standard_errors)
    assert hat.variances[0] == pytest.approx(100, rel=0.02)
    assert hat.independent
    # condition of v = M s, spec 5.4
    for count, condition in ((3, 2.0), (4, 1.5)):
        spread = np.eye(count) - 1 / count
        assert np.linalg.cond(spread**2) == pytest.approx(condition)


def test_standard_errors_of_the_hat_are_those_of_repetitions() -> None:
    rng = np.random.default_rng(4)
    axes = tetrahedron().axes
    sigma = np.array([1.0, 1.5, 0.7, 1, 2, 1, 1.2, 1, 1, 0.8, 1, 3])
    fits = [cornered_hat(sigma * rng.standard_normal((2000, 12)), axes) for _ in range(80)]
    scores = np.array([(f.variances - sigma**2) / f.standard_errors for f in fits])
    assert np.abs(scores.mean()) < 0.15
    assert scores.std() == pytest.approx(1.0, abs=0.1)
    # 5 false verdicts in 80 would be four deviations at 1 %
    assert sum(not f.independent for f in fits) <= 4


def test_sensors_that_share_errors_are_found_out() -> None:
    rng = np.random.default_rng(5)
    values = rng.standard_normal((20_000, 5))
    values[:, 3] += 0.4 * values[:, 1]
    hat = cornered_hat(values)
    assert not hat.independent and hat.pair == (1, 3)
    slow = np.cumsum(rng.standard_normal((20_000, 5)), axis=0)
    assert cornered_hat(slow[::2] - slow[1::2]).independent
    # a slow wander is worth few samples, and is not taken for shared errors
    wander = np.stack([np.convolve(v, np.ones(300), "valid") for v in values.T[:3]], axis=1)
    assert cornered_hat(wander).samples < 2000 < 19_701 and cornered_hat(wander).independent


def test_one_and_two_sensors_are_refused_with_the_reason() -> None:
    rng = np.random.default_rng(6)
    with pytest.raises(EstimationError, match="two sensors cannot be told apart"):
        cornered_hat(rng.standard_normal((100, 2)))
    with pytest.raises(EstimationError, match="two sensors cannot be told apart"):
        cornered_hat(rng.standard_normal((100, 6)), orthogonal(2).axes)
    with pytest.raises(EstimationError, match="without redundancy"):
        cornered_hat(rng.standard_normal((100, 1)))
    with pytest.raises(EstimationError, match="one triad has no residuals"):
        window_volatility(rng.standard_normal((100, 1, 3)), 5)


@pytest.mark.parametrize(("half_window", "paper"), [(1, 1.125), (5, 0.825), (50, 0.7575)])
def test_averaged_volatility_has_the_expectation_of_the_table(
    half_window: int, paper: float
) -> None:
    # spec 5.3, n = 4: sigma² (1 + 1/2T)(n-1)/n, and 1 for the unbiased divisor
    values = np.random.default_rng(half_window).standard_normal((60_000, 4, 3))
    biased = window_volatility(values, half_window, divisor="paper").variance
    right = window_volatility(values, half_window).variance
    inner = slice(half_window, -half_window)
    assert biased[inner].mean() == pytest.approx(paper, rel=0.02)
    assert right.mean() == pytest.approx(1.0, abs=0.02)
    centred = window_volatility(values, half_window, remove_mean=True).variance
    assert centred.mean() == pytest.approx(1.0, abs=0.02)
    # 6T n is right for 6T (n-1) degrees of freedom scaled by n/(n-1), as the paper has it
    both = window_volatility(values, half_window, remove_mean=True, divisor="paper").variance
    assert both[inner].mean() == pytest.approx(3 / 4, rel=0.02)
    # the scatter follows sqrt(2 / [3 (2T+1)(n-1)])
    error = window_volatility(values, half_window).relative_error[inner]
    assert right[inner].std() == pytest.approx(error[0], rel=0.1)
    assert error[0] == pytest.approx(np.sqrt(2 / (9 * (2 * half_window + 1))))


def test_residual_volatility_is_below_that_of_errors_by_the_lost_freedom_alone() -> None:
    # S000 Figure 8: ratio of deviations sqrt((n-1)/n) = 0.866
    values = np.random.default_rng(8).standard_normal((100_000, 4, 3))
    x = values - values.mean(axis=1, keepdims=True)
    assert np.sqrt(np.mean(x**2) / np.mean(values**2)) == pytest.approx(0.866, abs=0.004)
    assert np.abs(x.mean(axis=1)).max() < 1e-14
    # the identity behind (4): sum of squared errors = of residuals + n (mean - reference)²
    reference = np.random.default_rng(9).standard_normal((1000, 1, 3))
    w = values[:1000]
    left = ((w - reference) ** 2).sum(axis=1)
    right = (x[:1000] ** 2).sum(axis=1) + 4 * (w.mean(axis=1) - reference[:, 0]) ** 2
    np.testing.assert_allclose(left, right, rtol=1e-12)
    assert (left > (x[:1000] ** 2).sum(axis=1)).all()


def test_causal_volatility_knows_nothing_of_the_future_and_gaps_do_not_bias_it() -> None:
    rng = np.random.default_rng(10)
    values = rng.standard_normal((4000, 4, 3))
    before = window_volatility(values, 20, causal=True).variance
    changed = values.copy()
    changed[2000:] *= 7.0
    np.testing.assert_array_equal(
        window_volatility(changed, 20, causal=True).variance[:1990].round(9), before[:1990].round(9)
    )
    assert window_volatility(changed, 20, causal=True).variance[3000:].mean() == pytest.approx(
        49, rel=0.05
    )
    values[rng.random((4000, 4)) < 0.3] = np.nan
    assert window_volatility(values, 20).variance.mean() == pytest.approx(1.0, abs=0.03)


def test_averaged_volatility_of_an_array_works_in_the_common_frame() -> None:
    rng = np.random.default_rng(11)
    mounting = tetrahedron_mounting()
    rate = np.cumsum(rng.standard_normal((3000, 1, 3)), axis=0)
    # a large common motion drops out
    gyro = np.einsum("kij,nki->nkj", mounting.rotation, np.repeat(rate, 4, axis=1))
    gyro = gyro + 0.02 * rng.standard_normal((3000, 4, 3))
    array = ImuArray(np.arange(3000) / 100.0, gyro, np.zeros((3000, 4, 3)), mounting)
    found = averaged_volatility(array, 50)
    assert found.deviation.mean() == pytest.approx(0.02, rel=0.02)
    x = residuals(gyro.reshape(3000, 12), tetrahedron().axes)
    assert np.abs(x @ tetrahedron().axes).max() < 1e-10
    with pytest.raises(InputError, match="one IMU"):
        averaged_volatility(array.select([1]))
    copied = gyro.copy()
    copied[:, 2] = copied[:, 0]
    with pytest.raises(InputError, match=r"imu 3 is a copy of imu 1"):
        averaged_volatility(ImuArray(array.time, copied, array.accel, Mounting.aligned(4)))
