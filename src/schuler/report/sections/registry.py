"""Which sections show which result."""

from __future__ import annotations

from functools import singledispatch
from importlib import import_module
from importlib.metadata import entry_points

from schuler.errors import InputError
from schuler.report.blocks import Section

_HOMES = {
    "schuler.data.imu": "recording",
    "schuler.data.trajectory": "navigation",
    "schuler.screening": "screening",
    "schuler.estimation": "characterization",
    "schuler.estimation.comparison.methods": "methods",
    "schuler.estimation.comparison.replicates": "replicates",
    "schuler.denoising": "denoising",
    "schuler.navigation.tuning.inflation": "tuning",
    "schuler.evaluation": "outages",
    "schuler.evaluation.mechanizations": "mechanizations",
    "schuler.navigation.observability_run": "observability",
    "schuler.arrays.synthesis.synthetic": "sensor_arrays",
    "schuler.arrays.detection.faults": "sensor_arrays",
    "schuler.arrays.detection.lasting_faults": "lasting_faults",
    "schuler.arrays.geometry": "sensor_arrays",
    "schuler.arrays.merit": "sensor_arrays",
    "schuler.evaluation.error_model_comparison": "error_models",
    "schuler.arrays.calibration.review": "calibration",
    "schuler.report.sections.navigation": "navigation",
    "schuler.report.sections.simulation": "simulation",
    "schuler.report.sections.outages": "outages",
}
"""Where the maker for the results of a module lives: only that one is imported."""


@singledispatch
def _sections(result: object) -> tuple[Section, ...]:
    raise InputError(
        f"a report cannot show a {type(result).__name__}",
        expected="a recording, screening, characterization, navigation or outage result",
    )


register = _sections.register


@_sections.register
def _(result: Section) -> tuple[Section, ...]:
    return (result,)


def sections_of(result: object) -> tuple[Section, ...]:
    """Return the sections that show a result."""
    module = type(result).__module__
    for start, home in _HOMES.items():
        if f"{module}.".startswith(f"{start}."):
            import_module(f"schuler.report.sections.{home}")
    for point in entry_points(group="schuler.report_sections"):
        # A section of another package shows results of that package.
        if point.value.partition(".")[0] == module.partition(".")[0]:
            point.load()
    return _sections(result)
