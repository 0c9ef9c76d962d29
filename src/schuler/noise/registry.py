"""Which kinds of process there are: every class that has been imported, and entry points."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import ModelError
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.noise.base import Process

GROUP = "schuler.processes"
"""Entry point group by which an installed package offers processes of its own."""
_CLASSES: dict[str, type[Process]] = {}
_CHECKED: set[type[Process]] = set()
_INTERVAL = 0.01


def enrol(cls: type[Process]) -> None:
    """Remember a class by its kind; called when the class is made."""
    if "kind" not in cls.__dict__:
        return
    kind = cls.kind
    if not isinstance(kind, str) or not kind.isidentifier():
        raise ModelError(
            f"{cls.__qualname__}.kind is {kind!r}", expected="a name such as 'gauss_markov'"
        )
    known = _CLASSES.get(kind)
    if known is not None and (known.__module__, known.__name__) != (
        cls.__module__,
        cls.__name__,
    ):
        raise ModelError(
            f"{cls.__qualname__}.kind is '{kind}', which {known.__module__}.{known.__qualname__} "
            "has",
            expected="a kind of its own",
        )
    _CLASSES[kind] = cls


def kinds() -> dict[str, type[Process]]:
    """Classes that a file may name, by kind, in the order of tables."""
    named = {k: c for k, c in _CLASSES.items() if not getattr(c, "__abstractmethods__", None)}
    named.pop("sum", None)
    return dict(sorted(named.items(), key=lambda item: item[1].rank))


def process_class(kind: str) -> type[Process] | None:
    """The class of a kind: one that was imported, or one that an installed package offers."""
    if kind not in _CLASSES:
        from importlib.metadata import entry_points

        for point in entry_points(group=GROUP, name=kind):
            point.load()
    return kinds().get(kind)


def check_answers(process: Process) -> None:
    """Refuse a process whose class breaks the protocol, once for every class."""
    cls = type(process)
    if cls in _CHECKED or cls.__module__.startswith("schuler."):
        return
    name = cls.__qualname__
    if "kind" not in cls.__dict__:
        raise ModelError(f"{name} has no kind", expected="kind: ClassVar[str] = 'its_name'")
    fields = getattr(cls, "__dataclass_fields__", {})
    for parameter in cls.about:
        if parameter not in fields:
            raise ModelError(
                f"{name}.about speaks of '{parameter}'", expected=f"of {', '.join(fields)}"
            )
    clusters = np.array([1, 2, 30])
    asked: dict[str, Callable[[], FloatArray]] = {
        "allan_variance": lambda: process.allan_variance(clusters * _INTERVAL),
        "psd": lambda: process.psd(np.array([0.1, 1.0, 10.0]), onesided=False),
        "sampled_psd": lambda: process.sampled_psd(np.array([0.01, 0.1, 0.4]), _INTERVAL),
    }
    for question, ask in asked.items():
        try:
            answer = np.asarray(ask(), dtype=np.float64)
        except ModelError:
            continue  # a process may say that it does not exist there
        if answer.shape != (3,) or not (np.isfinite(answer).all() and (answer >= 0.0).all()):
            raise ModelError(
                f"{name}.{question} answers three points by {answer!r:.80}",
                expected="an array of three finite numbers, zero or above",
            )
    _CHECKED.add(cls)
