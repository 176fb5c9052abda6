"""The ideal sensor of flashes: which lit rings lie in a cone, and whether something hides them (thesis 3.1.2, 3.1.4.3).

Robots count by their centres: a robot is in the cone if its centre is, and it is hidden if the line between the centres
of the two meets the body of a third robot, or an obstacle. Enki's camera differs, see `enki_camera`.
"""

import math
from typing import Any

from epuck_sim import elementary
from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.cells import cells_around, members_along, members_in_row, rows_along
from epuck_sim.embodied.sensors.enki_camera import shows
from epuck_sim.embodied.sensors.sight import find_lit, find_visible
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.scenario.robots import ConeSection, ConeSignal, EnkiCameraSignal, SectorSection
from epuck_sim.util.elementary import hypot, sin_cos
from epuck_sim.util.jit import jit_inline, jit_no_alloc

_FULL_CIRCLE_COS = -2.0  # stands for the cosine of half the angle of a full circle; below any cosine


def set_cone(record: Any, section: SectorSection, forward_cm: float) -> None:
    """Set CONE of a group: where flashes or pulses reach its robots; forward_cm: how far its camera is ahead."""
    record.range_cm = math.inf if section.range_cm is None else section.range_cm
    full, half = section.angle_deg == 360, math.radians(section.angle_deg / 2)
    record.cos = _FULL_CIRCLE_COS if full else elementary.cos(half)
    record.of_vision = not isinstance(section, ConeSection) or section.of == "vision"
    record.occlusion = isinstance(section, ConeSignal | EnkiCameraSignal) and section.occlusion
    record.by_parts = isinstance(section, EnkiCameraSignal)
    record.half_view_rad, record.forward_cm = math.inf if full else half, forward_cm


@jit_no_alloc
def perceive_flashes(block: ByteArray, addresses: IntArray, number: int) -> None:
    """Write for each robot of a group whether it perceives a lit ring: 1 or 0 to its only pixel."""
    swarm = swarm_at(block)
    group = swarm.groups[number]
    lit = find_lit(swarm)
    for place in range(group.count):
        receiver = group.first + place
        if swarm.scene[0].hides_flashes:
            lit = find_visible(block, addresses, swarm, receiver)
        swarm.pixels[group.row + place] = 1 if lit > 0 and _perceives_any(swarm, group.cone, receiver, lit) else 0


@jit_inline
def _perceives_any(swarm: Swarm, cone: Any, receiver: int, lit: int) -> bool:
    """Return whether a robot perceives any of the listed robots; near ones, which are rarely hidden, come first."""
    robots = swarm.robots
    near = cells_around(robots[receiver].x, robots[receiver].y, swarm.scene[0])
    for row in range(near.first_row, near.end_row):
        start, end = members_in_row(near, row, swarm)
        for place in range(start, end):
            sender = swarm.members[place].robot
            if swarm.numbers[len(robots) + sender] > 0 and perceives(swarm, cone, receiver, sender):
                return True
    for place in range(lit):  # noqa: SIM110 numba knows no generators
        if perceives(swarm, cone, receiver, swarm.numbers[place]):
            return True
    return False


@jit_no_alloc
def perceives(swarm: Swarm, cone: Any, receiver: int, sender: int) -> bool:
    """Return whether a robot would perceive another one's lit ring, in a CONE; robots are sorted into cells."""
    if cone.by_parts:
        return sender != receiver and shows(swarm, cone, receiver, sender)
    reaches = sender != receiver and in_cone(swarm.robots[receiver], swarm.robots[sender], cone)
    return reaches and not (cone.occlusion and _is_hidden(swarm, receiver, sender))


@jit_inline
def in_cone(receiver: Any, sender: Any, cone: Any) -> bool:
    """Return whether a sender's flash reaches a receiver; the cone's edge belongs to it."""
    dx, dy = sender.x - receiver.x, sender.y - receiver.y
    distance = math.sqrt(dx * dx + dy * dy)
    if distance > cone.range_cm:
        return False
    if cone.cos == _FULL_CIRCLE_COS:
        return True
    heading = receiver.heading if cone.of_vision else sender.heading
    towards = 1.0 if cone.of_vision else -1.0
    sine, cosine = sin_cos(heading)
    ahead = towards * (dx * cosine + dy * sine)
    return bool(ahead >= cone.cos * distance)


@jit_inline
def _is_hidden(swarm: Swarm, receiver: int, sender: int) -> bool:
    scene = swarm.scene[0]
    ax, ay = swarm.robots[receiver].x, swarm.robots[receiver].y
    bx, by = swarm.robots[sender].x, swarm.robots[sender].y
    dx, dy = bx - ax, by - ay
    for place in range(scene.circles):
        circle = swarm.circles[place]
        if _distance_to_line(circle.x - ax, circle.y - ay, dx, dy) < circle.radius:
            return True
    for place in range(scene.edges):
        edge = swarm.edges[place]
        if _crosses(dx, dy, edge.ax - ax, edge.ay - ay, edge.bx - ax, edge.by - ay):
            return True
    reach = scene.largest_cm  # only cells that the line passes are looked at
    first, last = rows_along(ay, by, reach, scene)
    for row in range(first, last + 1):
        start, end = members_along(ax, ay, bx, by, reach, row, swarm)
        for place in range(start, end):
            member = swarm.members[place]
            if member.robot in (receiver, sender):
                continue
            if _distance_to_line(member.x - ax, member.y - ay, dx, dy) < member.radius_cm:
                return True
    return False


@jit_inline
def _distance_to_line(x: float, y: float, dx: float, dy: float) -> float:
    """Return the distance of a point from the line from the origin to (dx, dy)."""
    square = dx * dx + dy * dy
    share = min(max((x * dx + y * dy) / square, 0.0), 1.0) if square > 0.0 else 0.0
    return hypot(x - share * dx, y - share * dy)


@jit_inline
def _crosses(dx: float, dy: float, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether the line from the origin to (dx, dy) crosses that from (ax, ay) to (bx, by)."""
    if (dx * ay - dy * ax > 0.0) == (dx * by - dy * bx > 0.0):
        return False
    ex, ey = bx - ax, by - ay
    from_start = ex * -ay - ey * -ax
    from_end = ex * (dy - ay) - ey * (dx - ax)
    return (from_start > 0.0) != (from_end > 0.0)
