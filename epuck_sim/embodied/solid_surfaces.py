"""The shapes of walls and obstacles in pymunk."""

import pymunk
import pymunk.batch

from epuck_sim.arena import Arena
from epuck_sim.embodied.contact_candidates import MARGIN_CM

WALL_CM = 50.0
"""Thickness of the walls in cm: far more than a robot can cover in one physics step."""


def wall_shapes(body: pymunk.Body, arena: Arena) -> list[pymunk.Shape]:
    """Return four slabs around the floor that overlap at the corners."""
    width, height, out = arena.width_cm, arena.height_cm, WALL_CM
    slabs = [
        (-out, -out, 0, height + out),
        (width, -out, width + out, height + out),
        (-out, -out, width + out, 0),
        (-out, height, width + out, height + out),
    ]
    return [
        pymunk.Poly(body, [(left, low), (right, low), (right, high), (left, high)], radius=MARGIN_CM)
        for left, low, right, high in slabs
    ]


def obstacle_shapes(body: pymunk.Body, arena: Arena) -> list[pymunk.Shape]:
    """Return the shapes of the arena's obstacles."""
    circles: list[pymunk.Shape] = [
        pymunk.Circle(body, radius + MARGIN_CM, offset=(x, y))
        for x, y, radius in arena.circles[: arena.first_movable].tolist()
    ]
    return circles + [
        pymunk.Poly(body, [(x, y) for x, y in corners.tolist()], radius=MARGIN_CM) for corners in arena.polygons
    ]
