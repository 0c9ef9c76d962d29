"""A measurement of a user's own, from a file of his own, works in everything that navigates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import schuler
from schuler import earth
from schuler.data import GnssRecording, ImuRecording, NavigationSolution
from schuler.errors import InputError
from schuler.report import NavigationResults, render_report
from schuler.simulation import Profile, car_urban, ideal_imu, simulate_gnss, simulate_imu

Array = NDArray[np.float64]

# --- what a user writes ---------------------------------------------------------------------------


@dataclass(frozen=True)
class RangeToBeacon:
    """Distances to a beacon, too long by a constant that nobody knows."""

    time: Array
    distance: Array
    sd: float
    beacon: Array
    bias_sd: float = 0.0
    name: str = "range to beacon"

    @property
    def states(self) -> Sequence[schuler.AidingState]:
        known = self.bias_sd == 0.0
        return () if known else (schuler.AidingState(f"bias of {self.name}", self.bias_sd),)

    def linearise(self, k: int, state: schuler.AidedState) -> tuple[Array, Array, Array]:
        away = -earth.ned_from_geodetic(self.beacon, state.position)
        distance = float(np.linalg.norm(away))
        design = np.zeros((1, 9 + state.own.size))
        design[0, :3] = away / distance
        design[0, 9:] = 1.0
        predicted = distance + state.own.sum()
        return np.array([predicted - self.distance[k]]), design, np.array([self.sd**2])


@dataclass(frozen=True)
class SpeedLog:
    """A log of speed through the axes of the IMU: attitude, velocity and lever arm take part."""

    time: Array
    velocity: Array
    sd: float
    name: str = "speed log"

    def linearise(self, k: int, state: schuler.AidedState) -> tuple[Array, Array, Array]:
        c = state.rotation
        v = state.velocity
        # C' v changes by C' (psi x v): (I - [psi x]) turns C, so C' gets psi x v
        cross = np.array([[0.0, v[2], -v[1]], [-v[2], 0.0, v[0]], [v[1], -v[0], 0.0]])
        design = np.hstack([np.zeros((3, 3)), c.T, c.T @ cross])
        return c.T @ v - self.velocity[k], design, np.eye(3) * self.sd**2


# --- a drive --------------------------------------------------------------------------------------

WINDOW = (90.0, 60.0)
BEACONS = ((200.0, 300.0, -20.0), (-300.0, 150.0, -30.0), (100.0, -400.0, -10.0))
BIAS = 4.0
SD = 0.3
NOISE = schuler.NoiseModel(
    {
        f"{sensor}_{axis}": schuler.WhiteNoise(white) + schuler.RandomWalk(walk)
        for sensor, white, walk in (("gyro", 2e-4, 5e-6), ("accel", 2e-3, 1e-4))
        for axis in "xyz"
    },
    rate=50.0,
)


@dataclass(frozen=True)
class Drive:
    profile: Profile
    imu: ImuRecording
    gnss: GnssRecording

    def truth(self, time: Array) -> Any:
        return self.profile.trajectory(time)

    def ranges(self, bias: float = 0.0, bias_sd: float = 0.0) -> tuple[RangeToBeacon, ...]:
        rng = np.random.default_rng(8)
        # not at the stamps of the samples
        time = np.arange(self.imu.time[0] + 1.003, self.imu.time[-1], 1.0)
        path = self.truth(time)
        made = []
        for number, place in enumerate(BEACONS):
            beacon = earth.geodetic_from_ned(np.array(place), path.position[0])
            off = earth.ecef_from_geodetic(path.position) - earth.ecef_from_geodetic(beacon)
            distance = np.linalg.norm(off, axis=1) + SD * rng.standard_normal(time.size) + bias
            made.append(
                RangeToBeacon(time, distance, SD, beacon, bias_sd, f"range to beacon {number}")
            )
        return tuple(made)

    def log(self) -> SpeedLog:
        rng = np.random.default_rng(9)
        time = np.arange(self.imu.time[0] + 0.507, self.imu.time[-1], 0.5)
        path = self.truth(time)
        velocity = np.einsum("kji,kj->ki", path.rotation, path.velocity)
        return SpeedLog(time, velocity + 0.05 * rng.standard_normal(velocity.shape), 0.05)


@pytest.fixture(scope="module")
def drive() -> Drive:
    profile = car_urban(200.0, 6, standstill=20.0)
    rng = np.random.default_rng(6)
    imu = simulate_imu(ideal_imu(profile, 50.0), NOISE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=1.0, velocity_sd=0.05, rng=rng, start=1.0)
    return Drive(profile, imu, gnss)


def options(*sources: Any) -> schuler.MeasurementOptions:
    return schuler.MeasurementOptions(sources=sources)


def navigated(drive: Drive, *sources: Any, **how: Any) -> NavigationSolution:
    return schuler.navigate(
        drive.imu, drive.gnss, NOISE, time_offset=0.0, measurements=options(*sources), **how
    )


def worst(drive: Drive, solution: NavigationSolution) -> tuple[float, float]:
    """Largest horizontal error in the outage, and that error over its claimed deviation."""
    path, start = solution.trajectory, drive.gnss.time[0] + WINDOW[0]
    inside = (path.time > start) & (path.time < start + WINDOW[1])
    north, east = earth.metres_per_radian(path.position)
    true = drive.truth(path.time).position
    off = np.hypot(
        (path.position[:, 0] - true[:, 0]) * north, (path.position[:, 1] - true[:, 1]) * east
    )
    claimed = np.linalg.norm(solution.position_sd[:, :2], axis=1)
    at = int(np.argmax(np.where(inside, off, 0.0)))
    return float(off[at]), float(off[at] / claimed[at])


def test_ranges_carry_a_filter_through_an_outage_as_well_as_they_claim(drive: Drive) -> None:
    alone, _ = worst(drive, navigated(drive, outages=[WINDOW]))
    aided = navigated(drive, *drive.ranges(), outages=[WINDOW])
    off, over = worst(drive, aided)
    assert alone > 5.0
    assert off < 1.2
    assert over < 3.5
    for number in range(3):
        told = aided.innovations.of_kind(f"range to beacon {number}")
        assert told.time.size > 190
        # chi-square of so many degrees: its mean is one within five standard errors
        assert told.mean_nis == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / told.time.size))


def test_a_state_of_its_own_is_estimated_and_named(drive: Drive) -> None:
    solution = navigated(drive, *drive.ranges(BIAS, 10.0), outages=[WINDOW])
    off, over = worst(drive, solution)
    assert off < 2.5
    assert over < 3.5
    names = [f"bias of range to beacon {k}" for k in range(3)]
    places = [solution.sensor_error_names.index(n) for n in names]
    found, sd = solution.sensor_errors[-1, places], solution.sensor_errors_sd[-1, places]
    assert (sd < 0.3).all()
    assert (np.abs(found - BIAS) < 4.0 * sd).all()


def test_attitude_and_velocity_take_part(drive: Drive) -> None:
    solution = navigated(drive, drive.log(), outages=[WINDOW])
    off, over = worst(drive, solution)
    alone, _ = worst(drive, navigated(drive, outages=[WINDOW]))
    assert off < 0.5 * alone
    assert over < 3.5
    told = solution.innovations.of_kind("speed log")
    assert told.mean_nis == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / told.degrees.sum()))


@pytest.mark.parametrize("smooth", [True, "fixed-lag"])
def test_smoothing_takes_it(drive: Drive, smooth: Any) -> None:
    how = {"smooth": smooth, "outages": [WINDOW]}
    off, over = worst(drive, navigated(drive, *drive.ranges(), **how))
    assert off < 1.2
    assert over < 3.5
    # a smoother that computes its nodes once more asks nobody twice
    whole, again = (
        navigated(drive, *drive.ranges(BIAS, 10.0), smoother_memory=m, **how) for m in (5e8, 1e4)
    )
    np.testing.assert_array_equal(whole.trajectory.position, again.trajectory.position)


def test_a_stream_takes_it_and_agrees_with_the_batch(drive: Drive) -> None:
    sources = drive.ranges(BIAS, 10.0)
    known = {"time_offset": 0.0, "measurements": options(*sources)}
    imu, setup = schuler.prepare(drive.imu, drive.gnss, NOISE, **known)
    filter_ = schuler.NavigationFilter.from_setup(setup, imu, drive.gnss, late=1.0)
    gnss, waiting, heard = drive.gnss, 0, 0
    assert gnss.position_sd is not None
    assert gnss.velocity is not None
    assert gnss.velocity_sd is not None
    placed = setup.measurements.placed_sources
    time = sources[0].time
    for k, now in enumerate([*imu.time.tolist(), np.inf]):
        # a measurement is given before the sample it falls into, a fix comes 0.3 s late
        while heard < time.size and time[heard] <= now:
            for source in placed:
                filter_.add(source.rows().select(slice(heard, heard + 1)))
            heard += 1
        if k < imu.size:
            filter_.add_imu(now, imu.gyro[k], imu.accel[k])
        while waiting < gnss.size and gnss.time[waiting] + 0.3 <= now:
            i, waiting = waiting, waiting + 1
            fix = (gnss.position[i], gnss.position_sd[i], gnss.velocity[i], gnss.velocity_sd[i])
            assert filter_.add_gnss(gnss.time[i], *fix)
    batch = schuler.navigate(drive.imu, drive.gnss, NOISE, **known)
    last = filter_.state()
    north, east = earth.metres_per_radian(last.position)
    off = (last.position - batch.trajectory.position[-1]) * [float(north), float(east), 1.0]
    assert np.abs(off).max() < 5e-3
    # slow errors of GNSS are in units of what the receiver claims
    np.testing.assert_allclose(last.sensor_state, batch.sensor_errors[-1], atol=2e-2)


def test_outages_and_arrays_take_it_and_a_page_shows_it(drive: Drive) -> None:
    told = {"time_offset": 0.0, "measurements": options(*drive.ranges())}
    judged = schuler.evaluate_outages(drive.imu, drive.gnss, NOISE, windows=[WINDOW], **told)
    assert judged.causal.worst_m < 4.0
    page = render_report(
        NavigationResults(judged.solutions[0][0], judged.solutions[0][1], drive.gnss),
        title="ranges",
    )
    assert "range to beacon 1" in page
    second = simulate_imu(ideal_imu(drive.profile, 50.0), NOISE, np.random.default_rng(7))
    pair = schuler.ImuArray.from_recordings(
        [drive.imu, replace(second, name="other")], schuler.Mounting.aligned(2)
    )
    for name in ("single", "synthetic", "extended", "system"):
        done = schuler.navigate_array(
            pair, drive.gnss, NOISE, mechanization=name, outages=[WINDOW], **told
        )
        assert worst(drive, done.solution)[0] < 1.2
        assert "range to beacon 1" in done.solution.innovations.kinds
    with pytest.raises(InputError, match=r"sensors.*with the constrained mechanization"):
        schuler.navigate_array(pair, drive.gnss, NOISE, mechanization="constrained", **told)


class Nameless:
    time = (1.0,)

    def linearise(self, k: int, state: Any) -> None: ...


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"time": np.zeros((2, 2))}, "'range to beacon 0' has times of shape"),
        ({"linearise": 3}, "a function `linearise"),
        ({"states": [("bias", 1.0)]}, "schuler.AidingState"),
        ({"answer": 7.0}, "measurement 0 of aiding source 'range to beacon 0' returns"),
        ({"answer": ([0.0], np.zeros((1, 8)), [1.0])}, r"derivatives of shape \(1, 8\)"),
        ({"answer": (np.zeros(4), np.zeros((4, 9)), np.ones(4))}, "1 to 3 components"),
        ({"answer": ([0.0], np.zeros((1, 9)), [[1.0, 0.0]])}, "variance of shape"),
        ({"answer": ([np.nan], np.zeros((1, 9)), [1.0])}, "not finite"),
        ({"answer": ([0.0], np.zeros((1, 9)), [0.0])}, "positive numbers"),
        (
            {"answer": (np.zeros(2), np.zeros((2, 9)), np.ones((2, 2)))},
            "independent components",
        ),
    ],
)
def test_a_source_that_breaks_the_protocol_is_named(
    drive: Drive, change: dict[str, Any], said: str
) -> None:
    good = drive.ranges()[0]

    class Broken:
        name, time, states = good.name, good.time, ()

        def linearise(self, k: int, state: Any) -> Any:
            return change["answer"]

    for key, value in change.items():
        if key != "answer":
            setattr(Broken, key, value)
    with pytest.raises(InputError, match=said):
        navigated(drive, Broken())


def test_a_source_without_a_name_is_named_by_its_class(drive: Drive) -> None:
    with pytest.raises(InputError, match="aiding source Nameless has no `name`"):
        navigated(drive, Nameless())
