"""What Numba has to know of a structure: a pointer, and how a field is read behind it.

The only file that touches Numba's internals. Fields are loaded as invariant: the table of a
structure never changes, so the compiler keeps what it read. Arrays come as views without an
owner, hence nothing is counted up and down; a kernel must neither return nor keep one.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import register_default
from numba.core.datamodel.models import OpaqueModel
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, unbox
from numba.np import numpy_support
from numba.np.arrayobj import populate_array

from schuler.kernels.structure_fields import ArrayField, Field, NestedField, NumberField, places_of


class StructureType(types.Type):  # type: ignore[misc]
    """The type of all objects of one structure; fields with their places in its table."""

    def __init__(self, name: str, places: dict[str, tuple[int, Any]], constants: Any) -> None:
        self.places = places
        self.constants = constants
        super().__init__(name=name)


@cache
def type_of(cls: type) -> StructureType:
    """Return the type of a structure; always the same object."""
    places = {}
    for name, (begin, field) in places_of(cls).items():
        places[name] = (begin, _type_of_field(field))
    lengths = {n: f.shape for n, (_, f) in places_of(cls).items() if isinstance(f, ArrayField)}
    return StructureType(f"{cls.__module__}.{cls.__qualname__}", places, lengths)


def _type_of_field(field: Field) -> Any:
    if isinstance(field, NestedField):
        return type_of(field.kind)
    if isinstance(field, NumberField):
        return {int: types.int64, float: types.float64, bool: types.boolean}[field.kind]
    dtype = numpy_support.from_dtype(field.dtype)
    return types.Array(dtype, len(field.shape), "C")


register_default(StructureType)(OpaqueModel)


@unbox(StructureType)  # type: ignore[untyped-decorator]
def _unbox(typ: Any, obj: Any, c: Any) -> Any:
    address = c.pyapi.object_getattr_string(obj, "_address")
    number = c.pyapi.long_as_longlong(address)
    c.pyapi.decref(address)
    pointer = c.builder.inttoptr(number, ir.IntType(8).as_pointer())
    return NativeValue(pointer, is_error=cgutils.is_not_null(c.builder, c.pyapi.err_occurred()))


@infer_getattr
class _StructureAttributes(AttributeTemplate):  # type: ignore[misc]
    key = StructureType

    def generic_resolve(self, typ: Any, attr: str) -> Any:
        place = typ.places.get(attr)
        return None if place is None else place[1]


@lower_getattr_generic(StructureType)  # type: ignore[untyped-decorator]
def _read_field(context: Any, builder: Any, typ: Any, value: Any, attr: str) -> Any:
    begin, kind = typ.places[attr]
    word = ir.IntType(64)
    table = builder.bitcast(value, word.as_pointer())
    never = builder.module.add_metadata([])

    def load(place: int) -> Any:
        pointer = builder.gep(table, [ir.Constant(word, place)], inbounds=True)
        loaded = builder.load(pointer)
        loaded.set_metadata("invariant.load", never)
        return loaded

    if isinstance(kind, StructureType):
        return builder.inttoptr(load(begin), ir.IntType(8).as_pointer())
    if kind is types.float64:
        return builder.bitcast(load(begin), ir.DoubleType())
    if kind is types.boolean:
        return builder.icmp_unsigned("!=", load(begin), ir.Constant(word, 0))
    if kind is types.int64:
        return load(begin)
    array = context.make_array(kind)(context, builder)
    itemsize = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    shape = [
        load(begin + 1 + d) if length is None else ir.Constant(word, length)
        for d, length in enumerate(typ.constants[attr])
    ]
    strides = [ir.Constant(word, itemsize)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length, flags=["nsw"]))
    populate_array(
        array,
        data=builder.inttoptr(load(begin), array.data.type),
        shape=shape,
        strides=strides,
        itemsize=itemsize,
        meminfo=None,
    )
    return array._getvalue()
