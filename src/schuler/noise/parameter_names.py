"""What a key such as "gauss_markov_2.sigma" means: class, words and unit of a parameter."""

from __future__ import annotations

from schuler.noise.base import Process
from schuler.noise.registry import process_class


def class_and_number(name: str) -> tuple[type[Process] | None, int]:
    """Class and number of a part such as "gauss_markov_2"; 1 where it has no number."""
    cls = process_class(name)
    if cls is not None:
        return cls, 1
    kind, _, number = name.rpartition("_")
    return (process_class(kind), int(number)) if number.isdecimal() else (None, 1)


def parameter_words(key: str) -> str:
    """Name of a parameter for people, such as "white noise N"; empty if it is not shown."""
    name, _, field = key.partition(".")
    cls, _ = class_and_number(name)
    return "" if cls is None else cls.described(field).words


def parameter_kind(channel: str, key: str) -> str | None:
    """Return the kind of unit of a parameter, None for a plain number."""
    name, _, field = key.partition(".")
    cls, _ = class_and_number(name)
    unit = "" if cls is None else cls.described(field).unit
    return unit.format(channel.split("_")[0]) or None


def spoken_name(key: str) -> str:
    """Name of any parameter for people, numbered where its kind occurs more than once."""
    name, _, field = key.partition(".")
    cls, number = class_and_number(name)
    words = "" if cls is None else cls.described(field).words
    if not words:
        return key.replace("_", " ").replace(".", " ")
    label = "" if cls is None else cls.label
    numbered = bool(label) and name.rpartition("_")[2].isdecimal()
    return words.replace(label, f"{label} {number}", 1) if numbered else words
