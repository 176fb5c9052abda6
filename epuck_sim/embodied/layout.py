"""Makes the block of a scenario's swarm, with all that does not depend on a trial's seed."""

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import ByteArray
from epuck_sim.control.interface import Controller, Sensor
from epuck_sim.embodied.cells import count_cells, set_cells
from epuck_sim.embodied.changes.faults import LOGGED_STEPS
from epuck_sim.embodied.own_sensors import assign_sense, sensed_bytes
from epuck_sim.embodied.sensors.camera import set_camera
from epuck_sim.embodied.sensors.infrared import set_infrared
from epuck_sim.embodied.sensors.signals import set_signal, slots_of
from epuck_sim.embodied.swarm import Swarm, group_of, make_block, open_block
from epuck_sim.embodied.user_code import assign_bytes, bytes_needed
from epuck_sim.faults import set_faults
from epuck_sim.scenario.embodied import EmbodiedScenario, SpreadSection, TimingSection, arena_after, arena_entries
from epuck_sim.scenario.robot_kind import RobotKind, cell_cm
from epuck_sim.scenario.robots import CameraSignal, RobotGroup, members


def make_swarm_block(
    scenario: EmbodiedScenario, controllers: Sequence[Controller], sensors: Sequence[Sequence[Sensor]]
) -> tuple[ByteArray, Swarm, list[Arena]]:
    """Return the block of a swarm before its first trial, its arrays, and the arenas that it has room for.

    Robots have no places yet, and nothing is drawn. The last result is cached, and the block returned is a copy: most
    simulations are of the same scenario as the one before.
    """
    made_from = scenario, controllers, sensors
    if _last.get("from") != made_from or scenario.arena.floor.picture is not None:  # whose file may have changed
        later = (arena_after(scenario, entry).build() for entry in arena_entries(scenario))
        arenas = [scenario.arena.build(), *later]
        block = make_block(_lengths(scenario, arenas, controllers, sensors))
        swarm = open_block(block)
        furnish(swarm, scenario.robots, scenario.group_kinds, arenas[0], scenario.timing)
        _set_scene(swarm, scenario, arenas[0])
        _set_groups(swarm, scenario, controllers, sensors)
        set_faults(swarm.faults, scenario.faults, scenario.sensor_names)
        swarm.scene[0].hides_flashes = any(section.changes == "flashes" for section in scenario.faults)
        _last.update({"from": made_from, "block": block, "arenas": arenas})
    block = _last["block"].copy()
    return block, open_block(block), _last["arenas"]


_last: dict[str, Any] = {}


def room_for(groups: Sequence[RobotGroup], kinds: Sequence[RobotKind], arenas: Sequence[Arena]) -> dict[str, int]:
    """Return the lengths of scratch arrays and of those that `furnish` fills, with room for all arenas."""
    robots, pixels = sum(group.count for group in groups), max(group.pixels for group in groups)
    least_cm = cell_cm(kinds)
    return {
        "robots": robots,
        "groups": len(groups),
        "cells": max(math.prod(count_cells(each.width_cm, each.height_cm, robots, least_cm)) for each in arenas) + 1,
        "members": robots,
        "circles": max(len(arena.circles) for arena in arenas),
        "edges": max(len(arena.edges) for arena in arenas),
        "rays": sum(group.pixels for group in groups),
        "numbers": 3 * robots + 2 * pixels,
        "depths": 3 * pixels,
    }


def furnish(
    swarm: Swarm, groups: Sequence[RobotGroup], kinds: Sequence[RobotKind], arena: Arena, timing: TimingSection
) -> None:
    """Write to a swarm an arena and groups of robots with their kinds: their bodies, and how flashes reach them."""
    set_bodies(swarm, [kind for kind, group in zip(kinds, groups, strict=True) for _ in range(group.count)])
    set_arena(swarm, arena, cell_cm(kinds))
    ray = 0
    for group, (_, section, robots), kind in zip(swarm.groups, members(groups), kinds, strict=True):
        group.first, group.count, group.pixels, group.ray = robots.start, section.count, section.pixels, ray
        ray += section.pixels
        if isinstance(section.signal, CameraSignal):
            set_camera(group.camera, swarm.rays[group.ray : ray], section.camera, kind, timing.control_hz)
        else:
            set_signal(group, section.signal, kind.camera_forward_cm, timing.step_ms)


def _lengths(
    scenario: EmbodiedScenario,
    arenas: Sequence[Arena],
    controllers: Sequence[Controller],
    sensors: Sequence[Sequence[Sensor]],
) -> dict[str, int]:
    groups, faults = scenario.robots, len(scenario.faults)
    own = [(each, group.count) for group, listed in zip(groups, sensors, strict=True) for each in listed]
    # of the swarm: imperfections, faults; of a group: sensors, controllers, faults
    most_calls = 7 + 9 * len(groups) + len(own)
    return {
        **room_for(groups, scenario.group_kinds, arenas),
        "calls": most_calls,
        "pixels": sum(group.pictures * group.count * group.pixels for group in groups),
        "air": sum(slots_of(group.signal, scenario.timing.step_ms) * group.count for group in groups),
        "faults": faults,
        "affected": faults * scenario.population,
        "log": LOGGED_STEPS * faults * scenario.population,
        "patches": len(arenas[0].floor.patches),
        "patch_edges": len(arenas[0].floor.edges),
        "lamps": len(arenas[0].lamps),
        "picture": arenas[0].floor.picture.size,
        "senses": len(own),
        "sensed": sum(itertools.starmap(sensed_bytes, own)),
        "bytes": sum(bytes_needed(each, group.count) for group, each in zip(groups, controllers, strict=True)),
    }


