"""How dark the floor is below the middle of the body."""

from epuck_sim.embodied.sensing import brightness_at

PARAMETERS = {"scale": 1.0}
READINGS = {"darkness": float}


def sense(world, robot, readings, parameters, random):
    readings.darkness = parameters.scale * (1.0 - brightness_at(world, robot.x, robot.y))
