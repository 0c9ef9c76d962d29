"""`schuler geometry`: what an arrangement of sensors can do, before anything is built."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.job import Job, Result
from schuler.cli.options.files import Written

if TYPE_CHECKING:
    from schuler.arrays.detection.operating import OperatingCurve
    from schuler.arrays.geometry import Geometry
    from schuler.arrays.merit import FiguresOfMerit
    from schuler.cli.console import Screen

Criterion = Literal["gdop", "volume", "vertical", "detectable_bias", "isolation"]


def geometry(
    shapes: Annotated[tuple[str, ...], Parameter(name="SHAPES", negative=())],
    /,
    *,
    half_angle: float | None = None,
    optimize: Criterion | None = None,
    noise: float = 1.0,
    fault: float = 5.0,
    false_alarm_rate: float = 0.001,
    power: float = 0.8,
    written: Written = Written(),
) -> int:
    """Compare arrangements of redundant sensors: noise, and which faults they show.

    Example: `schuler geometry tetrahedron cone:6`

    Parameters
    ----------
    shapes : tuple of str
        orthogonal:4 (triads side by side), tetrahedron (four triads), cone:6, cone-axis:5 (one
        along the axis as well), cube, octahedron, dodecahedron, icosahedron (an axis for each
        face normal), or a file: mounting.yaml, or a calibration of schuler calibrate.
    half_angle : float, optional
        Of a cone, deg; that which measures equally well in all directions if not given.
    optimize : str, optional
        Find the half angle of a cone that is best in gdop, volume, vertical, detectable_bias or
        isolation.
    noise : float
        Standard deviation of an axis, any unit; results are in the same.
    fault : float
        Step on the first axis, in standard deviations, that the tests of one sample are tried on.
    false_alarm_rate : float
        Of the test of one sample.
    power : float
        Probability with which the smallest fault is found.
    """
    from schuler.arrays.detection.operating import operating_curve
    from schuler.arrays.merit import figures_of_merit
    from schuler.report.sections.arrays.sensor_arrays import compared_geometries

    job = Job(written, inputs=tuple(Path(s) for s in shapes if Path(s).is_file()))
    found: list[FiguresOfMerit] = []
    trials: list[OperatingCurve | None] = []
    for shape in shapes:
        one = _geometry_of(shape, half_angle, optimize)
        found.append(figures_of_merit(one, noise, false_alarm_rate=false_alarm_rate, power=power))
        trial = operating_curve(one, fault, rates=[false_alarm_rate]) if one.redundancy else None
        trials.append(trial)
    shown: list[object] = [compared_geometries(found, trials)] if len(found) > 1 else []
    told = [f.to_dict() | {"fault": _trial(t)} for f, t in zip(found, trials, strict=True)]
    return job.finish(
        Result(
            title="Geometry of redundant sensors",
            sections=(*shown, *found),
            show=lambda screen: show_geometries(screen, found, trials),
            json=lambda: {"geometries": told},
            settings={"noise": noise, "fault": fault},
            with_origin=True,
        )
    )


def _geometry_of(shape: str, half_angle: float | None, optimize: Criterion | None) -> Geometry:
    import numpy as np

    from schuler.arrays.calibration.result import ArrayCalibration
    from schuler.arrays.geometry import Geometry
    from schuler.arrays.optimum import optimize_cone
    from schuler.data.mounting import FILE_KIND, read_mounting
    from schuler.errors import InputError

    path = Path(shape)
    if path.is_file():
        if FILE_KIND in path.read_text(encoding="utf-8", errors="replace"):
            mounting = read_mounting(path)[1]
        else:
            mounting = ArrayCalibration.load(path).mounting
        return Geometry.from_mounting(mounting, title=path.stem)
    name, _, count = shape.partition(":")
    if optimize is not None and name in ("cone", "cone-axis") and count.isdecimal():
        if half_angle is not None:
            raise InputError("--half-angle and --optimize together", expected="one of them")
        best = optimize_cone(int(count), with_axis=name == "cone-axis", criterion=optimize)
        return best.geometry
    return Geometry.named(shape, None if half_angle is None else float(np.radians(half_angle)))


def _trial(curve: OperatingCurve | None) -> dict[str, Any] | None:
    if curve is None:
        return None
    shares = ("chi_square_power", "likelihood_power", "right_axis", "right_unit")
    return {"size": curve.size} | {name: float(getattr(curve, name)[0]) for name in shares}


def show_geometries(
    screen: Screen, found: list[FiguresOfMerit], trials: list[OperatingCurve | None]
) -> None:
    """Print the figures of merit side by side, and what cannot be seen or told apart."""
    from schuler.report.numbers import percent
    from schuler.report.sections.arrays.sensor_arrays import GEOMETRY_COLUMNS, geometry_rows

    screen.heading("Geometry of redundant sensors")
    screen.table(GEOMETRY_COLUMNS, geometry_rows(found, trials))
    size = next((t.size for t in trials if t is not None), None)
    if size is not None:
        screen.line(
            f"smallest fault: found in one sample with {percent(found[0].power)}; found, right: of "
            f"steps of {size:g} deviations on the first axis",
            "dim",
        )
    for one in found:
        for said in one.statements:
            screen.finding("info", f"{one.geometry.title}: {said}")
