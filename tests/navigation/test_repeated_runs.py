"""A filter that starts again says what a new one would."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from array_twins import draw_array, mems

from schuler.arrays.geometry import orthogonal_mounting
from schuler.navigation.engine import gate_thresholds, run_engine
from schuler.navigation.innovation_likelihood import InnovationSequence
from schuler.navigation.preparation.headings import RepeatedRuns, decimated_inputs
from schuler.navigation.preparation.moving_start import inflated_model
from schuler.rotations import dcm_from_euler
from schuler.simulation import motorcycle


def test_a_second_start_knows_nothing_of_the_first() -> None:
    twin = draw_array(motorcycle(60.0, 3, standstill=10.0), orthogonal_mounting(1), [mems()], 7)
    setup, imu = twin.prepared.setup, twin.prepared.recording
    model = inflated_model()
    slow, schedule = decimated_inputs(imu, twin.gnss, np.zeros(3), 0.0, None)
    begin = setup.initial_state(imu, twin.gnss)
    covariance = np.zeros((9 + model.size, 9 + model.size))
    covariance[:9, :9] = begin.covariance[:9, :9]
    covariance[9:, 9:] = model.initial_covariance
    begin = replace(begin, sensor_state=np.zeros(model.size), covariance=covariance)
    runs = RepeatedRuns(slow, model, schedule)
    for yaw in (2.0, 0.3, 0.0):
        start = replace(begin, rotation=dcm_from_euler(0.0, 0.0, yaw) @ begin.rotation)
        anew = run_engine(
            slow, start, model, schedule, gate=gate_thresholds(0.0), keep_nodes=False,
            node_interval=1e9,
        )  # fmt: skip
        once, again = InnovationSequence.of_run(anew), runs.innovations(start)
        assert once.value.size > 100
        np.testing.assert_array_equal(again.value, once.value)
        np.testing.assert_array_equal(again.variance, once.variance)
