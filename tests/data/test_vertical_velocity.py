"""A vertical velocity that nobody measured, or that points up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars
import pytest

from schuler.data.vertical_velocity import trouble_of_vertical_velocity
from schuler.errors import InputError
from schuler.io import read_gnss
from schuler.types import FloatArray


def hills(seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, height and velocity of a ride over hills of 4 m, with errors of height of 2 m."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 900.0, 0.2)
    slow = np.repeat(rng.standard_normal(30), 150)
    height = 4.0 * np.sin(time / 13.0) + rng.standard_normal(time.size) + 1.5 * slow
    down = -4.0 / 13.0 * np.cos(time / 13.0) + 0.1 * rng.standard_normal(time.size)
    return time, height, np.column_stack([np.full(time.size, 9.0), 0.0 * time, down])


@pytest.mark.parametrize("seed", range(5))
def test_the_sign_shows_over_longer_times_where_heights_are_poor(seed: int) -> None:
    time, height, velocity = hills(seed)
    assert trouble_of_vertical_velocity(time, height, velocity) is None
    assert trouble_of_vertical_velocity(time, height, velocity * [1, 1, -1]) == "points up"
    assert trouble_of_vertical_velocity(time, height, velocity * [1, 1, 0]) == "not measured"
    assert trouble_of_vertical_velocity(time, height, velocity * 0.0) is None  # it stands
    flat = np.random.default_rng(seed).standard_normal(time.size)
    assert trouble_of_vertical_velocity(time, flat, velocity * [1, 1, 0.1]) is None


def test_a_file_with_zeros_for_what_was_not_measured_is_told(tmp_path: Path) -> None:
    time, height, velocity = hills(1)
    columns = {"time_s": time, "lat_deg": 48.0 + time * 8.1e-5, "lon_deg": 0.0 * time + 11.0}
    columns |= {"height_m": height, "vel_north_m_s": velocity[:, 0], "vel_east_m_s": velocity[:, 1]}
    down = {"vel_down_m_s": velocity[:, 2]}
    zero = tmp_path / "zero.parquet"
    polars.DataFrame(columns | {"vel_down_m_s": 0.0 * time}).write_parquet(zero)
    read = read_gnss(zero)
    assert any("taken as not measured" in line for line in read.assumptions)
    assert read.velocity_sd is not None
    assert np.isinf(read.velocity_sd[:, 2]).all()
    up = tmp_path / "up.parquet"
    polars.DataFrame(columns | {"vel_down_m_s": -down["vel_down_m_s"]}).write_parquet(up)
    with pytest.raises(InputError, match="points up"):
        read_gnss(up)
