"""View culling: which robots and cells a camera may see, found without trigonometric functions.

The tests are fast and conservative: they never rule out a disc that a ray would meet. `line_camera` then decides ray by
ray what is seen.
"""

import math
from typing import NamedTuple

from epuck_sim import epuck
from epuck_sim.embodied.cell_list import CellList
from epuck_sim.util.jit import jit

_RADIUS = epuck.RADIUS_CM


class FieldOfView(NamedTuple):
    """The part of the floor between the rays of two pixels that begin at (x, y)."""

    x: float
    y: float
    left_x: float
    left_y: float
    """Direction of the leftmost ray, with `left_x`: a unit vector."""
    right_x: float
    right_y: float
    """Direction of the rightmost ray, with `right_x`: a unit vector."""
    wide: bool
    """Whether the two rays are half a turn apart or more; then nothing is ruled out."""


@jit
def may_contain_disc(view: FieldOfView, dx: float, dy: float, radius: float) -> bool:
    """Return whether a disc at (dx, dy) from the camera may reach into the view; never False for one that does."""
    beyond_left = dy * view.left_x - dx * view.left_y
    beyond_right = dx * view.right_y - dy * view.right_x
    return view.wide or max(beyond_left, beyond_right) <= radius


@jit
def visible_cells(left: float, right: float, wide: bool, own: int, ring: int, count: int) -> tuple[int, int]:
    """Return the first column (or row) up to `ring` away that the view may contain, and the one after the last.

    Where no ray points backwards, a robot that is seen may still have its centre in the previous column.

    Args:
        left: Component of the view's leftmost ray along the columns.
        right: Component of the view's rightmost ray along the columns.
        wide: Whether the two rays are half a turn apart or more.
        own: Column of the camera.
        ring: Largest difference to the camera's column.
        count: Number of columns.
    """
    low = own - (ring if wide or min(left, right) < 0.0 else min(ring, 1))
    high = own + (ring if wide or max(left, right) > 0.0 else min(ring, 1))
    return max(low, 0), min(high + 1, count)


@jit
def distance_outside(x: float, y: float, column: int, cell_row: int, ring: int, cells: CellList) -> float:
    """Return the distance from (x, y) to the nearest point of the arena outside the square of cells up to `ring`."""
    distance = math.inf
    if column - ring > 0:
        distance = min(distance, x - (column - ring) * cells.width_cm)
    if column + ring < cells.columns - 1:
        distance = min(distance, (column + ring + 1) * cells.width_cm - x)
    if cell_row - ring > 0:
        distance = min(distance, y - (cell_row - ring) * cells.height_cm)
    if cell_row + ring < cells.rows - 1:
        distance = min(distance, (cell_row + ring + 1) * cells.height_cm - y)
    return distance


@jit
def angular_radius_bound(distance: float) -> float:
    """Return an upper bound of a robot's angular radius at `distance`, asin(radius / distance)."""
    if distance <= _RADIUS:
        return math.pi
    share = _RADIUS / distance
    return share + (0.5 * math.pi - 1.0) * share * share * share


@jit
def fast_atan2(ahead: float, aside: float) -> float:
    """Return atan2(aside, ahead) with an error below 1e-5, five times as fast (Abramowitz and Stegun 4.4.49)."""
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
