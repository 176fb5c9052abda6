"""The rigid bodies: robots, walls and obstacles in pymunk. No other module uses pymunk.

Contacts are hard, without bounce, and by default without friction: they never turn a robot (Enki). Wheels set the
bodies' velocities at the beginning of each control step, and changes made by contacts last until the next one. Thus a
robot that pushes one that holds still moves both at half its speed.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
import pymunk
import pymunk.batch
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import BodyFields

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.chipmunk import CALLS, advance_space
from epuck_sim.errors import EpuckSimError

WALL_CM = 50.0
"""Thickness of the walls in cm: far more than a robot can cover in one physics step."""

MARGIN_CM = 0.08
"""Margin in cm by which bodies are enlarged; overlaps of up to twice the margin are not corrected.

pymunk detects a contact only after bodies overlap, and two robots that meet head-on at full speed approach by 2.56 mm
in a physics step. Margins make it detect contacts 1.6 mm earlier, so that real bodies overlap by less than 1 mm, and
robots that press on something come to rest where their real surfaces touch.
"""

_POSES = BodyFields.POSITION | BodyFields.ANGLE
_VELOCITIES = BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY


class World:
    """The bodies of one trial; a space is never used for a second one (viblo/pymunk#181)."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading; updated by `advance`. Headings count full turns."""
    velocities: FloatArray
    """(robots, 3) cm/s, cm/s, rad/s: to be written before `advance`."""

    def __init__(self, arena: Arena, poses: FloatArray, friction: float, physics_hz: int) -> None:
        """Put robots at (robots, 3) `poses` into the arena.

        Args:
            arena: The arena, in cm.
            poses: (robots, 3) cm, cm, rad: x, y, heading.
            friction: Coefficient between any two bodies that touch.
            physics_hz: Physics steps in a second.
        """
        self._space = space = pymunk.Space()
        space.collision_slop = 2 * MARGIN_CM
        space.collision_bias = 0.0  # an overlap is gone after one physics step
        self._step_s = 1.0 / physics_hz
        for shape in _walls(space.static_body, arena) + _obstacles(space.static_body, arena):
            shape.friction = friction**0.5  # pymunk multiplies the friction of the two that touch
            space.add(shape)
        for x, y, heading in poses.tolist():
            body = pymunk.Body(epuck.MASS_G, pymunk.moment_for_circle(epuck.MASS_G, 0, epuck.RADIUS_CM))
            body.position = x, y
            body.angle = heading
            disc = pymunk.Circle(body, epuck.RADIUS_CM + MARGIN_CM)
            disc.friction = friction**0.5
            space.add(body, disc)
        robots = len(poses)
        self._poses = pymunk.batch.Buffer()
        pymunk.batch.get_space_bodies(space, _POSES, self._poses)
        # The buffer keeps its place as long as the number of bodies does. Bodies come in the order they were added;
        # the static body, where it is listed, comes last.
        bodies = np.frombuffer(self._poses.float_buf()).reshape(-1, 3)
        self.poses = bodies[:robots]
        commands = np.zeros_like(bodies)
        self.velocities = commands[:robots]
        self._commands = pymunk.batch.Buffer()
        self._commands.set_float_buf(commands)
        self._batches = _batch(_VELOCITIES, self._commands), _batch(_POSES, self._poses)
        self._calls = _calls(space, *self._batches)

    def advance(self, steps: int) -> None:
        """Set the bodies' velocities and move the bodies for this number of physics steps.

        pymunk's `Space.step` would do no more than this: it also carries out what callbacks have asked for, and there
        are none.
        """
        advance_space(self._calls, steps, self._step_s)


def _batch(fields: BodyFields, buffer: pymunk.batch.Buffer) -> Any:
    """Return what pymunk's functions of one body take: which fields, and the buffer for them."""
    batch = ffi.new("pmBatchedData *")
    batch.fields, batch.floatArray, batch.intArray = fields.value, buffer._float_arr, buffer._int_arr
    return batch


def _calls(space: pymunk.Space, commands: Any, poses: Any) -> npt.NDArray[np.void]:
    """Return (1,) the record that `advance_space` takes, for batches of velocities and of poses."""
    calls = np.zeros(1, CALLS)
    calls["space"] = _pointer(space._space)
    calls["step"] = function_address("cpSpaceStep", "void(*)(cpSpace *, cpFloat)")
    calls["each_body"] = function_address("cpSpaceEachBody", "void(*)(cpSpace *, cpSpaceBodyIteratorFunc, void *)")
    calls["set_body"] = function_address("pmSpaceBodySetIteratorFuncBatched", "cpSpaceBodyIteratorFunc")
    calls["get_body"] = function_address("pmSpaceBodyGetIteratorFuncBatched", "cpSpaceBodyIteratorFunc")
    for name, read_or_written, batch in (("commands", "commands_read", commands), ("poses", "poses_written", poses)):
        calls[name] = _pointer(batch)
        calls[read_or_written] = _pointer(ffi.addressof(batch.floatArray, "num"))
    return calls


def _pointer(pointer: Any) -> int:
    """Return the address that a pointer of cffi holds."""
    return int(ffi.cast("uintptr_t", pointer))


def function_address(name: str, kind: str) -> int:
    """Return the address of one of Chipmunk's functions.

    Raises:
        EpuckSimError: this pymunk's function is of another kind than compiled code takes it for.
    """
    function = ffi.addressof(lib, name)
    if ffi.typeof(function) is not ffi.typeof(kind):
        raise EpuckSimError(
            f"pymunk {pymunk.version}: its function {name} is {ffi.typeof(function).cname}, not {kind}; "
            f"install pymunk 7.3"
        )
    return _pointer(function)


def _walls(body: pymunk.Body, arena: Arena) -> list[pymunk.Shape]:
    """Return four slabs around the floor that overlap at the corners."""
    width, height, out = arena.width_cm, arena.height_cm, WALL_CM
    slabs = [
        (-out, -out, 0, height + out),
        (width, -out, width + out, height + out),
        (-out, -out, width + out, 0),
        (-out, height, width + out, height + out),
    ]
    return [
        pymunk.Poly(body, [(left, low), (right, low), (right, high), (left, high)], radius=MARGIN_CM)
        for left, low, right, high in slabs
    ]


def _obstacles(body: pymunk.Body, arena: Arena) -> list[pymunk.Shape]:
    """Return the shapes of the arena's obstacles."""
    circles: list[pymunk.Shape] = [
        pymunk.Circle(body, radius + MARGIN_CM, offset=(x, y)) for x, y, radius in arena.circles.tolist()
    ]
    return circles + [
        pymunk.Poly(body, [(x, y) for x, y in corners.tolist()], radius=MARGIN_CM) for corners in arena.polygons
    ]
