"""Where robots start: at random without overlap, on the grid of the physical experiments, or as they are told."""

import math

import numpy as np

from epuck_sim import epuck
from epuck_sim.arena import Arena, clearance_cm
from epuck_sim.arrays import FloatArray
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import RobotGroup

GRID_SPACING_CM = 10.0
"""Distance between the points of the grid (thesis 4.3.1)."""

GRID_HEADINGS = 8
"""Headings on the grid are multiples of 45 degrees (thesis 4.3.1)."""

DRAWS = 10_000
"""So often a robot's place is drawn before the arena counts as full."""

_TOUCH_CM = 2 * epuck.RADIUS_CM
_TOLERANCE_CM = 1e-6


def place_robots(scenario: EmbodiedScenario, sequence: np.random.SeedSequence) -> FloatArray:
    """Return (robots, 3) cm, cm, rad: the poses at the start of a trial.

    Groups with poses come first, then those on the grid, then those at random, so that nobody is in another's way.
    Raises ScenarioError where robots do not fit, overlap, or stand in a wall or an obstacle.
    """
    arena = scenario.arena.build()
    random = np.random.default_rng(sequence)
    groups: list[FloatArray] = [np.empty((0, 3)) for _ in scenario.robots]
    for placement, place in (("poses", _as_told), ("grid", _on_grid), ("random", _at_random)):
        for number, group in enumerate(scenario.robots):
            if group.placement == placement:
                groups[number] = place(group, f"{scenario.name}: robots.{number}", arena, np.vstack(groups), random)
    return np.vstack(groups)


def _as_told(group: RobotGroup, where: str, arena: Arena, taken: FloatArray, _: np.random.Generator) -> FloatArray:
    poses = np.array(group.poses, float)
    for number, (x, y, _heading) in enumerate(poses):
        gap = clearance_cm(arena, x, y) - epuck.RADIUS_CM
        if gap < -_TOLERANCE_CM:
            raise ScenarioError(
                f"{where}.poses.{number}: is [{x:g}, {y:g}], {-gap:.3g} cm into a wall or an obstacle; allowed: at "
                f"least {epuck.RADIUS_CM:g} cm away from them"
            )
        others = np.vstack([taken, poses[:number]])
        distances = np.hypot(others[:, 0] - x, others[:, 1] - y)
        if distances.size and distances.min() < _TOUCH_CM - _TOLERANCE_CM:
            other = others[distances.argmin()]
            raise ScenarioError(
                f"{where}.poses.{number}: is [{x:g}, {y:g}] and overlaps the robot at [{other[0]:g}, {other[1]:g}]; "
                f"allowed: at least {_TOUCH_CM:g} cm between centres"
            )
    return poses


def _on_grid(group: RobotGroup, where: str, arena: Arena, taken: FloatArray, random: np.random.Generator) -> FloatArray:
    """Points 10 cm apart with equal padding to the walls, at least the spacing; headings in steps of 45 degrees."""
    xs, ys = (_grid_line(length) for length in (arena.width_cm, arena.height_cm))
    points = np.array([(x, y) for y in ys for x in xs])
    free = np.array([_is_free(arena, taken, x, y) for x, y in points])
    if free.sum() < group.count:
        raise ScenarioError(
            f"{where}.count: is {group.count}; allowed: up to {free.sum()}, the free points of the grid of "
            f"{len(xs)} x {len(ys)} in this arena; give fewer robots or a larger arena"
        )
    chosen = random.choice(points[free], group.count, replace=False)
    headings = random.integers(GRID_HEADINGS, size=group.count) * (2 * math.pi / GRID_HEADINGS)
    return np.column_stack([chosen, headings])


def _grid_line(length_cm: float) -> FloatArray:
    points = max(1, math.floor(length_cm / GRID_SPACING_CM) - 1)
    steps: FloatArray = np.arange(points, dtype=float) - (points - 1) / 2
    return length_cm / 2 + GRID_SPACING_CM * steps


def _at_random(
    group: RobotGroup, where: str, arena: Arena, taken: FloatArray, random: np.random.Generator
) -> FloatArray:
    """Centres uniform where bodies are off the walls, redrawn where they overlap (Enki; thesis 3.3)."""
    poses = np.vstack([taken, np.empty((group.count, 3))])
    low = epuck.RADIUS_CM
    high = (arena.width_cm - low, arena.height_cm - low)
    for place in range(len(taken), len(poses)):
        for _ in range(DRAWS):
            x, y = random.uniform(low, high)
            if _is_free(arena, poses[:place], x, y):
                break
        else:
            raise ScenarioError(
                f"{where}.count: is {group.count}; no free place was found for robot {place - len(taken)} in {DRAWS} "
                f"draws: random placement fills at most about half of the floor; give fewer robots, a larger arena, "
                "or poses"
            )
        poses[place] = x, y, random.uniform(0, 2 * math.pi)
    return poses[len(taken) :]


def _is_free(arena: Arena, taken: FloatArray, x: float, y: float) -> bool:
    apart = (taken[:, 0] - x) ** 2 + (taken[:, 1] - y) ** 2 >= _TOUCH_CM**2
    return bool(apart.all()) and clearance_cm(arena, x, y) >= epuck.RADIUS_CM - _TOLERANCE_CM
