"""Robots at given poses in an arena, in a block of their own."""

from collections.abc import Sequence

from epuck_sim.arena import Arena
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.cells import cells_needed, sort_into_cells
from epuck_sim.embodied.layout import set_arena
from epuck_sim.embodied.sensors.camera import set_camera
from epuck_sim.embodied.sensors.flash_cone import set_cone
from epuck_sim.embodied.swarm import Swarm, make_block, open_block
from epuck_sim.scenario.robot_kind import RobotKind
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.scenario.signals import CameraSignal, ConeSignal
from epuck_sim.util.jit import jit_inline


class Scene:
    """An arena with groups of robots of some kind, and what they see rings with."""

    def __init__(self, groups: Sequence[RobotGroup], kind: RobotKind, arena: Arena) -> None:
        """Make the block; the robots have no places yet."""
        self.groups = groups
        robots, pixels = sum(group.count for group in groups), max(group.pixels for group in groups)
        self.block = make_block(
            {
                "robots": robots,
                "groups": len(groups),
                "cells": cells_needed(arena.width_cm, arena.height_cm, robots, kind.cell_cm) + 1,
                "members": robots,
                "circles": len(arena.circles),
                "edges": len(arena.edges),
                "pixels": pixels,
                "rays": sum(group.pixels for group in groups),
                "numbers": 2 * robots,
                "depths": pixels,
            }
        )
        self.swarm = open_block(self.block)
        self.swarm.scene[0].radius_cm = kind.radius_cm
        set_arena(self.swarm, arena, kind.cell_cm)
        first = ray = 0
        for group, section in zip(self.swarm.groups, groups, strict=True):
            group.first, group.count, group.pixels, group.ray = first, section.count, section.pixels, ray
            if isinstance(section.signal, CameraSignal):
                set_camera(group.camera, self.swarm.rays[ray : ray + section.pixels], section.camera, kind, 1.0)
            elif isinstance(section.signal, ConeSignal):
                set_cone(group.cone, section.signal)
            first, ray = first + section.count, ray + section.pixels


@jit_inline
def place_robots(swarm: Swarm, poses: FloatArray) -> None:
    """Put robots at (robots, 3) poses, cm, cm, rad, and sort them into cells."""
    for robot in range(len(swarm.robots)):
        record = swarm.robots[robot]
        record.x, record.y, record.heading = poses[robot, 0], poses[robot, 1], poses[robot, 2]
    sort_into_cells(swarm)
