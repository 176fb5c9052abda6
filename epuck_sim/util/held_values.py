"""Values that compiled code reads at an address, field by field.

numba passes a named tuple from function to function as all the numbers that describe its arrays, hundreds of them for
a swarm: most of the time of compiling goes into that. A held value is passed as an address; what a function uses of it
is read from there. To the source of a kernel the two are alike.
"""

import struct
from collections.abc import Callable, Hashable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof
from numba.core import types
from numba.core.datamodel.models import PrimitiveModel
from numba.core.datamodel.registry import register_default
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic
from numba.np.arrayobj import populate_array

from epuck_sim.util.jit import digest

WORD_BYTES = 8
"""Size of a number in a held value, in bytes."""

_word = ir.IntType(8 * WORD_BYTES)
_intrinsic: Callable[[Callable[..., Any]], Any] = intrinsic  # its own type leaves the context among the arguments


def hold(value: tuple[Any, ...]) -> tuple[object, int]:
    """Hold a named tuple of arrays, numbers and further tuples for compiled code.

    Returns:
        (owner, address): the value is at the address as long as Python refers to the owner.

    Raises:
        TypeError: The tuple has something else in it.
    """
    formats: list[str] = []
    numbers: list[float] = []
    _list_words(value, formats, numbers)
    words = np.frombuffer(struct.pack("".join(formats), *numbers), np.int64)
    return (words, value), words.__array_interface__["data"][0]


def _list_words(value: object, formats: list[str], numbers: list[float]) -> None:
    """Append each number of a value to `numbers`, and how it is stored, see the module `struct`, to `formats`."""
    if isinstance(value, tuple):
        for field in value:
            _list_words(field, formats, numbers)
    elif isinstance(value, np.ndarray):
        formats.append(f"{1 + 2 * value.ndim}q")
        numbers.append(value.__array_interface__["data"][0])
        numbers.extend(value.shape)
        numbers.extend(value.strides)
    elif isinstance(value, bool | int | np.int64 | np.bool_):
        formats.append("q")
        numbers.append(int(value))
    elif isinstance(value, float):
        formats.append("d")
        numbers.append(value)
    else:
        raise TypeError(f"{value!r} cannot be held for compiled code: it is no array, number or tuple")


def layout(value: object) -> Hashable:
    """Return all that numba's type of a value depends on, faster than numba finds the type."""
    if isinstance(value, np.ndarray):
        rows, columns = value.flags.c_contiguous, value.flags.f_contiguous  # an array of one row is both: then C
        return type(value), value.dtype, value.ndim, rows, columns and not rows
    if isinstance(value, tuple):
        return type(value), *map(layout, value)
    return type(value).__name__


class HeldType(types.Type):
    """numba's type of a named tuple, with arrays in it, that is at an address."""

    def __init__(self, fields: Any) -> None:
        """Make the type; fields: numba's type of the named tuple."""
        self.fields = fields
        # a short name: numba names compiled code after the types of all arguments
        super().__init__(f"{fields.instance_class.__name__}_{digest([str(fields).encode()])}")

    @property
    def key(self) -> Any:
        """What tells two types apart."""
        return self.fields


@register_default(HeldType)
class _HeldModel(PrimitiveModel):
    """A held value in compiled code: a pointer to its words."""

    def __init__(self, manager: Any, kind: HeldType) -> None:
        super().__init__(manager, kind, _word.as_pointer())  # type: ignore[no-untyped-call]


def type_at_address(kind: Any) -> Any:
    """Return the type as which compiled code reads a value of some type: named tuples with arrays stay where they are.

    Those without arrays are read as themselves, as are all other values.
    """
    return HeldType(kind) if isinstance(kind, types.BaseNamedTuple) and _has_arrays(kind) else kind


def _has_arrays(kind: Any) -> bool:
    return isinstance(kind, types.Array) or any(map(_has_arrays, _members(kind)))


def _members(kind: Any) -> Any:
    """Return the types in a tuple; none of what is no tuple."""
    members: Any = kind if isinstance(kind, types.BaseTuple) else ()
    return tuple(members)


def _count_words(kind: Any) -> int:
    """Return how many words a value of this type takes."""
    if isinstance(kind, types.BaseTuple):
        return sum(map(_count_words, _members(kind)))
    return 1 + 2 * kind.ndim if isinstance(kind, types.Array) else 1


@infer_getattr
class _HeldAttributes(AttributeTemplate):
    key = HeldType

    def generic_resolve(self, held: HeldType, name: str) -> Any:  # type: ignore[override]
        fields = held.fields.fields
        return type_at_address(held.fields.types[fields.index(name)]) if name in fields else None


@lower_getattr_generic(HeldType)  # type: ignore[untyped-decorator]
def _read_attribute(context: Any, builder: Any, held: HeldType, pointer: Any, name: str) -> Any:
    """Return the code that reads a field of a held value."""
    place = held.fields.fields.index(name)
    kinds = held.fields.types
    return _read(context, builder, type_at_address(kinds[place]), _move(builder, pointer, kinds[:place]))


def _move(builder: Any, pointer: Any, kinds: Any) -> Any:
    """Return the pointer to what follows values of these types."""
    return builder.gep(pointer, [_word(sum(map(_count_words, kinds)))], inbounds=True)


def _read(context: Any, builder: Any, kind: Any, pointer: Any) -> Any:
    """Return the code that reads a value of some type at a pointer."""
    if isinstance(kind, HeldType):
        return pointer
    if isinstance(kind, types.BaseTuple):
        members = [
            _read(context, builder, member, _move(builder, pointer, _members(kind)[:place]))
            for place, member in enumerate(_members(kind))
        ]
        return context.make_tuple(builder, kind, members)
    if isinstance(kind, types.Array):
        return _read_array(context, builder, kind, pointer)
    if isinstance(kind, types.Boolean):
        return builder.icmp_signed("!=", _read_word(builder, pointer), _word(0))
    return _read_word(builder, builder.bitcast(pointer, context.get_value_type(kind).as_pointer()))


def _read_array(context: Any, builder: Any, kind: Any, pointer: Any) -> Any:
    """Return the code that reads an array; compiled code does not own it."""
    element = context.get_data_type(kind.dtype)
    data = _read_word(builder, builder.bitcast(pointer, element.as_pointer().as_pointer()))
    numbers = [
        _read_word(builder, _move(builder, pointer, [types.intp] * word)) for word in range(1, 1 + 2 * kind.ndim)
    ]
    array = context.make_array(kind)(context, builder)
    populate_array(
        array,
        data=data,
        shape=numbers[: kind.ndim],
        strides=numbers[kind.ndim :],
        itemsize=context.get_constant(types.intp, context.get_abi_sizeof(element)),
        meminfo=None,
    )
    return array._getvalue()


def _read_word(builder: Any, pointer: Any) -> Any:
    """Return the code that reads a word, which nothing changes: it need be read but once."""
    loaded = builder.load(pointer)
    loaded.set_metadata("invariant.load", builder.module.add_metadata([]))
    return loaded


def make_reader(value: object) -> Any:
    """Return a function for compiled code that returns a value of the same type as this one, held at an address."""
    kind = type_at_address(typeof(value))

    @_intrinsic
    def value_at(context: Any, address: Any) -> Any:  # noqa: ARG001
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
            return _read(context, builder, kind, builder.inttoptr(arguments[0], _word.as_pointer()))

        return kind(types.intp), generate

    return value_at
