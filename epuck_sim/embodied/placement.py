"""Placement of robots at the start: at given poses, on the grid of the physical experiments, or at random."""

import math
from collections.abc import Iterable
from itertools import product
from typing import NamedTuple

import numpy as np

from epuck_sim.arena import Arena, clearance_cm
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.attendance import parked_poses
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robot_checks import GRID_SPACING_CM
from epuck_sim.scenario.robots import RobotGroup

GRID_HEADINGS = 8
"""Number of headings on the grid, multiples of 45 degrees (thesis 4.3.1)."""

MAX_DRAWS = 10_000
"""Number of random positions tried for a robot before the arena counts as full."""

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
    floor = Floor(scenario.arena.build(), scenario.robot.radius_cm)
    random = np.random.default_rng(sequence)
    taken = _TakenPlaces(floor.touch_cm)
    poses = parked_poses(np.arange(scenario.robot_count))
    firsts = np.cumsum([0, *(group.count for group in scenario.robots)]).tolist()
    for placement, place in (("poses", _at_given_poses), ("grid", _on_grid), ("random", _at_random)):
        for number, group in enumerate(scenario.robots):
            if group.present and group.placement == placement:
                found = place(group, f"{scenario.name}: robots.{number}", floor, taken, random)
                poses[firsts[number] : firsts[number + 1]] = found
    return poses


class Floor(NamedTuple):
    """The arena, and the robots for which there is to be room."""

    arena: Arena
    """With its movables where they are."""
    radius_cm: float
    """Radius of a robot."""

    @property
    def touch_cm(self) -> float:
        """Distance of the centres of two robots that touch."""
        return 2 * self.radius_cm

    def is_clear(self, x: float, y: float) -> bool:
        """Return whether a robot at (x, y) touches no wall, no obstacle and no movable."""
        return clearance_cm(self.arena, x, y) >= self.radius_cm - _TOLERANCE_CM

    def is_free(self, placed: FloatArray, x: float, y: float) -> bool:
        """Return whether a robot at (x, y) touches no robot that is placed, no wall, no obstacle and no movable."""
        dx, dy = placed[:, 0] - x, placed[:, 1] - y
        return bool((np.hypot(dx, dy) >= self.touch_cm - _TOLERANCE_CM).all()) and self.is_clear(x, y)

    def draw_place(self, taken: "_TakenPlaces", random: np.random.Generator) -> tuple[float, float] | None:
        """Return a random place where a robot touches nothing; None if none is found."""
        width, height = self.arena.width_cm - self.touch_cm, self.arena.height_cm - self.touch_cm
        for _ in range(MAX_DRAWS):
            x = self.radius_cm + width * random.random()
            y = self.radius_cm + height * random.random()
            if taken.is_free(x, y) and self.is_clear(x, y):
                return x, y
        return None

    def draw_pose(self, placed: FloatArray, random: np.random.Generator) -> tuple[float, float, float] | None:
        """Return a random pose at which a robot touches nothing, (robots, 3) poses of others; None if none is found."""
        taken = _TakenPlaces(self.touch_cm)
        for x, y, _ in placed.tolist():
            taken.add(x, y)
        place = self.draw_place(taken, random)
        return None if place is None else (*place, 2 * math.pi * random.random())


def _at_given_poses(
    group: RobotGroup, key: str, floor: Floor, taken: "_TakenPlaces", _: np.random.Generator
) -> FloatArray:
    """Return the poses that the scenario gives; raise ScenarioError if one is not free."""
    poses = np.array(group.poses, float)
    for number, (x, y, _heading) in enumerate(poses.tolist()):
        gap = clearance_cm(floor.arena, x, y) - floor.radius_cm
        if gap < -_TOLERANCE_CM:
            raise ScenarioError(
                f"{key}.poses.{number}: is [{x:g}, {y:g}], {-gap:.3g} cm into a wall, an obstacle or a movable; "
                f"allowed: at least {floor.radius_cm:g} cm away from them"
            )
        others = taken.around(x, y)
        other = min(others, key=lambda place: math.dist(place, (x, y)), default=None)
        if other is not None and math.dist(other, (x, y)) < floor.touch_cm - _TOLERANCE_CM:
            raise ScenarioError(
                f"{key}.poses.{number}: is [{x:g}, {y:g}] and overlaps the robot at [{other[0]:g}, {other[1]:g}]; "
                f"allowed: at least {floor.touch_cm:g} cm between centres"
            )
        taken.add(x, y)
    return poses


