"""The start of a trial: all randomness in it comes from its seed, and each part has random numbers of its own.

Robots are placed at given poses, on the grid of the physical experiments, or at random. Placed robots are listed by the
cells of the swarm's cell list. A cell is larger than a robot, so robots that touch a given one are in its cell or in
one of the eight around it. `Swarm.cells` holds the first robot of each cell, counted from 1, and the scratch numbers
the next one after each robot.
"""

import math

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray, WordArray
from epuck_sim.embodied.cells import cell_of, cells_around
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.epuck import GRID_SPACING_CM
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import members
from epuck_sim.util import generators
from epuck_sim.util.elementary import hypot
from epuck_sim.util.jit import jit, jit_no_alloc
from epuck_sim.util.rng import uniform
from epuck_sim.util.seeds import seed_words

PLACEMENT, INFRARED_NOISE, WHEEL_NOISE, CONTROLLERS, VARIATION, SIGNALS, FAULTS, SCHEDULE, SENSORS = range(9)
"""Spawn keys of the trial's seed: each has random numbers of its own, independent of those of all others."""


def draw_start(block: ByteArray, seed: int) -> None:
    """Set the generators and streams of a new swarm to their states at the start of the trial with this seed."""
    draw_all(block, seed_words(seed), np.empty(2 * generators.SEQUENCE_WORDS, np.uint64))


@jit_no_alloc
def draw_all(block: ByteArray, words: WordArray, scratch: WordArray) -> None:
    """Do what `draw_start` does; words: `seed_words` of the seed; scratch: (2 * `SEQUENCE_WORDS`,), overwritten."""
    swarm = swarm_at(block)
    scene, robots = swarm.scene[0], swarm.robots
    size = len(scratch) // 2
    trial, part = scratch[:size], scratch[size:]
    generators.begin_sequence(trial, words)
    for key in range(SIGNALS + 1):
        generators.spawn(part, trial, key)
        if key == PLACEMENT:
            generators.seed_pcg64(scene.placement_random, part)
        elif key == INFRARED_NOISE:
            generators.seed_sfc64(scene.noise_random, part)
        elif key == WHEEL_NOISE:
            generators.seed_sfc64(scene.slip_random, part)
        elif key == CONTROLLERS or (key == VARIATION and scene.robots_vary) or (key == SIGNALS and scene.signals_draw):
            factor = generators.DRAW_BEGIN
            for number in range(len(robots)):
                robot = robots[number]
                stream = robot.variation_random if key == VARIATION else robot.signal_random
                factor = generators.draw_row(robot.random if key == CONTROLLERS else stream, part, factor)


@jit_no_alloc
def vary(block: ByteArray) -> None:
    """Draw all factors in which robots differ, even if a spread is 0, each robot's from a stream of its own (4.4)."""
    swarm = swarm_at(block)
    spread, step_ms = swarm.scene[0].spread, swarm.scene[0].step_ms
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        random = robot.variation_random
        both = 1 + spread[0] * (2 * uniform(random) - 1)
        for wheel in range(2):
            robot.wheel_gain[wheel] = both * (1 + spread[1] * (2 * uniform(random) - 1))
        robot.clock_rate = 1 + spread[2] * (2 * uniform(random) - 1)
        robot.own_step_ms = step_ms * robot.clock_rate
        for sensor in range(len(robot.infrared_gain)):
            robot.infrared_gain[sensor] = 1 + spread[3] * (2 * uniform(random) - 1)


GRID_HEADINGS = 8  # number of headings on the grid, multiples of 45 degrees (thesis 4.3.1)
MAX_DRAWS = 10_000  # number of random positions tried for a robot before the arena counts as full

OUTSIDE_CM, APART_CM = -1e6, 1e3
"""x and y in cm at which the first robot is parked while it is not in the arena, farther away than any range; and
distance in cm between parked robots along each axis."""

TOLERANCE_CM = 1e-6  # largest overlap of bodies at given poses, cm: allows for rounding of poses that touch
PLACED = -1  # returned instead of a robot when all are placed


def parked_poses(robots: IntArray) -> FloatArray:
    """Return (n, 3) cm, cm, rad: where robots of these numbers are parked."""
    places = OUTSIDE_CM - APART_CM * robots
    return np.column_stack([places, places, np.zeros(len(robots))])


