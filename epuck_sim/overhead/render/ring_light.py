"""The light of LED rings in an overexposed webcam picture: a saturated core, and a haze around it."""

import math

from epuck_sim.arrays import Float32Array, FloatArray, IntArray
from epuck_sim.util.jit import jit

COLOUR_LEVELS = (900.0, 130.0, 120.0)
"""Levels of red, green and blue that a ring of light 1 adds; our estimate.

A pixel holds at most 255: red is saturated all along the ring, and what leaks into green and blue makes its core
pinkish, as in Fig. 4.5 of the thesis.
"""

NOMINAL_EXPOSURE_MS = 20.0
"""Exposure at which an LED has light 1; our definition."""

WIDTH_CM = 0.3
"""Standard deviation of the brightness across a ring, which shines through a diffuser; our estimate."""

DEPTH = 0.5
"""Fraction by which a ring is darker midway between two of its eight LEDs; our estimate."""

FADE_CM = 1.0
"""Distance from a ring at which its haze has fallen to 1/e of its brightness; our estimate."""

CORE_CM = 5 * WIDTH_CM
"""Distance beyond which the core of a ring adds less than half a level, even in an exposure of one second."""

FAINT_LEVELS = 0.5
"""Levels of haze below which it rounds to nothing."""


def reach_cm(light: float, bloom: float) -> float:
    """Return the distance from a ring up to which its core or haze is visible; bloom: see `add_rings`."""
    brightest = light * bloom * max(COLOUR_LEVELS) / FAINT_LEVELS
    return max(CORE_CM, FADE_CM * math.log(max(brightest, 1.0)))


@jit
def add_rings(
    image: Float32Array,
    floor_cm: Float32Array,
    eye_cm: FloatArray,
    poses: FloatArray,
    boxes: IntArray,
    light: float,
    bloom: float,
    reach: float,
    ring_cm: tuple[float, float],
) -> None:
    """Add the light of rings to an image.

    Args:
        image: (rows, columns) light, changed in place.
        floor_cm: (rows, columns, 2) cm: the point of the floor that each pixel shows.
        eye_cm: (3,) cm: position of the camera.
        poses: (rings, 3) cm, cm, rad: x, y, heading of the robots whose rings are on.
        boxes: (rings, 4) px, as `bounding_boxes` returns them.
        light: Light of an LED.
        bloom: Brightness of the haze at the ring, relative to the LED's.
        reach: Distance from a ring, in cm, beyond which nothing is added.
        ring_cm: Radius of each ring, and its height above the floor.
    """
    radius, height = ring_cm
    rise = height / eye_cm[2]
    for ring in range(len(poses)):
        # the ring's centre, projected along the lines of sight onto the floor, where the ring appears enlarged
        x, y = poses[ring, 0] - rise * eye_cm[0], poses[ring, 1] - rise * eye_cm[1]
        ahead_x, ahead_y = math.cos(poses[ring, 2]), math.sin(poses[ring, 2])
        for row in range(boxes[ring, 0], boxes[ring, 1]):
            for column in range(boxes[ring, 2], boxes[ring, 3]):
                dx = (1.0 - rise) * floor_cm[row, column, 0] - x
                dy = (1.0 - rise) * floor_cm[row, column, 1] - y
                distance = math.sqrt(dx * dx + dy * dy)
                off_ring = abs(distance - radius)
                if off_ring <= reach:
                    brightness = bloom * math.exp(-off_ring / FADE_CM)
                    if off_ring <= CORE_CM:
                        ahead = (dx * ahead_x + dy * ahead_y) / max(distance, 1e-9)
                        brightness += _led_light(ahead) * math.exp(-0.5 * (off_ring / WIDTH_CM) ** 2)
                    image[row, column] += light * brightness


@jit
def _led_light(ahead: float) -> float:
    """Return the light of a ring, 1 at each of its eight LEDs; ahead: cosine of the angle to the heading."""
    for _ in range(3):  # each round gives the cosine of twice the angle
        ahead = 2.0 * ahead * ahead - 1.0
    return 1.0 - DEPTH * 0.5 * (1.0 - ahead)
