"""What GNSS and parity see of the state: ranks of S002 (13) and spec 7.5, words for the rest.

The filter itself is the judge: a direction that the analysis calls unseen keeps the prior's
standard deviation in the filter, one that it calls seen does not.
"""

from __future__ import annotations

import numpy as np
import pytest
from array_twins import draw_array, mems, one_state

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.errors import InputError
from schuler.navigation.aiding.parity import parity_rows
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_model import (
    extended_model,
    fusion_of,
    without_idle_states,
)
from schuler.navigation.observability import (
    Observability,
    Segment,
    gramian,
    observability,
    system_matrix,
)
from schuler.navigation.observability_run import most_different, observe_array, segments_of
from schuler.rotations import dcm_from_euler
from schuler.simulation import motorcycle, static

G = 9.81
TURNING = (
    Segment(np.array([0.0, 0.0, -G]), dcm_from_euler(0.0, 0.0, 0.3)),
    Segment(np.array([3.0, 1.0, -G]), dcm_from_euler(0.5, 0.1, 1.0)),
    Segment(np.array([-1.0, 4.0, 1.0 - G]), dcm_from_euler(-0.4, 0.2, 2.5)),
)
CONSTANT = (TURNING[0],) * 3
MOUNTING = tetrahedron_mounting()


def models(times: list[tuple[float, float]]) -> list[SensorErrorModel]:
    return [
        without_idle_states(
            sensor_error_model(one_state(times=t), turn_on_accel=0.0, turn_on_gyro=0.0)
        )
        for t in times
    ]


EQUAL = models([(60.0, 120.0)] * 4)
FUSION = fusion_of(MOUNTING, EQUAL)
EXTENDED = extended_model(EQUAL, FUSION, list("abcd"))


def with_parity(segments: tuple[Segment, ...]) -> Observability:
    rows = np.vstack(parity_rows(EQUAL, FUSION, 24))
    return observability(EXTENDED, segments, rows=np.hstack([np.zeros((18, 9)), rows]))


def test_ranks_over_three_segments() -> None:
    assert observability(EQUAL[0], TURNING).rank == 15
    extended = observability(EXTENDED, TURNING)
    assert len(extended.names) == 33
    # S002 found 15 of 33 as well: 33 - 24 + 6
    assert extended.rank == extended.practical_rank == 15
    parity = with_parity(TURNING)
    assert parity.rank == parity.practical_rank == 33
    assert "Nothing is hidden." in parity.sentences()


def test_time_constants_of_their_own_make_sensors_visible_in_theory_only() -> None:
    times = [(40.0 + 20.0 * i, 50.0 + 30.0 * i) for i in range(4)]
    distinct = models(times)
    found = observability(extended_model(distinct, FUSION, list("abcd")), TURNING)
    assert found.rank == 33
    assert found.practical_rank < 26
    # spec 7.5 has 5e-10 with twelve time constants
    assert 1e-10 < found.relative[-1] < 1e-8


def test_without_changes_of_force_heading_and_one_gyro_bias_stay_hidden() -> None:
    single = observability(EQUAL[0], CONSTANT)
    assert single.rank == 13
    assert "Heading is not seen at all." in single.sentences()
    assert "Gyro_z Gauss-Markov is not seen at all." in single.sentences()
    assert observability(EXTENDED, CONSTANT).rank == 13
    assert with_parity(CONSTANT).rank == 31
    assert "a gyro bias along" in with_parity(CONSTANT).sentences()[-1]
    # the turn of the earth shows the north
    earth = np.array([5.2e-5, 0.0, -5.2e-5])
    turning = tuple(Segment(s.force, s.rotation, 600.0, earth) for s in CONSTANT)
    assert observability(EQUAL[0], turning).rank > 13


def test_what_cancels_between_sensors_is_called_so() -> None:
    told = " ".join(observability(EXTENDED, TURNING).sentences())
    assert "9 combinations of the 12 accelerometer states cancel" in told
    assert "9 combinations of the 12 gyro states cancel" in told


