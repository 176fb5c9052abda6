"""Motion without Python between physics steps: compiled code calls Chipmunk, the C library inside pymunk.

Functions, bodies and shapes are passed by their addresses. These differ from process to process, so they stand in an
array and not in the compiled code, which can thus be kept on disk. Only this file has private names of pymunk. If the
names, or the way in which C is called, are not as expected, the same kernels run as plain Python, slowly: their array
has pymunk's objects instead of addresses, and functions of its public interface instead of Chipmunk's. The outcome is
the same, to the bit.
"""

import platform
import sys
from collections.abc import Callable, Iterable
from functools import cache
from operator import attrgetter
from types import FunctionType, SimpleNamespace
from typing import Any

import pymunk

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.bodies.contacts import PUSHED_CM, SLOP_CM, add_reached, find_contact_candidates, move_others
from epuck_sim.embodied.cells import sort_into_cells
from epuck_sim.embodied.swarm import GROUND, KEEP, SPACE, Swarm, open_block, swarm_at
from epuck_sim.util.elementary import hypot
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import call_c, double_from_c, pointer_from_c, vector_from_c

try:
    from pymunk._chipmunk_cffi import ffi, lib
except ImportError:
    ffi = lib = None

Thing = pymunk.Body | pymunk.Shape | pymunk.Constraint


def _setter(name: str) -> Callable[..., None]:
    return lambda thing, *values: setattr(thing, name, values if len(values) > 1 else values[0])


FUNCTIONS: dict[str, tuple[str, Callable[..., Any]]] = {
    "cpSpaceNew": ("cpSpace *(*)(void)", pymunk.Space),
    "cpSpaceFree": ("void(*)(cpSpace *)", lambda _: None),
    "cpSpaceSetCollisionSlop": ("void(*)(cpSpace *, cpFloat)", _setter("collision_slop")),
    "cpSpaceSetCollisionBias": ("void(*)(cpSpace *, cpFloat)", _setter("collision_bias")),
    "cpSpaceStep": ("void(*)(cpSpace *, cpFloat)", pymunk.Space.step),
    "cpSpaceAddBody": ("cpBody *(*)(cpSpace *, cpBody *)", pymunk.Space.add),
    "cpSpaceAddShape": ("cpShape *(*)(cpSpace *, cpShape *)", pymunk.Space.add),
    "cpSpaceRemoveBody": ("void(*)(cpSpace *, cpBody *)", pymunk.Space.remove),
    "cpSpaceRemoveShape": ("void(*)(cpSpace *, cpShape *)", pymunk.Space.remove),
    "cpBodyGetSpace": ("cpSpace *(*)(cpBody *)", lambda body: body.space or 0),
    "cpBodySetPosition": ("void(*)(cpBody *, cpVect)", _setter("position")),
    "cpBodySetAngle": ("void(*)(cpBody *, cpFloat)", _setter("angle")),
    "cpBodySetVelocity": ("void(*)(cpBody *, cpVect)", _setter("velocity")),
    "cpBodySetAngularVelocity": ("void(*)(cpBody *, cpFloat)", _setter("angular_velocity")),
    "cpBodyGetPosition": ("cpVect(*)(cpBody *)", attrgetter("position")),
    "cpBodyGetAngle": ("cpFloat(*)(cpBody *)", attrgetter("angle")),
    "cpBodyGetVelocity": ("cpVect(*)(cpBody *)", attrgetter("velocity")),
    "cpBodyUpdatePosition": ("void(*)(cpBody *, cpFloat)", pymunk.Body.update_position),
}
"""Chipmunk's functions that compiled code calls, in the order of their addresses: the C type of each, and its
equivalent in pymunk's public interface."""

FIRST = KEEP + 1

