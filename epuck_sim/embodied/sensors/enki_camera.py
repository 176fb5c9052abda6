"""Enki's camera (thesis 3.1.4.3; Magnenat et al. 2007, `CircularCam`).

A disc covers an arc of atan(radius / distance) to either side of its centre, and hides the same part of the arcs of
discs whose centres are farther. A robot is seen if any part of its arc is in view and not hidden, and if its centre is
within the range plus its radius. Pixels are infinitely narrow here; Enki has 60.
"""

import math
from typing import Any, NamedTuple

from epuck_sim.embodied.cells import members_along, rows_along
from epuck_sim.embodied.swarm import Swarm
from epuck_sim.util.elementary import atan2, sin_cos
from epuck_sim.util.jit import jit_inline


class _Look(NamedTuple):
    """A look from a camera towards the centre of another robot."""

    receiver: int
    sender: int
    x: float  # where the camera is, cm
    y: float
    dx: float  # from there to the other's centre, cm
    dy: float
    square: float  # square of that distance


@jit_inline
def shows(swarm: Swarm, cone: Any, receiver: int, sender: int) -> bool:
    """Return whether any part of a robot is seen by another, in a CONE; robots are sorted into cells."""
    eye, other = swarm.robots[receiver], swarm.robots[sender]
    apart_x, apart_y = other.x - eye.x, other.y - eye.y
    if math.sqrt(apart_x * apart_x + apart_y * apart_y) > cone.range_cm + other.radius_cm:
        return False
    sine, cosine = sin_cos(eye.heading)
    dx, dy = apart_x - cone.forward_cm * cosine, apart_y - cone.forward_cm * sine
    look = _Look(receiver, sender, other.x - dx, other.y - dy, dx, dy, dx * dx + dy * dy)
    width = atan2(other.radius_cm, math.sqrt(look.square))
    bearing = atan2(dy * cosine - dx * sine, dx * cosine + dy * sine)
    turns = 1 if cone.half_view_rad < math.inf else 0  # what is behind may show at both ends of a wide view
    for turn in range(-turns, turns + 1):
        middle = 2.0 * math.pi * turn - bearing
        low, high = max(-width, middle - cone.half_view_rad), min(width, middle + cone.half_view_rad)
        if low < high and not (cone.occlusion and _is_covered(swarm, look, other.radius_cm, low, high)):
            return True
    return False


@jit_inline
def _is_covered(swarm: Swarm, look: _Look, radius: float, low: float, high: float) -> bool:
    """Return whether all between two angles, rad from the direction of the look, is hidden."""
    end_x, end_y = look.x + look.dx, look.y + look.dy
    reach = 2.0 * swarm.scene[0].largest_cm  # whatever hides a part reaches into the strip between camera and disc
    first, last = rows_along(look.y, end_y, reach, swarm.scene[0])
    covered = low  # up to this angle
    while covered < high:
        before = covered
        for row in range(first, last + 1):
            start, end = members_along(look.x, look.y, end_x, end_y, reach, row, swarm)
            for place in range(start, end):
                member = swarm.members[place]
                if member.robot not in (look.receiver, look.sender):
                    covered = _behind_disc(look, radius, member.x, member.y, member.radius_cm, covered)
        for place in range(swarm.scene[0].circles):
            circle = swarm.circles[place]
            covered = _behind_disc(look, radius, circle.x, circle.y, circle.radius, covered)
        for place in range(swarm.scene[0].edges):
            covered = _behind_edge(look, swarm.edges[place], covered)
        if covered == before:
            return False
    return True


@jit_inline
def _behind_disc(look: _Look, radius: float, x: float, y: float, other: float, covered: float) -> float:
    """Return the angle up to which an arc, of a disc of this radius, is covered when another disc is added."""
    fx, fy = x - look.x, y - look.y
    square, distance = fx * fx + fy * fy, math.sqrt(look.square)
    aside = (look.dx * fy - look.dy * fx) / distance if distance > 0.0 else math.inf
    if square >= look.square or abs(aside) > radius + other:
        return covered
    angle = atan2(aside, (look.dx * fx + look.dy * fy) / distance)
    width = atan2(other, math.sqrt(square))
    return _extended(covered, angle - width, angle + width)


@jit_inline
def _behind_edge(look: _Look, edge: Any, covered: float) -> float:
    """Return the angle up to which an arc is covered when the part of an edge nearer than the arc's disc is added."""
    ax, ay, ex, ey = edge.ax - look.x, edge.ay - look.y, edge.bx - edge.ax, edge.by - edge.ay
    length, along = ex * ex + ey * ey, ax * ex + ay * ey
    root = along * along - length * (ax * ax + ay * ay - look.square)
    if root <= 0.0:
        return covered
    begin, end = max((-along - math.sqrt(root)) / length, 0.0), min((-along + math.sqrt(root)) / length, 1.0)
    if begin >= end:
        return covered
    one = _angle_to(look, ax + begin * ex, ay + begin * ey)
    other = _angle_to(look, ax + end * ex, ay + end * ey)
    low, high = min(one, other), max(one, other)
    if high - low <= math.pi:
        return _extended(covered, low, high)
    return _extended(_extended(covered, -math.inf, low), high, math.inf)  # it passes behind the camera


@jit_inline
def _angle_to(look: _Look, x: float, y: float) -> float:
    """Return the angle of a point, cm from the camera, left of the direction of the look."""
    return atan2(look.dx * y - look.dy * x, look.dx * x + look.dy * y)


@jit_inline
def _extended(covered: float, low: float, high: float) -> float:
    """Return the angle up to which an arc is covered when the part between two angles is added."""
    return high if low <= covered < high else covered
