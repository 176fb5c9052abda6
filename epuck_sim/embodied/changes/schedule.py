"""Parts of a schedule of robots: new walls, displaced phases, and scheduled faults."""

import math
from collections.abc import Sequence

import numpy as np

from epuck_sim.embodied.bodies.contacts import MARGIN_CM
from epuck_sim.embodied.controllers import GroupControllers
from epuck_sim.embodied.placement import clearance_cm
from epuck_sim.embodied.swarm import Swarm
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.changes import RobotDisplacement

DEEPEST_CM = 2 * MARGIN_CM
"""How far a body may reach into new walls and obstacles, cm: as far as bodies may overlap that press on each other."""


def check_bodies_outside(swarm: Swarm, origin: str) -> None:
    """Raise ScenarioError, which begins with `origin`, if a robot or a movable is in a wall or an obstacle."""
    scene, robots = swarm.scene[0], swarm.robots
    bodies = [(f"robot {robot}", robots[robot], robots[robot].radius_cm) for robot in np.flatnonzero(robots.present)]
    movables = swarm.circles[scene.first_movable : scene.circles]
    bodies += [(f"movable {number}", circle, circle.radius) for number, circle in enumerate(movables)]
    for name, place, radius_cm in bodies:
        overlap_cm = radius_cm - clearance_cm(swarm, float(place.x), float(place.y), scene.first_movable)
        if overlap_cm > DEEPEST_CM:
            raise ScenarioError(
                f"{origin}: {name} at [{place.x:.4g}, {place.y:.4g}] would be {overlap_cm:.3g} cm into a wall or an "
                "obstacle; change the arena where, and when, no body is"
            )


def displace_phases(
    swarm: Swarm,
    controllers: Sequence[GroupControllers],
    displacement: RobotDisplacement,
    sequence: np.random.SeedSequence,
) -> None:
    """Displace phases, and command rings dark; random ones are drawn for all robots, whoever is displaced."""
    robots = np.arange(len(swarm.robots))
    drawn = np.random.Generator(np.random.SFC64(sequence)).random(len(robots))
    is_displaced = np.isin(robots, robots if displacement.robots is None else displacement.robots)
    by_cycles = displacement.by_cycles
    for group in controllers:
        if not group.controller.is_oscillator:
            continue
        phase_ms, period_ms = group.memory["phase_ms"], group.period_ms
        if isinstance(by_cycles, str):
            displaced = drawn[group.robots] * period_ms
        else:
            ahead_ms = np.round(by_cycles * period_ms, 6)  # 1450 ms, not 1449.9999999999998, for whole phases
            displaced = (phase_ms + ahead_ms) % period_ms
        rows = is_displaced[group.robots]
        phase_ms[rows] = displaced[rows]
        swarm.robots.actuators.ring_on[group.robots][rows] = 0


def begin_or_end(swarm: Swarm, fault: int, *, begins: bool, time_ms: float) -> None:
    """Have a scheduled fault begin, or end, in the control step at this time, in all robots that may have it."""
    affected = swarm.affected.reshape(len(swarm.faults), -1)[fault]
    is_active = affected.is_active
    will_be = is_active ^ (affected.change_ms <= time_ms)  # where an entry before has had it begin, or end
    concerned = affected.is_member & (will_be != begins)
    affected.change_ms[concerned] = np.where(is_active[concerned] != begins, time_ms, math.inf)
