"""Motion without Python between physics steps: calls of Chipmunk, the engine inside pymunk, from compiled code.

Functions are called by their addresses. Addresses differ from process to process: as arguments, they do not become a
part of the compiled code, which can thus be kept on disk.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from epuck_sim.embodied.bodies_tuple import Bodies
from epuck_sim.embodied.cell_list import sort_into_cells
from epuck_sim.embodied.contact_candidates import find_contact_candidates
from epuck_sim.util.jit import jit_no_alloc

CALLS = np.dtype(
    [
        ("space", np.intp),  # the `cpSpace`
        ("step", np.intp),  # the function `cpSpaceStep`
        ("add_body", np.intp),  # the function `cpSpaceAddBody`
        ("add_shape", np.intp),  # the function `cpSpaceAddShape`
        ("remove_body", np.intp),  # the function `cpSpaceRemoveBody`
        ("remove_shape", np.intp),  # the function `cpSpaceRemoveShape`
        ("set_body", np.intp),  # the function that sets what a batch holds of a body
        ("get_body", np.intp),  # the function that writes to a batch what it holds of a body
        ("poses", np.intp),  # a `pmBatchedData`
        ("poses_index", np.intp),  # the index of the next float to read or write in it, a C int
        ("velocities", np.intp),  # a `pmBatchedData`
        ("velocities_index", np.intp),  # the index of the next float to read in it, a C int
        ("turns", np.intp),  # a `pmBatchedData` of the angular velocities alone
        ("turns_index", np.intp),  # the index of the next float to read in it, a C int
        ("circles", np.intp),  # a `pmBatchedData` of positions, for movables
        ("circles_index", np.intp),  # the index of the next float to write in it, a C int
    ]
)
"""Addresses of what `move_bodies` calls, and of what it calls that with."""


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
def _call(context: Any, function: Any, one: Any, other: Any) -> Any:  # noqa: ARG001
    """Call the function at an address with two addresses, and ignore what it returns."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        function, *pointers = arguments
        kind = ir.FunctionType(ir.VoidType(), [_POINTER] * 2)
        pointers = [builder.inttoptr(pointer, _POINTER) for pointer in pointers]
        builder.call(builder.inttoptr(function, kind.as_pointer()), pointers)
        return context.get_dummy_value()

    return types.void(types.intp, types.intp, types.intp), generate


@_intrinsic
def _set_int(context: Any, address: Any, value: Any) -> Any:  # noqa: ARG001
    """Set the C int at an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:  # noqa: ARG001
        address, value = arguments
        number = ir.IntType(32)
        builder.store(builder.trunc(value, number), builder.inttoptr(address, number.as_pointer()))
        return context.get_dummy_value()

    return types.void(types.intp, types.intp), generate


@jit_no_alloc
def move_bodies(bodies: Bodies, steps: int) -> None:
    """Move all bodies for a number of physics steps.

    Only robots that may touch something are in Chipmunk's space; the others move in straight lines, as they would
    there. Where nothing can touch anything, no physics step is taken. `bodies.cells` are sorted by the poses, before
    and after.
    """
    poses, velocities, robots = bodies.poses, bodies.velocities, len(bodies.poses)
    time_s = steps * bodies.step_s
    find_contact_candidates(bodies, time_s)
    in_space = 0
    for robot in range(robots):
        _enter_or_leave(bodies, robot)
        if bodies.is_candidate[robot]:
            in_space += 1
            _set_body(bodies, robot)
        else:
            for axis in range(3):
                poses[robot, axis] += velocities[robot, axis] * time_s
    if in_space > 0:
        _step_space(bodies, steps)
    sort_into_cells(poses, bodies.cells)


@jit_no_alloc
def _step_space(bodies: Bodies, steps: int) -> None:
    """Take physics steps, and get the poses of the robots in the space."""
    call = bodies.calls[0]
    for _ in range(steps):
        _call_step(call.step, call.space, bodies.step_s)
    for robot in range(len(bodies.poses)):
        if bodies.is_in_space[robot]:
            _set_int(call.poses_index, 3 * robot)
            _call(call.get_body, bodies.pointers[robot, 0], call.poses)
    first = len(bodies.circles) - len(bodies.movables)
    for movable in range(len(bodies.movables)):
        _set_int(call.circles_index, 3 * (first + movable))
        _call(call.get_body, bodies.movables[movable], call.circles)


@jit_no_alloc
def _enter_or_leave(bodies: Bodies, robot: int) -> None:
    """Put a robot that may touch something into the space, and take one that cannot out of it."""
    if bodies.is_candidate[robot] == bodies.is_in_space[robot]:
        return
    call = bodies.calls[0]
    body, shape = bodies.pointers[robot]
    if bodies.is_candidate[robot]:
        _call(call.add_body, call.space, body)
        _call(call.add_shape, call.space, shape)
    else:
        _call(call.remove_shape, call.space, shape)
        _call(call.remove_body, call.space, body)
    bodies.is_in_space[robot] = bodies.is_candidate[robot]


@jit_no_alloc
def _set_body(bodies: Bodies, robot: int) -> None:
    """Set the pose of a robot's body, and its velocities, or those to which its wheels drive it."""
    call = bodies.calls[0]
    _set_int(call.poses_index, 3 * robot)
    _call(call.set_body, bodies.pointers[robot, 0], call.poses)
    _set_int(call.velocities_index, 3 * robot)
    if len(bodies.drives) == 0:
        _call(call.set_body, bodies.pointers[robot, 0], call.velocities)
    else:
        _call(call.set_body, bodies.drives[robot], call.velocities)
        _set_int(call.turns_index, 3 * robot + 2)
        _call(call.set_body, bodies.pointers[robot, 0], call.turns)
