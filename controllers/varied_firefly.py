"""A firefly with a speed of its own, drawn from a lognormal distribution, once or again and again (thesis 6.2).

`speed_cm_s` is the mean over robots. Wheels limit the speed of a robot that would be faster.
"""

import math

import firefly

from epuck_sim.util.elementary import cos, exp, log
from epuck_sim.util.rng import uniform

PARAMETERS = firefly.PARAMETERS | {
    "speed_spread": 1.0,  # standard deviation of the speeds, as a share of their mean
    "new_speed_s": 0.0,  # mean time after which a robot draws a new speed; 0: never
}
MEMORY = firefly.MEMORY | {"speed_ratio": float}


def check(parameters):
    """Refuse what a firefly refuses, and spreads and times that make no sense."""
    firefly.check(parameters)
    if not 0 <= parameters.speed_spread <= 10:
        raise ValueError(f"speed_spread is {parameters.speed_spread}; allowed: 0 to 10")
    if not 0 <= parameters.new_speed_s <= 1_000_000:
        raise ValueError(f"new_speed_s is {parameters.new_speed_s}; allowed: 0 to 1000000")


def start(memory, parameters, random):
    """Start as a firefly that has drawn its speed."""
    firefly.start(memory, parameters, random)
    memory.speed_ratio = speed_ratio(parameters, random)


def speed_ratio(parameters, random):
    """Draw a speed as a multiple of the mean: lognormal, with mean 1."""
    variance = log(1 + parameters.speed_spread**2)  # of the logarithm
    normal = math.sqrt(-2 * log(1 - uniform(random))) * cos(2 * math.pi * uniform(random))  # Box and Muller
    return exp(math.sqrt(variance) * normal - variance / 2)


def step(sensors, memory, actuators, parameters, random):
    """Run a firefly, at its own speed where it goes straight ahead."""
    firefly.step(sensors, memory, actuators, parameters, random)
    if parameters.new_speed_s > 0 and uniform(random) < 1 - exp(-sensors.step_ms / 1000 / parameters.new_speed_s):
        memory.speed_ratio = speed_ratio(parameters, random)
    if actuators.left_cm_s == actuators.right_cm_s:
        actuators.left_cm_s *= memory.speed_ratio
        actuators.right_cm_s *= memory.speed_ratio
