"""The light of LED rings, as an overexposed webcam sees it: a core that is brighter than it can hold, and a haze."""

import math

from epuck_sim import epuck
from epuck_sim.arrays import Float32Array, FloatArray, IntArray
from epuck_sim.util.jit import jit

COLOUR_LEVELS = (900.0, 130.0, 120.0)
"""Levels of red, green and blue that a ring of light 1 adds; our estimate.

A sensor holds 255: red is saturated all along the ring, and what leaks into green and blue makes its core pinkish, as
Fig. 4.5 of the thesis shows it.
"""

NOMINAL_EXPOSURE_MS = 20.0
"""At this exposure an LED has light 1; our definition."""

WIDTH_CM = 0.3
"""Standard deviation of the brightness across a ring: it shines through a diffuser; our estimate."""

DEPTH = 0.5
"""Midway between two of the eight LEDs a ring is darker by this share; our estimate."""

FADE_CM = 1.0
"""The haze falls to 1/e of its brightness so far from a ring; our estimate."""

CORE_CM = 5 * WIDTH_CM
"""Farther from the ring than this, its core adds less than half a level, even in an exposure of a second."""

FAINT_LEVELS = 0.5
"""A haze of less than this rounds to nothing."""


def reach_cm(light: float, bloom: float) -> float:
    """Return how far from a ring of this light its core or haze is seen."""
    brightest = light * bloom * max(COLOUR_LEVELS) / FAINT_LEVELS
    return max(CORE_CM, FADE_CM * math.log(max(brightest, 1.0)))


@jit
def add_rings(
    image: Float32Array,
    floor_cm: Float32Array,
    eye_cm: FloatArray,
    poses: FloatArray,
    patches: IntArray,
    light: float,
    bloom: float,
    reach: float,
) -> None:
    """Add rings that are on to (rows, columns) `image`.

    floor_cm: (rows, columns, 2) the point of the floor that each pixel shows; eye_cm: (3,) where the lens is;
    poses: (rings, 3) cm, cm, rad of robots; patches: (rings, 4) as `find_patches` returns them; light: of an LED;
    bloom: brightness of the haze at the ring, beside the LED's; reach: cm from the ring beyond which nothing is added.
    """
    rise = epuck.RING_HEIGHT_CM / eye_cm[2]
    for ring in range(len(poses)):
        # the ring's centre, moved along the lines of sight to the floor, whose points are then the ring's, enlarged
        x, y = poses[ring, 0] - rise * eye_cm[0], poses[ring, 1] - rise * eye_cm[1]
        ahead_x, ahead_y = math.cos(poses[ring, 2]), math.sin(poses[ring, 2])
        for row in range(patches[ring, 0], patches[ring, 1]):
            for column in range(patches[ring, 2], patches[ring, 3]):
                dx = (1.0 - rise) * floor_cm[row, column, 0] - x
                dy = (1.0 - rise) * floor_cm[row, column, 1] - y
                distance = math.sqrt(dx * dx + dy * dy)
                off = abs(distance - epuck.RING_RADIUS_CM)
                if off <= reach:
                    shine = bloom * math.exp(-off / FADE_CM)
                    if off <= CORE_CM:
                        ahead = (dx * ahead_x + dy * ahead_y) / distance
                        shine += _led_light(ahead) * math.exp(-0.5 * (off / WIDTH_CM) ** 2)
                    image[row, column] += light * shine


@jit
def _led_light(ahead: float) -> float:
    """Return the light of a ring at the angle whose cosine is `ahead`, from the heading: 1 at each of eight LEDs."""
    for _ in range(3):  # the cosine of twice the angle, thrice
        ahead = 2.0 * ahead * ahead - 1.0
    return 1.0 - DEPTH * 0.5 * (1.0 - ahead)
