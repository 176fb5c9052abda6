"""The rigid bodies: robots, walls and obstacles in pymunk. No other module uses pymunk.

Contacts are hard, without bounce, and by default without friction: they never turn a robot (Enki). Wheels set the
bodies' velocities at the beginning of each control step, and changes made by contacts last until the next one. Thus a
robot that pushes one that holds still moves both at half its speed.
"""

import numpy as np
import pymunk
import pymunk.batch
from pymunk.batch import BodyFields

from epuck_sim import epuck
from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray

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

    def advance(self, steps: int) -> None:
        """Set the bodies' velocities and move the bodies for this number of physics steps."""
        space, step, step_s = self._space, self._space.step, self._step_s
        pymunk.batch.set_space_bodies(space, _VELOCITIES, self._commands)
        for _ in range(steps):
            step(step_s)
        self._poses.clear()
        pymunk.batch.get_space_bodies(space, _POSES, self._poses)


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