def _on_grid(
    group: RobotGroup, key: str, floor: Floor, taken: "_TakenPlaces", random: np.random.Generator
) -> FloatArray:
    """Return free points of a grid of 10 cm, as far from the walls or farther, with headings in steps of 45 degrees."""
    xs, ys = (_grid_line(length) for length in (floor.arena.width_cm, floor.arena.height_cm))
    points = np.array([(x, y) for y in ys for x in xs])
    free = np.array([taken.is_free(x, y) and floor.is_clear(x, y) for x, y in points.tolist()])
    if free.sum() < group.count:
        raise ScenarioError(
            f"{key}.count: is {group.count}; allowed: up to {free.sum()}, the free points of the grid of "
            f"{len(xs)} x {len(ys)} in this arena; give fewer robots or a larger arena"
        )
    chosen = random.choice(points[free], group.count, replace=False)
    headings = random.integers(GRID_HEADINGS, size=group.count) * (2 * math.pi / GRID_HEADINGS)
    for x, y in chosen.tolist():
        taken.add(x, y)
    return np.column_stack([chosen, headings])


def _grid_line(length_cm: float) -> FloatArray:
    """Return the coordinates of the grid's points along one side of the arena."""
    points = max(1, math.floor(length_cm / GRID_SPACING_CM) - 1)
    steps: FloatArray = np.arange(points, dtype=float) - (points - 1) / 2
    return length_cm / 2 + GRID_SPACING_CM * steps


def _at_random(
    group: RobotGroup, key: str, floor: Floor, taken: "_TakenPlaces", random: np.random.Generator
) -> FloatArray:
    """Return uniform positions away from the walls, redrawn where bodies would overlap (Enki; thesis 3.3)."""
    poses = []
    for robot in range(group.count):
        place = floor.draw_place(taken, random)
        if place is None:
            raise ScenarioError(
                f"{key}.count: is {group.count}; no free place was found for robot {robot} in "
                f"{MAX_DRAWS} draws: random placement fills at most about half of the floor; give fewer robots, a "
                "larger arena, or poses"
            )
        taken.add(*place)
        poses.append((*place, 2 * math.pi * random.random()))
    return np.array(poses)


class _TakenPlaces:
    """Places of robots in square cells, which are faster to search than one array: most are far away."""

    def __init__(self, touch_cm: float) -> None:
        """Take no place yet; touch_cm: distance of the centres of two robots that touch."""
        self._touch_cm = touch_cm
        self._cell_cm = 1.01 * touch_cm  # who touches a robot is in its cell or in one of the eight around it
        self._cells: dict[tuple[int, int], list[tuple[float, float]]] = {}

    def add(self, x: float, y: float) -> None:
        """Take a place."""
        self._cells.setdefault((int(x / self._cell_cm), int(y / self._cell_cm)), []).append((x, y))

    def around(self, x: float, y: float) -> list[tuple[float, float]]:
        """Return the places, in cells around (x, y), of all robots that touch one there, and of some that do not."""
        return [place for cell in self._cells_around(x, y) for place in self._cells.get(cell, ())]

    def is_free(self, x: float, y: float) -> bool:
        """Return whether a robot at (x, y) touches none of those whose places are taken."""
        for cell in self._cells_around(x, y):
            for other_x, other_y in self._cells.get(cell, ()):
                dx, dy = other_x - x, other_y - y
                if dx * dx + dy * dy < self._touch_cm**2:
                    return False
        return True

    def _cells_around(self, x: float, y: float) -> Iterable[tuple[int, int]]:
        column, row = int(x / self._cell_cm), int(y / self._cell_cm)
        return product((column - 1, column, column + 1), (row - 1, row, row + 1))
