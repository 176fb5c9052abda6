"""Which robots may touch something soon: only they need a physics engine, all others move in straight lines.

Most candidates touch only walls, or only one other robot, without friction. These move by the same arithmetic as in
Chipmunk, with equal outcomes up to rounding, but without the time that its space takes. In each physics step bodies
move; then those that touch lose the speed at which they approach, shared by their masses; overlaps beyond `SLOP_CM` are
corrected in the next physics step.

Candidates are the robots that would touch something in a control step if all moved in straight lines, and in turn all
robots that candidates may push or be pushed into. All others are too far from a candidate to meet it, even if both were
as fast as the fastest robot and contacts moved each `PUSHED_CM` farther.

Contacts can move a robot any distance: rows of robots that drive at each other squeeze out one between them, the faster
the longer the rows. So before each physics step, `chipmunk` looks for candidates that their velocities take farther
than the fastest robot's path and `PUSHED_CM`. It brings in the robots that these may touch in that step, by
`add_reached`, and then those that robots brought in may touch. The others touch nobody: two that have not come too far
are out of each other's reach by another `PUSHED_CM`. This is left for corrections of overlaps, which do not show in
velocities. So a contact is found in the same physics step as with all robots in the space, unless corrections alone
move a robot by more than that in a single step; then it is found a step later.
"""

import math
from typing import Any, NamedTuple

from epuck_sim.arrays import ByteArray
from epuck_sim.embodied.cells import cells_around, members_in_row
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.util.elementary import hypot
from epuck_sim.util.jit import jit_inline, jit_no_alloc

MARGIN_CM = 0.08
"""Margin in cm by which bodies are enlarged; overlaps of up to twice the margin are not corrected.

pymunk detects a contact only after bodies overlap, and two e-pucks that meet head-on at full speed approach by 2.56 mm
in a physics step. Margins make it detect contacts 1.6 mm earlier, so that real bodies overlap by less than 1 mm, and
robots that press on something come to rest where their real surfaces touch. Scenarios refuse wheels that are too fast
for this.
"""

SLOP_CM = 2 * MARGIN_CM  # overlap of enlarged bodies that is not corrected

PUSHED_CM = 0.1
"""Distance in cm by which contacts may move a robot farther than the fastest robot drives before others are sought."""

NOBODY = -1  # stands for no robot

_ROUNDING_CM = 1e-6
_EQUAL_CM = 1e-9


@jit_inline
def touch_cm(one_cm: float, other_cm: float) -> float:
    """Return the distance of the centres of two enlarged robots of these radii that touch."""
    return (one_cm + MARGIN_CM) + (other_cm + MARGIN_CM) + _ROUNDING_CM


@jit_inline
def wall_touch_cm(radius_cm: float) -> float:
    """Return the distance from a wall or an obstacle to the centre of a robot, both enlarged, that touches it."""
    return radius_cm + 2.0 * MARGIN_CM + _ROUNDING_CM


