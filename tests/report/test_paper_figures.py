"""Figures of the page drawn for papers: the same numbers, fonts inside, one file for each group."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from report_examples import circle, solution

from schuler import NoiseModel, WhiteNoise, simulate_static
from schuler.cli import main
from schuler.report.blocks import FigureGrid, LegendItem
from schuler.report.drawing.palette import colour_of, palette
from schuler.report.figures import axis, band, line, marks, shaded
from schuler.report.makers import plot
from schuler.report.plots import titled_grids
from schuler.report.sections import sections_of

pytest.importorskip("matplotlib")

from schuler.report.drawing.matplotlib import (
    COLUMN,
    PAGE,
    matplotlib_figure,
    save_figure,
)


def grid(columns: int = 1) -> FigureGrid:
    x = np.array([1.0, 10.0, 100.0])
    one = plot(
        "Noise <raw> & fit",
        "words",
        (*band(x, 0.5 * x, 2.0 * x, "@data/0.25", "95 %"), line(x, x, "@model", "fit", dash="dash"),
         marks(x, 1.1 * x, "@data", "seen", symbol="diamond-open")),
        axis("time in s", log=True),
        axis("a & b", log=True, limits=(0.1, 1000.0)),
        spans=((10.0, 20.0),),
    )  # fmt: skip
    key = (LegendItem("fit", "@model", "dash"), LegendItem("95 %", "@data/0.25", "band"))
    return FigureGrid((one,) * columns, key, columns=3 if columns > 1 else 1)


def test_every_trace_is_drawn_with_its_numbers_and_its_colour() -> None:
    axes = matplotlib_figure(grid()).axes[0]
    assert (axes.get_title(loc="left"), axes.get_ylabel()) == ("Noise <raw> & fit", "a & b")
    fit, seen = axes.lines
    np.testing.assert_allclose(fit.get_ydata(), [1.0, 10.0, 100.0])
    np.testing.assert_allclose(seen.get_ydata(), [1.1, 11.0, 110.0], rtol=1e-6)
    assert (fit.get_linestyle(), seen.get_marker()) == ("--", "D")
    assert fit.get_color() == palette()["model"] == "#1d2530"
    assert axes.get_ylim() == pytest.approx((0.1, 1000.0))
    area = axes.collections[0].get_paths()[0].get_extents()
    assert (area.ymin, area.ymax) == pytest.approx((0.5, 200.0))
    stripe = axes.patches[0]
    assert (stripe.get_x(), stripe.get_width()) == (10.0, 10.0)
    assert colour_of("@data/0.25") == ("#0072b2", 0.25)
    assert shaded(((0.0, 1.0),))[0]["yref"] == "paper"  # what a stripe is known by


def test_widths_are_those_of_a_column_and_of_a_page() -> None:
    assert matplotlib_figure(grid()).get_figwidth() == pytest.approx(COLUMN)
    assert matplotlib_figure(grid(3)).get_figwidth() == pytest.approx(PAGE)
    assert pytest.approx((88.0, 180.0)) == (COLUMN * 25.4, PAGE * 25.4)


def test_fonts_are_embedded_whole_and_files_are_the_same_each_time(tmp_path: Path) -> None:
    for form in ("pdf", "svg", "png"):
        for name in ("a", "b"):
            save_figure(grid(), tmp_path / name, form)
        assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes(), form
    save_figure(grid(), tmp_path / "a", "pdf")
    raw = (tmp_path / "a").read_bytes()
    streams = [raw, *(_inflated(s) for s in re.findall(rb"stream\r?\n(.*?)endstream", raw, re.S))]
    assert any(b"/FontFile2" in s for s in streams)  # a TrueType font within the file
    assert not any(b"/Type3" in s for s in streams)


def _inflated(data: bytes) -> bytes:
    try:
        return zlib.decompress(data)
    except zlib.error:
        return b""


def test_every_figure_of_a_run_can_be_drawn(tmp_path: Path) -> None:
    run = solution(circle(2000, 10.0), np.random.default_rng(1))
    grids = titled_grids(sections_of(run))
    assert len(grids) >= 4
    for k, one in enumerate(grids):
        save_figure(one.grid, tmp_path / f"{k}.png", "png")
    assert len({(tmp_path / f"{k}.png").read_bytes() for k in range(len(grids))}) == len(grids)


def test_the_command_writes_one_file_a_group_and_never_over_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, out = solution(circle(500, 10.0), np.random.default_rng(1)), tmp_path / "figures"
    run.to_parquet(tmp_path / "run.parquet")
    run.trajectory.to_parquet(tmp_path / "truth.parquet")
    call = ["evaluate", f"{tmp_path}/run.parquet", "--truth", f"{tmp_path}/truth.parquet"]
    call += ["--figures", str(out), "--figure-format", "svg"]
    assert main(call) == 0
    (file,) = out.iterdir()
    assert file.name == "01-errors-of-run-parquet-against-the-reference.svg"
    before = file.read_bytes()
    assert main(call) == 2
    assert f"{file}: exists already; expected a new name, or --force" in capsys.readouterr().err
    assert main([*call, "--force"]) == 0
    assert file.read_bytes() == before


def test_outputs_are_written_over_only_with_force(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    imu = simulate_static(model, 20.0, 100.0, np.random.default_rng(1))
    imu.to_parquet(tmp_path / "imu.parquet")
    (tmp_path / "mine.csv").write_text("years of work", encoding="utf-8")
    call = ["convert", f"{tmp_path}/imu.parquet", f"{tmp_path}/mine.csv", "--as", "imu"]
    assert main(call) == 2
    assert "mine.csv: exists already" in capsys.readouterr().err
    assert (tmp_path / "mine.csv").read_text(encoding="utf-8") == "years of work"
    assert main([*call, "--force"]) == 0
    assert (tmp_path / "mine.csv").read_text(encoding="utf-8").startswith("time_s,")
    assert main(call) == 2  # force holds for one call


def test_a_lack_of_matplotlib_is_told_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert main(["geometry", "tetrahedron", "--figures", f"{tmp_path}/f"]) == 2
    assert "pip install 'schuler[figures]'" in capsys.readouterr().err
