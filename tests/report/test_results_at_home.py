"""Results in a notebook and in other tools, one mechanism for all of them."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import schuler
from schuler import (
    GnssRecording,
    ImuRecording,
    InputError,
    NavigationSolution,
    NoiseModel,
    Trajectory,
    WhiteNoise,
)
from schuler.data.exportable import Exportable
from schuler.data.trajectory import Innovations

N = 2000


def imu() -> ImuRecording:
    rng = np.random.default_rng(3)
    still = rng.normal((0.0, 0.0, -9.81), 1e-2, (N, 3))
    return ImuRecording(np.arange(N) / 100.0, rng.normal(0.0, 1e-3, (N, 3)), still)


def solution() -> NavigationSolution:
    place = np.tile((np.radians(48.1), np.radians(11.5), 520.0), (N, 1))
    track = Trajectory(np.arange(N) / 100.0, place, np.ones((N, 3)), np.tile(np.eye(3), (N, 1, 1)))
    two = np.ones((2, 3))
    seen = Innovations(
        np.arange(2.0), ("GNSS position",) * 2, two, two, two[:, 0], np.array([3, 3]),
        np.array([True, True]),
    )  # fmt: skip
    return NavigationSolution(
        track, np.tile(4.0 * np.eye(3), (N, 1, 1)), np.ones((N, 3)), np.ones((N, 3)),
        np.arange(2.0), two, two, ("a", "b", "c"), seen,
    )  # fmt: skip


def gnss() -> GnssRecording:
    place = np.tile((np.radians(48.1), np.radians(11.5), 520.0), (50, 1))
    return GnssRecording(np.arange(50.0), place, np.ones((50, 3)))


def family() -> list[Any]:
    signal = imu().gyro[:, 0]
    model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    return [
        imu(), gnss(), solution(), solution().trajectory, solution().innovations, model,
        schuler.allan_deviation(signal, 100.0),
        schuler.power_spectral_density(signal, 100.0, onesided=True),
        schuler.identify(signal, 100.0), schuler.screen(imu()),
        schuler.tetrahedron_mounting(0.1), schuler.ImuArray.from_recordings([imu(), imu()]),
    ]  # fmt: skip


def test_every_result_shows_itself_and_goes_over_into_other_tools(tmp_path: Path) -> None:
    import polars

    for result in family():
        name = type(result).__name__
        assert len(repr(result)) < 1200, name
        assert repr(result).startswith(f"{name}("), name
        page = result._repr_html_()
        assert 100 < len(page) < 40_000, name
        assert not re.search(r"<script|\bnan\b.*polyline", page), name
        columns = result.to_columns()
        assert columns, name
        assert len({c.size for c in columns.values()}) == 1, name
        result.to_parquet(tmp_path / "table.parquet")
        back = polars.read_parquet(tmp_path / "table.parquet")
        assert back.equals(result.to_polars(), null_equal=True), name
        assert len(result.to_pandas()) == back.height, name
        assert isinstance(result.to_dict(), dict), name


def test_public_results_are_of_the_family() -> None:
    settings = {
        "ErrorModel",
        "CorrelatedGnss",
        "GnssErrorModel",
        "GnssWeighting",
    }  # what goes in, not what comes out
    for name in schuler.__all__:
        one = getattr(schuler, name)
        if inspect.isclass(one) and "to_dict" in dir(one) and name not in settings:
            assert issubclass(one, Exportable), name


def test_a_solution_by_time_has_the_columns_of_its_file() -> None:
    frame = solution().to_pandas()
    assert frame.index.name == "time_s"
    assert frame["latitude_deg"].iloc[0] == pytest.approx(48.1)
    assert frame["pos_std_down_m"].iloc[0] == 2.0
    assert list(solution().innovations.to_columns()) == [
        "time", "kind", "value_north", "value_east", "value_down", "sd_north", "sd_east",
        "sd_down", "nis", "degrees", "accepted",
    ]  # fmt: skip


def test_recordings_come_back_from_every_table() -> None:
    whole = imu()
    xarray = pytest.importorskip("xarray")
    tables = [whole.to_pandas(), whole.to_polars(), whole.to_polars().lazy(), whole.to_columns()]
    tables += [whole.to_xarray(), {"time": whole.time, "gyro_rad_s": whole.gyro, "accel_m_s2": whole.accel}]  # noqa: E501  # fmt: skip
    assert isinstance(tables[4], xarray.Dataset)
    for table in tables:
        back = schuler.read_imu(table)
        np.testing.assert_allclose(back.time, whole.time, atol=1e-12)
        np.testing.assert_array_equal(back.gyro, whole.gyro)
        np.testing.assert_array_equal(back.accel, whole.accel)
    fixes = schuler.read_gnss(gnss().to_pandas())
    np.testing.assert_allclose(fixes.position, gnss().position, atol=1e-15)


def test_dates_of_a_frame_are_seconds_and_units_can_be_told() -> None:
    import pandas

    frame = imu().to_pandas().reset_index(drop=True)
    frame.index = pandas.date_range("2026-11-30", periods=N, freq="10ms", tz="Europe/Berlin")
    frame.columns = ["gx", "gy", "gz", "ax", "ay", "az"]
    back = schuler.read_imu(frame, gyro_unit="rad/s", accel_unit="m/s^2")
    assert back.rate == pytest.approx(100.0)
    assert back.time[0] == pytest.approx(1795993200.0)
    np.testing.assert_array_equal(back.accel, imu().accel)


def test_what_is_no_table_and_columns_of_two_lengths_are_refused() -> None:
    with pytest.raises(InputError, match="a float is no recording; expected the name of a file"):
        schuler.read_imu(3.0)
    with pytest.raises(InputError, match=r"dict: the arrays differ in length \(time_s 3, gx 2\)"):
        schuler.read_imu({"time_s": np.arange(3.0), "gx": np.zeros(2)})


def test_plots_by_both_libraries_hold_the_numbers() -> None:
    signal = imu().gyro[:, 0]
    curve = schuler.allan_deviation(signal, 100.0)
    by_plotly = curve.plot()
    drawn = by_plotly.data[0]
    np.testing.assert_allclose(drawn.x, curve.tau, rtol=1e-6)
    np.testing.assert_allclose(drawn.y, curve.deviation, rtol=1e-6)
    pytest.importorskip("matplotlib")
    by_matplotlib = curve.plot(backend="matplotlib")
    line = by_matplotlib.axes[0].lines[0]
    np.testing.assert_allclose(line.get_xdata(), curve.tau, rtol=1e-6)
    assert by_matplotlib.axes[0].get_xscale() == "log"


def test_a_plot_is_chosen_by_its_title_and_an_unknown_one_names_those_there_are() -> None:
    track = solution().plot("track")
    assert [a.text for a in track.layout.annotations] == ["Track in local coordinates"]
    assert len(solution().plot("Height").layout.annotations) == 5
    with pytest.raises(InputError, match="no figure 'heigth'; expected part of one of: Track"):
        solution().plot("heigth")
    with pytest.raises(InputError, match="expected 'plotly' or 'matplotlib'"):
        solution().plot(backend="bokeh")  # type: ignore[arg-type]


def test_a_package_that_is_not_there_is_named_with_the_line_that_installs_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r"pip install 'schuler\[frames\]'"):
        imu().to_xarray()


def test_a_fit_is_a_table_of_its_parameters() -> None:
    signal = WhiteNoise(1e-3).simulate(60_000, 0.01, np.random.default_rng(1))
    found = schuler.identify(signal, 100.0)
    row = found.to_pandas().iloc[0]
    key = "white_noise.density"
    assert (row["parameter"], row["value"]) == (key, found.parameters[key])
    assert row["standard_error"] == found.standard_errors[key]
    assert row["lower"] < row["value"] < row["upper"]
    model = NoiseModel({"gyro_x": found.process}, {"gyro_x": found.standard_errors})
    assert model.to_pandas().iloc[0].to_dict() == {
        "channel": "gyro_x", "parameter": key, "value": row["value"],
        "standard_error": row["standard_error"],
    }  # fmt: skip
    assert len(found.plot().data) == 4  # the curve it was fitted to
