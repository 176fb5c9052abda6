"""The slow twin of `World`: all robots are in pymunk's space, and pymunk's own methods move them."""

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.cell_list import sort_into_cells
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.scenario.robot_kind import EPUCK, RobotKind


class FullSpaceWorld(World):
    """A world in which every robot takes every physics step."""

    def __init__(
        self, arena: Arena, poses: FloatArray, friction: float, physics_hz: int, robot: RobotKind = EPUCK
    ) -> None:
        super().__init__(arena, poses, friction, physics_hz, robot=robot)
        for (body, disc), (x, y, heading) in zip(self._discs, poses.tolist(), strict=True):
            body.position, body.angle = (x, y), heading
            self._space.add(body, disc)

    def advance(self, steps: int) -> None:
        for (body, _), (x, y, turn) in zip(self._discs, self.velocities.tolist(), strict=True):
            body.velocity, body.angular_velocity = (x, y), turn
        for _ in range(steps):
            self._space.step(self.bodies.step_s)
        for pose, (body, _) in zip(self.poses, self._discs, strict=True):
            pose[:] = *body.position, body.angle
        sort_into_cells(self.poses, self.bodies.cells)
