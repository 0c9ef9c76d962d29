"""What the fields of a structure may be: arrays, numbers, other structures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import NDArray


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
        # text is made only for what does not fit: structures are made by the thousand
        if not isinstance(value, np.ndarray):
            return type(value).__name__, self._wanted()
        fits = value.dtype == self.dtype and value.ndim == len(self.shape)
        if fits:
            for found, expected in zip(value.shape, self.shape, strict=True):
                fits = fits and (expected is None or found == expected)
        if not fits:
            return f"an array {value.shape} of {value.dtype}", self._wanted()
        flags = value.flags
        if not flags.c_contiguous:
            return f"an array {value.shape} with strides {value.strides}", self._wanted()
        if not (self.seen or flags.writeable):
            return "a read-only array", f"{self._wanted()} that can be written to"
        return None

    def _wanted(self) -> str:
        lengths = ", ".join("any" if n is None else str(n) for n in self.shape)
        return f"a C-contiguous array ({lengths}) of {self.dtype}"

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


def places_of(cls: type) -> dict[str, tuple[int, Field]]:
    """Where each field begins in the table, and what it is."""
    found, begin = {}, 0
    for name, field in cast("dict[str, Field]", cls._fields_of_structure).items():  # type: ignore[attr-defined]
        found[name] = (begin, field)
        begin += field.words()
    return found