@jit_no_alloc
def find_contact_candidates(block: ByteArray) -> float:
    """Flag the robots that may touch something in a control step, and set partners; return the top speed, cm/s."""
    swarm = swarm_at(block)
    scene, robots, reached = swarm.scene[0], swarm.robots, swarm.numbers
    time_s = scene.physics_steps * scene.physics_s
    fastest = 0.0
    for number in range(len(robots)):
        fastest = max(fastest, robots[number].vx ** 2 + robots[number].vy ** 2)
    fastest = math.sqrt(fastest)
    path_cm = fastest * time_s + PUSHED_CM
    reach_cm = touch_cm(scene.largest_cm, scene.largest_cm) + 2.0 * path_cm
    # robots beyond the cells around may be within reach, and movables may push robots that are far from each other
    if reach_cm > min(scene.cell_width_cm, scene.cell_height_cm) or scene.circles > scene.first_movable:
        for number in range(len(robots)):
            robots[number].may_touch, robots[number].partner = robots[number].present, NOBODY
        return fastest
    found = 0
    for number in range(len(robots)):
        robot = robots[number]
        robot.partner = NOBODY
        robot.may_touch = robot.present and (
            _wall_gap_cm(swarm, number, time_s) <= wall_touch_cm(robot.radius_cm)
            or _is_near_obstacle(swarm, number, wall_touch_cm(robot.radius_cm) + path_cm)
            or (scene.touch and _meets_robot(swarm, number, time_s, reach_cm))
        )
        if robot.may_touch:
            robot.partner = number
            reached[found] = number
            found += 1
    while scene.touch and found > 0:
        found -= 1
        found = _reach_others(swarm, reached[found], reach_cm, found)
    for number in range(len(robots)):
        robot = robots[number]
        if robot.may_touch and robot.partner >= number:
            other = robots[robot.partner]
            is_lone = scene.smooth and other.partner == number and _is_lone(swarm, number, path_cm)
            robot.may_touch = other.may_touch = not is_lone
            if not is_lone:
                robot.partner = other.partner = NOBODY
    return fastest


@jit_inline
def _is_lone(swarm: Swarm, number: int, path_cm: float) -> bool:
    """Return whether a robot and its partner touch nothing but each other, or one robot nothing but walls."""
    scene, other = swarm.scene[0], swarm.robots[number].partner
    reach_cm = wall_touch_cm(scene.largest_cm) + path_cm
    if _is_near_obstacle(swarm, number, reach_cm) or _is_near_obstacle(swarm, other, reach_cm):
        return False
    if other != number and min(_wall_gap_cm(swarm, number, 0.0), _wall_gap_cm(swarm, other, 0.0)) <= reach_cm:
        return False
    return lone_motion(swarm, number, scene.physics_steps, path_cm).is_exact


@jit_inline
def _wall_gap_cm(swarm: Swarm, number: int, time_s: float) -> float:
    """Return the distance from the nearest wall to a robot's centre when it has moved in a straight line."""
    robot, scene = swarm.robots[number], swarm.scene[0]
    x = robot.x + robot.vx * time_s
    y = robot.y + robot.vy * time_s
    gap_cm: float = min(x, y, scene.width_cm - x, scene.height_cm - y)
    return gap_cm


@jit_inline
def _is_near_obstacle(swarm: Swarm, number: int, reach_cm: float) -> bool:
    """Return whether a robot is within reach of a round obstacle, or of the box around an obstacle's edge."""
    x, y = swarm.robots[number].x, swarm.robots[number].y
    for index in range(swarm.scene[0].circles):
        circle = swarm.circles[index]
        if hypot(circle.x - x, circle.y - y) <= circle.radius + reach_cm:
            return True
    for index in range(swarm.scene[0].edges):
        edge = swarm.edges[index]
        beside = max(min(edge.ax, edge.bx) - x, x - max(edge.ax, edge.bx))
        if max(beside, min(edge.ay, edge.by) - y, y - max(edge.ay, edge.by)) <= reach_cm:
            return True
    return False


@jit_inline
def _meets_robot(swarm: Swarm, number: int, time_s: float, reach_cm: float) -> bool:
    robot = swarm.robots[number]
    near = cells_around(robot.x, robot.y, swarm.scene[0])
    for row in range(near.first_row, near.end_row):
        start, end = members_in_row(near, row, swarm)
        for index in range(start, end):
            member = swarm.members[index]
            dx, dy = member.x - robot.x, member.y - robot.y
            if dx * dx + dy * dy > reach_cm * reach_cm or member.robot == number:
                continue
            other = swarm.robots[member.robot]
            vx, vy = other.vx - robot.vx, other.vy - robot.vy
            approach = -(dx * vx + dy * vy)
            when = 0.0 if approach <= 0.0 else min(approach / (vx * vx + vy * vy), time_s)
            if hypot(dx + vx * when, dy + vy * when) <= touch_cm(robot.radius_cm, member.radius_cm):
                return True
    return False


