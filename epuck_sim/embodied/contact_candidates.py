"""Which robots may touch something soon: only they need a physics engine, all others move in straight lines."""

import math

import numpy as np

from epuck_sim.embodied.bodies_tuple import Bodies
from epuck_sim.embodied.cell_list import cells_around, members_in_row
from epuck_sim.util.jit import jit_no_alloc

MARGIN_CM = 0.08
"""Margin in cm by which bodies are enlarged; overlaps of up to twice the margin are not corrected.

pymunk detects a contact only after bodies overlap, and two e-pucks that meet head-on at full speed approach by 2.56 mm
in a physics step. Margins make it detect contacts 1.6 mm earlier, so that real bodies overlap by less than 1 mm, and
robots that press on something come to rest where their real surfaces touch. Scenarios refuse wheels that are too fast
for this.
"""

PUSHED_CM = 0.1
"""Distance in cm by which a contact may move a robot farther in a control step than the fastest robot drives.

Contacts take overlaps away, and squeeze robots out between others; 0.06 cm was the most in crowds at full speed.
"""

_ROUNDING_CM = 1e-6


@jit_no_alloc
def touch_cm(bodies: Bodies) -> float:
    """Return the distance of the centres of two enlarged robots that touch."""
    return 2.0 * (bodies.radius_cm + MARGIN_CM) + _ROUNDING_CM


@jit_no_alloc
def wall_touch_cm(bodies: Bodies) -> float:
    """Return the distance from a wall or an obstacle to the centre of a robot, both enlarged, that touches it."""
    return bodies.radius_cm + 2.0 * MARGIN_CM + _ROUNDING_CM


@jit_no_alloc
def find_contact_candidates(bodies: Bodies, time_s: float) -> None:
    """Find the robots that may touch a wall, an obstacle or another robot within a time; never miss one that does.

    These are the robots that would touch something if all moved in straight lines, and all that they may push or be
    pushed into, one by the other. Writes `bodies.is_candidate`; `bodies.cells` are sorted by the poses.
    """
    poses, velocities, cells = bodies.poses, bodies.velocities, bodies.cells
    fastest = 0.0
    for robot in range(len(poses)):
        fastest = max(fastest, velocities[robot, 0] ** 2 + velocities[robot, 1] ** 2)
    path_cm = math.sqrt(fastest) * time_s + PUSHED_CM
    reach_cm = touch_cm(bodies) + 2.0 * path_cm
    # robots of further cells may be within reach, too; and movables may push robots that are far from each other
    if reach_cm > min(cells.width_cm, cells.height_cm) or len(bodies.movables) > 0:
        for robot in range(len(poses)):
            bodies.is_candidate[robot] = bodies.present[robot]
        return
    found = 0
    for robot in range(len(poses)):
        if not bodies.present[robot]:
            bodies.is_candidate[robot] = False
            continue
        meets = _meets_wall(bodies, robot, time_s) or _is_near_obstacle(bodies, robot, wall_touch_cm(bodies) + path_cm)
        bodies.is_candidate[robot] = meets or (bodies.touch and _meets_robot(bodies, robot, time_s, reach_cm))
        if bodies.is_candidate[robot]:
            bodies.reached[found] = robot
            found += 1
    while bodies.touch and found > 0:
        found -= 1
        found = _reach_others(bodies, bodies.reached[found], reach_cm, found)


@jit_no_alloc
def _meets_wall(bodies: Bodies, robot: int, time_s: float) -> bool:
    """Return whether a straight line ends at a wall."""
    x = bodies.poses[robot, 0] + bodies.velocities[robot, 0] * time_s
    y = bodies.poses[robot, 1] + bodies.velocities[robot, 1] * time_s
    gap_cm: float = min(x, y, bodies.width_cm - x, bodies.height_cm - y)
    return gap_cm <= wall_touch_cm(bodies)


@jit_no_alloc
def _is_near_obstacle(bodies: Bodies, robot: int, reach_cm: float) -> bool:
    """Return whether a robot is within reach of a round obstacle, or of the box around an obstacle's edge."""
    x, y = bodies.poses[robot, 0], bodies.poses[robot, 1]
    circles, edges = bodies.circles, bodies.edges
    for k in range(len(circles)):
        if np.hypot(circles[k, 0] - x, circles[k, 1] - y) <= circles[k, 2] + reach_cm:
            return True
    for k in range(len(edges)):
        ax, ay, bx, by = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
        if max(min(ax, bx) - x, x - max(ax, bx), min(ay, by) - y, y - max(ay, by)) <= reach_cm:
            return True
    return False


@jit_no_alloc
def _meets_robot(bodies: Bodies, robot: int, time_s: float, reach_cm: float) -> bool:
    """Return whether the straight lines of a robot and another one come so close that the two touch."""
    poses, velocities, cells = bodies.poses, bodies.velocities, bodies.cells
    x, y = poses[robot, 0], poses[robot, 1]
    block = cells_around(x, y, cells)
    for row in range(block.first_row, block.end_row):
        start, end = members_in_row(block, row, cells)
        for member in range(start, end):
            other = cells.members[member]
            dx, dy = poses[other, 0] - x, poses[other, 1] - y
            if dx * dx + dy * dy > reach_cm * reach_cm or other == robot:
                continue
            vx = velocities[other, 0] - velocities[robot, 0]
            vy = velocities[other, 1] - velocities[robot, 1]
            if _closest(dx, dy, vx, vy, time_s) <= touch_cm(bodies):
                return True
    return False


@jit_no_alloc
def _closest(dx: float, dy: float, vx: float, vy: float, time_s: float) -> float:
    """Return the smallest distance within a time of a point that starts at (dx, dy) and moves with (vx, vy)."""
    approach = -(dx * vx + dy * vy)
    speed2 = vx * vx + vy * vy
    when = 0.0 if approach <= 0.0 else min(approach / speed2, time_s)
    return math.hypot(dx + vx * when, dy + vy * when)


@jit_no_alloc
def _reach_others(bodies: Bodies, robot: int, reach_cm: float, found: int) -> int:
    """Add to `bodies.reached` the robots within reach of one that may be pushed; return the number of robots in it."""
    poses, cells = bodies.poses, bodies.cells
    x, y = poses[robot, 0], poses[robot, 1]
    block = cells_around(x, y, cells)
    for row in range(block.first_row, block.end_row):
        start, end = members_in_row(block, row, cells)
        for member in range(start, end):
            other = cells.members[member]
            dx, dy = poses[other, 0] - x, poses[other, 1] - y
            if not bodies.is_candidate[other] and dx * dx + dy * dy <= reach_cm * reach_cm:
                bodies.is_candidate[other] = True
                bodies.reached[found] = other
                found += 1
    return found
