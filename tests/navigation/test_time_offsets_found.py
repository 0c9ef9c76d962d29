"""Time offsets of position and velocity are found from wherever a search for them begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import schuler
from schuler.navigation.preparation.setup import TimeOffsets
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.tune import OFFSET_UNIT, Sought, tune
from schuler.simulation import car_urban, ideal_imu, simulate_imu
from schuler.simulation.receivers import RTK_FIXED, simulate_receiver

NOISE = schuler.NoiseModel(
    {
        f"{sensor}_{axis}": schuler.WhiteNoise(white)
        for sensor, white in (("gyro", 1e-4), ("accel", 1.5e-3))
        for axis in "xyz"
    },
    rate=20.0,
)


def test_offsets_are_found_where_position_and_velocity_begin_at_one_time() -> None:
    # innovations at one time depend on which comes first: a step that turns their order must not
    # be taken for a slope; and a fix that an offset pushes over the end must not count
    rng = np.random.default_rng(31010)
    profile = car_urban(120.0, 31010, standstill=10.0)
    imu = simulate_imu(ideal_imu(profile, 20.0), NOISE, rng)
    gnss = simulate_receiver(profile, RTK_FIXED, 1.0, rng=rng)
    imu, setup = schuler.prepare(imu, gnss, NOISE, time_offset=0.0)
    for begin, steps in (((0.005, 0.005), 0), ((0.005, 0.005), 40), ((-0.005, 0.005), 40)):
        moved = replace(setup, offsets=TimeOffsets(*begin))
        found = tune(imu, gnss, moved, Sought(None, True, longest=steps))
        sd = np.array([found.standard_errors[f"offset {n}"] for n in ("position", "velocity")])
        assert np.all((sd > 1e-4) & (sd < OFFSET_UNIT))
        if steps:
            offsets = np.array([found.setup.offsets.position, found.setup.offsets.velocity])
            assert found.converged
            assert np.all(np.abs(offsets) < 4.0 * sd)

    late = replace(gnss, time=gnss.time + 0.1)

    def keys(position: float, velocity: float) -> np.ndarray:
        moved = replace(setup, offsets=TimeOffsets(position, velocity))
        return innovations(imu, [late], moved).key

    np.testing.assert_array_equal(keys(0.3, -0.3), keys(-0.3, 0.3))
