"""Which sections show which result: the maker of a section says so by the type it is given."""

from __future__ import annotations

import re
import warnings
from functools import cache, singledispatch
from importlib import import_module
from pathlib import Path

from schuler.errors import InputError
from schuler.plugins import plugins
from schuler.report.blocks import Section

GROUP = "schuler.report_sections"
"""Entry points of other packages: NAME = MODULE, a module that registers its makers."""


@singledispatch
def _sections(result: object) -> tuple[Section, ...]:
    raise InputError(
        f"a report cannot show a {type(result).__name__}",
        expected="a recording, screening, characterization, navigation or outage result, or one "
        f"that another package shows (entry point group {GROUP})",
    )


register = _sections.register


@_sections.register
def _(result: Section) -> tuple[Section, ...]:
    return (result,)


def sections_of(result: object) -> tuple[Section, ...]:
    """Return the sections that show a result."""
    kind = type(result)
    for base in kind.__mro__:
        if base.__name__ in _homes():
            import_module(_homes()[base.__name__])
    ours = kind.__module__.partition(".")[0] == "schuler"
    if not ours or _sections.dispatch(kind) is _sections.dispatch(object):
        _load_others()
    return _sections(result)


@cache
def _homes() -> dict[str, str]:
    """Return the module of the maker for each name of a type, read without importing any."""
    here = Path(__file__).parent
    homes = {}
    for file in sorted(here.rglob("*.py")):
        module = ".".join((__package__ or "", *file.relative_to(here).with_suffix("").parts))
        text = file.read_text(encoding="utf-8")
        for name in re.findall(r"^@register\ndef \w+\(\w+: (\w+)\)", text, re.M):
            homes[name] = module
    return homes


@cache
def _load_others() -> None:
    """Import the sections of other packages; one that is broken is told and left out."""
    for name, module in plugins(GROUP).items():
        try:
            import_module(module.partition(":")[0])
        except Exception as error:
            warnings.warn(
                f"the report section '{name}' of another package ({module}) cannot be used: "
                f"{error}",
                stacklevel=2,
            )
