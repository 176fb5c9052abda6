"""The arena: a walled rectangle with one corner at the origin, its obstacles, what robots can push, floor and lamps."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import ByteArray, FloatArray
from epuck_sim.geometry import contains, polygon_distance_cm

PATCH = np.dtype(
    [("brightness", "f8"), ("x", "f8"), ("y", "f8"), ("radius", "f8"), ("first_edge", "i8"), ("edge_count", "i8")]
)
"""A patch of a floor: brightness from 0, black, to 1, white; for a disc, centre and radius in cm; for a convex polygon,
the mean of its corners, radius 0, and its range among the floor's edges."""

LAMP_SHARE = 1 / 80  # radius of a lamp's dot in pictures, as a share of the arena's longer side


@dataclass(frozen=True, eq=False)
class Floor:
    """Brightness of the floor, for ground sensors; white by default."""

    brightness: float = 1.0
    """Brightness where there is no patch, from 0, black, to 1, white; without effect on a floor with a picture."""
    patches: npt.NDArray[np.void] = field(default_factory=lambda: np.empty(0, PATCH))
    """(patches,) records of type `PATCH`; later ones lie on top of earlier ones."""
    edges: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    """(m, 4) cm: the polygons' edges, from x, y to x, y, counter-clockwise."""
    picture: ByteArray = field(default_factory=lambda: np.empty((0, 0), np.uint8))
    """(rows, columns) levels from 0, black, to 255, white, stretched between the walls; the first row lies at the wall
    of largest y. Without rows if there is none."""

    @property
    def is_white(self) -> bool:
        """Whether it is white everywhere, so that nothing of it is drawn."""
        return self.brightness == 1 and not len(self.patches) and not self.picture.size


@dataclass(frozen=True, eq=False)
class Arena:
    """A rectangle from (0, 0) to (width_cm, height_cm) with walls on all sides, its obstacles and its movables."""

    width_cm: float
    height_cm: float
    circles: FloatArray  # (k, 3) cm: centre x, centre y, radius of round obstacles, and then of movables where they are
    polygons: tuple[FloatArray, ...]  # convex obstacles, each (v, 2) cm: corners counter-clockwise
    edges: FloatArray  # (m, 4) cm: the polygons' edges, from x, y to x, y
    movables: FloatArray
    """(movables, 2) mass in g, and coefficient of friction with the floor, of the last of the circles."""
    floor: Floor = field(default_factory=Floor)
    lamps: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    """(lamps, 4) cm: x, y and height above the floor; and strength, the light on the floor right below."""

    @property
    def first_movable(self) -> int:
        """Number of the first movable among the circles."""
        return len(self.circles) - len(self.movables)

    @property
    def lamp_cm(self) -> float:
        """Radius of the dots that stand for lamps in pictures, cm."""
        return LAMP_SHARE * max(self.width_cm, self.height_cm)

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
    """Return the arena with the given obstacles and movables, a white floor and no lamps.

    Lengths are in cm: round obstacles are (x, y, radius) each, convex ones (v, 2) corners counter-clockwise, movables
    (x, y, radius, mass in g, friction).
    """
    pushed = np.array(movables, float).reshape(-1, 5)
    return Arena(
        width_cm,
        height_cm,
        np.vstack([np.array(circles, float).reshape(-1, 3), pushed[:, :3]]),
        tuple(polygons),
        _edges(polygons),
        pushed[:, 3:],
    )


def _edges(polygons: Iterable[FloatArray]) -> FloatArray:
    """Return (m, 4) cm: the edges of polygons, one after the other."""
    edges = [np.hstack([corners, np.roll(corners, -1, axis=0)]) for corners in polygons]
    return np.vstack([np.empty((0, 4)), *edges])


