"""Normalised squares of every kind of aiding and every mechanization over 50 seeds.

    python -m benchmarks.consistency [--seeds 50] [--only NAME ...]

Twins: a known motion, sensors that draw their errors from what the filter is told, a start that is
drawn. Then the innovations (NIS) and the errors (NEES), each over its claimed covariance and its
number of components, are 1 on average, and the band is that of chi-square at 99.9 %. A row outside
it is named, and the command ends with exit code 1. What a filter supposes without measuring it
(no motion at rest, a rigid body) holds better here than it is told: such NIS may be small.

NIS counts every update after the first 5 s; its components are independent. NEES is that of the
nine navigation states together at one moment near the end of the run (mechanizations report blocks
of three, so theirs is that of position, velocity and attitude, each by itself), and of the states
that the sensor brings: one independent draw for each seed. Motions and seeds are not those of the
tests.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# the twins live beside the tests, which judge smaller draws with them
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "navigation"))

from array_twins import draw_array, mems
from twins import LEVER, Twin, draw_twin, navigation_errors, perfect
from vehicle_twins import ARM, draw_vehicle, ride

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import Mounting
from schuler.navigation.aiding.barometer import Barometer
from schuler.navigation.aiding.gnss import CorrelatedGnss
from schuler.navigation.aiding.heading import Heading
from schuler.navigation.aiding.magnetometer import Magnetometer, earth_field
from schuler.navigation.aiding.options import MeasurementOptions
from schuler.navigation.aiding.schedule import KIND_NAMES, PlacedAiding
from schuler.navigation.engine import NO_VEHICLE, gate_thresholds, run_engine
from schuler.navigation.mechanizations.navigate_array import (
    MECHANIZATIONS,
    Mechanization,
    run_mechanization,
)
from schuler.navigation.mechanizations.stacked import RigidBody, default_weight
from schuler.rotations import dcm_from_rotation_vector
from schuler.simulation import Profile, car_urban, motorcycle, simulate_gnss

Array = NDArray[np.float64]

DURATION = 150.0
SETTLED = 5.0
PROBABILITY = 0.999
HEADING_OFFSET = np.radians(3.0)
FIELD = earth_field(np.radians(4.0), np.radians(63.0), 48.0)
FIRST_SEED = 5000
ROLLING = KIND_NAMES.index("velocity across the vehicle")
SUPPOSED = (
    "zero velocity",
    "zero rate",
    "relative attitude",
    "relative position",
    "relative velocity",
)


@dataclass
class Tally:
    """Sums of normalised squares and how many components they have, by what they are of."""

    sums: dict[str, float] = field(default_factory=dict)
    degrees: dict[str, int] = field(default_factory=dict)

    def add(self, name: str, square: float, degrees: int) -> None:
        """Add one."""
        self.sums[name] = self.sums.get(name, 0.0) + float(square)
        self.degrees[name] = self.degrees.get(name, 0) + degrees


def band(degrees: int) -> tuple[float, float]:
    """Interval of a chi-square variable over its degrees of freedom."""
    from scipy.stats import chi2

    tail = 0.5 * (1.0 - PROBABILITY)
    low, high = chi2.ppf([tail, 1.0 - tail], degrees) / degrees
    return float(low), float(high)


def sensor(kind: str, profile: Profile, seed: int) -> tuple[PlacedAiding | None, Array]:
    """A sensor with errors drawn from its own prior, and the true values of its states."""
    rng = np.random.default_rng([seed, 1])
    last = profile.stop - 1.0
    if kind == "barometer":
        t = np.arange(0.5, last, 0.2)
        walk = np.cumsum(0.03 * np.sqrt(0.2) * rng.standard_normal(t.size))
        # the state is of the down component: positive where the height is too low
        low = 100.0 * rng.standard_normal() + walk
        height = profile.trajectory(t).position[:, 2] - low + 0.3 * rng.standard_normal(t.size)
        return Barometer(t, height, 0.3), low[-1:]
    t = np.arange(0.5, last, 1.0)
    rotation = profile.trajectory(t).rotation
    if kind == "heading":
        baseline = np.array([0.8, 0.6, 0.1])
        ahead = rotation @ baseline
        offset = HEADING_OFFSET * rng.standard_normal()
        seen = np.arctan2(ahead[:, 1], ahead[:, 0]) + offset
        seen += np.radians(0.5) * rng.standard_normal(t.size)
        return Heading(t, seen, np.radians(0.5), baseline, HEADING_OFFSET), np.array([offset])
    if kind == "magnetometer":
        iron = 5.0 * rng.standard_normal(3)
        seen = np.einsum("kij,i->kj", rotation, FIELD) + iron + rng.standard_normal((t.size, 3))
        return Magnetometer(t, seen, FIELD, 1.0, 5.0), iron
    return None, np.zeros(0)


def run_twin(
    drawn: Twin, profile: Profile, truth: Array, tally: Tally, rng: np.random.Generator
) -> None:
    """Filter one draw and add its squares: of every kind of update, and at the last node.

    `truth` is that of the last sensor states, NaN for those that are not judged.
    """
    imu, gnss, setup = drawn.imu, drawn.gnss, drawn.setup
    schedule = setup.schedule(imu, gnss)
    # a car that slips by as much as the filter is told
    value = schedule.value.copy()
    slipping = (schedule.kind == ROLLING)[:, None] & np.isfinite(schedule.variance)
    noise = rng.standard_normal(value.shape) * np.sqrt(np.where(slipping, schedule.variance, 0.0))
    schedule = replace(schedule, value=value + noise)
    done = run_engine(
        imu,
        setup.initial_state(imu, gnss),
        setup.model,
        schedule,
        gate=gate_thresholds(0.0),
        vehicle=NO_VEHICLE if setup.vehicle is None else setup.vehicle.states,
    )
    late = schedule.time > imu.time[0] + SETTLED
    for number in np.unique(schedule.kind):
        rows = late & (schedule.kind == number)
        nis, degrees = done.aiding.nis[rows], done.aiding.degrees[rows]
        tally.add(f"NIS {KIND_NAMES[number]}", nis.sum(), int(degrees.sum()))
    nodes = done.nodes
    k = int(np.searchsorted(imu.time, nodes.time[-1] - 1e-6))
    s = done.samples
    here = slice(k, k + 1)
    error = navigation_errors(
        profile, imu.time[here], s.position[here], s.velocity[here], s.rotation[here]
    )[0]
    covariance = nodes.covariance[-1]
    tally.add("NEES navigation", error @ np.linalg.solve(covariance[:9, :9], error), 9)
    if truth.size:
        judged = np.flatnonzero(np.isfinite(truth))
        place = covariance.shape[0] - truth.size + judged
        left = truth[judged] - nodes.sensor_state[-1, place - 9]
        own = covariance[np.ix_(place, place)]
        tally.add("NEES own states", left @ np.linalg.solve(own, left), judged.size)


def aiding(kind: str) -> Callable[[int, Tally], None]:
    """Return what draws one run with a kind of aiding."""
    profile = car_urban(DURATION, 17, standstill=15.0)
    ideal = perfect(profile, 50.0)

    def draw(seed: int, tally: Tally) -> None:
        drawn = draw_twin(profile, ideal, seed)
        if kind == "slow errors of GNSS":
            gnss = simulate_gnss(
                profile, 1.0, position_sd=0.3, velocity_sd=0.05, correlated_sd=1.5,
                correlation_time=30.0, lever_arm=LEVER, rng=np.random.default_rng([seed, 2]),
            )  # fmt: skip
            options, truth = MeasurementOptions(correlated=CorrelatedGnss(1.5, 30.0)), np.zeros(0)
            drawn = replace(drawn, gnss=gnss)
        else:
            source, truth = sensor(kind, profile, seed)
            options = MeasurementOptions(sources=() if source is None else (source,))
        model, placed = options.placed(drawn.setup.model)
        setup = replace(drawn.setup, model=model, measurements=placed)
        rng = np.random.default_rng([seed, 3])
        run_twin(replace(drawn, setup=setup), profile, truth, tally, rng)

    return draw


def vehicle(constraints: tuple[str, ...]) -> Callable[[int, Tally], None]:
    """Return what draws one run with what is known of a vehicle."""
    car = ride(DURATION, 17, standstill=15.0)

    def draw(seed: int, tally: Tally) -> None:
        drawn = draw_vehicle(car, seed, constraints or ("zupt",))
        truth = np.zeros(0)
        if "nhc" in constraints:
            truth = np.concatenate([drawn.mu, -ARM, [0.0, -0.005]])
            # the height above the axle shows in rolling alone, which lags behind the gyro: known
            # to come out 2.5 claimed deviations short (docs/vehicle.md), and not judged here
            truth[5] = np.nan
        rng = np.random.default_rng([seed, 3])
        run_twin(drawn.aided if constraints else drawn.plain, car.profile, truth, tally, rng)

    return draw


def mechanization(name: Mechanization) -> Callable[[int, Tally], None]:
    """Return what draws one run of four unequal IMUs on a motorcycle."""
    profile, mounting = motorcycle(100.0, 17, standstill=20.0), tetrahedron_mounting(0.05)
    noises = [mems(), mems(), mems(2.0), mems(4.0, 3.0)]

    def draw(seed: int, tally: Tally) -> None:
        twin = draw_array(profile, mounting, noises, seed)
        if name == "constrained":
            # a mounting that differs from what is believed, as this filter is told
            rng, rigid = np.random.default_rng([seed, 5]), RigidBody()
            weight = default_weight(twin.prepared)
            turn = rng.standard_normal((4, 3)) * rigid.rotation_sd
            shift = rng.standard_normal((4, 3)) * rigid.position_sd
            turn, shift = turn - weight @ turn, shift - weight @ shift
            true = Mounting(
                dcm_from_rotation_vector(turn) @ mounting.rotation, mounting.position - shift
            )
            twin = draw_array(profile, true, noises, seed, believed=mounting)
        solution = run_mechanization(twin.prepared, twin.gnss, name, imu=seed % 4).solution
        path, seen = solution.trajectory, solution.innovations
        for kind in seen.kinds:
            part = seen.of_kind(kind)
            late = part.time > path.time[0] + SETTLED
            tally.add(f"NIS {kind}", part.nis[late].sum(), int(part.degrees[late].sum()))
        k = int(np.searchsorted(path.time, 95.0 - 1e-6))
        here = slice(k, k + 1)
        error = navigation_errors(
            profile, path.time[here], path.position[here], path.velocity[here], path.rotation[here]
        )[0]
        place = error[:3]
        tally.add(
            "NEES position", place @ np.linalg.solve(solution.position_covariance[k], place), 3
        )
        tally.add("NEES velocity", np.sum((error[3:6] / solution.velocity_sd[k]) ** 2), 3)
        tally.add("NEES attitude", np.sum((error[6:] / solution.attitude_sd[k]) ** 2), 3)

    return draw


def cases() -> dict[str, Callable[[], Callable[[int, Tally], None]]]:
    """Return what can be judged, by name; each is set up when it is run."""
    found: dict[str, Callable[[], Callable[[int, Tally], None]]] = {
        name: partial(aiding, name)
        for name in ("GNSS alone", "heading", "barometer", "magnetometer", "slow errors of GNSS")
    }
    found["car without aiding"] = partial(vehicle, ())
    found["wheels (nhc)"] = partial(vehicle, ("nhc",))
    found["standstill (zupt)"] = partial(vehicle, ("zupt",))
    return found | {f"array, {name}": partial(mechanization, name) for name in MECHANIZATIONS}


def main() -> int:
    """Print the table; 1 when a row lies outside its band."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--only", nargs="+", default=list(cases()))
    options = parser.parse_args()
    outside = []
    print(f"{options.seeds} seeds, bands of chi-square at {100 * PROBABILITY:g} %")
    for name in options.only:
        begun, draw, tally = time.process_time(), cases()[name](), Tally()
        for seed in range(options.seeds):
            draw(FIRST_SEED + seed, tally)
        print(f"{name}  ({time.process_time() - begun:.1f} CPU s)")
        for what, degrees in tally.degrees.items():
            if not degrees:
                continue
            low, high = band(degrees)
            if what.removeprefix("NIS ") in SUPPOSED:
                low = 0.0
            mean = tally.sums[what] / degrees
            good = low < mean < high
            print(
                f"  {what:42}{mean:7.3f}  band {low:.3f} .. {high:.3f}  of {degrees:6d}  "
                + ("good" if good else "OUTSIDE"),
                flush=True,
            )
            outside += [] if good else [f"{name}: {what}"]
    print("all inside" if not outside else "outside: " + "; ".join(outside))
    return 1 if outside else 0


if __name__ == "__main__":
    sys.exit(main())
