"""The line of a controller's file in which compiled code has failed.

numba knows it for `raise` statements alone, and not for a division by 0, an index out of bounds or what numpy refuses.
Here every way out of a controller's function with an error also writes its place to memory; all others cost nothing.
"""

import ctypes
from typing import Any, NamedTuple

import llvmlite.binding
from llvmlite import ir
from numba.core import callconv
from numba.core.compiler import CompilerBase
from numba.core.compiler_machinery import register_pass
from numba.core.cpu import CPUContext
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering

from epuck_sim.util.kernel import pipelines_with

FILE_NUMBER = "__file_number__"
"""Global name in a function's module of the number of its file."""

_SYMBOL = "epuck_sim_error_place"
_WORD = ir.IntType(64)
_LINES = 2**32  # a place is the file's number times this, plus the line, which begins at 1; 0 is none

_place = ctypes.c_int64(0)
_add_symbol: Any = llvmlite.binding.add_symbol
_add_symbol(_SYMBOL, ctypes.addressof(_place))  # by its name: compiled code from the cache finds it, too


class Place(NamedTuple):
    """A place in a controller's files."""

    file: int
    """Number of the file."""
    line: int
    """Number of the line, from 1."""


def take_error_place() -> Place | None:
    """Return where the last error of compiled code began, once; None if that is not known."""
    place, _place.value = _place.value, 0
    return Place(*divmod(place, _LINES)) if place else None


class _Calls(callconv.CPUCallConv):
    """Leaves functions as numba does, and notes from where if that is with an error."""

    def return_user_exc(self, builder: Any, *arguments: Any, **more: Any) -> None:
        self._note(builder, is_new=True)
        super().return_user_exc(builder, *arguments, **more)  # type: ignore[no-untyped-call]

    def return_dynamic_user_exc(self, builder: Any, *arguments: Any, **more: Any) -> None:
        self._note(builder, is_new=True)
        super().return_dynamic_user_exc(builder, *arguments, **more)  # type: ignore[no-untyped-call]

    def return_status_propagate(self, builder: Any, status: Any) -> None:
        self._note(builder, is_new=False)
        super().return_status_propagate(builder, status)  # type: ignore[no-untyped-call]

    def _note(self, builder: Any, *, is_new: bool) -> None:
        """Write the place of the instruction, unless the function that was called has; none if `try` catches it."""
        slot = builder.module.globals.get(_SYMBOL) or ir.GlobalVariable(builder.module, _WORD, _SYMBOL)
        lower: Any = self.context.lower
        here = ir.Constant(_WORD, lower.file_number * _LINES + lower.loc.line)
        none = ir.Constant(_WORD, 0)
        before = builder.load(slot)
        place = here if is_new else builder.select(builder.icmp_unsigned("==", before, none), here, before)
        status: Any = self.check_try_status(builder)  # type: ignore[no-untyped-call]
        builder.store(builder.select(status.in_try, none, place), slot)


class _Context(CPUContext):
    """What numba knows of the processor while it makes machine code of one function, with `_Calls`."""

    lower: "_Lower"

    @property
    def call_conv(self) -> _Calls:
        return _Calls(self)  # type: ignore[no-untyped-call]


class _Lower(Lower):
    """Makes machine code of a controller's function as numba does, with `_Context`."""

    def init(self) -> None:
        super().init()  # type: ignore[no-untyped-call]
        self.file_number: int = self.func_ir.func_id.func.__globals__[FILE_NUMBER]
        self.context.__class__ = _Context  # a copy of numba's own, for this function alone
        self.context.lower = self
        self.context.error_model = type(self.context.error_model)(self.context.call_conv)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    """numba's pass that makes machine code, with `_Lower`."""

    _name = "lowering_with_error_places"

    @property
    def lowering_class(self) -> type[Lower]:
        return _Lower


class ErrorPlaceCompiler(CompilerBase):
    """numba's compiler for functions whose modules have a `FILE_NUMBER`."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's passes, with `_Lowering`."""
        return pipelines_with(_Lowering, self.state)