def parked(poses: FloatArray) -> FloatArray:
    """Return (..., robots, 3) poses with NaN, for robots not in the arena, replaced by the poses of parked robots."""
    return np.where(np.isnan(poses), parked_poses(np.arange(poses.shape[-2])), poses)


@jit_no_alloc
def clearance_cm(swarm: Swarm, x: float, y: float, circles: int) -> float:
    """Return the least distance, cm, of a point from walls, polygons and first `circles`; negative beyond or inside."""
    scene = swarm.scene[0]
    clearance: float = min(x, y, scene.width_cm - x, scene.height_cm - y)
    for index in range(circles):
        circle = swarm.circles[index]
        clearance = min(clearance, hypot(circle.x - x, circle.y - y) - circle.radius)
    index = 0
    while index < scene.edges:
        polygon, inside, outside, all_left = swarm.edges[index].polygon, -math.inf, math.inf, True
        while index < scene.edges and swarm.edges[index].polygon == polygon:
            edge = swarm.edges[index]
            along_x, along_y, to_x, to_y = edge.bx - edge.ax, edge.by - edge.ay, x - edge.ax, y - edge.ay
            length = hypot(along_x, along_y)
            outward = (along_y * to_x - along_x * to_y) / length
            all_left &= outward <= 0.0
            inside = max(inside, outward)
            share = min(max((to_x * along_x + to_y * along_y) / (length * length), 0.0), 1.0)
            outside = min(outside, hypot(to_x - share * along_x, to_y - share * along_y))
            index += 1
        clearance = min(clearance, inside if all_left else outside)
    return clearance


@jit_no_alloc
def _take(swarm: Swarm, robot: int) -> None:
    cell = cell_of(swarm.robots[robot], swarm.scene[0])
    swarm.numbers[robot] = swarm.cells[cell]
    swarm.cells[cell] = robot + 1


@jit_no_alloc
def is_free(swarm: Swarm, x: float, y: float, radius: float) -> bool:
    """Return whether a robot at (x, y) would overlap no placed robot, no wall, no obstacle and no movable."""
    near = cells_around(x, y, swarm.scene[0])
    for row in range(near.first_row, near.end_row):
        for column in range(near.first_column, near.last_column + 1):
            other = swarm.cells[row * swarm.scene[0].columns + column]
            while other > 0:
                taken = swarm.robots[other - 1]
                dx, dy, apart = taken.x - x, taken.y - y, taken.radius_cm + radius
                if dx * dx + dy * dy < apart * apart:
                    return False
                other = swarm.numbers[other - 1]
    return clearance_cm(swarm, x, y, swarm.scene[0].circles) >= radius - TOLERANCE_CM


@jit_no_alloc
def begin_placement(block: ByteArray) -> None:
    """Register the robots in the arena as placed; the others are parked far outside."""
    swarm = swarm_at(block)
    for cell in range(len(swarm.cells)):
        swarm.cells[cell] = 0
    for robot in range(len(swarm.robots)):
        if swarm.robots[robot].x > OUTSIDE_CM / 2:
            _take(swarm, robot)


@jit_no_alloc
def place_at_random(block: ByteArray, first: int, end: int) -> int:
    """Put robots at uniform free positions (Enki; thesis 3.3); return the first that finds no place, or `PLACED`."""
    swarm = swarm_at(block)
    scene, random = swarm.scene[0], swarm.scene[0].placement_random
    for number in range(first, end):
        robot, radius = swarm.robots[number], swarm.robots[number].radius_cm
        width, height = scene.width_cm - 2 * radius, scene.height_cm - 2 * radius
        is_placed = False
        for _ in range(MAX_DRAWS):
            x = radius + width * generators.next_double(random)
            y = radius + height * generators.next_double(random)
            if is_free(swarm, x, y, radius):
                is_placed = True
                robot.x, robot.y = x, y
                robot.heading = 2 * math.pi * generators.next_double(random)
                _take(swarm, number)
                break
        if not is_placed:
            return number
    return PLACED


