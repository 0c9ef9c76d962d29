"""Arrays of one subject under one name, handed to a kernel as one pointer.

    @structure
    class State:
        position: Vector3
        covariance: Matrix

To Python a structure is a frozen dataclass, and that is what a kernel gets without the compiler.
When it is made it looks at its fields, so that what has a wrong shape or type never reaches a
kernel, and writes their addresses and lengths once into a table. A compiled kernel gets the
address of the table and reads fields as views into the same arrays (kernels/structure_types.py);
a structure in a structure is one more pointer. Numbers are constants: what changes is an array.
"""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import fields as fields_of
from math import prod
from typing import Any, TypeVar, cast, dataclass_transform, get_type_hints

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.structure_fields import ArrayField, Field, NestedField, NumberField

T = TypeVar("T")


def _field_of(owner: str, name: str, hint: Any) -> Field:
    for extra in getattr(hint, "__metadata__", ()):
        if isinstance(extra, ArrayField):
            return extra
    if hint in (int, float, bool):
        return NumberField(hint)
    if hasattr(hint, "_fields_of_structure"):
        return NestedField(hint)
    raise TypeError(
        f"{owner}.{name} is declared as {hint}, "
        "should be an array (Vector, Matrix, ...), int, float, bool or a structure"
    )


def _pack(instance: Any) -> None:
    """Look at all fields and write the table; TypeError names the first that does not fit."""
    owner = type(instance)
    words: list[int] = []
    for name, field in owner._fields_of_structure.items():
        value = getattr(instance, name)
        fault = field.fault(value)
        if fault is not None:
            raise TypeError(f"{owner.__name__}.{name} is {fault[0]}, should be {fault[1]}")
        words += field.pack(value)
    table = np.array(words, dtype=np.int64)
    object.__setattr__(instance, "_table", table)
    object.__setattr__(instance, "_address", table.__array_interface__["data"][0])


def _state_of(instance: Any) -> dict[str, Any]:
    """The fields: addresses are of this process."""
    return {name: getattr(instance, name) for name in type(instance)._fields_of_structure}


def _set_state(instance: Any, state: dict[str, Any]) -> None:
    for name, value in state.items():
        object.__setattr__(instance, name, value)
    _pack(instance)


class _NumbaType:
    """The type that compiled kernels know a structure by, made when Numba first asks."""

    def __get__(self, instance: object, owner: type) -> Any:
        from schuler.kernels.structure_types import type_of

        made = type_of(owner)
        owner._numba_type_ = made  # type: ignore[attr-defined]
        return made


@dataclass_transform(frozen_default=True, eq_default=False)
def structure(cls: type[T]) -> type[T]:
    """Make a class with annotated fields a structure."""
    hints = get_type_hints(cls, include_extras=True)
    cls.__post_init__ = _pack  # type: ignore[attr-defined]
    made: Any = dataclass(frozen=True, eq=False, repr=False)(cls)
    made._fields_of_structure = {
        f.name: _field_of(cls.__name__, f.name, hints[f.name]) for f in fields_of(made)
    }
    made._numba_type_ = _NumbaType()
    made.__getstate__ = _state_of
    made.__setstate__ = _set_state
    return cast("type[T]", made)


def carve(shapes: dict[str, tuple[int, ...]], memory: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Views of these shapes, one behind the other in a flat array that holds just them."""
    views, begin = {}, 0
    for name, shape in shapes.items():
        end = begin + prod(shape)
        views[name] = memory[begin:end].reshape(shape)
        begin = end
    return views


def size_of(shapes: dict[str, tuple[int, ...]]) -> int:
    """Places that `carve` needs."""
    return sum(prod(shape) for shape in shapes.values())
