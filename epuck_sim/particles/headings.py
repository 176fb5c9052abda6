"""Directions of motion: away from a wall, anywhere, or around the present one (thesis 3.1, D, 6.2)."""

import math

from epuck_sim.arrays import FloatArray, StreamArray
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.rng import uniform


@jit_inline
def heading_from_wall(heading: FloatArray, axis: int, inward: float, stream: StreamArray) -> None:
    """Draw a heading within 90 degrees of a wall's normal.

    In a square the angle to the normal is uniform (thesis 3.1), in a cube the direction is uniform over the hemisphere
    (D.3), and in a segment the normal is the only direction.

    Args:
        heading: (dimensions,) unit vector, which is overwritten.
        axis: Axis of the normal.
        inward: Sign of the normal, 1 or -1.
        stream: (4,) state of the random number generator.
    """
    if len(heading) == 1:
        heading[0] = inward
    elif len(heading) == 2:
        angle = math.pi * (uniform(stream) - 0.5)
        heading[axis] = inward * math.cos(angle)
        heading[1 - axis] = math.sin(angle)
    else:
        set_heading(heading, axis, inward * (1.0 - uniform(stream)), uniform(stream))


@jit_inline
def random_heading(heading: FloatArray, stream: StreamArray) -> None:
    """Draw a heading, (dimensions,), uniformly over all directions."""
    if len(heading) == 1:
        heading[0] = 1.0 if uniform(stream) < 0.5 else -1.0
    elif len(heading) == 2:
        angle = 2 * math.pi * uniform(stream)
        heading[0] = math.cos(angle)
        heading[1] = math.sin(angle)
    else:
        set_heading(heading, 2, 2 * uniform(stream) - 1, uniform(stream))


@jit_inline
def set_heading(heading: FloatArray, axis: int, height: float, turn: float) -> None:
    """Set a heading, (3,), by its component along an axis, -1 to 1, and its azimuth around it, 0 to 1 turn."""
    rim = math.sqrt(1 - height * height)
    heading[axis] = height
    heading[(axis + 1) % 3] = rim * math.cos(2 * math.pi * turn)
    heading[(axis + 2) % 3] = rim * math.sin(2 * math.pi * turn)


@jit_inline
def turn_heading(heading: FloatArray, persistence: float, stream: StreamArray) -> None:
    """Turn a heading by a random angle whose mean cosine is `persistence`; with 0, any direction is as likely.

    In a segment it is reversed with the chance that gives this mean. In a square the angle has a wrapped Cauchy
    distribution, in a cube that of Henyey and Greenstein (1941), whose axis is the old heading.

    Args:
        heading: (dimensions,) unit vector, which is overwritten.
        persistence: Mean cosine g of the angle, 0 to 1.
        stream: (4,) state of the random number generator.
    """
    if len(heading) == 1:
        heading[0] = -heading[0] if uniform(stream) < (1 - persistence) / 2 else heading[0]
    elif len(heading) == 2:
        narrowing = (1 - persistence) / (1 + persistence)
        angle = 2 * math.atan(narrowing * math.tan(math.pi * (uniform(stream) - 0.5)))
        set_rotated(heading, math.cos(angle), math.sin(angle))
    else:
        share = 1.0 - uniform(stream)  # above 0, so that the denominator is, too
        spread = 1 - persistence + 2 * persistence * share
        cosine = 2 * share * (1 + persistence) ** 2 * (1 - persistence * (1 - share)) / (spread * spread) - 1
        set_tilted(heading, min(max(cosine, -1.0), 1.0), uniform(stream))


@jit_inline
def set_rotated(heading: FloatArray, cosine: float, sine: float) -> None:
    """Rotate a heading, (2,), by an angle; its length is set to 1, so that rounding errors do not add up."""
    x = heading[0] * cosine - heading[1] * sine
    y = heading[0] * sine + heading[1] * cosine
    length = math.sqrt(x * x + y * y)
    heading[0] = x / length
    heading[1] = y / length


@jit_inline
def set_tilted(heading: FloatArray, cosine: float, turn: float) -> None:
    """Tilt a heading, (3,), by an angle, in the plane that an azimuth of 0 to 1 turn around it gives; to length 1.

    The two directions across it are those of Duff et al. (2017), which have no singularity.
    """
    x, y, z = heading[0], heading[1], heading[2]
    side = math.copysign(1.0, z)
    a = -1 / (side + z)
    b = x * y * a
    rim = math.sqrt(1 - cosine * cosine)
    one, other = rim * math.cos(2 * math.pi * turn), rim * math.sin(2 * math.pi * turn)
    heading[0] = one * (1 + side * x * x * a) + other * b + cosine * x
    heading[1] = one * (side * b) + other * (side + y * y * a) + cosine * y
    heading[2] = one * (-side * x) - other * y + cosine * z
    length = math.sqrt(heading[0] ** 2 + heading[1] ** 2 + heading[2] ** 2)
    for axis in range(3):
        heading[axis] /= length