(_NEW_SPACE, _FREE_SPACE, _SET_SLOP, _SET_BIAS, _STEP, _ADD_BODY, _ADD_SHAPE) = range(FIRST, FIRST + 7)
(_REMOVE_BODY, _REMOVE_SHAPE, _SPACE_OF, _SET_POSITION, _SET_ANGLE, _SET_VELOCITY) = range(FIRST + 7, FIRST + 13)
(_SET_SPIN, _GET_POSITION, _GET_ANGLE, _GET_VELOCITY, _UPDATE_POSITION) = range(FIRST + 13, FIRST + 18)
"""Indices of the functions in the addresses."""

END = FIRST + len(FUNCTIONS)  # index of the first address that differs between the worlds of a process


@jit_no_alloc
def move_bodies(block: ByteArray, addresses: IntArray) -> None:
    """Move all bodies of a block for a control step.

    Chipmunk moves robots that may touch something, except those that `contacts` moves as Chipmunk would; others move in
    straight lines. With no robot in the space, no physics step is taken. The cell list is valid before and after.
    """
    swarm = swarm_at(block)
    scene, robots = swarm.scene[0], swarm.robots
    fastest_cm_s = find_contact_candidates(block)
    for number in range(len(robots)):
        robot = robots[number]
        if robot.in_space and not robot.may_touch:
            _leave(swarm, addresses, number)
        if robot.may_touch:
            _enter(swarm, addresses, number)
    inside = 0
    for index in range(len(robots)):
        if robots[swarm.members[index].robot].may_touch:
            swarm.numbers[inside] = index
            inside += 1
    candidates = inside
    for step in range(scene.physics_steps if candidates > 0 else 0):
        if scene.touch and step > 0 and inside < len(robots):
            inside = _bring_in(block, addresses, candidates, inside, fastest_cm_s, step)
        call_c(addresses[_STEP], addresses[SPACE], scene.physics_s)
    for index in range(inside):
        number = swarm.members[swarm.numbers[index]].robot
        body = addresses[scene.bodies + 2 * number]
        robots[number].x, robots[number].y = vector_from_c(addresses[_GET_POSITION], body)
        robots[number].heading = double_from_c(addresses[_GET_ANGLE], body)
    for movable in range(scene.circles - scene.first_movable):
        body = addresses[scene.movables + movable]
        circle = swarm.circles[scene.first_movable + movable]
        circle.x, circle.y = vector_from_c(addresses[_GET_POSITION], body)
    move_others(block)
    sort_into_cells(block)


@jit_inline
def _bring_in(
    block: ByteArray, addresses: IntArray, candidates: int, inside: int, fastest_cm_s: float, past: int
) -> int:
    """Bring robots into the space that may be touched by one that comes too far, or by one brought in before.

    The list has `candidates` robots, then those that were brought in, `inside` in all; return its new length.
    """
    swarm = swarm_at(block)
    first, path_cm = swarm.scene[0].bodies, fastest_cm_s * past * swarm.scene[0].physics_s + PUSHED_CM
    index = 0
    while index < inside:
        start = swarm.members[swarm.numbers[index]]
        body = addresses[first + 2 * start.robot]
        x, y = vector_from_c(addresses[_GET_POSITION], body)
        vx, vy = vector_from_c(addresses[_GET_VELOCITY], body)
        speed_cm_s = hypot(vx, vy)
        ahead_cm = max(speed_cm_s - fastest_cm_s, 0.0) * swarm.scene[0].physics_s
        if hypot(x - start.x, y - start.y) + ahead_cm > path_cm or index >= candidates:
            entered, inside = inside, add_reached(block, inside, x, y, speed_cm_s + fastest_cm_s, past)
            for entering in range(entered, inside):
                _enter(swarm, addresses, swarm.members[swarm.numbers[entering]].robot)
        index += 1
    return inside


