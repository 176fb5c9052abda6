"""Paths of point-like agents between recorded rows: straight, by way of a wall, or broken where rows do not tell.

A recording has a row at every twentieth of a period; a quick agent may leave a wall in between, in a random direction.
It moves at a constant speed, along the heading of the row before until it reaches a wall.
"""

import math

import numpy as np

from epuck_sim.arrays import Float32Array, FloatArray

TOLERANCE = 1e-4
"""Largest deviation from a straight path, as a share of the side; positions are recorded in single precision."""

REGULAR_SHARE = 0.5
"""Share of the longest time between two rows that two rows must be apart for a speed to be measured between them."""


def agent_path(
    time_s: FloatArray, positions: Float32Array, headings: FloatArray, side_cm: float, *, is_cyclic: bool
) -> FloatArray:
    """Return the path of an agent in a segment or square.

    An agent that meets two walls between two rows is drawn to the first of them; then its path has a gap.

    Args:
        time_s: (rows,) s.
        positions: (rows, 2) cm; y is 0 in a segment.
        headings: (rows,) rad.
        side_cm: Side of the space.
        is_cyclic: Whether agents that leave on one side enter on the opposite one.

    Returns:
        (points, 3) s, cm, cm: time, x, y; NaN where the path has a gap.
    """
    points, directions = np.column_stack([time_s, positions]), _directions(headings)
    speed = _measure_speed(time_s, positions, side_cm if is_cyclic else math.inf)
    straight = points[:-1, 1:] + speed * np.diff(time_s)[:, None] * directions[:-1]
    deviation_cm = np.abs(straight - points[1:, 1:]).max(axis=1)
    path: list[FloatArray] = []
    last = 0
    for row in np.flatnonzero(deviation_cm > TOLERANCE * side_cm).tolist():
        detour = _detour(points[row], points[row + 1], directions[row], speed, side_cm, is_cyclic=is_cyclic)
        path += [points[last : row + 1], detour]
        last = row + 1
    return np.concatenate([*path, points[last:]])


def _measure_speed(time_s: FloatArray, positions: Float32Array, cycle_cm: float) -> float:
    """Return an agent's speed in cm/s: the highest between two rows, because detours by a wall seem slower.

    Ways that are longer than half of `cycle_cm` are shorter across the edge.
    """
    elapsed_s = np.diff(time_s)
    if not len(elapsed_s):
        return 0.0
    is_long = elapsed_s >= REGULAR_SHARE * elapsed_s.max()
    ways = np.abs(np.diff(positions, axis=0))
    ways_cm = np.hypot(*np.minimum(ways, np.abs(cycle_cm - ways)).T)
    return float((ways_cm[is_long] / elapsed_s[is_long]).max())


def _directions(headings: FloatArray) -> FloatArray:
    """Return (rows, 2) unit vectors; one along an axis is exactly so."""
    directions = np.column_stack([np.cos(headings), np.sin(headings)])
    directions[np.abs(directions) < TOLERANCE**2] = 0.0
    return directions


def _detour(
    start: FloatArray, end: FloatArray, direction: FloatArray, speed: float, side_cm: float, *, is_cyclic: bool
) -> FloatArray:
    """Return (points, 3) what lies between two points, (3,) s, cm, cm, that no straight line joins."""
    gap = np.full(3, np.nan)
    ahead_cm = _distance_to_wall(start[1:], direction, side_cm)
    wall = _point_along(start, direction, ahead_cm, speed)
    if is_cyclic:  # the heading stays the same
        behind_cm = _distance_to_wall(end[1:], -direction, side_cm)
        return np.array([wall, gap, _point_along(end, direction, -behind_cm, speed)])
    length_cm = ahead_cm + math.hypot(*(end[1:] - wall[1:]))
    is_one_wall = abs(length_cm - speed * (end[0] - start[0])) <= TOLERANCE * side_cm
    return wall[None] if is_one_wall else np.array([wall, gap])


def _distance_to_wall(position: FloatArray, direction: FloatArray, side_cm: float) -> float:
    """Return the distance in cm from a position, (2,) cm, to the next wall in a direction."""
    moves = direction != 0
    room = np.where(direction > 0, side_cm - position, position)[moves]
    return max(0.0, float((room / np.abs(direction[moves])).min()))


def _point_along(origin: FloatArray, direction: FloatArray, distance_cm: float, speed: float) -> FloatArray:
    """Return (3,) s, cm, cm: when and where an agent that passes `origin` has gone on for a distance."""
    return np.array([origin[0] + distance_cm / speed, *(origin[1:] + distance_cm * direction)])