def test_the_system_matrix_is_that_of_the_filter() -> None:
    # one step of the filter's covariance kernel against expm(F dt), by its own rows
    from scipy.linalg import expm

    from schuler.kernels.navigation.covariance import navigation_rows

    segment = Segment(np.array([1.0, -2.0, -9.0]), dcm_from_euler(0.2, -0.3, 1.0), 0.01,
                      np.array([3e-5, 1e-5, -4e-5]))  # fmt: skip
    f = system_matrix(EQUAL[0], segment)
    rows, errors, result = np.zeros(9 * 264), np.zeros(6 * 264), np.zeros(9 * 264)
    for i in range(9):
        rows[i * 264 + i] = 1.0
    for c in range(6):
        errors[c * 264 + 9 + c] = 1.0
    earth = np.concatenate([segment.force, segment.frame_rate, np.zeros(4)])
    navigation_rows(rows, errors, result, 15, 0.01, segment.rotation, earth, np.zeros(3))
    step = result.reshape(9, 264)[:, :15]
    np.testing.assert_allclose(step, expm(f * 0.01)[:9], atol=2e-5)


def test_information_equals_a_least_squares_of_all_fixes() -> None:
    model = EQUAL[0]
    prior = np.diag([4.0] * 3 + [1.0] * 3 + [0.01] * 3 + [4e-4] * 3 + [4e-6] * 3)
    found = gramian(model, TURNING, prior, position_sd=0.5)
    from scipy.linalg import expm

    passed, rows = np.eye(15), []
    for segment in TURNING:
        for _ in range(10):
            passed = expm(system_matrix(model, segment)) @ passed
            rows.append(passed[:3] / 0.5)
    singular = np.linalg.svd(np.vstack(rows) @ np.sqrt(prior), compute_uv=False)
    np.testing.assert_allclose(found.information[:9], singular[:9] ** 2, rtol=1e-6)
    assert found.learnt == np.sum(singular > 1.0)


@pytest.mark.parametrize("moving", [True, False])
def test_the_filter_agrees_with_the_analysis(moving: bool) -> None:
    profile = motorcycle(100.0, 3, standstill=20.0) if moving else static(60.0, yaw=0.4)
    twin = draw_array(profile, MOUNTING, [mems()] * 4, 1)
    _, extended, parity = observe_array(twin.prepared, twin.gnss)
    # 48 sensor states, of which pi sees 12; the turn of the earth shows the north in theory
    assert extended.matrix.rank == 57 - 36
    assert parity.matrix.rank == 57
    if moving:
        assert extended.decay[-1, 8] < 0.6
    else:
        # but not to these gyros within a minute: the filter keeps its prior of the heading
        assert extended.decay[-1, 8] > 0.99
    # differences of constants between sensors: by parity only
    walks = [j for j, name in enumerate(extended.matrix.names) if "random walk" in name]
    assert np.all(extended.decay[-1, walks] > 0.8)
    assert np.all(parity.decay[-1, walks] < 0.75)
    assert len(parity.sentences()) >= 3


def test_segments_carry_force_and_attitude_of_the_motion() -> None:
    profile = motorcycle(100.0, 3, standstill=20.0)
    time = np.arange(0.0, 100.0, 0.02)
    segments = segments_of(profile.trajectory(time))
    np.testing.assert_allclose(segments[1].force, [0.0, 0.0, -9.806], atol=0.01)
    assert len(segments) == 19
    chosen = most_different(segments, 4)
    assert len(chosen) == 4
    assert observability(EQUAL[0], chosen).rank == 15
    with pytest.raises(InputError, match="at least 5 s"):
        segments_of(profile.trajectory(time[:100]))
    with pytest.raises(InputError, match="no segment"):
        observability(EQUAL[0], ())
