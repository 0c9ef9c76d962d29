"""The experiments of Waegli 2008 on twins: skis with two IMUs, a motorcycle with four."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from schuler import (
    MeasurementOptions,
    MechanizationComparison,
    NavigationSettings,
    bias_correlation,
    compare_mechanizations,
    navigate_array,
    trajectory_errors,
)
from schuler_papers.experiment import FloatArray, Numbers, Size, numbers
from schuler_papers.waegli2008.rides import GRADES, Receiver, Ride

Mechanization = Literal["single", "synthetic", "extended", "constrained", "system"]
# roll, pitch, heading in degrees, as the paper has them
UNITS = np.array([1.0] * 6 + [180.0 / np.pi] * 3)
PAPER_S_GNSS = MeasurementOptions(correlated=None)
"""The filter of the paper has 15 or 33 states: it takes errors of GNSS for white noise."""
FAULT, FAULT_TIME = float(np.radians(2.0)), 80.0
"""Offset of one gyro, rad/s, and when it comes, s."""
NUMBERS = (1, 2, 4, 8)
"""Of IMUs that are compared."""
BIAS_STEP = 2.0
"""Seconds between points of a curve of biases."""


def compared(
    ride: Ride, receiver: Receiver, names: tuple[Mechanization, ...], *, parity: bool
) -> MechanizationComparison:
    """Run mechanizations on a ride with one receiver."""
    return compare_mechanizations(
        ride.array,
        ride.gnss(receiver),
        ride.models,
        NavigationSettings(
            heading=ride.heading,
            time_offset=0.0,
            turn_on_accel=0.0,
            turn_on_gyro=0.0,
            measurements=PAPER_S_GNSS,
        ),
        mechanizations=names,
        parity=parity,
        truth=ride.truth,
        judged=ride.judged,
    )


def _errors(found: MechanizationComparison, key: str, names: tuple[Mechanization, ...]) -> Numbers:
    out: Numbers = {}
    for name in names:
        for what in ("rms", "largest"):
            out[f"{key} {name} {what}"] = found.average(name, what) * UNITS
    return out


def _key(receiver: Receiver) -> str:
    return receiver.replace("/", "")


def run_ski(seed: int, size: Size) -> Numbers:
    """Two aligned IMUs on a skier, both receivers. Tables 1, Figs 12 and 13."""
    ride = Ride("ski", seed, (1.0, 1.0))
    names: tuple[Mechanization, ...] = ("single", "synthetic", "extended")
    out: Numbers = {}
    for receiver in GRADES:
        found = compared(ride, receiver, names, parity=False)
        out |= _errors(found, _key(receiver), names)
        out |= {f"{_key(receiver)} difference": _difference(found)}
    return out | _biases(ride, found)


def run_motorcycle(seed: int, size: Size) -> Numbers:
    """Four IMUs on a tetrahedron, equal sensors, both receivers. Tables 2 and 3, Figs 14 to 17."""
    ride = Ride("motorcycle", seed, (1.0, 1.0, 1.0, 1.0))
    names: tuple[Mechanization, ...] = ("single", "synthetic", "extended")
    fused = names[1:]
    code = compared(ride, "L1", fused, parity=False)
    more = (*names, "constrained", "system")
    found = compared(ride, "L1/L2", more, parity=False)
    out = _errors(code, "L1", fused) | _errors(found, "L1L2", more)
    out |= {"L1L2 difference": _difference(found)} | _biases(ride, found)
    curves = [r for r in found.results if r.mechanization in ("single", "extended")]
    error = [trajectory_errors(r.solution, ride.truth)[:, 6:] * UNITS[6:] for r in curves]
    out |= numbers(
        attitude_time=ride.truth.time[::5],
        attitude_single=np.array(error[0])[::5],
        attitude_extended=np.array(error[-1])[::5],
    )
    return out | _individual_biases(ride)


def run_unequal(seed: int, size: Size) -> Numbers:
    """Four IMUs of which one has biases ten times as large, with and without parity."""
    ride = Ride("motorcycle", 1000 + seed, (0.3, 0.3, 0.3, 3.0))
    without = compared(ride, "L1/L2", ("single", "synthetic", "extended"), parity=False)
    with_parity = compared(ride, "L1/L2", ("extended",), parity=True)
    out = _errors(without, "without", ("single", "synthetic", "extended"))
    return out | _errors(with_parity, "with", ("extended",))


def run_number(seed: int, size: Size) -> Numbers:
    """One, two, four and eight IMUs on skis, fused with equal weights: the ideal number."""
    whole = Ride("ski", 2000 + seed, (1.0,) * NUMBERS[-1])
    errors = []
    for count in NUMBERS:
        ride = whole.first(max(count, 2))
        name: Mechanization = "single" if count == 1 else "synthetic"
        found = compared(ride, "L1/L2", (name,), parity=False)
        errors.append(found.average(name, "rms") * UNITS)
    return numbers(errors=errors)


def run_faulty(seed: int, size: Size) -> Numbers:
    """Four IMUs of which one gyro gets an offset: heading with and without detection inside."""
    ride = Ride("motorcycle", 3000 + seed, (1.0,) * 4)
    gyro = np.array(ride.array.gyro)
    gyro[ride.array.time >= FAULT_TIME, 3, 0] += FAULT
    broken = replace(ride.array, gyro=gyro)
    cases = {"healthy": (ride.array, True), "watched": (broken, True), "blind": (broken, False)}
    errors = []
    for array, watched in cases.values():
        done = navigate_array(
            array,
            ride.gnss("L1/L2"),
            ride.models,
            faults=watched,
            heading=ride.heading,
            time_offset=0.0,
            turn_on_accel=0.0,
            turn_on_gyro=0.0,
            measurements=PAPER_S_GNSS,
        )
        after = trajectory_errors(done.solution, ride.truth)[ride.truth.time >= FAULT_TIME]
        errors.append(np.sqrt(np.mean(after**2, axis=0)) * UNITS)
    return numbers(errors=errors)


def _difference(found: MechanizationComparison) -> FloatArray:
    """Largest difference between synthetic and extended: m, m/s, rad."""
    a, b = (found.of(n)[0].solution.trajectory for n in ("synthetic", "extended"))
    metres = np.abs(a.position - b.position).max(axis=0) * [6.4e6, 6.4e6, 1.0]
    speed = np.abs(a.velocity - b.velocity).max()
    turn = np.abs(a.rotation - b.rotation).max()
    return np.array([metres.max(), speed, turn])


def _biases(ride: Ride, found: MechanizationComparison) -> Numbers:
    """Gyro biases in the body: each IMU by itself, their mean, and the synthetic IMU's."""
    start, stop = ride.judged
    time = np.arange(start, stop, BIAS_STEP)
    alone, sd = [], []
    for result in found.of("single"):
        value, spread = _gyro_bias(result, time)
        alone.append(value)
        sd.append(spread)
    fused, _ = _gyro_bias(found.of("synthetic")[0], time)
    apart = fused[-1] - np.mean(alone, axis=0)[-1]
    return numbers(
        bias_time=time,
        bias_alone=np.array(alone) * UNITS[6:],
        bias_synthetic=fused * UNITS[6:],
        bias_apart_in_sd=np.abs(apart) / np.mean(sd, axis=0)[-1],
    )


