"""Ray casting: the distance along a ray to a disc or a segment.

A ray starts at (ox, oy) and runs along the unit vector (dx, dy). Each function returns the distance in cm to the first
surface, `inf` where the ray misses, and 0 where it starts inside a disc and looks towards its centre.
"""

import math

from epuck_sim.util.jit import jit_inline


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
