"""The position columns of S003, tables 1 and 2, and what they should have been (spec 8.3)."""

from __future__ import annotations

import math

import pytest

from schuler.errors import InputError
from schuler.evaluation.position_error import (
    position_error_of_accel_bias,
    position_error_of_gyro_bias,
    position_sd_of_white_acceleration,
    schuler_factor,
)

HOUR = 3600.0
ACCEL = [(5e-9, 458), (3e-11, 35), (1e-11, 20), (5e-9, 458), (2e-12, 9), (3e-14, 1), (2e-16, 0.09)]
GYRO = [(7e-6, 978), (5e-6, 826), (1e-6, 369), (2e-6, 523), (2e-7, 165), (4e-10, 7), (3e-11, 2)]


@pytest.mark.parametrize(("mean_square", "printed"), ACCEL)
def test_position_column_of_table_1(mean_square: float, printed: float) -> None:
    unit = 0.01 if printed < 1 else 1.0
    metres = position_error_of_accel_bias(math.sqrt(mean_square), HOUR)
    assert abs(metres - printed) < 0.51 * unit


@pytest.mark.parametrize(("mean_square", "printed"), GYRO)
def test_position_column_of_table_2(mean_square: float, printed: float) -> None:
    rate = math.radians(math.sqrt(mean_square)) / 3600.0  # printed in (deg/h)²
    # the paper cut digits off instead of rounding (827.0 and 369.9 m)
    assert abs(position_error_of_gyro_bias(rate, HOUR) - printed) < 1.05


def test_the_earth_is_round_and_prediction_errors_are_white() -> None:
    assert schuler_factor("accel", HOUR) == pytest.approx(0.1246, abs=5e-4)
    assert schuler_factor("gyro", HOUR) == pytest.approx(0.366, abs=1e-3)
    assert schuler_factor("gyro", 0.0) == 1.0
    # Schuler's period is 84.4 min: an accelerometer error is then forgotten
    assert schuler_factor("accel", 84.43 * 60.0) == pytest.approx(0.0, abs=1e-4)
    # 458 m of table 1 are the law of a constant; white at 200 Hz it is 0.62 m
    sd = position_sd_of_white_acceleration(math.sqrt(5e-9), 1.0 / 200.0, HOUR)
    assert sd == pytest.approx(0.62, abs=0.005)
    with pytest.raises(InputError, match="not negative"):
        position_error_of_accel_bias(1.0, -1.0)