@jit_inline
def _reach_others(swarm: Swarm, number: int, reach_cm: float, found: int) -> int:
    """List the robots within reach of a candidate, and set its partner if it is only one; return the list's length."""
    robot = swarm.robots[number]
    near = cells_around(robot.x, robot.y, swarm.scene[0])
    for row in range(near.first_row, near.end_row):
        start, end = members_in_row(near, row, swarm)
        for index in range(start, end):
            member = swarm.members[index]
            dx, dy = member.x - robot.x, member.y - robot.y
            if dx * dx + dy * dy > reach_cm * reach_cm or member.robot == number:
                continue
            robot.partner = member.robot if robot.partner == number else NOBODY
            other = swarm.robots[member.robot]
            if not other.may_touch:
                other.may_touch, other.partner = True, member.robot
                swarm.numbers[found] = member.robot
                found += 1
    return found


class Motion(NamedTuple):
    """Places, cm, and velocities, cm/s, of a robot and of the only other one that it may touch."""

    x: float
    y: float
    vx: float
    vy: float
    other_x: float
    other_y: float
    other_vx: float
    other_vy: float
    is_exact: bool  # whether Chipmunk would have moved them there, and would have nothing left to correct


@jit_no_alloc
def lone_motion(swarm: Swarm, number: int, steps: int, reach_cm: float) -> Motion:
    """Return the motion of a robot and its partner in some physics steps; that of two is inexact beyond `reach_cm`."""
    scene, robot = swarm.scene[0], swarm.robots[number]
    if robot.partner != number:
        return _push(robot, swarm.robots[robot.partner], steps, scene.physics_s, reach_cm)
    x, vx, x_exact = _slide(robot.x, robot.vx, robot.radius_cm, scene.width_cm, steps, scene.physics_s)
    y, vy, y_exact = _slide(robot.y, robot.vy, robot.radius_cm, scene.height_cm, steps, scene.physics_s)
    return Motion(x, y, vx, vy, x, y, vx, vy, x_exact and y_exact)


@jit_inline
def _slide(
    place: float, speed: float, radius_cm: float, length_cm: float, steps: int, step_s: float
) -> tuple[float, float, bool]:
    """Return place and speed along an axis after some physics steps between two walls, and whether they are exact."""
    back, end = 0.0, length_cm - radius_cm
    is_exact = radius_cm - _EQUAL_CM <= place <= end + _EQUAL_CM
    for _ in range(steps):
        place += (speed + back) * step_s
        back = 0.0
        if place <= radius_cm + SLOP_CM:
            speed, back = max(speed, 0.0), max(radius_cm - place, 0.0) / step_s
        elif place >= end - SLOP_CM:
            speed, back = min(speed, 0.0), min(end - place, 0.0) / step_s
    return place, speed, is_exact and abs(back) * step_s <= _EQUAL_CM


@jit_inline
def _push(one: Any, other: Any, steps: int, step_s: float, reach_cm: float) -> Motion:
    together_cm = one.radius_cm + other.radius_cm
    share = other.mass_g / (one.mass_g + other.mass_g)  # of a change of speed that the first one takes
    x, y, vx, vy = one.x, one.y, one.vx, one.vy
    other_x, other_y, other_vx, other_vy = other.x, other.y, other.vx, other.vy
    dx, dy, apart_s = other_x - x, other_y - y, 0.0
    farthest = 0.0
    is_exact = math.sqrt(dx * dx + dy * dy) >= together_cm - _EQUAL_CM
    for _ in range(steps):
        # apart_s: velocity, as a share of (dx, dy), with which the two are moved apart
        x += (vx - share * apart_s * dx) * step_s
        y += (vy - share * apart_s * dy) * step_s
        other_x += (other_vx + (1.0 - share) * apart_s * dx) * step_s
        other_y += (other_vy + (1.0 - share) * apart_s * dy) * step_s
        farthest = max(
            farthest, (x - one.x) ** 2 + (y - one.y) ** 2, (other_x - other.x) ** 2 + (other_y - other.y) ** 2
        )
        dx, dy, apart_s = other_x - x, other_y - y, 0.0
        square = dx * dx + dy * dy
        if square >= (together_cm + SLOP_CM) ** 2:
            continue
        approach_s = max(-((other_vx - vx) * dx + (other_vy - vy) * dy) / square, 0.0)
        vx, vy = vx - share * approach_s * dx, vy - share * approach_s * dy
        other_vx, other_vy = other_vx + (1.0 - share) * approach_s * dx, other_vy + (1.0 - share) * approach_s * dy
        distance = math.sqrt(square)
        apart_s = max(together_cm - distance, 0.0) / (step_s * distance)
    left_cm = apart_s * step_s * math.sqrt(dx * dx + dy * dy)
    is_exact = is_exact and farthest <= reach_cm * reach_cm and left_cm <= _EQUAL_CM
    return Motion(x, y, vx, vy, other_x, other_y, other_vx, other_vy, is_exact)


