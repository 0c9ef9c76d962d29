"""A receiver that wanders and does not say so: the claim of the filter covers what it does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import schuler
from schuler.data import GnssRecording
from schuler.earth import ned_from_geodetic
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.simulation import DIFFERENTIAL_CODE
from schuler.types import FloatArray

NOISE = schuler.NoiseModel.isotropic(schuler.WhiteNoise(8e-5), schuler.WhiteNoise(1e-3))
BETWEEN_HOUSES = (150.0, 230.0)


def wandering(gnss: GnssRecording, metres: float, seed: int) -> GnssRecording:
    """Positions that wander for a while over 15 s, with the same word of the receiver."""
    rng = np.random.default_rng(seed)
    there = np.flatnonzero((gnss.time > BETWEEN_HOUSES[0]) & (gnss.time < BETWEEN_HOUSES[1]))
    kept = np.exp(-float(np.median(np.diff(gnss.time))) / 15.0)
    position, now = gnss.position.copy(), rng.standard_normal(2)
    for k in there:
        position[k, 0] += metres * now[0] / 6.37e6
        position[k, 1] += metres * now[1] / 6.37e6 / np.cos(position[k, 0])
        now = kept * now + np.sqrt(1.0 - kept**2) * rng.standard_normal(2)
    return replace(gnss, position=position)


def squares(solution: schuler.NavigationSolution, drive: schuler.SimulatedDrive) -> FloatArray:
    """Normalised squares a degree of the horizontal position, once a second."""
    truth = drive.truth
    at = np.arange(60.0, solution.trajectory.time[-1], 1.0)
    mine, real = (np.searchsorted(t, at) for t in (solution.trajectory.time, truth.time))
    error = ned_from_geodetic(solution.trajectory.position[mine], truth.position[0])
    error -= ned_from_geodetic(truth.position[real], truth.position[0])
    covariance = solution.position_covariance[mine][:, :2, :2]
    return np.asarray(
        np.einsum("ni,nij,nj->n", error[:, :2], np.linalg.inv(covariance), error[:, :2]) / 2.0
    )


def test_positions_between_houses_are_believed_to_what_they_are_worth() -> None:
    scenario = schuler.Scenario("car_urban", NOISE, DIFFERENTIAL_CODE, duration=400.0)
    drive = schuler.simulate_drive(scenario, 811)
    gnss = wandering(drive.gnss, 15.0, 812)
    solution = schuler.navigate(drive.imus[0], gnss, time_offset=0.0, smooth=True)
    found = [f for f in solution.settings["findings"] if f["kind"] == "worse GNSS"]
    assert len(found) == 1
    ((begin, end),) = found[0]["intervals_s"]
    assert abs(begin - BETWEEN_HOUSES[0]) < 15.0
    assert abs(end - BETWEEN_HOUSES[1]) < 15.0
    # believed as the receiver says, they are 60
    assert squares(solution, drive).mean() < 4.0
    plain = schuler.navigate(drive.imus[0], drive.gnss, time_offset=0.0, smooth=True)
    assert not [f for f in plain.settings["findings"] if f["kind"] == "worse GNSS"]


@pytest.mark.parametrize(
    ("claimed", "bounds"),
    [
        ([0.02] * 50 + [0.6] * 30 + [0.02] * 20, [np.sqrt(0.02 * 0.6)]),
        ([0.02] * 50 + [0.6] * 5, []),  # too few
        (list(np.geomspace(0.5, 20.0, 100)), []),  # nothing between is missing
        ([0.02, 0.6] * 40, []),  # now this, now that
        ([0.02] * 30 + [0.5] * 30 + [4.0] * 30, [0.1, np.sqrt(2.0)]),
    ],
)
def test_claims_of_another_solution_have_errors_of_their_own(
    claimed: list[float], bounds: list[float]
) -> None:
    sd = np.array(claimed)
    place = np.tile((0.8, 0.2, 100.0), (sd.size, 1))
    gnss = GnssRecording(np.arange(float(sd.size)), place, np.tile(sd[:, None], 3))
    levelled = replace(GnssErrorModel(), place=6).levelled(gnss)
    assert levelled.bounds == pytest.approx(bounds)
    states = levelled.states(np.tile(sd[:, None], 3) ** 2)
    assert states[0].tolist() == [6, 7, 8]
    assert states.max() == levelled.places[-1] == 8 + 3 * len(bounds)
