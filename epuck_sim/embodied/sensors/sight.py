"""Lines of sight: rays that end at surfaces, views that rule out what they cannot show, and lists of lit rings.

A ray starts at (ox, oy) and runs along the unit vector (dx, dy); its functions return the distance in cm to the first
surface, `inf` where the ray misses, and 0 where it starts inside a disc and looks towards its centre. Views rule out
robots and cells without trigonometric functions, and never a disc that a ray would meet.
"""

import math
from typing import Any, NamedTuple

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.cells import cell_index
from epuck_sim.embodied.swarm import HIDE, Swarm
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.native import call

SECTOR_RAD = 1.0
"""Largest angle of a view that is searched strip by strip: all its rays must run ahead, at most 74 degrees aside."""

ATAN2_ERROR_RAD = 1.2e-5
"""Bound of the error of `fast_atan2` in rad: at most 1.15e-5, near the diagonals (Abramowitz and Stegun 4.4.49)."""

SLACK_CM = 1e-6  # allowance in cm on a robot's radius, so that rounding never rules out a robot that a ray just meets


@jit_inline
def to_disc(ox: float, oy: float, dx: float, dy: float, cx: float, cy: float, radius: float) -> float:
    """Return the distance along the ray to the disc of `radius` around (cx, cy)."""
    fx = cx - ox
    fy = cy - oy
    along = fx * dx + fy * dy
    if along <= 0.0:  # also from inside: bodies that touch may overlap a little, and a sensor that looks away sees none
        return math.inf
    outside = fx * fx + fy * fy - radius * radius
    if outside <= 0.0:
        return 0.0
    cut = along * along - outside
    if cut < 0.0:
        return math.inf
    # the nearer root, written without a difference of nearly equal numbers
    return outside / (along + math.sqrt(cut))


@jit_inline
def to_segment(ox: float, oy: float, dx: float, dy: float, ax: float, ay: float, bx: float, by: float) -> float:
    """Return the distance along the ray to the segment from (ax, ay) to (bx, by)."""
    ex = bx - ax
    ey = by - ay
    turn = dx * ey - dy * ex
    if turn == 0.0:  # parallel: the ray would meet the polygon's neighbouring edges
        return math.inf
    fx = ax - ox
    fy = ay - oy
    distance = (fx * ey - fy * ex) / turn
    share = (fx * dy - fy * dx) / turn
    if distance < 0.0 or share < 0.0 or share > 1.0:
        return math.inf
    return distance


class FieldOfView(NamedTuple):
    """The part of the floor between the rays of two pixels that begin at (x, y)."""

    x: float
    y: float
    left_x: float
    left_y: float  # direction of the leftmost ray, with `left_x`: a unit vector
    right_x: float
    right_y: float  # direction of the rightmost ray, with `right_x`: a unit vector
    wide: bool  # whether the two rays are half a turn apart or more; then nothing is ruled out
    reach_cm: float  # radius of the largest robot that may be seen, and `SLACK_CM`


class Strips(NamedTuple):
    """Columns or rows of cells, whichever lie more across a view; numbered as in the cell list."""

    are_columns: bool  # whether the strips are columns; else they are rows
    first: int  # nearest strip in which the centre of a robot that is seen may be
    step: int  # 1 or -1: from a strip to the next one ahead
    total: int  # number of strips in the arena
    width_cm: float  # width of a strip
    ahead_cm: float  # how far ahead of the camera the near side of strip 0 is, at right angles to the strips


class Wedge(NamedTuple):
    """Where along the strips the centres of robots that reach into a view may be: between two lines."""

    low: float  # slope of the line below: towards larger x (or y), along the strips, for each cm ahead
    low_cm: float  # where the line below meets the camera's strip line, seen from the camera
    high: float  # slope of the line above
    high_cm: float  # where the line above meets the camera's strip line, seen from the camera
    stretch: float  # length of the view's shortest ray for each cm ahead, at least 1
    reach_cm: float  # that of the view


@jit_inline
def may_contain_robot(view: FieldOfView, dx: float, dy: float) -> bool:
    """Return whether a robot at (dx, dy) from the camera may reach into the view; never False for one that does."""
    beyond_left = dy * view.left_x - dx * view.left_y
    beyond_right = dx * view.right_y - dy * view.right_x
    return view.wide or max(beyond_left, beyond_right) <= view.reach_cm


@jit_inline
def make_strips(view: FieldOfView, scene: Any) -> Strips:
    """Return the strips of cells that lie across a view of at most `SECTOR_RAD`."""
    ahead_x, ahead_y = view.left_x + view.right_x, view.left_y + view.right_y
    are_columns = abs(ahead_x) >= abs(ahead_y)
    if are_columns:
        position, ahead, width, count = view.x, ahead_x, scene.cell_width_cm, scene.columns
    else:
        position, ahead, width, count = view.y, ahead_y, scene.cell_height_cm, scene.rows
    step = 1 if ahead > 0.0 else -1
    first = cell_index(position - step * view.reach_cm, width, count)
    return Strips(are_columns, first, step, count, width, -position if step > 0 else position - width)


