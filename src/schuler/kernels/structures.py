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
from typing import Annotated, Any, TypeVar, cast, dataclass_transform, get_type_hints

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")


@dataclass(frozen=True)
class ArrayField:
    """What an array has to be: its type, its lengths (None: any), and whether it is only read."""

    dtype: np.dtype[Any]
    shape: tuple[int | None, ...]
    seen: bool = False

    def words(self) -> int:
        """Places in the table: the address and the lengths."""
        return 1 + len(self.shape)

    def fault(self, value: object) -> tuple[str, str] | None:
        """What was found and what should be, if the value does not fit."""
        wanted = f"a C-contiguous array ({self._lengths()}) of {self.dtype}"
        if not isinstance(value, np.ndarray):
            return type(value).__name__, wanted
        if value.dtype != self.dtype or value.ndim != len(self.shape):
            return f"an array {value.shape} of {value.dtype}", wanted
        for found, expected in zip(value.shape, self.shape, strict=True):
            if expected is not None and found != expected:
                return f"an array {value.shape} of {value.dtype}", wanted
        if not value.flags.c_contiguous:
            return f"an array {value.shape} with strides {value.strides}", wanted
        if not (self.seen or value.flags.writeable):
            return "a read-only array", f"{wanted} that can be written to"
        return None

    def _lengths(self) -> str:
        return ", ".join("any" if n is None else str(n) for n in self.shape)

    def pack(self, value: NDArray[Any]) -> tuple[int, ...]:
        """What stands in the table."""
        return (value.__array_interface__["data"][0], *value.shape)


@dataclass(frozen=True)
class NumberField:
    """A whole number, a real one or a truth value; a constant of the structure."""

    kind: type[int] | type[float] | type[bool]

    def words(self) -> int:
        """Places in the table."""
        return 1

    def fault(self, value: object) -> tuple[str, str] | None:
        """What was found and what should be, if the value does not fit."""
        allowed: tuple[type, ...] = (bool, np.bool_)
        if self.kind is not bool:
            if isinstance(value, allowed):
                return type(value).__name__, self.kind.__name__
            whole: tuple[type, ...] = (int, np.integer)
            allowed = whole if self.kind is int else (*whole, float, np.floating)
        return None if isinstance(value, allowed) else (type(value).__name__, self.kind.__name__)

    def pack(self, value: Any) -> tuple[int, ...]:
        """What stands in the table: the number, or the bits of a real one."""
        if self.kind is float:
            return (int(np.float64(value).view(np.int64)),)
        return (int(value),)


@dataclass(frozen=True)
class NestedField:
    """A structure in a structure."""

    kind: type

    def words(self) -> int:
        """Places in the table."""
        return 1

    def fault(self, value: object) -> tuple[str, str] | None:
        """What was found and what should be, if the value does not fit."""
        if isinstance(value, self.kind):
            return None
        return type(value).__name__, self.kind.__name__

    def pack(self, value: Any) -> tuple[int, ...]:
        """What stands in the table."""
        return (value._address,)


Field = ArrayField | NumberField | NestedField

_REAL, _WHOLE, _TRUTH = np.dtype(np.float64), np.dtype(np.int64), np.dtype(np.bool_)

Vector = Annotated[NDArray[np.float64], ArrayField(_REAL, (None,))]
Number = Annotated[NDArray[np.float64], ArrayField(_REAL, (1,))]
Vector3 = Annotated[NDArray[np.float64], ArrayField(_REAL, (3,))]
Matrix = Annotated[NDArray[np.float64], ArrayField(_REAL, (None, None))]
Matrix3 = Annotated[NDArray[np.float64], ArrayField(_REAL, (3, 3))]
Cube = Annotated[NDArray[np.float64], ArrayField(_REAL, (None, None, None))]
Places = Annotated[NDArray[np.int64], ArrayField(_WHOLE, (None,))]
Counter = Annotated[NDArray[np.int64], ArrayField(_WHOLE, (1,))]
Places3 = Annotated[NDArray[np.int64], ArrayField(_WHOLE, (3,))]
Flags = Annotated[NDArray[np.bool_], ArrayField(_TRUTH, (None,))]


def reals(*shape: int | None) -> ArrayField:
    """Real numbers, lengths as given, that a kernel may write to."""
    return ArrayField(_REAL, shape)


def wholes(*shape: int | None) -> ArrayField:
    """Whole numbers, lengths as given, that a kernel may write to."""
    return ArrayField(_WHOLE, shape)


def seen(field: ArrayField) -> ArrayField:
    """The same for an array that kernels only read: it may be read-only, or not."""
    return ArrayField(field.dtype, field.shape, seen=True)


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


def places_of(cls: type) -> dict[str, tuple[int, Field]]:
    """Where each field begins in the table, and what it is."""
    found, begin = {}, 0
    for name, field in cast("dict[str, Field]", cls._fields_of_structure).items():  # type: ignore[attr-defined]
        found[name] = (begin, field)
        begin += field.words()
    return found
