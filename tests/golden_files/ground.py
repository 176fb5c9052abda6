"""A ground and light sensor that also counts near robots; noisy."""

from epuck_sim.embodied.sensing import brightness_at, distance_cm, light_at, nearest_robot
from epuck_sim.util.rng import uniform

PARAMETERS = {"noise": 0.2, "range_cm": 15.0}
READINGS = {"near": int, "ground": (float, 2), "ahead_cm": float}


def sense(world, robot, readings, parameters, random):
    readings.ground[0] = brightness_at(world, robot.x, robot.y) + parameters.noise * (uniform(random) - 0.5)
    readings.ground[1] = light_at(world, robot.x, robot.y)
    readings.near = nearest_robot(world, robot.x, robot.y, parameters.range_cm, robot.number)
    readings.ahead_cm = distance_cm(world, robot.x, robot.y, robot.heading, 100.0, robot.number)