@jit_inline
def make_wedge(view: FieldOfView, strips: Strips) -> Wedge:
    """Return the wedge of a view, or of a part of the view, for which the strips were made."""
    if strips.are_columns:
        left, left_along, right, right_along = view.left_x, view.left_y, view.right_x, view.right_y
    else:
        left, left_along, right, right_along = view.left_y, view.left_x, view.right_y, view.right_x
    left_stretch, right_stretch = 1.0 / abs(left), 1.0 / abs(right)
    low, low_stretch = left_along * left_stretch, left_stretch
    high, high_stretch = right_along * right_stretch, right_stretch
    if low > high:
        low, low_stretch, high, high_stretch = high, high_stretch, low, low_stretch
    stretch = 1.0 if low <= 0.0 <= high else min(low_stretch, high_stretch)
    return Wedge(low, -view.reach_cm * low_stretch, high, view.reach_cm * high_stretch, stretch, view.reach_cm)


@jit_inline
def cells_in_strip(view: FieldOfView, wedge: Wedge, strips: Strips, strip: int, scene: Any) -> tuple[int, int, int]:
    """Return the first cell of a strip where seen robots may be, the number of cells upwards, and sideways."""
    near = strips.ahead_cm + strips.step * strip * strips.width_cm
    far = near + strips.width_cm
    near = max(near, -view.reach_cm)
    low = wedge.low_cm + min(wedge.low * near, wedge.low * far)
    high = wedge.high_cm + max(wedge.high * near, wedge.high * far)
    if strips.are_columns:
        south = cell_index(view.y + low, scene.cell_height_cm, scene.rows)
        north = cell_index(view.y + high, scene.cell_height_cm, scene.rows)
        return south * scene.columns + strip, north - south + 1, 1
    west = cell_index(view.x + low, scene.cell_width_cm, scene.columns)
    east = cell_index(view.x + high, scene.cell_width_cm, scene.columns)
    return strip * scene.columns + west, 1, east - west + 1


@jit_inline
def distance_beyond(wedge: Wedge, strips: Strips, strip: int) -> float:
    """Return a distance at which no ray of the view has met a robot beyond a strip yet; it may be negative."""
    far = strips.ahead_cm + (strips.step * strip + 1) * strips.width_cm
    return (far - wedge.reach_cm) * wedge.stretch - SLACK_CM


@jit_inline
def angular_radius_bound(distance: float, radius: float) -> float:
    """Return an upper bound of the angular radius of a disc at `distance`, asin(radius / distance)."""
    if distance <= radius:
        return math.pi
    share = radius / distance
    return share + (0.5 * math.pi - 1.0) * share * share * share


@jit_inline
def fast_atan2(ahead: float, aside: float) -> float:
    """Return atan2(aside, ahead) with an error below `ATAN2_ERROR_RAD`, five times as fast."""
    x, y = abs(ahead), abs(aside)
    longer = max(x, y)
    if longer == 0.0:
        return 0.0
    slope = min(x, y) / longer
    square = slope * slope
    angle = slope * (
        0.9998660 + square * (-0.3302995 + square * (0.1801410 + square * (-0.0851330 + square * 0.0208351)))
    )
    if y > x:
        angle = 0.5 * math.pi - angle
    if ahead < 0.0:
        angle = math.pi - angle
    return angle if aside >= 0.0 else -angle


@jit_inline
def find_lit(swarm: Swarm) -> int:
    """Label the robots whose rings are lit with 1, others with 0, and list the lit; return how many there are."""
    robots = len(swarm.robots)
    for robot in range(robots):
        swarm.numbers[robots + robot] = 1 if swarm.robots[robot].ring_on else 0
    return list_labelled(swarm)


@jit_inline
def find_visible(block: ByteArray, addresses: IntArray, swarm: Swarm, robot: int) -> int:
    """Label and list the lit rings that faults do not hide from a robot; return how many there are."""
    call(addresses[HIDE], block, addresses, robot)
    return list_labelled(swarm)


@jit_inline
def list_labelled(swarm: Swarm) -> int:
    """List the robots whose labels are not 0; return how many there are."""
    robots, found = len(swarm.robots), 0
    for robot in range(robots):
        if swarm.numbers[robots + robot] > 0:
            swarm.numbers[found] = robot
            found += 1
    return found


@jit_inline
def add_pair(step: int, robot: int, other: int, found: IntArray, count: int) -> int:
    """Write three words, behind those of `count` other pairs, if there is room; return the number of pairs so far."""
    if 3 * count < len(found):
        found[3 * count], found[3 * count + 1], found[3 * count + 2] = step, robot, other
    return count + 1
