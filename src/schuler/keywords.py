"""Keywords that several functions take alike: a `TypedDict` says which, and no other passes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from inspect import signature

from schuler.errors import InputError


def refuse_unknown(
    function: Callable[..., object], given: Iterable[str], options: type, fixed: Iterable[str] = ()
) -> None:
    """Raise for a keyword that a function does not take, and name the nearest that it takes.

    `options` is the `TypedDict` of its `**options`; `fixed` are those of them that it sets itself.
    """
    shown = signature(function).parameters.values()
    own = [p.name for p in shown if p.kind is not p.VAR_KEYWORD]
    known = [n for n in (*own, *options.__annotations__) if n not in set(fixed)]
    for name in given:
        if name in set(fixed):
            raise InputError(f"{function.__name__} sets '{name}' itself", cure="leave it out")
        if name not in known:
            near = get_close_matches(name, known, 1)
            raise InputError(
                f"{function.__name__} has no option '{name}'",
                expected=", ".join(known),
                cure=f"did you mean '{near[0]}'?" if near else "",
            )
