"""Physics steps without Python between them: calls of Chipmunk, the engine inside pymunk, from compiled code.

Functions are called by their addresses. Addresses differ from process to process: as arguments, they do not become a
part of the compiled code, which can thus be kept on disk.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from epuck_sim.util.jit import jit_nogil

CALLS = np.dtype(
    [
        ("space", np.intp),  # the `cpSpace`
        ("step", np.intp),  # the function `cpSpaceStep`
        ("each_body", np.intp),  # the function `cpSpaceEachBody`
        ("set_body", np.intp),  # the function that takes a body's velocities from `commands`
        ("commands", np.intp),  # a `pmBatchedData`
        ("commands_read", np.intp),  # the number of floats that have been taken, a C int
        ("get_body", np.intp),  # the function that appends a body's pose to `poses`
        ("poses", np.intp),  # a `pmBatchedData`
        ("poses_written", np.intp),  # the number of floats that have been appended, a C int
    ]
)
"""Addresses of what `advance_space` calls, and of what it calls that with."""

_intrinsic: Callable[[Callable[..., Any]], Any] = intrinsic  # its own type leaves the context among the arguments
_POINTER = ir.IntType(8).as_pointer()


@_intrinsic
def _call_step(context: Any, function: Any, space: Any, step_s: Any) -> Any:  # noqa: ARG001
    """Call the function at an address with the space at an address and a time in seconds."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        function, space, step_s = arguments
        kind = ir.FunctionType(ir.VoidType(), [_POINTER, ir.DoubleType()])
        builder.call(builder.inttoptr(function, kind.as_pointer()), [builder.inttoptr(space, _POINTER), step_s])
        return context.get_dummy_value()

    return types.void(types.intp, types.intp, types.float64), generate


@_intrinsic
def _call_each_body(context: Any, function: Any, space: Any, callback: Any, data: Any) -> Any:  # noqa: ARG001
    """Call the function at an address with the addresses of a space, of a function and of its data."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        function, *pointers = arguments
        kind = ir.FunctionType(ir.VoidType(), [_POINTER] * 3)
        pointers = [builder.inttoptr(pointer, _POINTER) for pointer in pointers]
        builder.call(builder.inttoptr(function, kind.as_pointer()), pointers)
        return context.get_dummy_value()

    return types.void(types.intp, types.intp, types.intp, types.intp), generate


@_intrinsic
def _set_to_zero(context: Any, address: Any) -> Any:  # noqa: ARG001
    """Set the C int at an address to 0."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        number = ir.IntType(32)
        builder.store(number(0), builder.inttoptr(arguments[0], number.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.intp), generate


@jit_nogil
def advance_space(calls: npt.NDArray[np.void], steps: int, step_s: float) -> None:
    """Set the bodies' velocities, take a number of physics steps, and get the bodies' poses.

    Args:
        calls: (1,) a record, see `CALLS`.
        steps: number of physics steps.
        step_s: seconds of a physics step.
    """
    call = calls[0]
    _set_to_zero(call.commands_read)
    _call_each_body(call.each_body, call.space, call.set_body, call.commands)
    for _ in range(steps):
        _call_step(call.step, call.space, step_s)
    _set_to_zero(call.poses_written)
    _call_each_body(call.each_body, call.space, call.get_body, call.poses)