def _set_scene(swarm: Swarm, scenario: EmbodiedScenario, arena: Arena) -> None:
    """Write what all robots share, floor and lamps, which no schedule changes, and all in which robots begin alike."""
    scene, floor, timing, stuck, spread = swarm.scene[0], arena.floor, scenario.timing, scenario.stuck, scenario.spread
    values = {
        "step": -1,
        "serving": -1,
        "drives": -1,
        "step_ms": timing.step_ms,
        "step_s": timing.step_ms / 1000,
        "physics_steps": timing.physics_hz // timing.control_hz,
        "physics_s": 1.0 / timing.physics_hz,
        "touch": scenario.contact.robots,
        "slip": scenario.noise.wheel_speed,
        "infrared_noise": scenario.noise.infrared_counts > 0,
        "clocks_differ": spread.clock_rate > 0,
        "mean_free_s": 3600 / stuck.per_hour if stuck.per_hour > 0 else math.inf,
        "mean_stuck_s": stuck.mean_s,
        "robots_vary": spread != SpreadSection() or stuck.per_hour > 0,
        "signals_draw": any(group.signal_is_random for group in scenario.robots),
        "spread": (spread.wheel_speed, spread.wheel_imbalance, spread.clock_rate, spread.infrared_gain),
        "brightness": floor.brightness,
        "picture_rows": floor.picture.shape[0],
        "picture_columns": floor.picture.shape[1],
    }
    for name, value in values.items():
        scene[name] = value
    swarm.picture[:] = floor.picture.ravel()
    swarm.patches[:] = floor.patches
    edges, lamps, robots = swarm.patch_edges, swarm.lamps, swarm.robots
    edges.ax, edges.ay, edges.bx, edges.by = floor.edges.T
    lamps.x, lamps.y, lamps.height, lamps.strength = arena.lamps.T
    robots.number = np.arange(len(robots))
    robots.present = scenario.present
    robots.wheel_gain = robots.clock_rate = robots.infrared_gain = 1.0
    robots.own_step_ms = robots.sensors.step_ms = timing.step_ms
    robots.sensors.new_picture = True
    robots.is_stuck = stuck.per_hour > 0  # until time 0, when all are freed
    robots.starts_anew_at = -1.0


def set_bodies(swarm: Swarm, kinds: Sequence[RobotKind]) -> None:
    """Write to a swarm the radius, mass and wheels of its robots, given the kind of each."""
    for name in ("radius_cm", "mass_g", "wheel_limit_cm_s", "wheel_base_cm"):
        swarm.robots[name] = [getattr(kind, name) for kind in kinds]
    swarm.scene[0].largest_cm = swarm.robots.radius_cm.max()


def set_arena(swarm: Swarm, arena: Arena, least_cm: float) -> None:
    """Write walls, obstacles and movables to a swarm with room for them; least_cm: least side of a cell."""
    scene = swarm.scene[0]
    scene.circles, scene.edges, scene.first_movable = len(arena.circles), len(arena.edges), arena.first_movable
    circles, edges = swarm.circles[: len(arena.circles)], swarm.edges[: len(arena.edges)]
    circles.x, circles.y, circles.radius = arena.circles.T
    edges.ax, edges.ay, edges.bx, edges.by = arena.edges.T
    edges.polygon = [number for number, corners in enumerate(arena.polygons) for _ in corners]
    set_cells(swarm, arena.width_cm, arena.height_cm, least_cm)


def _set_groups(
    swarm: Swarm, scenario: EmbodiedScenario, controllers: Sequence[Controller], sensors: Sequence[Sequence[Sensor]]
) -> None:
    """Write the places of all that robots of each group have in the block, and of the reference's phase."""
    row, pulses, byte, sense, sensed = 0, 0, 0, 0, 0
    later = sum(section.count * section.pixels for section in scenario.robots)  # behind all rows that controllers read
    sections = zip(swarm.groups, scenario.robots, scenario.group_kinds, controllers, sensors, strict=True)
    for group, section, kind, controller, listed in sections:
        rows = section.count * section.pixels
        group.row, group.in_view, group.waiting = row, row, row
        if section.pictures > 1:
            group.in_view, group.waiting, later = later, later + rows, later + 2 * rows
        group.radio.first, group.sense = pulses, sense
        set_infrared(group.infrared, kind, section.infrared, scenario.noise.infrared_counts)
        byte = assign_bytes(swarm, group, controller, byte)
        row += rows
        pulses += group.radio.slots * section.count
        for name, sensor in zip(section.sensors, listed, strict=True):
            swarm.senses[sense].name = scenario.sensor_names.index(name)
            sensed = assign_sense(swarm.senses[sense], sensor, group.first, group.count, sensed)
            sense += 1
    scene, robot = swarm.scene[0], scenario.stop.reference_robot
    group = swarm.groups[group_of(swarm, robot)]
    scene.reference, scene.lit_phase = robot if group.phase >= 0 else -1, math.nan
    scene.reference_phase = group.memory + (robot - group.first) * group.memory_bytes + group.phase
    scene.reference_is_float = group.phase_is_float