@jit_no_alloc
def _move(swarm: Swarm, number: int, steps: int) -> None:
    """Move a robot, and its partner, if it has one, by some physics steps, and set their new velocities."""
    robot, time_s = swarm.robots[number], steps * swarm.scene[0].physics_s
    robot.heading += robot.spin * time_s
    if robot.partner == NOBODY:
        robot.x += robot.vx * time_s
        robot.y += robot.vy * time_s
        return
    other, moved = swarm.robots[robot.partner], lone_motion(swarm, number, steps, math.inf)
    other.x, other.y, other.vx, other.vy = moved.other_x, moved.other_y, moved.other_vx, moved.other_vy
    robot.x, robot.y, robot.vx, robot.vy = moved.x, moved.y, moved.vx, moved.vy
    if robot.partner != number:
        other.heading += other.spin * time_s


@jit_no_alloc
def add_reached(block: ByteArray, found: int, x: float, y: float, approach_cm_s: float, past: int) -> int:
    """Add to the candidates, `found` so far, the robots that may touch one at (x, y) in the next physics step.

    They are first moved by the `past` physics steps since the control step began. Without contacts, a robot approaches
    at up to `approach_cm_s`. Return the number of candidates.
    """
    swarm = swarm_at(block)
    largest_cm, time_s = swarm.scene[0].largest_cm, past * swarm.scene[0].physics_s
    reach_cm = touch_cm(largest_cm, largest_cm) + approach_cm_s * swarm.scene[0].physics_s + PUSHED_CM
    near = cells_around(x, y, swarm.scene[0])
    for row in range(near.first_row, near.end_row):
        start, end = members_in_row(near, row, swarm)
        for index in range(start, end):
            number = swarm.members[index].robot
            other = swarm.robots[number]
            if not other.present or other.may_touch:
                continue
            there_x, there_y = other.x + other.vx * time_s, other.y + other.vy * time_s
            if other.partner != NOBODY:
                moved = lone_motion(swarm, number, past, math.inf)
                there_x, there_y = moved.x, moved.y
            if hypot(there_x - x, there_y - y) <= reach_cm:
                found = _add(swarm, number, past, found)
    return found


@jit_inline
def _add(swarm: Swarm, number: int, past: int, found: int) -> int:
    """Move a robot, and its partner, if it has one, and add them to the list of candidates; return its new length."""
    _move(swarm, number, past)
    for index in range(len(swarm.members)):
        if swarm.members[index].robot in (number, swarm.robots[number].partner):
            swarm.robots[swarm.members[index].robot].may_touch = True
            swarm.numbers[found] = index
            found += 1
    return found


@jit_no_alloc
def move_others(block: ByteArray) -> None:
    """Move the robots that Chipmunk does not move, by a control step."""
    swarm = swarm_at(block)
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        if not robot.may_touch and (robot.partner == NOBODY or robot.partner >= number):
            _move(swarm, number, swarm.scene[0].physics_steps)