@jit_no_alloc
def _enter(swarm: Swarm, addresses: IntArray, number: int) -> None:
    """Put a robot into the space unless it is there, and give its body, or its wheels' drive, the robot's velocities.

    Its shape enters where its body was last, which decides on the order in which Chipmunk finds contacts.
    """
    scene, robot = swarm.scene[0], swarm.robots[number]
    body = addresses[scene.bodies + 2 * number]
    if not robot.in_space:
        call_c(addresses[_ADD_BODY], addresses[SPACE], body)
        call_c(addresses[_ADD_SHAPE], addresses[SPACE], addresses[scene.bodies + 2 * number + 1])
        call_c(addresses[_SET_POSITION], body, robot.x, robot.y)
        call_c(addresses[_SET_ANGLE], body, robot.heading)
        robot.in_space = True
    driven = body if scene.drives < 0 else addresses[scene.drives + number]
    call_c(addresses[_SET_VELOCITY], driven, robot.vx, robot.vy)
    call_c(addresses[_SET_SPIN], body, robot.spin)


@jit_inline
def _leave(swarm: Swarm, addresses: IntArray, number: int) -> None:
    first = swarm.scene[0].bodies + 2 * number
    call_c(addresses[_REMOVE_SHAPE], addresses[SPACE], addresses[first + 1])
    call_c(addresses[_REMOVE_BODY], addresses[SPACE], addresses[first])
    swarm.robots[number].in_space = False


@jit_no_alloc
def place(block: ByteArray, addresses: IntArray) -> None:
    """Create a new space (none is used twice: viblo/pymunk#181); all robots are at rest where they are, outside it."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    surfaces = addresses[scene.surfaces : scene.surfaces + scene.surface_count]
    if addresses[SPACE] != 0:
        for shape in surfaces:
            call_c(addresses[_REMOVE_SHAPE], addresses[SPACE], shape)
        call_c(addresses[_REMOVE_BODY], addresses[SPACE], addresses[GROUND])
    for number in range(len(swarm.robots)):
        _rest(swarm, addresses, number)
    if addresses[SPACE] != 0:
        call_c(addresses[_FREE_SPACE], addresses[SPACE])
    addresses[SPACE] = pointer_from_c(addresses[_NEW_SPACE])
    call_c(addresses[_SET_SLOP], addresses[SPACE], SLOP_CM)
    call_c(addresses[_SET_BIAS], addresses[SPACE], 0.0)  # an overlap is gone after one physics step
    call_c(addresses[_ADD_BODY], addresses[SPACE], addresses[GROUND])
    for shape in surfaces:
        call_c(addresses[_ADD_SHAPE], addresses[SPACE], shape)
    sort_into_cells(block)


@jit_no_alloc
def rest(block: ByteArray, addresses: IntArray, number: int) -> None:
    """Put a robot at rest, as one that has touched nothing yet, and sort all robots into cells."""
    _rest(swarm_at(block), addresses, number)
    sort_into_cells(block)


@jit_no_alloc
def _rest(swarm: Swarm, addresses: IntArray, number: int) -> None:
    """Put a body at rest like a new one, out of the space: its last place would change the order of contacts."""
    body, robot = addresses[swarm.scene[0].bodies + 2 * number], swarm.robots[number]
    if pointer_from_c(addresses[_SPACE_OF], body) != 0:
        _leave(swarm, addresses, number)
    call_c(addresses[_SET_VELOCITY], body, 0.0, 0.0)
    call_c(addresses[_SET_SPIN], body, 0.0)
    call_c(addresses[_UPDATE_POSITION], body, 0.0)  # clears the correction due to its last contact
    call_c(addresses[_SET_POSITION], body, 0.0, 0.0)
    call_c(addresses[_SET_ANGLE], body, 0.0)
    robot.in_space = False
    robot.vx, robot.vy, robot.spin = 0.0, 0.0, 0.0


_KINDS: dict[type, str] = {
    pymunk.PivotJoint: "Constraint",
    pymunk.Circle: "Shape",
    pymunk.Poly: "Shape",
    pymunk.Body: "Body",
}
"""Chipmunk's names of the parts of worlds, in the order in which they are taken out of a space."""


def _struct(thing: Thing) -> Any:
    return getattr(thing, f"_{_KINDS[type(thing)].lower()}")


def _value(pointer: Any) -> int:
    return int(ffi.cast("uintptr_t", pointer))


def address(thing: Thing) -> int:
    """Return the address of the C struct behind an object of pymunk."""
    return _value(_struct(thing))


