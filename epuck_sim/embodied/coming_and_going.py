"""Takes robots out of the arena, and puts them back in, between two control steps."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from epuck_sim.control.interface import ACTUATORS
from epuck_sim.embodied.attendance import AbsentGroup, AbsentSwarm, parked_poses
from epuck_sim.embodied.camera_clock import CameraClock, forget_pictures
from epuck_sim.embodied.group import RobotGroupState, start_again
from epuck_sim.embodied.placement import Floor
from epuck_sim.embodied.radio import Radio, forget_pulses
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.swarm_arrays import SwarmArrays
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.robot_schedule import RobotScheduleEntry


def absent_swarm(swarm: SwarmArrays) -> AbsentSwarm:
    """Return what robots do that are not in the arena."""
    return AbsentSwarm(swarm.sensors.present, swarm.ring_commands, swarm.ring_on, swarm.wheels_cm_s, swarm.velocities)


def absent_group(group: RobotGroupState) -> AbsentGroup:
    """Return what robots of a group sense that are not in the arena."""
    senses, receiver = group.runner.arrays.senses, group.receiver
    waits = isinstance(receiver, CameraClock) and len(receiver.waiting) > 0
    return AbsentGroup(
        present=senses.present,
        infrared=senses.infrared,
        distance_mm=senses.distance_mm,
        pixels=group.sensing.pixels,
        waiting=receiver.waiting if waits else senses.camera,  # type: ignore[union-attr]
        camera=senses.camera,
        pulses=senses.pulses,
        messages=senses.messages,
    )


def show_present(swarm: SwarmArrays) -> None:
    """Write the poses that steps show: those of robots that are in the arena, and NaN for others."""
    swarm.shown_poses[:] = swarm.poses
    swarm.shown_poses[~swarm.sensors.present] = np.nan


def take_out(robots: Sequence[int], world: World, swarm: SwarmArrays, groups: Sequence[RobotGroupState]) -> None:
    """Take robots out of the arena: they forget all."""
    for robot in robots:
        world.move(robot, parked_poses(np.array([robot]))[0])
        swarm.sensors.present[robot] = False
        swarm.actuators[robot] = np.zeros(1, ACTUATORS)[0]
        group, row = _row(groups, robot)
        group.runner.memory.view(np.ndarray)[row] = np.zeros(1, group.runner.memory.dtype)[0]
        for rings in (swarm.ring_commands, swarm.ring_on, swarm.ring_before):
            rings[robot] = False


def put_in(
    entry: RobotScheduleEntry,
    world: World,
    swarm: SwarmArrays,
    groups: Sequence[RobotGroupState],
    sequence: Any,
    origin: str,
) -> None:
    """Put the robots of an entry into the arena that are not in it; their controllers start.

    Args:
        entry: The entry of the schedule.
        world: All bodies.
        swarm: The arrays of all robots.
        groups: All groups.
        sequence: Seed sequence from which places are drawn, for all robots of the entry in turn.
        origin: Begins error messages.

    Raises:
        ScenarioError: There is no free place, or a pose that is given is not free.
        RobotError: A controller raises at its start.
    """
    random = np.random.default_rng(sequence)
    present = swarm.sensors.present
    for number, robot in enumerate(entry.add):
        if present[robot]:
            continue
        others, floor = world.poses[present], Floor(swarm.arena, world.bodies.radius_cm)
        if entry.poses is None:
            pose = floor.draw_pose(others, random)
            if pose is None:
                raise ScenarioError(f"{origin}: no free place was found for robot {robot}")
        else:
            pose = entry.poses[number]
            if not floor.is_free(others, *pose[:2]):
                raise ScenarioError(
                    f"{origin}: robot {robot} cannot come to [{pose[0]:g}, {pose[1]:g}]: it would overlap a robot, a "
                    "wall, an obstacle or a movable; give a free place, or no poses"
                )
        world.move(robot, pose)
        present[robot] = True
        group, row = _row(groups, robot)
        start_again(group, row)
        if isinstance(group.receiver, Radio):
            forget_pulses(group.receiver, row)
        elif isinstance(group.receiver, CameraClock):
            forget_pictures(group.receiver, row)


def _row(groups: Sequence[RobotGroupState], robot: int) -> tuple[RobotGroupState, int]:
    """Return the group of a robot, and the robot's number in it."""
    group = next(group for group in groups if group.robots.start <= robot < group.robots.stop)
    return group, robot - group.robots.start
