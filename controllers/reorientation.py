"""The motion of thesis 3.1.4: straight ahead, and at once into a random direction away from a wall that is near.

A robot that sees others with its infrared sensors turns away from them, too; `infrared: {robots: false}` leaves walls.
"""

import math

from epuck_sim.util.elementary import atan2, sin_cos
from epuck_sim.util.rng import uniform

PARAMETERS = {
    "speed_cm_s": 12.8,  # V, straight ahead
    "reorientation_distance_mm": 30,  # distance within which a robot turns away
}

MEMORY = {}

DIRECTIONS_DEG = (-18, -45, -90, -142, 142, 90, 45, 18)  # of the infrared sensors, to the left of straight ahead


def check(parameters):
    """Refuse speeds beyond the wheels' limit, and distances beyond the range of infrared."""
    if not 0 <= parameters.speed_cm_s <= 12.8:
        raise ValueError(f"speed_cm_s is {parameters.speed_cm_s}; allowed: 0 to 12.8, the wheels' limit")
    if not 1 <= parameters.reorientation_distance_mm <= 100:
        raise ValueError(f"reorientation_distance_mm is {parameters.reorientation_distance_mm}; allowed: 1 to 100")


def start(memory, parameters, random):
    """Do nothing: there is nothing to remember."""


def nearness(sensors, parameters):
    """Return the vector towards near objects, ahead and to the left; (0, 0) if there are none."""
    ahead = 0.0
    left = 0.0
    for sensor in range(8):
        near = parameters.reorientation_distance_mm - sensors.distance_mm[sensor]
        if near > 0:
            direction = math.radians(DIRECTIONS_DEG[sensor])
            sine, cosine = sin_cos(direction)
            ahead += near * cosine
            left += near * sine
    return ahead, left


def step(sensors, memory, actuators, parameters, random):
    """Go straight ahead; turn at once to within 90 degrees of the normal of a wall ahead that is near."""
    ahead, left = nearness(sensors, parameters)
    actuators.turn_rad = 0.0
    if ahead > 0:
        away = atan2(left, ahead) + math.pi
        actuators.turn_rad = away + math.pi * (uniform(random) - 0.5)
    actuators.left_cm_s = parameters.speed_cm_s
    actuators.right_cm_s = parameters.speed_cm_s
