"""The drive linearised about one run tells what the filter would find by other parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from twins import draw_twin, perfect

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.innovation_likelihood import RUN, InnovationSequence, thin
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.gnss_errors import SLOW, TIME, WHITE
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.linear_drive import DriveLikelihood, LinearDrive, linearisable
from schuler.navigation.tuning.tune import ARM, setup_at
from schuler.navigation.tuning.vibration import vibration_level
from schuler.simulation import car_urban

MOVED: dict[str, Mapping[str, float]] = {
    "nothing": {},
    "white noise": {"white accel": 1.0, "white gyro": -1.0},
    "one axis": {"white 1": 2.0, "white 5": 2.0},
    "biases that walk": {"drive accel": 2.0, "drive gyro": 2.0},
    "vibration": {"vibration accel": 2.0, "vibration gyro": 2.0},
    "the receiver": {"sd velocity": 0.7},
    "what lasts of its errors": {WHITE: 0.5, SLOW: 1.0, TIME: -1.0},
    "when it measures": {"offset position": 1.0, "offset velocity": 1.0},
    "where the antenna is": dict(zip(ARM, (0.3, -0.2, 0.1), strict=True)),
}


@pytest.fixture(scope="module")
def drive() -> tuple[ImuRecording, list[GnssRecording], RunSetup]:
    profile = car_urban(150.0, 8, standstill=10.0)
    twin = draw_twin(profile, perfect(profile, 20.0), 4)
    model, split = GnssErrorModel().placed(twin.setup.model)
    measurements = replace(twin.setup.measurements, correlated=split)
    setup = replace(twin.setup, model=model, measurements=measurements)
    return twin.imu, [twin.gnss, thin(twin.gnss, 5.0)], setup


def distance(a: InnovationSequence, b: InnovationSequence) -> tuple[float, float]:
    """Of innovations in standard deviations, and of logarithms of variances."""
    np.testing.assert_array_equal(a.key, b.key)
    away = (a.value - b.value) / np.sqrt(b.variance)
    return float(np.sqrt(np.mean(away**2))), float(np.std(np.log(a.variance / b.variance)))


@pytest.mark.parametrize("name", MOVED)
def test_other_parameters_need_no_other_run(
    drive: tuple[ImuRecording, list[GnssRecording], RunSetup], name: str
) -> None:
    imu, gnss, setup = drive
    level = vibration_level(imu)
    linear = LinearDrive.about(imu, gnss, setup, level)
    there = setup_at({WHITE: np.log(0.36)} | dict(MOVED[name]), setup)
    truth = innovations(imu, gnss, there, level)
    found = linear.innovations(there)
    all_of_it, thinned = truth.key < RUN, truth.key >= RUN
    # an offset moves the ends of steps, and their noise does not follow
    limit = 0.03 if name == "when it measures" else 0.008
    assert max(distance(found.select(all_of_it), truth.select(all_of_it))) < limit
    # GNSS thinned leaves a filter farther from the run than what is linear
    assert max(distance(found.select(thinned), truth.select(thinned))) < 0.04
    if name != "nothing":
        assert max(distance(linear.innovations(setup), truth)) > 0.03


def test_a_search_ends_where_that_of_the_filter_ends(
    drive: tuple[ImuRecording, list[GnssRecording], RunSetup],
) -> None:
    imu, gnss, setup = drive
    names = ("white accel", "white gyro", "sd velocity", "offset position", "offset velocity")

    def at(x: np.ndarray) -> RunSetup:
        return setup_at(dict(zip(names, x, strict=True)), setup)

    offsets = np.array([n.startswith("offset") for n in names])
    likelihood = DriveLikelihood(imu, gnss, at, offsets)
    # far off: noise that is a third, offsets by 30 ms
    begin = np.array([-1.0, -1.0, -1.0, 3.0, 3.0])
    found = likelihood.maximise(begin, np.full(5, 0.1), np.full(5, -8.0))
    assert found.converged
    assert found.log_likelihood == pytest.approx(
        likelihood.filtered(found.x).log_likelihood - 0.05 * float(found.x @ found.x)
    )
    np.testing.assert_array_less(np.abs(found.x), 3.5 * found.sd + 0.3)


def test_states_in_pairs_are_left_to_the_filter(
    drive: tuple[ImuRecording, list[GnssRecording], RunSetup],
) -> None:
    _, gnss, setup = drive
    assert linearisable(setup, gnss[0])
    partner = setup.model.partner.copy()
    partner[:2] = 1, 0
    paired = replace(setup, model=replace(setup.model, partner=partner))
    assert not linearisable(paired, gnss[0])
