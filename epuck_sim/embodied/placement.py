"""Placement of robots at the start: at given poses, on the grid of the physical experiments, or at random."""

import math
from itertools import product

import numpy as np

from epuck_sim import epuck
from epuck_sim.arena import Arena, clearance_cm
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.attendance import parked_poses
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import RobotGroup

GRID_SPACING_CM = 10.0
"""Distance between the points of the grid in cm (thesis 4.3.1)."""

GRID_HEADINGS = 8
"""Number of headings on the grid, multiples of 45 degrees (thesis 4.3.1)."""

MAX_DRAWS = 10_000
"""Number of random positions tried for a robot before the arena counts as full."""

_TOUCH_CM = 2 * epuck.RADIUS_CM
_CELL_CM = 8.0  # longer than that: who touches a robot is in its cell or in one of the eight around it
_TOLERANCE_CM = 1e-6


def place_robots(scenario: EmbodiedScenario, sequence: np.random.SeedSequence) -> FloatArray:
    """Return the poses at the start of a trial.

    Groups with given poses are placed first, then those on the grid, then those at random, so that none takes a place
    that another one needs.

    Args:
        scenario: The scenario with the arena and the groups.
        sequence: The seed sequence from which placements are drawn.

    Returns:
        (robots, 3) cm, cm, rad: x, y, heading; those that are not present are parked outside.

    Raises:
        ScenarioError: Robots do not fit, overlap, or stand in a wall or an obstacle.
    """
    arena = scenario.arena.build()
    random = np.random.default_rng(sequence)
    groups: list[FloatArray] = [np.empty((0, 3)) for _ in scenario.robots]
    for placement, place in (("poses", _at_given_poses), ("grid", _on_grid), ("random", _at_random)):
        for number, group in enumerate(scenario.robots):
            if group.present and group.placement == placement:
                groups[number] = place(group, f"{scenario.name}: robots.{number}", arena, np.vstack(groups), random)
    firsts = np.cumsum([0, *(group.count for group in scenario.robots)]).tolist()
    for number, group in enumerate(scenario.robots):
        if not group.present:
            groups[number] = parked_poses(np.arange(firsts[number], firsts[number + 1]))
    return np.vstack(groups)


def place_anew(arena: Arena, placed: FloatArray, random: np.random.Generator) -> tuple[float, float, float] | None:
    """Return a random pose of a robot away from walls, obstacles, movables and other robots; None if none is found.

    Args:
        arena: The arena, with its movables where they are.
        placed: (robots, 3) cm, cm, rad: poses of the others.
        random: Draws the pose.
    """
    place = _draw_free(arena, _TakenPlaces(placed), random)
    return None if place is None else (*place, 2 * math.pi * random.random())


def is_free(arena: Arena, placed: FloatArray, x: float, y: float) -> bool:
    """Return whether a robot at (x, y) overlaps no robot that is placed, no wall, no obstacle and no movable."""
    return _TakenPlaces(placed).is_free(x, y) and _is_clear(arena, x, y)


def _at_given_poses(
    group: RobotGroup, key: str, arena: Arena, placed: FloatArray, _: np.random.Generator
) -> FloatArray:
    """Return the poses that the scenario gives; raise ScenarioError if one is not free."""
    poses = np.array(group.poses, float)
    for number, (x, y, _heading) in enumerate(poses):
        gap = clearance_cm(arena, x, y) - epuck.RADIUS_CM
        if gap < -_TOLERANCE_CM:
            raise ScenarioError(
                f"{key}.poses.{number}: is [{x:g}, {y:g}], {-gap:.3g} cm into a wall, an obstacle or a movable; "
                f"allowed: at least {epuck.RADIUS_CM:g} cm away from them"
            )
        others = np.vstack([placed, poses[:number]])
        distances = np.hypot(others[:, 0] - x, others[:, 1] - y)
        if distances.size and distances.min() < _TOUCH_CM - _TOLERANCE_CM:
            other = others[distances.argmin()]
            raise ScenarioError(
                f"{key}.poses.{number}: is [{x:g}, {y:g}] and overlaps the robot at [{other[0]:g}, {other[1]:g}]; "
                f"allowed: at least {_TOUCH_CM:g} cm between centres"
            )
    return poses


