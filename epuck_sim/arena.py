"""The arena: a walled rectangle with one corner at the origin, the obstacles in it, and what robots can push."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.geometry import polygon_distance_cm


@dataclass(frozen=True, eq=False)
class Arena:
    """A rectangle from (0, 0) to (width_cm, height_cm) with walls on all sides, its obstacles and its movables."""

    width_cm: float
    height_cm: float
    circles: FloatArray
    """(k, 3) cm: centre x, centre y, radius of round obstacles, and then of movables where they are."""
    polygons: tuple[FloatArray, ...]
    """Convex obstacles, each (v, 2) cm: corners counter-clockwise."""
    edges: FloatArray
    """(m, 4) cm: the polygons' edges, from x, y to x, y."""
    movables: FloatArray
    """(movables, 2) mass in g, and coefficient of friction with the floor, of the last of the circles."""

    @property
    def first_movable(self) -> int:
        """Number of the first movable among the circles."""
        return len(self.circles) - len(self.movables)

    def with_movables_at(self, places_cm: FloatArray) -> "Arena":
        """Return the arena with its movables at (movables, 2) cm."""
        circles = self.circles.copy()
        circles[self.first_movable :, :2] = places_cm
        return replace(self, circles=circles)


def make_arena(
    width_cm: float,
    height_cm: float,
    circles: Sequence[Sequence[float]],
    polygons: Sequence[FloatArray],
    movables: Sequence[Sequence[float]] = (),
) -> Arena:
    """Return the arena with the given obstacles and movables.

    Args:
        width_cm: Length along x.
        height_cm: Length along y.
        circles: Centre x, centre y and radius in cm of each round obstacle.
        polygons: (v, 2) cm: corners of each convex obstacle, counter-clockwise.
        movables: Centre x, centre y and radius in cm, mass in g, and coefficient of friction of each movable.
    """
    pushed = np.array(movables, float).reshape(-1, 5)
    edges = [np.hstack([corners, np.roll(corners, -1, axis=0)]) for corners in polygons]
    return Arena(
        width_cm,
        height_cm,
        np.vstack([np.array(circles, float).reshape(-1, 3), pushed[:, :3]]),
        tuple(polygons),
        np.vstack([np.empty((0, 4)), *edges]),
        pushed[:, 3:],
    )


def clearance_cm(arena: Arena, x_cm: float, y_cm: float) -> float:
    """Return the distance from a point to the nearest wall, obstacle or movable; negative beyond or inside it."""
    walls = min(x_cm, y_cm, arena.width_cm - x_cm, arena.height_cm - y_cm)
    if not len(arena.circles) and not arena.polygons:
        return walls
    circles = np.hypot(arena.circles[:, 0] - x_cm, arena.circles[:, 1] - y_cm) - arena.circles[:, 2]
    polygons = [polygon_distance_cm(corners, x_cm, y_cm) for corners in arena.polygons]
    return float(min(walls, *circles, *polygons))
