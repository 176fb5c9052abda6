"""Signals other than the line camera's: the ideal sensor of flashes, Enki's camera, and radio (thesis 3.1.2, 3.1.4.3).

A flash or a pulse reaches a robot in a cone. The ideal sensor takes robots by their centres: a robot is in the cone if
its centre is, and it is hidden if the line between the centres of the two meets the body of a third robot, or an
obstacle. Enki's camera sees parts of robots.
"""

import math
from typing import Any, NamedTuple

from epuck_sim import elementary
from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.interface import MAX_MESSAGES
from epuck_sim.embodied.cells import cells_around, members_along, members_in_row, rows_along
from epuck_sim.embodied.sensors.camera import NEVER
from epuck_sim.embodied.sensors.sight import find_lit, find_visible
from epuck_sim.embodied.swarm import Swarm, group_of, swarm_at
from epuck_sim.scenario.robots import EnkiCameraSignal, RadioSignal, SectorSection, SignalSection
from epuck_sim.util.elementary import atan2, hypot, sin_cos
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.rng import uniform

_FULL_CIRCLE_COS = -2.0  # stands for the cosine of half the angle of a full circle; below any cosine


def slots_of(section: SignalSection, step_ms: int) -> int:
    """Return the number of control steps for which each robot of a group has PULSES in `Swarm.air`; 0 without radio."""
    return math.ceil(section.latency_ms / step_ms) + 1 if isinstance(section, RadioSignal) else 0


def set_signal(group: Any, section: SectorSection, forward_cm: float, step_ms: int) -> None:
    """Set CONE, and RADIO but the index of its pulses, of a group whose cameras are so far ahead."""
    cone, full, half = group.cone, section.angle_deg == 360, math.radians(section.angle_deg / 2)
    cone.range_cm = math.inf if section.range_cm is None else section.range_cm
    cone.cos = _FULL_CIRCLE_COS if full else elementary.cos(half)
    cone.of_vision = getattr(section, "of", "vision") == "vision"
    cone.occlusion = getattr(section, "occlusion", False)
    cone.by_parts = isinstance(section, EnkiCameraSignal)
    cone.half_view_rad, cone.forward_cm = math.inf if full else half, forward_cm
    if isinstance(section, RadioSignal):
        radio = group.radio
        radio.loss, radio.collisions, radio.half_duplex = section.loss, section.collisions, section.half_duplex
        radio.slots = slots_of(section, step_ms)


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


# --- Enki's camera (thesis 3.1.4.3; Magnenat et al. 2007, `CircularCam`) ------------------------------------
#
# A disc covers an arc of atan(radius / distance) to either side of its centre, and hides the same part of the arcs of
# discs whose centres are farther. A robot is seen if any part of its arc is in view and not hidden, and if its centre
# is within the range plus its radius. Pixels are infinitely narrow here; Enki has 60.


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


# --- radio (thesis 6.2) ---------------------------------------------------------------------------------
#
# A robot sends in each control step in which its ring goes on, or its controller sets `actuators.send`. The pulse is on
# the air in the next control step, in which robots also see the ring, and arrives `latency` control steps later.


@jit_no_alloc
def receive_pulses(block: ByteArray, addresses: IntArray, number: int) -> None:  # noqa: ARG001
    """Send the pulses of the last control step on their way, and deliver to a group those that arrive in this one."""
    swarm = swarm_at(block)
    group, step = swarm.groups[number], swarm.scene[0].step
    radio = group.radio
    senders = 0
    for index in range(len(swarm.robots)):
        robot = swarm.robots[index]
        goes_on = robot.ring_on and not robot.ring_before
        robot.sends = goes_on or robot.actuators.send != 0
        if robot.sends:
            swarm.numbers[senders] = index
            senders += 1
    departing, arriving = (step + radio.slots - 1) % radio.slots, step % radio.slots
    for place in range(group.count):
        leaving = swarm.air[radio.first + departing * group.count + place]
        leaving.count = _take_from_air(swarm, group, senders, group.first + place, leaving)
        pulses = swarm.air[radio.first + arriving * group.count + place]
        sensors = swarm.robots[group.first + place].sensors
        sensors.pulses = pulses.count
        for message in range(MAX_MESSAGES):
            sensors.messages[message] = pulses.messages[message] if message < pulses.count else 0
        swarm.pixels[group.row + place] = 1 if pulses.count > 0 else 0


@jit_inline
def _take_from_air(swarm: Swarm, group: Any, senders: int, number: int, pulses: Any) -> int:
    """Write the messages that reach a robot in this control step; return how many do."""
    radio, receiver = group.radio, swarm.robots[number]
    if radio.half_duplex and receiver.sends:
        return 0
    count = 0
    for place in range(senders):
        sender = swarm.numbers[place]
        if sender == number or not in_cone(receiver, swarm.robots[sender], group.cone):
            continue
        if radio.loss > 0.0 and uniform(receiver.signal_random) < radio.loss:
            continue
        if count < MAX_MESSAGES:
            pulses.messages[count] = swarm.robots[sender].actuators.send
        count += 1
    return 0 if radio.collisions and count > 1 else count


def forget_signals(swarm: Swarm, robot: int) -> None:
    """Discard the picture and the pulses on their way to a robot; its camera keeps its instants."""
    swarm.robots[robot].picture_arrives = NEVER
    group = swarm.groups[group_of(swarm, robot)]
    first = group.radio.first + robot - group.first
    swarm.air.count[first : first + group.radio.slots * group.count : group.count] = 0
