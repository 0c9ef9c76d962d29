"""Noise of one and of four gyros, and faults seen in parity space: Figs 5 to 7, eqs (1) to (3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, kstest

from schuler import (
    FaultSettings,
    Geometry,
    ImuArray,
    Mounting,
    OnlineSettings,
    chi_square_power,
    chi_square_threshold,
    dcm_from_euler,
    dcm_from_rotation_vector,
    detect_faults,
    empirical_threshold,
    euler_from_dcm,
    ideal_imu,
    jarque_bera_test,
    motorcycle,
    parity_matrix,
    rotation_vector_from_dcm,
    synthesize,
    tetrahedron_mounting,
    threshold_performance,
    wahba,
)
from schuler_papers.experiment import FloatArray, Numbers, Size, generator, numbers
from schuler_papers.waegli2008.rides import GYRO_SD, PAPER, RATE

FREEDOM = 9
FALSE_ALARM = 0.05
PRINTED_THRESHOLD = 0.0155
FAULT = 3.5
"""Standard deviations beyond which the paper calls a difference a fault."""
FAULTY_AXIS = 4
SHOWN = 400
"""Epochs that are drawn."""
MISALIGNED = np.radians([2.0, -1.0, 1.5])


def geometry() -> Geometry:
    """Return the 12 axes of the tetrahedron."""
    return Geometry.from_mounting(tetrahedron_mounting())


def _at_rest(noise: FloatArray) -> ImuArray:
    n = noise.shape[0]
    gyro = noise.reshape(n, 4, 3)
    return ImuArray(np.arange(n) / RATE, gyro, np.full(gyro.shape, np.nan), tetrahedron_mounting())


def run_noise(seed: int, size: Size) -> Numbers:
    """Four equal gyro triads at rest and their best estimate. Fig 5, eq (1), Fig 6."""
    rng = generator(seed, PAPER, "noise")
    n = 6_000 if size == "quick" else 60_000
    noise = GYRO_SD * rng.standard_normal((n, 12))
    whole = synthesize(_at_rest(noise), "equal", settings=OnlineSettings(keep_biases=True))
    fused = whole.sensor("gyro").vectors
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
        **_ridden(generator(seed, PAPER, "figure-5")),
    )


def _ridden(rng: np.random.Generator) -> Numbers:
    """Three seconds of a ride: the rate about one axis by four IMUs, fused, and as it was."""
    ride = motorcycle(70.0, rng.spawn(1)[0], standstill=20.0)
    true = ideal_imu(ride, RATE).between(40.0, 43.0).gyro
    measured = true[:, None] + GYRO_SD * rng.standard_normal((true.shape[0], 4, 3))
    array = ImuArray(
        np.arange(true.shape[0]) / RATE, measured, np.full(measured.shape, np.nan),
        Mounting.aligned(4),
    )  # fmt: skip
    whole = synthesize(array, "equal", settings=OnlineSettings(keep_biases=True))
    fused = whole.sensor("gyro").vectors
    return numbers(
        rate_time=array.time,
        rates=np.degrees(np.column_stack([measured[:, :, 2], fused[:, 2], true[:, 2]]).T),
    )


def run_parity(seed: int, size: Size) -> Numbers:
    """Law of D, its power against one biased sensor, and the paper's own experiment. Fig 7."""
    rng = generator(seed, PAPER, "parity")
    n = 100_000
    four = geometry()
    v = parity_matrix(four.axes, np.ones(12))
    noise = GYRO_SD * rng.standard_normal((n, 12))
    statistic = np.sum((noise @ v.T) ** 2, axis=1)
    threshold = chi_square_threshold(GYRO_SD, FALSE_ALARM, FREEDOM)
    sizes = np.arange(2.0, 7.0)
    power = []
    for bias in sizes:
        moved = noise[:20_000].copy()
        moved[:, FAULTY_AXIS] += bias * GYRO_SD
        power.append(np.mean(np.sum((moved @ v.T) ** 2, axis=1) > threshold))
    tails = rng.standard_t(6, size=(n, 12)) * GYRO_SD / np.sqrt(1.5)
    grid = np.linspace(2e-3, 0.02, 181)
    labels = _called_faults(noise)
    return numbers(
        false_alarms=np.mean(statistic > threshold),
        law_p=kstest(statistic / GYRO_SD**2, chi2(FREEDOM).cdf).pvalue,
        sizes=sizes,
        power=power,
        theory=chi_square_power(four, FAULTY_AXIS, sizes, FALSE_ALARM),
        gaussian=_labelled(noise, v),
        tails=_labelled(tails, v),
        shown_statistic=np.sum((tails[:SHOWN] @ v.T) ** 2, axis=1),
        shown_fault=_called_faults(tails)[:SHOWN],
        grid=grid,
        curve=[threshold_performance(statistic, labels, float(t)).cost for t in grid],
        blamed=_blamed(rng),
    )


def _called_faults(noise: FloatArray) -> NDArray[np.bool_]:
    """What the paper's experiment calls a fault: any difference in the tails."""
    found: NDArray[np.bool_] = np.any(np.abs(noise) > FAULT * noise.std(), axis=1)
    return found


def _labelled(noise: FloatArray, v: FloatArray) -> FloatArray:
    """The paper's experiment on noise without any fault: tails are called faults.

    Returns the share of 'faults', the threshold with the fewest errors in number, and there the
    share missed and false alarms over faults; last the share missed at the printed threshold.
    """
    fault = _called_faults(noise)
    statistic = np.sum((noise @ v.T) ** 2, axis=1)
    best = empirical_threshold(statistic, fault)
    printed = threshold_performance(statistic, fault, PRINTED_THRESHOLD)
    # alarms are raised above the threshold: the least sample that raises one
    least = float(statistic[statistic > best.threshold].min(initial=np.inf))
    return np.array(
        [fault.mean(), least, best.missed_share, best.false_alarms_per_fault, printed.missed_share]
    )


def _blamed(rng: np.random.Generator) -> float:
    """Whether a step of five deviations on one gyro is blamed on it within five seconds."""
    n, start = 3000, 2000
    noise = GYRO_SD * rng.standard_normal((n, 12))
    noise[start:, FAULTY_AXIS] += 5.0 * GYRO_SD
    found = detect_faults(_at_rest(noise), FaultSettings())
    imu, axis = divmod(FAULTY_AXIS, 3)
    name = f"{found.names[imu]} {'xyz'[axis]}"
    begin = start / RATE
    return float(any(r.name == name and begin <= r.start <= begin + 5.0 for r in found.records))


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
