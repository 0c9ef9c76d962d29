"""Noise that was told and that the drive contradicts: a shaken IMU is not claimed too well."""

from __future__ import annotations

import numpy as np
import pytest

import schuler
from schuler.data import Innovations
from schuler.navigation.engine import SampleOutputs
from schuler.navigation.run_findings import causes
from schuler.simulation import RTK_FIXED

NOISE = schuler.NoiseModel.isotropic(schuler.WhiteNoise(5e-5), schuler.WhiteNoise(7e-4))


@pytest.mark.parametrize("vibration", [0.0, 3.0])
def test_noise_is_tuned_by_itself_where_rotors_shake_the_imu(vibration: float) -> None:
    scenario = schuler.Scenario("drone", NOISE, RTK_FIXED, duration=110.0, vibration=vibration)
    drive = schuler.simulate_drive(scenario, 907)
    solution = schuler.navigate(drive.imus[0], drive.gnss, NOISE, time_offset=0.0)
    found = {f["kind"]: f for f in solution.settings["findings"]}
    assert ("noise" in found) == (vibration > 0.0)
    assert "claims" not in found
    if vibration:
        # without it normalised squares of the innovations are 15
        assert found["noise"]["value"] > 10.0
        assert solution.innovations.gnss.mean_nis < 1.3


def test_what_a_filter_corrects_at_a_fix_is_no_print_of_an_antenna() -> None:
    rng = np.random.default_rng(3)
    fixes, each = 200, 10
    value = 0.03 * rng.standard_normal((fixes, 3))
    # tilt is corrected by the innovations, and nothing turns between them
    tilt = np.repeat(0.1 * np.cumsum(value, axis=0), each, axis=0)
    time = np.arange(fixes * each) / each
    rotation = np.tile(np.eye(3), (time.size, 1, 1))
    rotation[:, 0, 2], rotation[:, 2, 0] = tilt[:, 0], -tilt[:, 0]
    rotation[:, 1, 2], rotation[:, 2, 1] = tilt[:, 1], -tilt[:, 1]
    samples = SampleOutputs.empty(time.size)
    samples.rotation[:] = rotation
    updates = Innovations(
        time[::each], ("GNSS position",) * fixes, value, np.full((fixes, 3), 0.03),
        np.sum((value / 0.03) ** 2, axis=1), np.full(fixes, 3), np.ones(fixes, dtype=bool),
    )  # fmt: skip
    assert causes(updates, time, samples) == ()
