"""Every mechanization takes every option of `navigate`, or refuses it by its name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from array_twins import mems

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import GnssRecording, ImuArray
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.barometer import Barometer
from schuler.navigation.aiding.gnss import CorrelatedGnss
from schuler.navigation.aiding.heading import Heading
from schuler.navigation.aiding.magnetometer import Magnetometer, earth_field
from schuler.navigation.aiding.options import GnssWeighting, MeasurementOptions
from schuler.navigation.mechanizations.navigate_array import (
    MECHANIZATIONS,
    ArrayNavigation,
    navigate_array,
)
from schuler.rotations import euler_from_dcm
from schuler.simulation import Profile, car_urban, simulate_array, simulate_gnss

MOUNTING = tetrahedron_mounting(0.05)
FIELD = earth_field(0.0, np.radians(60.0), 48e-6)


@cache
def drive() -> tuple[Profile, ImuArray, GnssRecording]:
    profile = car_urban(80.0, 5, standstill=15.0)
    rng = np.random.default_rng(4)
    parts = simulate_array(profile, MOUNTING.rotation, MOUNTING.position, mems(0.3), 50.0, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.5, velocity_sd=0.05, rng=rng)
    return profile, ImuArray.from_recordings(parts, MOUNTING), gnss


def navigated(name: str, array: ImuArray | None = None, **told: Any) -> ArrayNavigation:
    _, whole, gnss = drive()
    told = {"time_offset": 0.0, "mounting": np.eye(3)} | told
    return navigate_array(array or whole, gnss, mems(0.3), mechanization=name, **told)  # type: ignore[arg-type]


@cache
def plain(name: str) -> ArrayNavigation:
    return navigated(name)


@dataclass(frozen=True)
class Height:
    """A sensor of one's own: it says how high it is."""

    time: np.ndarray
    height: np.ndarray
    name: str = "height by laser"

    def linearise(self, k: int, state: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        design = np.zeros((1, 9 + state.own.size))
        design[0, 2] = 1.0
        return np.array([self.height[k] - state.position[2]]), design, np.array([0.01])


def sources(kind: str) -> MeasurementOptions:
    profile, _, _ = drive()
    time = np.arange(2.0, 78.0)
    path = profile.trajectory(time)
    made = {
        "heading": lambda: Heading(time, euler_from_dcm(path.rotation)[2], 0.01),
        "barometer": lambda: Barometer(time, path.position[:, 2] + 7.0, 0.2),
        "magnetometer": lambda: Magnetometer(
            time, np.einsum("kji,j->ki", path.rotation, FIELD), FIELD, 5e-7, 0.0
        ),
        "own": lambda: Height(time, path.position[:, 2]),
    }
    return MeasurementOptions(sources=(made[kind](),))


def kinds(result: ArrayNavigation) -> set[str]:
    return set(result.solution.innovations.kind)


def states(result: ArrayNavigation) -> str:
    return " ".join(result.solution.sensor_error_names)


Promise = Callable[[ArrayNavigation, ArrayNavigation], bool]

OPTIONS: dict[str, tuple[dict[str, Any], Promise, str]] = {
    "nhc": (
        {"aiding": ["nhc"]},
        lambda a, b: any("vehicle" in k for k in kinds(a) - kinds(b)),
        "--aid",
    ),
    "zupt": ({"aiding": ["zupt"]}, lambda a, b: len(kinds(a) - kinds(b)) == 2, "--aid"),
    "wheel": (
        {"aiding": ["nhc", "wheel"]},
        lambda a, b: "wheel_speeds" in str(a.solution.settings),
        "--aid",
    ),
    "smooth": (
        {"smooth": True},
        lambda a, b: a.solution.smoothed and better(a, b),
        "--smooth",
    ),
    "lag": (
        {"smooth": "fixed-lag", "lag": 3.0},
        lambda a, b: a.solution.settings["lag_s"] == 3.0 and better(a, b),
        "--lag",
    ),
    "huber": (
        {"measurements": MeasurementOptions(GnssWeighting("huber"))},
        lambda a, b: a.solution.settings["gnss_update"] == "huber" and moved(a, b),
        "--update",
    ),
    "student-t": (
        {"measurements": MeasurementOptions(GnssWeighting("student-t"))},
        lambda a, b: moved(a, b),
        "--update",
    ),
    "adaptive": (
        {"measurements": MeasurementOptions(GnssWeighting("gate", True))},
        lambda a, b: moved(a, b),
        "--adaptive",
    ),
    "correlated": (
        {"measurements": MeasurementOptions(correlated=CorrelatedGnss(0.3, 30.0))},
        lambda a, b: "GNSS" in states(a) and moved(a, b),
        "--gnss-correlated",
    ),
    "outages": (
        {"outages": [(40.0, 10.0)]},
        lambda a, b: widest(a, 41.0, 51.0) > 1.5 * widest(b, 41.0, 51.0),
        "",
    ),
} | {
    kind: (
        {"measurements": sources(kind)},
        lambda a, b: len(kinds(a) - kinds(b)) == 1 and moved(a, b),
        "--heading-file" if kind == "own" else f"--{kind}",
    )
    for kind in ("heading", "barometer", "magnetometer", "own")
}


def moved(a: ArrayNavigation, b: ArrayNavigation) -> bool:
    return not np.allclose(
        a.solution.trajectory.velocity, b.solution.trajectory.velocity, rtol=0.0, atol=1e-9
    )


def better(a: ArrayNavigation, b: ArrayNavigation) -> bool:
    ratio = np.median(a.solution.velocity_sd) / np.median(b.solution.velocity_sd)
    # at system level the average of covariances stands for that of the average
    return moved(a, b) and bool(ratio < 1.0)


def widest(result: ArrayNavigation, start: float, stop: float) -> float:
    time = result.solution.trajectory.time
    return float(result.solution.position_sd[(time > start) & (time < stop)].max())


@pytest.mark.parametrize("option", OPTIONS)
@pytest.mark.parametrize("name", MECHANIZATIONS)
def test_an_option_is_taken_or_refused_by_name(name: str, option: str) -> None:
    told, promise, called = OPTIONS[option]
    if name == "constrained" and called:
        with pytest.raises(InputError, match=called) as refused:
            navigated(name, **told)
        assert "--mechanization extended" in str(refused.value)
        assert "constrained" in str(refused.value)
        return
    assert promise(navigated(name, **told), plain(name))


@pytest.mark.parametrize("seconds", [0.5, 12.0])
@pytest.mark.parametrize("name", MECHANIZATIONS)
def test_gaps_and_restarts_are_taken_or_refused(name: str, seconds: float) -> None:
    profile, array, _ = drive()
    keep = (array.time < 45.0) | (array.time > 45.0 + seconds)
    cut = replace(array, time=array.time[keep], gyro=array.gyro[keep], accel=array.accel[keep])
    if name == "constrained":
        with pytest.raises(NavigationError, match="constrained mechanization"):
            navigated(name, cut)
        return
    result = navigated(name, cut)
    path = result.solution.trajectory
    late = path.time > 70.0
    away = (path.velocity - profile.trajectory(path.time).velocity)[late]
    assert np.abs(away).max() < 0.3
    assert any(f["kind"] == "gap" for f in result.solution.settings["findings"])
