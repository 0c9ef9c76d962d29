"""Noise of one and of four gyros, and faults seen in parity space: Figs 5 to 7, eqs (1) to (3)."""

from __future__ import annotations

import numpy as np
from scipy.stats import chi2, kstest, ncx2

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.arrays.merit import parity_matrix
from schuler.estimation.residuals.tests import jarque_bera_test
from schuler.rotations import (
    dcm_from_euler,
    dcm_from_rotation_vector,
    euler_from_dcm,
    rotation_vector_from_dcm,
    wahba,
)
from schuler.simulation import ideal_imu, motorcycle
from schuler.types import FloatArray
from schuler_papers.experiment import Numbers, Size, generator, numbers
from schuler_papers.waegli2008.rides import GYRO_SD, PAPER, RATE

FREEDOM = 9
FALSE_ALARM = 0.05
PRINTED_THRESHOLD = 0.0155
FAULT = 3.5
"""Standard deviations beyond which the paper calls a difference a fault."""
MISALIGNED = np.radians([2.0, -1.0, 1.5])


def parity() -> tuple[FloatArray, FloatArray]:
    """Return the 12 axes A of the tetrahedron and V, both for sensors of unit noise."""
    axes = np.concatenate([c.T for c in tetrahedron_mounting().rotation])
    return axes, parity_matrix(axes, np.ones(12))


def run_noise(seed: int, size: Size) -> Numbers:
    """Four equal gyro triads at rest and their best estimate. Fig 5, eq (1), Fig 6."""
    rng = generator(seed, PAPER, "noise")
    n = 6_000 if size == "quick" else 60_000
    axes, _ = parity()
    noise = GYRO_SD * rng.standard_normal((n, 12))
    fused = noise @ np.linalg.pinv(axes).T
    single = noise.reshape(n, 4, 3).std(axis=0, ddof=1).mean(axis=0)
    tails = rng.standard_t(6, size=n) * GYRO_SD / np.sqrt(1.5)
    quantiles = (np.arange(200) + 0.5) / 200
    return numbers(
        single=single.mean(),
        synthetic=fused.std(axis=0, ddof=1).mean(),
        gaussian_p=jarque_bera_test(noise[:, 0]).p_value,
        tails_p=jarque_bera_test(tails).p_value,
        quantiles=quantiles,
        gaussian=np.quantile(noise[:, 0], quantiles),
        tails=np.quantile(tails, quantiles),
    )


def run_parity(seed: int, size: Size) -> Numbers:
    """Law of D, its power against one biased sensor, and the paper's own experiment. Fig 7."""
    rng = generator(seed, PAPER, "parity")
    n = 100_000
    _, v = parity()
    noise = GYRO_SD * rng.standard_normal((n, 12))
    statistic = np.sum((noise @ v.T) ** 2, axis=1)
    threshold = GYRO_SD**2 * chi2.isf(FALSE_ALARM, FREEDOM)
    sizes = np.arange(2.0, 7.0)
    power = []
    for bias in sizes:
        moved = noise[:20_000].copy()
        moved[:, 4] += bias * GYRO_SD
        power.append(np.mean(np.sum((moved @ v.T) ** 2, axis=1) > threshold))
    share = float((v[:, 4] ** 2).sum())
    tails = rng.standard_t(6, size=(n, 12)) * GYRO_SD / np.sqrt(1.5)
    return numbers(
        false_alarms=np.mean(statistic > threshold),
        law_p=kstest(statistic / GYRO_SD**2, chi2(FREEDOM).cdf).pvalue,
        sizes=sizes,
        power=power,
        theory=ncx2.sf(chi2.isf(FALSE_ALARM, FREEDOM), FREEDOM, sizes**2 * share),
        gaussian=_labelled(noise, v),
        tails=_labelled(tails, v),
        grid=np.linspace(2e-3, 0.02, 181),
        curve=_sum_of_errors(noise, v, np.linspace(2e-3, 0.02, 181)),
    )


def _labelled(noise: FloatArray, v: FloatArray) -> FloatArray:
    """The paper's experiment on noise without any fault: tails are called faults.

    Returns the share of 'faults', the threshold with the fewest errors in number, and there the
    share missed and false alarms over faults; last the share missed at the printed threshold.
    """
    fault = np.any(np.abs(noise) > FAULT * noise.std(), axis=1)
    statistic = np.sum((noise @ v.T) ** 2, axis=1)
    order = np.argsort(-statistic)
    hit, false = np.cumsum(fault[order]), np.cumsum(~fault[order])
    errors = false + fault.sum() - hit
    best = int(np.argmin(errors))
    missed = 1.0 - hit[best] / fault.sum()
    at_printed = np.mean(statistic[fault] <= PRINTED_THRESHOLD)
    return np.array(
        [fault.mean(), statistic[order[best]], missed, false[best] / fault.sum(), at_printed]
    )


def _sum_of_errors(noise: FloatArray, v: FloatArray, grid: FloatArray) -> FloatArray:
    """Misses plus false alarms over 'faults' for a grid of thresholds."""
    fault = np.any(np.abs(noise) > FAULT * noise.std(), axis=1)
    statistic = np.sum((noise @ v.T) ** 2, axis=1)
    missed = np.array([np.mean(statistic[fault] <= t) for t in grid])
    false = np.array([np.sum(statistic[~fault] > t) for t in grid]) / fault.sum()
    return np.asarray(missed + false)


def run_misalignment(seed: int, size: Size) -> Numbers:
    """Relative attitude of an IMU from rates, and what the paper's model makes of it. Eq (12)."""
    rng = generator(seed, PAPER, "misalignment")
    profile = motorcycle(200.0, rng.spawn(1)[0], standstill=20.0)
    rates = ideal_imu(profile, RATE).between(60.0, 120.0).gyro
    true = dcm_from_rotation_vector(MISALIGNED)
    seen = rates @ true.T + 0.0201 * rng.standard_normal(rates.shape)
    error = rotation_vector_from_dcm(wahba(seen, rates) @ true.T)
    return numbers(rates=np.degrees(error), **_euler_model())


def _euler_model() -> dict[str, FloatArray]:
    """A small rotation laid on a vector of Euler angles, at 150 and at 510 degrees of heading."""
    x, y, z = MISALIGNED
    small = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    out = {}
    for name, heading in (("once", 150.0), ("turned", 510.0)):
        angles = np.radians([30.0, 20.0, heading])
        model = (np.eye(3) + small) @ angles
        exact = dcm_from_euler(*angles) @ dcm_from_rotation_vector(MISALIGNED)
        wrong = rotation_vector_from_dcm(dcm_from_euler(*model) @ exact.T)
        out[f"euler_{name}"] = np.degrees(np.linalg.norm(wrong))
        out[f"angles_{name}"] = np.degrees(np.array(euler_from_dcm(exact)).ravel())
    return out