def make_floor(
    brightness: float, patches: Sequence[tuple[float, Sequence[float] | FloatArray]], picture: ByteArray | None = None
) -> Floor:
    """Return the floor with patches, later ones on top, and a picture of (rows, columns) levels, if any.

    A patch has a brightness from 0 to 1, and a shape in cm: (x, y, radius) of a disc, or (v, 2) corners of a convex
    polygon, counter-clockwise.
    """
    records = np.zeros(len(patches), PATCH)
    polygons: list[FloatArray] = []
    for record, (level, shape) in zip(records, patches, strict=True):
        record["brightness"] = level
        if np.ndim(shape) == 1:
            record["x"], record["y"], record["radius"] = shape
        else:
            corners = np.asarray(shape, float)
            record["x"], record["y"] = corners.mean(axis=0)
            record["first_edge"], record["edge_count"] = sum(map(len, polygons)), len(corners)
            polygons.append(corners)
    floor = Floor(brightness, records, _edges(polygons))
    return floor if picture is None else replace(floor, picture=picture)


def clearance_cm(arena: Arena, x_cm: float, y_cm: float) -> float:
    """Return the distance from a point to the nearest wall, obstacle or movable; negative beyond or inside it."""
    walls = x_cm, y_cm, arena.width_cm - x_cm, arena.height_cm - y_cm
    circles = np.hypot(arena.circles[:, 0] - x_cm, arena.circles[:, 1] - y_cm) - arena.circles[:, 2]
    polygons = [polygon_distance_cm(corners, x_cm, y_cm) for corners in arena.polygons]
    return float(min(*walls, *circles, *polygons))


def brightness_at(arena: Arena, x_cm: npt.ArrayLike, y_cm: npt.ArrayLike) -> FloatArray:
    """Return the brightness of the floor at points, (...) cm, from 0, black, to 1, white.

    Beyond the walls, a picture is continued by its outermost pixels.
    """
    points = np.stack(np.broadcast_arrays(np.asarray(x_cm, float), np.asarray(y_cm, float)), axis=-1)
    floor = arena.floor
    brightness = np.full(points.shape[:-1], floor.brightness, np.float64)
    if floor.picture.size:
        sizes = np.array(floor.picture.shape[::-1])  # columns along x, rows against y
        pixels = np.floor(points / (arena.width_cm, arena.height_cm) * sizes).astype(np.int64)
        column, row = np.moveaxis(np.clip(pixels, 0, sizes - 1), -1, 0)
        brightness[...] = floor.picture[-1 - row, column] / 255
    for patch in floor.patches:
        first, count = patch["first_edge"], patch["edge_count"]
        if count:
            on_patch = contains(floor.edges[first : first + count, :2], points)
        else:
            on_patch = np.hypot(points[..., 0] - patch["x"], points[..., 1] - patch["y"]) <= patch["radius"]
        brightness[on_patch] = patch["brightness"]
    return brightness


def light_at(arena: Arena, x_cm: npt.ArrayLike, y_cm: npt.ArrayLike) -> FloatArray:
    """Return the light of all lamps on the floor at points, (...) cm; a lamp of strength 1 gives 1 right below it.

    A lamp is a point that shines alike in all directions. At the distance r, its light falls with the square of r, and
    a level floor gets the share cos(a) = h / r of it, where h is the lamp's height and a the angle from the vertical.
    With the distance d on the floor, the light is proportional to h / (h^2 + d^2)^(3/2), and to 1 / h^2 right below:
    the strength times (h^2 / (h^2 + d^2))^(3/2). Nothing casts a shadow.
    """
    x, y, height, strength = arena.lamps.T
    square = (np.asarray(x_cm, float)[..., None] - x) ** 2 + (np.asarray(y_cm, float)[..., None] - y) ** 2
    light: FloatArray = (strength * (height**2 / (height**2 + square)) ** 1.5).sum(axis=-1)
    return light


def floor_levels(arena: Arena, side_px: int) -> ByteArray:
    """Return (rows, columns) levels of the floor from above, 0 for black and 255 for white, the largest y first."""
    scale = side_px / max(arena.width_cm, arena.height_cm)
    columns, rows = (max(1, round(scale * side)) for side in (arena.width_cm, arena.height_cm))
    x = (np.arange(columns) + 0.5) * arena.width_cm / columns
    y = (np.arange(rows)[::-1, None] + 0.5) * arena.height_cm / rows
    return np.rint(255 * brightness_at(arena, x, y)).astype(np.uint8)