def _gyro_bias(result: Any, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    solution = result.solution
    names = list(solution.sensor_error_names)
    value, sd = np.zeros((time.size, 3)), np.zeros((time.size, 3))
    for a, axis in enumerate("xyz"):
        for j, name in enumerate(names):
            if name.startswith(f"gyro_{axis}"):
                at = solution.sensor_error_time
                value[:, a] += np.interp(time, at, solution.sensor_errors[:, j])
                sd[:, a] = np.interp(time, at, solution.sensor_errors_sd[:, j])
    return value, sd


def _individual_biases(ride: Ride) -> Numbers:
    """All 24 biases of the extended filter at the end, with and without parity, and the truth."""
    out: Numbers = {}
    truth = np.concatenate([ride.biases[-1, :, 3:], ride.biases[-1, :, :3]], axis=1).ravel()
    for parity in (False, True):
        found = compared(ride, "L1/L2", ("extended",), parity=parity)
        solution, fusion = found.results[0].solution, found.prepared.fusion
        key = "with" if parity else "without"
        value, sd = solution.sensor_errors[-1], solution.sensor_errors_sd[-1]
        error = (value - truth).reshape(4, 2, 3)
        estimate = value.reshape(4, 2, 3)
        whole = np.linalg.qr(fusion.axes, mode="complete")[0]
        seen, unseen = whole[:, :3], whole[:, 3:]
        gyro, off = estimate[:, 1].ravel(), error[:, 1].ravel()
        out |= numbers(
            **{
                f"{key}_error_in_sd": np.abs(value - truth) / sd,
                f"{key}_gyro": gyro * UNITS[6],
                f"{key}_unseen_rms": np.sqrt(np.mean((unseen.T @ gyro) ** 2)),
                f"{key}_seen_error": np.sqrt(np.mean((seen.T @ off) ** 2)),
                f"{key}_seen_truth": np.sqrt(
                    np.mean((seen.T @ truth.reshape(4, 2, 3)[:, 1].ravel()) ** 2)
                ),
            }
        )
    out |= numbers(gyro_truth=truth.reshape(4, 2, 3)[:, 1].ravel() * UNITS[6])
    _, correlation = bias_correlation(found.prepared, ride.gnss("L1/L2"), parity=False)
    gyros = 9 + np.array([6 * i + 3 + a for i in range(4) for a in range(3)])
    axes = fusion.axes @ fusion.axes.T
    return out | numbers(
        correlation=correlation,
        correlation_gyro=correlation[np.ix_(gyros, gyros)],
        correlation_theory=-axes / 3.0,
    )
