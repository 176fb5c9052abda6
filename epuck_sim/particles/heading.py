"""The directions in which agents set out (thesis 3.1, D.1, D.3)."""

import math

from epuck_sim.arrays import FloatArray, StreamArray
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.rng import uniform


@jit_inline
def set_out(heading: FloatArray, axis: int, inward: float, stream: StreamArray) -> None:
    """Point a heading, (dimensions,), away from a wall: anywhere within 90 degrees of its normal.

    axis, inward: the normal's axis, and 1 or -1, its sign. In a square the angle to it is uniform (thesis 3.1), in a
    cube the direction, over the hemisphere; in a segment there is but one.
    """
    if len(heading) == 1:
        heading[0] = inward
    elif len(heading) == 2:
        angle = math.pi * (uniform(stream) - 0.5)
        heading[axis] = inward * math.cos(angle)
        heading[1 - axis] = math.sin(angle)
    else:
        point(heading, axis, inward * (1.0 - uniform(stream)), uniform(stream))


@jit_inline
def set_out_anywhere(heading: FloatArray, stream: StreamArray) -> None:
    """Point a heading, (dimensions,), in a direction that is uniform over all of them."""
    if len(heading) == 1:
        heading[0] = 1.0 if uniform(stream) < 0.5 else -1.0
    elif len(heading) == 2:
        angle = 2 * math.pi * uniform(stream)
        heading[0] = math.cos(angle)
        heading[1] = math.sin(angle)
    else:
        point(heading, 2, 2 * uniform(stream) - 1, uniform(stream))


@jit_inline
def point(heading: FloatArray, axis: int, height: float, turned: float) -> None:
    """Point a heading, (3,), to this height, -1 to 1, along an axis, turned by a share of a circle around it."""
    rim = math.sqrt(1 - height * height)
    heading[axis] = height
    heading[(axis + 1) % 3] = rim * math.cos(2 * math.pi * turned)
    heading[(axis + 2) % 3] = rim * math.sin(2 * math.pi * turned)
