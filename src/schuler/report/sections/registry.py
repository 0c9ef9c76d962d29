"""Which sections show which result."""

from __future__ import annotations

from functools import singledispatch
from importlib import import_module

from schuler.errors import InputError
from schuler.report.blocks import Section

_HOMES = ("recording", "screening", "characterization", "navigation", "outages")


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
    for home in _HOMES:
        import_module(f"schuler.report.sections.{home}")
    return _sections(result)
