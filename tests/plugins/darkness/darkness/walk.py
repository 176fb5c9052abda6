"""Walks straight, and turns now and then."""

from turns import next_turn  # a file beside this one

PARAMETERS = {"speed_cm_s": 4.0, "straight_steps": 20}
MEMORY = {"steps_left": int}


def start(memory, parameters, random):
    memory.steps_left = parameters.straight_steps


def step(sensors, memory, actuators, parameters, random):
    memory.steps_left -= 1
    actuators.left_cm_s = actuators.right_cm_s = parameters.speed_cm_s
    actuators.turn_rad = 0.0
    if memory.steps_left <= 0:
        actuators.turn_rad = next_turn(random)
        memory.steps_left = parameters.straight_steps
