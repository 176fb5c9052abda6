"""Three photosensors on a circle around the axle, one ahead and two behind, as the Pogobot has (places estimated)."""

import math

from epuck_sim.embodied.sensing import light_at

PARAMETERS = {"circle_cm": 2.0}
READINGS = {"light": (float, 3)}


def sense(world, robot, readings, parameters, random):
    """Read the light on the floor below each sensor."""
    for place in range(3):
        angle = robot.heading + place * 2 * math.pi / 3
        x = robot.x + parameters.circle_cm * math.cos(angle)
        y = robot.y + parameters.circle_cm * math.sin(angle)
        readings.light[place] = light_at(world, x, y)
