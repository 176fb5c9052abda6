"""Walls and obstacles that change while a trial of robots runs, around bodies that stay where they are."""

import numpy as np

from epuck_sim.arena import Arena, clearance_cm, without_movables
from epuck_sim.embodied.bodies.contact_candidates import MARGIN_CM
from epuck_sim.embodied.swarm import Swarm
from epuck_sim.errors import ScenarioError

DEEPEST_CM = 2 * MARGIN_CM
"""How far a body may reach into new walls and obstacles, cm: as far as bodies may overlap that press on each other."""


def check_bodies_outside(swarm: Swarm, arena: Arena, origin: str) -> None:
    """Raise ScenarioError if a robot or a movable would be in a wall or an obstacle, or beyond the walls.

    Args:
        swarm: Where robots and movables are now.
        arena: The new arena.
        origin: Begins the message: what changes the arena, and when.
    """
    fixed, scene, robots = without_movables(arena), swarm.scene[0], swarm.robots
    bodies = [(f"robot {robot}", robots[robot], scene.radius_cm) for robot in np.flatnonzero(robots.present)]
    movables = swarm.circles[scene.first_movable : scene.circles]
    bodies += [(f"movable {number}", circle, circle.radius) for number, circle in enumerate(movables)]
    for name, place, radius_cm in bodies:
        overlap_cm = radius_cm - clearance_cm(fixed, float(place.x), float(place.y))
        if overlap_cm > DEEPEST_CM:
            raise ScenarioError(
                f"{origin}: {name} at [{place.x:.4g}, {place.y:.4g}] would be {overlap_cm:.3g} cm into a wall or an "
                "obstacle; change the arena where, and when, no body is"
            )
