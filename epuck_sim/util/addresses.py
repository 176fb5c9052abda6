"""Functions of compiled code by their addresses, and functions of held values.

numba unpacks each array of a tuple whenever Python calls compiled code, which takes longer than the work of a small
swarm: a function takes the address of a held value instead. And numba compiles a function anew for each function that
it calls: one that calls others by their addresses is compiled once.
"""

from collections.abc import Callable, Hashable
from functools import cache
from typing import Any

from llvmlite import ir
from numba import typeof
from numba.core import cgutils, types
from numba.extending import intrinsic

from epuck_sim.util.held_values import layout, make_reader
from epuck_sim.util.jit import bind, compile_cached, digest, kernel_digest, name_after

_intrinsic: Callable[[Callable[..., Any]], Any] = intrinsic  # its own type leaves the context among the arguments


def compile_at(function: Any, value: object, contents_digest: str, *, careful: bool) -> Any:
    """Compile a function of an address, in which `value_at(address)` is a value of the same type as this one.

    Args:
        function: A function whose arguments are an address and perhaps further ints and floats, as annotated.
        value: What it will be given the address of.
        contents_digest: See `compile_cached`.
        careful: See `compile_cached`.
    """
    # the type is no part of the compiled function's signature, and thus one of its digest
    whole_digest = digest([contents_digest.encode(), str(typeof(value)).encode()])
    bound = name_after(bind(function, value_at=make_reader(value)), whole_digest)
    compiled: Any = compile_cached(bound, whole_digest, careful=careful, nogil=True)
    arguments = function.__code__.co_varnames[: function.__code__.co_argcount]
    compiled.compile(tuple(_KINDS[function.__annotations__[argument]] for argument in arguments))
    return compiled


_KINDS = {int: types.intp, float: types.float64}

_compiled: dict[Hashable, Any] = {}


def compiled_for(function: Any, value: object) -> Any:
    """Return a function of the package's kernels, compiled for addresses of such values; see `compile_at`."""
    key = function, layout(value)
    if key not in _compiled:
        _compiled[key] = compile_at(function, value, kernel_digest(), careful=False)
    return _compiled[key]


@cache
def function_address(compiled: Any) -> int:
    """Return the address of a function that `compile_at` has compiled, for `call_at` or `evaluate_at`."""
    (result,) = compiled.overloads.values()
    return int(result.library.get_pointer_to_function(result.fndesc.llvm_func_name))


@_intrinsic
def call_at(context: Any, function: Any, argument: Any) -> Any:  # noqa: ARG001
    """Call the function at an address, see `function_address`, with an address; raise what it raises."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        convention = context.call_conv
        kind = convention.get_function_type(types.void, (types.intp,)).as_pointer()
        function = builder.inttoptr(arguments[0], kind)
        status, _ = convention.call_function(builder, function, types.void, (types.intp,), arguments[1:])
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return context.get_dummy_value()

    return types.void(types.intp, types.intp), generate


@_intrinsic
def evaluate_at(context: Any, function: Any, argument: Any, number: Any) -> Any:  # noqa: ARG001
    """Return the float of the function at an address, of an address and a float; raise what it raises."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        convention = context.call_conv
        kind = convention.get_function_type(types.float64, signature.args[1:]).as_pointer()
        function = builder.inttoptr(arguments[0], kind)
        status, result = convention.call_function(builder, function, types.float64, signature.args[1:], arguments[1:])
        with cgutils.if_unlikely(builder, status.is_error):
            convention.return_status_propagate(builder, status)
        return result

    return types.float64(types.intp, types.intp, types.float64), generate


@_intrinsic
def call_c_at(context: Any, function: Any, argument: Any) -> Any:  # noqa: ARG001
    """Call the C function at an address, which takes an address and returns nothing."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        function, argument = arguments
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t])
        builder.call(builder.inttoptr(function, kind.as_pointer()), [builder.inttoptr(argument, cgutils.voidptr_t)])
        return context.get_dummy_value()

    return types.void(types.intp, types.intp), generate
