"""Robots in an arena as observers see them: those of a simulation, or others at given poses."""

from collections.abc import Sequence
from typing import NamedTuple

from epuck_sim.arena import Arena
from epuck_sim.arrays import ByteArray, FloatArray
from epuck_sim.embodied.cells import cells_needed, sort_into_cells
from epuck_sim.embodied.layout import set_arena, set_bodies, set_signal
from epuck_sim.embodied.swarm import Swarm, make_block, open_block
from epuck_sim.scenario.embodied import TimingSection
from epuck_sim.scenario.robot_kind import RobotKind, cell_cm
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.jit import jit_inline


class Scene(NamedTuple):
    """An arena with groups of robots, and what they see rings with."""

    groups: Sequence[RobotGroup]
    block: ByteArray
    """The swarm; observers write poses, cells and scratch numbers."""
    swarm: Swarm
    """The arrays of the block."""


def make_scene(groups: Sequence[RobotGroup], kinds: Sequence[RobotKind], arena: Arena) -> Scene:
    """Return a scene in a block of its own, with robots, of each group's kind, which have no places yet."""
    robots, pixels = sum(group.count for group in groups), [group.pixels for group in groups]
    block = make_block(
        {
            "robots": robots,
            "groups": len(groups),
            "cells": cells_needed(arena.width_cm, arena.height_cm, robots, cell_cm(kinds)) + 1,
            "members": robots,
            "circles": len(arena.circles),
            "edges": len(arena.edges),
            "rays": sum(pixels),
            "numbers": 2 * robots,
            "depths": max(pixels),
        }
    )
    swarm = open_block(block)
    set_bodies(swarm, [kind for kind, group in zip(kinds, groups, strict=True) for _ in range(group.count)])
    set_arena(swarm, arena, cell_cm(kinds))
    first = ray = 0
    for group, section, kind in zip(swarm.groups, groups, kinds, strict=True):
        group.first, group.count, group.pixels, group.ray = first, section.count, section.pixels, ray
        set_signal(swarm, group, section, kind, TimingSection())
        first, ray = first + section.count, ray + section.pixels
    return Scene(groups, block, swarm)


@jit_inline
def place_robots(swarm: Swarm, poses: FloatArray) -> None:
    """Put robots at (robots, 3) poses, cm, cm, rad, and sort them into cells."""
    for robot in range(len(swarm.robots)):
        record = swarm.robots[robot]
        record.x, record.y, record.heading = poses[robot, 0], poses[robot, 1], poses[robot, 2]
    sort_into_cells(swarm)
