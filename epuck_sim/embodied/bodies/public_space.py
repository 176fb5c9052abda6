"""Motion by pymunk's public interface alone, slowly: for versions whose C functions compiled code cannot call.

The kernels of `chipmunk` run as plain Python, on an array that has pymunk's objects where compiled code has addresses,
and functions of the public interface where it has Chipmunk's. So the outcome is the same, to the bit.
"""

import platform
import sys
from collections.abc import Callable, Iterable
from functools import lru_cache
from operator import attrgetter
from types import FunctionType, SimpleNamespace
from typing import Any

import pymunk

from epuck_sim.embodied.bodies import chipmunk
from epuck_sim.embodied.bodies.shapes import Thing
from epuck_sim.embodied.swarm import open_block


def _setter(name: str) -> Callable[..., None]:
    """Return a function that sets an attribute to a number, or a vector to several."""
    return lambda thing, *values: setattr(thing, name, values if len(values) > 1 else values[0])


_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "cpSpaceNew": pymunk.Space,
    "cpSpaceFree": lambda _: None,
    "cpSpaceSetCollisionSlop": _setter("collision_slop"),
    "cpSpaceSetCollisionBias": _setter("collision_bias"),
    "cpSpaceStep": pymunk.Space.step,
    **dict.fromkeys(("cpSpaceAddBody", "cpSpaceAddShape"), pymunk.Space.add),
    **dict.fromkeys(("cpSpaceRemoveBody", "cpSpaceRemoveShape"), pymunk.Space.remove),
    "cpBodyGetSpace": lambda body: body.space or 0,
    "cpBodySetPosition": _setter("position"),
    "cpBodySetAngle": _setter("angle"),
    "cpBodySetVelocity": _setter("velocity"),
    "cpBodySetAngularVelocity": _setter("angular_velocity"),
    "cpBodyGetPosition": attrgetter("position"),
    "cpBodyGetAngle": attrgetter("angle"),
    "cpBodyGetVelocity": attrgetter("velocity"),
    "cpBodyUpdatePosition": pymunk.Body.update_position,
}
"""What does by pymunk's public interface what each of `chipmunk.FUNCTIONS` does."""


@lru_cache
def public_way() -> SimpleNamespace:
    """Return the functions of `chipmunk` as plain Python, by pymunk's public interface."""

    def call(function: Callable[..., Any], *arguments: Any) -> Any:
        return function(*arguments)

    def add_to_space(space: pymunk.Space, things: Iterable[Thing]) -> None:
        for thing in things:  # at once, all bodies would enter first
            space.add(thing)

    names = dict.fromkeys(("call_c", "pointer_from_c", "double_from_c", "vector_from_c"), call) | {
        "address": lambda thing: thing,
        "function_addresses": lambda: [_FUNCTIONS[name] for name in chipmunk.FUNCTIONS],
        "add_to_space": add_to_space,
        "take_from_space": lambda space, things: space.remove(*things),
        "free_space": lambda *_: None,
        "swarm_at": open_block,
    }
    found: dict[str, Any] = {**vars(chipmunk), **names}
    for name in found.keys() - names:
        function = getattr(found[name], "function", found[name])  # a kernel's, if it is one
        if isinstance(function, FunctionType) and function.__module__ == chipmunk.__name__:
            found[name] = FunctionType(function.__code__, found)
    return SimpleNamespace(**found)


@lru_cache
def reason_for_public_way() -> str:
    """Return why compiled code cannot call this pymunk's Chipmunk, or "" if it can."""
    if sys.platform == "win32" or platform.machine().lower() not in {"x86_64", "amd64", "aarch64", "arm64"}:
        return f"compiled code does not know how {platform.system()} on {platform.machine()} passes C structs"
    try:
        chipmunk.function_addresses()
    except (AttributeError, TypeError) as error:  # which the private interface of another version may raise
        return str(error)
    return ""
