"""Texts of the commented files that `epuck-sim new` writes; {name} is the name that the user has given."""

MEASURE = '''\
"""A measure of trials; run it with: epuck-sim run thesis --measure {name}.py

It runs as it stands: the path length of the swarm's centre, in cm, from cycle to cycle. Change what you need.
"""

import numpy as np


class {name}:
    """Path length of the swarm's centre in cm."""

    # The simulation is a `Simulation` of robots or a `ParticleSimulation`, before its first event.
    # What follows the star are parameters, with defaults; a scenario sets them as {{{name}.py: {{from_cycle: 3}}}}.
    def __init__(self, simulation, *, from_cycle=1):
        self.simulation = simulation
        self.from_cycle = from_cycle
        self.centre = None
        self.length_cm = 0.0

    # Called after every firing of the reference; it costs nothing in between.
    # For every control step of robots, add `def step(self, step, state)`; for every event of point agents,
    # `def event(self, event, state)`. Leave out what you do not need: `step` and `event` make trials slower.
    # `state` has time_s, cycles, order_parameter and is_synchronised.
    def cycle(self, event, state):
        if state.cycles < self.from_cycle:
            return
        centre = self.positions(event).mean(axis=0)
        if self.centre is not None:
            self.length_cm += float(np.linalg.norm(centre - self.centre))
        self.centre = centre  # arrays of robots are overwritten in the next step: keep copies; a mean is one

    # Called at the end: return a number, True or False, None where it is undetermined, or a list with one of these
    # for each cycle.
    def value(self):
        return self.length_cm

    def positions(self, event):
        if hasattr(event, "poses"):  # a step of robots
            return event.poses[:, :2]
        return self.simulation.positions()  # of point agents
'''
"""A new measure."""

CONTROLLER = '''\
"""A controller of robots; run it with: epuck-sim run thesis --controller {name}.py

It runs as it stands: drives about, turns away from what is near, and flashes every few seconds. Change what you need.
"""

from epuck_sim.util.rng import randint

# Name to default; a scenario sets them under `parameters`, a command with --set robots.0.parameters.speed_cm_s=3.
# The default's type is the parameter's: a number (3.0), a whole number (3), or True or False.
PARAMETERS = {{"speed_cm_s": 6.0, "near_mm": 30, "period_s": 5.0, "flash_s": 0.4}}

# Name to type: what a robot remembers from step to step; also arrays, such as (float, 8).
# With `phase_ms` here and `period_s` above, robots are oscillators, whose synchrony is measured.
MEMORY = {{"phase_ms": int, "turning_steps": int}}


# Optional: refuse values that make no sense.
def check(parameters):
    if not 0 <= parameters.speed_cm_s <= 12.8:
        raise ValueError(f"speed_cm_s is {{parameters.speed_cm_s}}; allowed: 0 to 12.8, the wheels' limit")


# Called once; memory is all zeros before. Draw random numbers from the robot's own stream, and from nowhere else.
def start(memory, parameters, random):
    memory.phase_ms = randint(random, int(parameters.period_s * 1000))


# Called in each control step.
# `sensors` has step_ms, infrared (8 raw counts), distance_mm (8, 65535 where nothing is near; sensor 0 is front-right,
# then clockwise), camera (a row of 1 where a lit ring is seen, else 0) and new_picture.
# `actuators` has left_cm_s, right_cm_s and ring_on, which are kept until they are set again.
def step(sensors, memory, actuators, parameters, random):
    right_is_near = min(sensors.distance_mm[0], sensors.distance_mm[1]) < parameters.near_mm
    left_is_near = min(sensors.distance_mm[7], sensors.distance_mm[6]) < parameters.near_mm
    if memory.turning_steps == 0 and (right_is_near or left_is_near):
        memory.turning_steps = 5 + randint(random, 5)
        actuators.left_cm_s = parameters.speed_cm_s if left_is_near else -parameters.speed_cm_s
        actuators.right_cm_s = -actuators.left_cm_s
    elif memory.turning_steps > 0:
        memory.turning_steps -= 1
    else:
        actuators.left_cm_s = parameters.speed_cm_s
        actuators.right_cm_s = parameters.speed_cm_s

    memory.phase_ms += sensors.step_ms
    if memory.phase_ms >= parameters.period_s * 1000:
        memory.phase_ms = 0
    actuators.ring_on = memory.phase_ms < parameters.flash_s * 1000
'''
"""A new controller."""

