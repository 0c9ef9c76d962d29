"""Which sections show which result."""

from __future__ import annotations

from functools import singledispatch
from importlib import import_module

from schuler.errors import InputError
from schuler.report.blocks import Section

_HOMES = {
    "schuler.data.imu": "recording",
    "schuler.data.trajectory": "navigation",
    "schuler.characterize": "screening",
    "schuler.identify": "characterization",
    "schuler.identify.comparison.methods": "methods",
    "schuler.identify.comparison.replicates": "replicates",
    "schuler.denoise": "denoising",
    "schuler.navigate.inflation": "tuning",
    "schuler.evaluate": "outages",
    "schuler.evaluate.mechanizations": "mechanizations",
    "schuler.navigate.observability_run": "observability",
    "schuler.fuse.synthetic": "sensor_arrays",
    "schuler.fuse.faults": "sensor_arrays",
    "schuler.fuse.lasting_faults": "lasting_faults",
    "schuler.fuse.geometry": "sensor_arrays",
    "schuler.fuse.merit": "sensor_arrays",
    "schuler.studies.reproduction": "reproduction",
    "schuler.evaluate.error_model_comparison": "error_models",
    "schuler.fuse.calibration.review": "calibration",
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
    """Return the sections that show a result.

    Parameters
    ----------
    result : object
        A recording, a screening, a characterization, a navigation run, an outage evaluation, or
        a section made by the caller.

    Returns
    -------
    tuple of Section
        In reading order.

    Raises
    ------
    InputError
        Nothing is known about this kind of result.
    """
    module = type(result).__module__
    for start, home in _HOMES.items():
        if f"{module}.".startswith(f"{start}."):
            import_module(f"schuler.report.sections.{home}")
    return _sections(result)
