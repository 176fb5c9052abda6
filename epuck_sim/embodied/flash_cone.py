"""The ideal sensor of flashes: which lit rings lie in a cone, and whether something hides them (thesis 3.1.2, 3.1.4.3).

Robots count by their centres: a robot is in the cone if its centre is, and it is hidden if the line between the centres
of the two meets the body of a third robot, or an obstacle.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.cell_list import CellList, cell_index, cells_around, members_in_row
from epuck_sim.scenario.signals import ConeSection, ConeSignal
from epuck_sim.util.jit import jit, jit_no_alloc

_RADIUS = epuck.RADIUS_CM
_FULL_CIRCLE_COS = -2.0
"""Stands for the cosine of half the angle of a full circle; below any cosine."""


class FlashCone(NamedTuple):
    """A cone, of vision or of emission."""

    range_cm: float
    """Radius."""
    cos: float
    """Cosine of half the opening angle; -2 for a full circle."""
    of_vision: bool
    """Whether the cone is the receiver's; else it is the sender's."""


class LitRingSensor(NamedTuple):
    """The ideal sensor of a group of robots."""

    cone: FlashCone
    occlusion: bool
    """Whether robots and obstacles hide rings."""


class Obstruction(NamedTuple):
    """What may hide a robot from another one."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading of all robots."""
    circles: FloatArray
    """(k, 3) cm: round obstacles, see `arena.Arena`."""
    edges: FloatArray
    """(m, 4) cm: edges of the other obstacles, see `arena.Arena`."""
    cells: CellList
    """Cell list sorted by `poses`."""


def make_cone(section: ConeSection) -> FlashCone:
    """Return the cone that a group's section of a scenario describes."""
    return FlashCone(
        math.inf if section.range_cm is None else section.range_cm,
        _FULL_CIRCLE_COS if section.angle_deg == 360 else math.cos(math.radians(section.angle_deg / 2)),
        section.of == "vision",
    )


def make_lit_ring_sensor(section: ConeSignal) -> LitRingSensor:
    """Return the sensor that a group's section of a scenario describes."""
    return LitRingSensor(make_cone(section), section.occlusion)


