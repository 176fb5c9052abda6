"""How dark the floor is below the middle of the body."""

from epuck_sim.embodied.sensing import brightness_at

READINGS = {"darkness": float}


def sense(world, robot, readings, parameters, random):
    readings.darkness = 1.0 - brightness_at(world, robot.x, robot.y)
