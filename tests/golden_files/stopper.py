"""Fireflies whose speed is told by what is below and ahead of them."""

import firefly

PARAMETERS = firefly.PARAMETERS
MEMORY = firefly.MEMORY


def start(memory, parameters, random):
    firefly.start(memory, parameters, random)


def step(sensors, memory, actuators, parameters, random):
    firefly.step(sensors, memory, actuators, parameters, random)
    if sensors.ground[0] < 0.5 or sensors.near == 0:
        actuators.left_cm_s = actuators.left_cm_s * sensors.ground[1]
    if sensors.ahead_cm < 10.0:
        actuators.right_cm_s = -actuators.right_cm_s