def add_to_space(space: int, things: Iterable[Thing]) -> None:
    """Put things into the space at an address."""
    pointer = ffi.cast("cpSpace *", int(space))
    for thing in things:
        getattr(lib, f"cpSpaceAdd{_KINDS[type(thing)]}")(pointer, _struct(thing))


def take_from_space(space: int, things: Iterable[Thing]) -> None:
    """Remove the things that are in the space at an address from it: first joints, then shapes, then bodies."""
    pointer, every = ffi.cast("cpSpace *", int(space)), list(things)
    for kind in dict.fromkeys(_KINDS.values()):
        space_of, remove = getattr(lib, f"cp{kind}GetSpace"), getattr(lib, f"cpSpaceRemove{kind}")
        for thing in every:
            if _KINDS[type(thing)] == kind and space_of(_struct(thing)) == pointer:
                remove(pointer, _struct(thing))


def free_space(addresses: IntArray, parts: Callable[[], Iterable[Thing]]) -> None:
    """Free the space, if there is one, after removing the parts, which pymunk's objects free themselves."""
    if addresses[SPACE]:
        take_from_space(addresses[SPACE], parts())
        lib.cpSpaceFree(ffi.cast("cpSpace *", int(addresses[SPACE])))
        addresses[SPACE] = 0


@cache
def function_addresses() -> list[int]:
    """Return the addresses of Chipmunk's functions; raise AttributeError or TypeError if they or structs differ."""
    functions = {name: ffi.addressof(lib, name) for name in FUNCTIONS}
    if ffi.typeof("cpFloat") is not ffi.typeof("double"):
        raise TypeError("its numbers are no doubles")
    for name, (kind, _) in FUNCTIONS.items():
        found = ffi.typeof(functions[name])
        if found is not ffi.typeof(kind):
            raise TypeError(f"its function {name} is {found.cname}, not {kind}")
    body, other = pymunk.Body(1, 1), pymunk.Body(1, 1)
    for thing in (body, pymunk.Circle(body, 1), pymunk.Poly.create_box(body), pymunk.PivotJoint(body, other, (0, 0))):
        if ffi.typeof(_struct(thing)) is not ffi.typeof(f"cp{_KINDS[type(thing)]} *"):
            raise TypeError(f"its {type(thing).__name__} has another C struct")
    return list(map(_value, functions.values()))


@cache
def public_way() -> SimpleNamespace:
    """Return the functions of this module as plain Python, by pymunk's public interface."""

    def call(function: Callable[..., Any], *arguments: Any) -> Any:
        return function(*arguments)

    def add_to_space(space: pymunk.Space, things: Iterable[Thing]) -> None:
        for thing in things:  # at once, all bodies would enter first
            space.add(thing)

    names = dict.fromkeys(("call_c", "pointer_from_c", "double_from_c", "vector_from_c"), call) | {
        "address": lambda thing: thing,
        "function_addresses": lambda: [public for _, public in FUNCTIONS.values()],
        "add_to_space": add_to_space,
        "take_from_space": lambda space, things: space.remove(*things),
        "free_space": lambda *_: None,
        "swarm_at": open_block,
    }
    found: dict[str, Any] = {**globals(), **names}
    for name in found.keys() - names:
        function = getattr(found[name], "function", found[name])  # a kernel's, if it is one
        if isinstance(function, FunctionType) and function.__module__ == __name__:
            found[name] = FunctionType(function.__code__, found)
    return SimpleNamespace(**found)


@cache
def reason_for_public_way() -> str:
    """Return why compiled code cannot call this pymunk's Chipmunk, or "" if it can."""
    if sys.platform == "win32" or platform.machine().lower() not in {"x86_64", "amd64", "aarch64", "arm64"}:
        return f"compiled code does not know how {platform.system()} on {platform.machine()} passes C structs"
    try:
        function_addresses()
    except (AttributeError, TypeError) as error:  # which the private interface of another version may raise
        return str(error)
    return ""