@jit
def place_on_grid(block: ByteArray, first: int, end: int) -> int:
    """Put robots on free points of a grid; return the number of free points, if there are too few, or `PLACED`."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    columns, rows = _grid_points(scene.width_cm), _grid_points(scene.height_cm)
    free = np.empty(columns * rows, np.int64)
    found = 0
    for point in range(columns * rows):
        x = _grid_coordinate(scene.width_cm, columns, point % columns)
        y = _grid_coordinate(scene.height_cm, rows, point // columns)
        free[found] = point
        found += is_free(swarm, x, y, swarm.robots[first].radius_cm)
    count = end - first
    if found < count:
        return found
    chosen = np.empty(count, np.int64)
    generators.choose(chosen, np.empty(found, np.int64), scene.placement_random)
    for row in range(count):
        point, robot = free[chosen[row]], swarm.robots[first + row]
        robot.x = _grid_coordinate(scene.width_cm, columns, point % columns)
        robot.y = _grid_coordinate(scene.height_cm, rows, point // columns)
        _take(swarm, first + row)
    for row in range(count):
        heading = generators.integer_between(0, GRID_HEADINGS, scene.placement_random)
        swarm.robots[first + row].heading = heading * (2 * math.pi / GRID_HEADINGS)
    return PLACED


@jit_no_alloc
def _grid_points(length_cm: float) -> int:
    points: int = max(1, math.floor(length_cm / GRID_SPACING_CM) - 1)
    return points


@jit_no_alloc
def _grid_coordinate(length_cm: float, points: int, point: int) -> float:
    return length_cm / 2 + GRID_SPACING_CM * (point - (points - 1) / 2)


def put_at_given_poses(swarm: Swarm, scenario: EmbodiedScenario) -> None:
    """Put robots at their given poses, which depend on no seed, and park all others far outside."""
    robots = swarm.robots
    robots["x"], robots["y"], _ = parked_poses(np.arange(len(robots))).T
    for number, group, numbers in members(scenario.robots):
        radius_cm = scenario.group_kinds[number].radius_cm
        for row, (x, y, heading) in enumerate(group.poses or () if group.present else ()):
            key = f"{scenario.name}: robots.{number}.poses.{row}: is [{x:g}, {y:g}]"
            gap = clearance_cm(swarm, float(x), float(y), swarm.scene[0].circles) - radius_cm
            if gap < -TOLERANCE_CM:
                said = f"{-gap:.3g} cm into a wall, an obstacle or a movable"
                raise ScenarioError(f"{key}, {said}; allowed: at least {radius_cm:g} cm away from them")
            apart_cm = robots["radius_cm"] + radius_cm
            gaps_cm = np.sqrt((robots["x"] - x) ** 2 + (robots["y"] - y) ** 2) - apart_cm
            nearest = gaps_cm.argmin()
            if scenario.contact.robots and gaps_cm[nearest] < -TOLERANCE_CM:
                other = f"the robot at [{robots['x'][nearest]:g}, {robots['y'][nearest]:g}]"
                allowed = f"at least {apart_cm[nearest]:g} cm between centres"
                raise ScenarioError(f"{key} and overlaps {other}; allowed: {allowed}")
            robots[["x", "y", "heading"]][numbers.start + row] = x, y, heading


def draw_places(block: ByteArray, scenario: EmbodiedScenario) -> None:
    """Draw places on the grid, and at random, for the other robots; raise ScenarioError if they do not fit."""
    begin_placement(block)
    groups = [each for each in members(scenario.robots) if each[1].present and each[1].count]
    for number, group, robots in groups:
        if group.placement == "grid" and (free := place_on_grid(block, robots.start, robots.stop)) != PLACED:
            columns, rows = _grid_points(scenario.arena.width_cm), _grid_points(scenario.arena.height_cm)
            allowed = f"up to {free}, the free points of the grid of {columns} x {rows} in this arena"
            said = f"robots.{number}.count: is {group.count}; allowed: {allowed}"
            raise ScenarioError(f"{scenario.name}: {said}; give fewer robots or a larger arena")
    for number, group, robots in groups:
        if group.placement == "random" and (robot := place_at_random(block, robots.start, robots.stop)) != PLACED:
            said = f"no free place was found for robot {robot - robots.start} in {MAX_DRAWS} draws"
            why = "random placement fills at most about half of the floor; give fewer robots, a larger arena, or poses"
            raise ScenarioError(f"{scenario.name}: robots.{number}.count: is {group.count}; {said}: {why}")