def _on_grid(group: RobotGroup, key: str, arena: Arena, placed: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return free points of a grid of 10 cm, as far from the walls or farther, with headings in steps of 45 degrees."""
    xs, ys = (_grid_line(length) for length in (arena.width_cm, arena.height_cm))
    points = np.array([(x, y) for y in ys for x in xs])
    free = np.array([_is_free(arena, placed, x, y) for x, y in points])
    if free.sum() < group.count:
        raise ScenarioError(
            f"{key}.count: is {group.count}; allowed: up to {free.sum()}, the free points of the grid of "
            f"{len(xs)} x {len(ys)} in this arena; give fewer robots or a larger arena"
        )
    chosen = random.choice(points[free], group.count, replace=False)
    headings = random.integers(GRID_HEADINGS, size=group.count) * (2 * math.pi / GRID_HEADINGS)
    return np.column_stack([chosen, headings])


def _grid_line(length_cm: float) -> FloatArray:
    """Return the coordinates of the grid's points along one side of the arena."""
    points = max(1, math.floor(length_cm / GRID_SPACING_CM) - 1)
    steps: FloatArray = np.arange(points, dtype=float) - (points - 1) / 2
    return length_cm / 2 + GRID_SPACING_CM * steps


def _at_random(
    group: RobotGroup, key: str, arena: Arena, placed: FloatArray, random: np.random.Generator
) -> FloatArray:
    """Return uniform positions away from the walls, redrawn where bodies would overlap (Enki; thesis 3.3)."""
    poses = []
    taken = _TakenPlaces(placed)
    for robot in range(group.count):
        place = _draw_free(arena, taken, random)
        if place is None:
            raise ScenarioError(
                f"{key}.count: is {group.count}; no free place was found for robot {robot} in "
                f"{MAX_DRAWS} draws: random placement fills at most about half of the floor; give fewer robots, a "
                "larger arena, or poses"
            )
        taken.add(*place)
        poses.append((*place, 2 * math.pi * random.random()))
    return np.array(poses)


def _draw_free(arena: Arena, taken: "_TakenPlaces", random: np.random.Generator) -> tuple[float, float] | None:
    """Return a random place where a robot touches nothing; None if none is found."""
    width, height = arena.width_cm - 2 * epuck.RADIUS_CM, arena.height_cm - 2 * epuck.RADIUS_CM
    for _ in range(MAX_DRAWS):
        x = epuck.RADIUS_CM + width * random.random()
        y = epuck.RADIUS_CM + height * random.random()
        if taken.is_free(x, y) and _is_clear(arena, x, y):
            return x, y
    return None


class _TakenPlaces:
    """Places of robots in square cells, which are faster to search than one array: most are far away."""

    def __init__(self, placed: FloatArray) -> None:
        """Take the places of (robots, 3) poses."""
        self._cells: dict[tuple[int, int], list[tuple[float, float]]] = {}
        for x, y, _ in placed.tolist():
            self.add(x, y)

    def add(self, x: float, y: float) -> None:
        """Take a place."""
        self._cells.setdefault((int(x / _CELL_CM), int(y / _CELL_CM)), []).append((x, y))

    def is_free(self, x: float, y: float) -> bool:
        """Return whether a robot at (x, y) touches none of those whose places are taken."""
        column, row = int(x / _CELL_CM), int(y / _CELL_CM)
        for cell in product((column - 1, column, column + 1), (row - 1, row, row + 1)):
            for other_x, other_y in self._cells.get(cell, ()):
                dx, dy = other_x - x, other_y - y
                if dx * dx + dy * dy < _TOUCH_CM**2:
                    return False
        return True


def _is_free(arena: Arena, placed: FloatArray, x: float, y: float) -> bool:
    """Return whether a robot at (x, y) touches no robot that is placed, no wall and no obstacle."""
    dx, dy = placed[:, 0] - x, placed[:, 1] - y
    return bool((dx * dx + dy * dy >= _TOUCH_CM**2).all()) and _is_clear(arena, x, y)


def _is_clear(arena: Arena, x: float, y: float) -> bool:
    """Return whether a robot at (x, y) touches no wall and no obstacle."""
    return clearance_cm(arena, x, y) >= epuck.RADIUS_CM - _TOLERANCE_CM