@jit_no_alloc
def in_cone(poses: FloatArray, receiver: int, sender: int, cone: FlashCone) -> bool:
    """Return whether a sender's flash reaches a receiver; the cone's edge belongs to it."""
    dx, dy = poses[sender, 0] - poses[receiver, 0], poses[sender, 1] - poses[receiver, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance > cone.range_cm:
        return False
    if cone.cos == _FULL_CIRCLE_COS:
        return True
    heading = poses[receiver, 2] if cone.of_vision else poses[sender, 2]
    towards = 1.0 if cone.of_vision else -1.0
    ahead: float = towards * (dx * math.cos(heading) + dy * math.sin(heading))
    return ahead >= cone.cos * distance


@jit_no_alloc
def is_hidden(receiver: int, sender: int, among: Obstruction) -> bool:
    """Return whether a robot's body or an obstacle is on the line between the centres of two robots."""
    ax, ay = among.poses[receiver, 0], among.poses[receiver, 1]
    dx, dy = among.poses[sender, 0] - ax, among.poses[sender, 1] - ay
    for k in range(len(among.circles)):
        x, y, radius = among.circles[k]
        if _distance_to_line(x - ax, y - ay, dx, dy) < radius:
            return True
    for k in range(len(among.edges)):
        if _crosses(
            dx, dy, among.edges[k, 0] - ax, among.edges[k, 1] - ay, among.edges[k, 2] - ax, among.edges[k, 3] - ay
        ):
            return True
    return _is_behind_robot(receiver, sender, among)


@jit_no_alloc
def _is_behind_robot(receiver: int, sender: int, among: Obstruction) -> bool:
    """Return whether a third robot is on the line between two; only cells that the line passes are looked at."""
    poses, cells = among.poses, among.cells
    ax, ay = poses[receiver, 0], poses[receiver, 1]
    bx, by = poses[sender, 0], poses[sender, 1]
    last_row = cell_index(max(ay, by) + _RADIUS, cells.height_cm, cells.rows)
    for row in range(cell_index(min(ay, by) - _RADIUS, cells.height_cm, cells.rows), last_row + 1):
        left, right = _part_in_row(ax, ay, bx, by, row, cells)
        first = row * cells.columns + cell_index(left - _RADIUS, cells.width_cm, cells.columns)
        last = row * cells.columns + cell_index(right + _RADIUS, cells.width_cm, cells.columns)
        for member in range(cells.first[first], cells.first[last + 1]):
            other = cells.members[member]
            x, y = cells.positions[member]
            if other not in (receiver, sender) and _distance_to_line(x - ax, y - ay, bx - ax, by - ay) < _RADIUS:
                return True
    return False


@jit_no_alloc
def _part_in_row(ax: float, ay: float, bx: float, by: float, row: int, cells: CellList) -> tuple[float, float]:
    """Return from where to where in x a line is within a robot's radius of a row of cells.

    The first and the last row also hold the robots beyond them.
    """
    low = -math.inf if row == 0 else row * cells.height_cm - _RADIUS
    high = math.inf if row == cells.rows - 1 else (row + 1) * cells.height_cm + _RADIUS
    if ay == by:
        return min(ax, bx), max(ax, bx)
    start = min(max((low - ay) / (by - ay), 0.0), 1.0)
    end = min(max((high - ay) / (by - ay), 0.0), 1.0)
    one, other = ax + start * (bx - ax), ax + end * (bx - ax)
    return min(one, other), max(one, other)


@jit_no_alloc
def _distance_to_line(x: float, y: float, dx: float, dy: float) -> float:
    """Return the distance of a point from the line from the origin to (dx, dy)."""
    square = dx * dx + dy * dy
    share = min(max((x * dx + y * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return math.hypot(x - share * dx, y - share * dy)


@jit_no_alloc
def _crosses(dx: float, dy: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether the line from the origin to (dx, dy) crosses that from (ax, ay) to (bx, by)."""
    if (dx * ay - dy * ax > 0.0) == (dx * by - dy * bx > 0.0):
        return False
    ex, ey = bx - ax, by - ay
    from_start = ex * -ay - ey * -ax
    from_end = ex * (dy - ay) - ey * (dx - ax)
    return (from_start > 0.0) != (from_end > 0.0)


@jit
def perceive_flashes(
    cone: FlashCone, occlusion: bool, ring_on: BoolArray, among: Obstruction, observer: int, flashes: IntArray
) -> None:
    """Write for some robots whether they perceive a lit ring.

    Args:
        cone: The cone.
        occlusion: Whether robots and obstacles hide rings.
        ring_on: (robots,) whether each ring is lit.
        among: The robots and the obstacles.
        observer: Number of the first robot that observes.
        flashes: (observers, 1) 1 for a robot that perceives a lit ring, 0 for one that does not; written.
    """
    lit = np.flatnonzero(ring_on)
    for row in range(len(flashes)):
        flashes[row, 0] = len(lit) > 0 and _perceives(cone, occlusion, ring_on, lit, among, observer + row)


@jit_no_alloc
def _perceives(
    cone: FlashCone, occlusion: bool, ring_on: BoolArray, lit: IntArray, among: Obstruction, receiver: int
) -> bool:
    """Return whether a robot perceives any of the `lit` robots; near ones, which are rarely hidden, come first."""
    poses, cells = among.poses, among.cells
    block = cells_around(poses[receiver, 0], poses[receiver, 1], cells)
    for row in range(block.first_row, block.end_row):
        start, end = members_in_row(block, row, cells)
        for member in range(start, end):
            sender = cells.members[member]
            if ring_on[sender] and perceives(cone, occlusion, among, receiver, sender):
                return True
    for sender in lit:  # noqa: SIM110 numba knows no generators
        if perceives(cone, occlusion, among, receiver, sender):
            return True
    return False


@jit_no_alloc
def perceives(cone: FlashCone, occlusion: bool, among: Obstruction, receiver: int, sender: int) -> bool:
    """Return whether a robot would perceive another one's lit ring."""
    reaches = sender != receiver and in_cone(among.poses, receiver, sender, cone)
    return reaches and not (occlusion and is_hidden(receiver, sender, among))
