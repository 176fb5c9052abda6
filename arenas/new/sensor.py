"""A sensor of robots; see its readings in a trace:

epuck-sim run thesis --set "robots.0.sensors=[NAME.py]" --trace NAME.parquet

It runs as it stands: looks at the floor and at the lamps below the front of the body. Change what you need.
"""

import math

from epuck_sim.embodied.sensing import brightness_at, light_at
from epuck_sim.util.rng import uniform

# Name to default; a scenario sets them as sensors: [{NAME.py: {noise: 0.1}}].
PARAMETERS = {"ahead_cm": 3.0, "noise": 0.0}

# Name to type: what controllers find in `sensors`, as sensors.NAME; also arrays, such as (float, 3).
READINGS = {"NAME": float, "NAME_light": float}


# Called for each robot in each control step, before any controller.
# `world` has time_s, width_cm, height_cm, radius_cm, robots (x, y, heading, radius_cm, ring_on, present, number of
# each), circles and edges (of obstacles); `robot` is the one that senses. Functions that it may call are in
# epuck_sim.embodied.sensing.
# `readings` keep their values until they are set again. Draw random numbers from `random`, and from nowhere else.
def sense(world, robot, readings, parameters, random):
    x = robot.x + parameters.ahead_cm * math.cos(robot.heading)
    y = robot.y + parameters.ahead_cm * math.sin(robot.heading)
    readings.NAME = brightness_at(world, x, y) + parameters.noise * (uniform(random) - 0.5)
    readings.NAME_light = light_at(world, x, y)
