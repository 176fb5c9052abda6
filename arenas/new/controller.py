"""A controller of robots; run it with: epuck-sim run thesis --controller NAME.py

It runs as it stands: drives about, turns away from what is near, and flashes every few seconds. Change what you need.
"""

from epuck_sim.util.rng import randint

# Name to default; a scenario sets them under `parameters`, a command with --set robots.0.parameters.speed_cm_s=3.
# The default's type is the parameter's: a number (3.0), a whole number (3), or True or False.
PARAMETERS = {"speed_cm_s": 6.0, "near_mm": 30, "period_s": 5.0, "flash_s": 0.4}

# Name to type: what a robot remembers from step to step; also arrays, such as (float, 8).
# With `phase_ms` here and `period_s` above, robots are oscillators, whose synchrony is measured.
MEMORY = {"phase_ms": int, "turning_steps": int}


# Optional: refuse values that make no sense.
def check(parameters):
    if not 0 <= parameters.speed_cm_s <= 12.8:
        raise ValueError(f"speed_cm_s is {parameters.speed_cm_s}; allowed: 0 to 12.8, the wheels' limit")


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