SENSOR = '''\
"""A sensor of robots; see what it tells in a trace:

epuck-sim run thesis --set "robots.0.sensors=[{name}.py]" --trace {name}.parquet

It runs as it stands: looks at the floor and at the lamps below the front of the body. Change what you need.
"""

import math

from epuck_sim.embodied.sensing import brightness_at, light_at
from epuck_sim.util.rng import uniform

# Name to default; a scenario sets them as sensors: [{{{name}.py: {{noise: 0.1}}}}].
PARAMETERS = {{"ahead_cm": 3.0, "noise": 0.0}}

# Name to type: what controllers find in `sensors`, as sensors.{name}; also arrays, such as (float, 3).
READINGS = {{"{name}": float, "{name}_light": float}}


# Called for each robot in each control step, before any controller.
# `world` has time_s, width_cm, height_cm, radius_cm, robots (x, y, heading, radius_cm, ring_on, present, number of
# each), circles and edges (of obstacles); `robot` is the one that senses. What else it may ask is in
# epuck_sim.embodied.sensing.
# `readings` keep their values until they are set again. Draw random numbers from `random`, and from nowhere else.
def sense(world, robot, readings, parameters, random):
    x = robot.x + parameters.ahead_cm * math.cos(robot.heading)
    y = robot.y + parameters.ahead_cm * math.sin(robot.heading)
    readings.{name} = brightness_at(world, x, y) + parameters.noise * (uniform(random) - 0.5)
    readings.{name}_light = light_at(world, x, y)
'''
"""A new sensor."""

ROBOT = """\
# A robot; run it with: epuck-sim run thesis --set robot={name}.yaml
# It runs as it stands. What is left out is the e-puck's; docs/other_robots.md has all keys.
description: a robot of my own
radius_cm: 3.0 # of the body, a disc
wheel_base_cm: 4.5 # distance between the wheels
wheel_limit_cm_s: 10.0 # largest speed of a wheel
mass_g: 100.0

infrared: # up to eight proximity sensors; null for none
  sensors: [[2.8, -0.8, -20], [2.8, 0.8, 20]] # x_cm ahead, y_cm to the left, direction_deg counter-clockwise
  range_cm: 10.0

# Sensors in files of their own beside this one, with their parameters; epuck-sim new sensor ground writes one.
# sensors: [{{ground.py: {{ahead_cm: 2.0}}}}]
"""
"""A new robot."""

SCENARIO = """\
# A scenario; run it with: epuck-sim run {name}.yaml
# It runs as it stands. What is left out has its default; epuck-sim check {name}.yaml prints all keys.
name: {name}
description: ten fireflies around a pillar
model: embodied # robots with bodies; particles are point agents, see docs/particles.md

arena:
  width_cm: 80
  height_cm: 80
  obstacles:
    - {{shape: circle, x_cm: 40, y_cm: 40, radius_cm: 5}}

robots: # groups; robots of a group share a controller
  - count: 10
    placement: random # or grid, or poses: [[x_cm, y_cm, heading_rad], ...] instead of count
    controller: firefly # a shipped one (epuck-sim list), or a file, such as mine.py, relative to this one
    parameters: {{speed_cm_s: 5.0, period_s: 5.0}}

noise: {{wheel_speed: 0.05, infrared_counts: 10}} # or off

stop:
  order_parameter: 0.95 # the trial ends when the swarm is synchronised as far as this,
  max_cycles: 500 # or after this number of firings of the first robot

trials: 1
seed: 0

# Remove the # to make it a sweep of 2 x 3 points; run it with: epuck-sim run {name}.yaml --trials 20 --out runs/{name}
# sweep:
#   grid:
#     robots.0.count: [5, 10]
#     robots.0.parameters.speed_cm_s: [1, 3, 9]
"""
"""A new scenario."""
