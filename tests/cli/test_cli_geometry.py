"""`schuler geometry`: figures of merit side by side, own mountings, the best cone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import schuler
from schuler.arrays.geometry import tetrahedron_mounting
from schuler.cli.options.files import Written
from schuler.cli.verbs.geometry import geometry
from schuler.data.mounting import mounting_yaml
from schuler.errors import InputError


def told(
    tmp_path: Path, *shapes: str, report: Path | None = None, **options: object
) -> list[dict[str, object]]:
    out = tmp_path / f"{len([*tmp_path.iterdir()])}.json"
    geometry(shapes, written=Written(report, out), **options)  # type: ignore[arg-type]
    return list(json.loads(out.read_text())["geometries"])


def test_shapes_are_told_with_parity_and_faults(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    two, four, cone = told(tmp_path, "orthogonal:2", "tetrahedron", "cone:6", report=page)
    assert two["gdop"] == pytest.approx(np.sqrt(1.5))
    assert four["gdop"] == pytest.approx(np.sqrt(0.75))
    assert page.stat().st_size > 10_000
    for one in (two, four, cone):
        v, a = np.array(one["parity"]), np.array(one["axes"])
        np.testing.assert_allclose(v @ a, 0.0, atol=1e-12)
        np.testing.assert_allclose(v @ v.T, np.eye(v.shape[0]), atol=1e-12)
    # of two aligned axes either could be it
    assert two["fault"]["right_axis"] == pytest.approx(0.5, abs=0.01)
    assert cone["fault"]["right_axis"] > 0.85


def test_parity_is_blind_to_motion_where_sensors_are_unequal() -> None:
    shape = schuler.Geometry.named("tetrahedron")
    noise = np.linspace(1.0, 3.0, 12)
    figures = schuler.figures_of_merit(shape, noise)
    np.testing.assert_allclose(figures.parity @ shape.axes, 0.0, atol=1e-12)
    white = figures.parity @ np.diag(noise**2) @ figures.parity.T
    np.testing.assert_allclose(white, np.eye(9), atol=1e-12)
    assert figures.threshold == pytest.approx(27.877, abs=1e-3)


def test_files_and_the_best_angle(tmp_path: Path) -> None:
    place = tmp_path / "mounting.yaml"
    place.write_text(mounting_yaml(tetrahedron_mounting(0.1), ["a", "b", "c", "d"]))
    mine, best = told(tmp_path, str(place), "cone:5", optimize="gdop")
    assert mine["gdop"] == pytest.approx(np.sqrt(0.75))
    assert best["axes"][0][2] == pytest.approx(1 / np.sqrt(3), abs=1e-4)
    flat = told(tmp_path, "cone:5", half_angle=80.0)[0]
    assert flat["gdop"] > best["gdop"]


@pytest.mark.parametrize("shape", ["cone", "cone:x", "sphere:4", "orthogonal:0", "cone:2"])
def test_what_is_no_geometry_is_refused(shape: str) -> None:
    with pytest.raises(InputError):
        geometry((shape,))
