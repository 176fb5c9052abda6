"""A random walk (thesis 6.2): straight runs with a turn on the spot at the end of each, and Appendix B's avoidance.

Runs have durations that are exponential, or follow a power law; a turn's angle has a wrapped Cauchy distribution, whose
mean cosine is the persistence. Avoidance comes first: the rest of a run or of a turn follows when the way is free.
"""

import math

import obstacle_avoidance

from epuck_sim.util.elementary import atan, exp, log, tan
from epuck_sim.util.rng import uniform

PARAMETERS = obstacle_avoidance.PARAMETERS | {
    "run_s": 5.0,  # mean duration of a run; the shortest if durations follow a power law
    "persistence": 0.0,  # mean cosine of the turns: 0 is Brownian, above it the walk is correlated, 1 never turns
    "exponent": 0.0,  # 0: exponential durations; above 1, up to 3: the power law of a Levy walk
}
MEMORY = obstacle_avoidance.MEMORY | {"run_left_ms": float, "turn_left_rad": float}

LONGEST_RUN_MS = 1e12  # a power law may draw more than a number can hold


def check(parameters):
    """Refuse what obstacle avoidance refuses, and walks that cannot exist."""
    obstacle_avoidance.check(parameters)
    if parameters.rotation_speed_cm_s == 0:
        raise ValueError("rotation_speed_cm_s is 0; allowed: above 0, because turns of the walk take it")
    if not 0.1 <= parameters.run_s <= 1_000_000:
        raise ValueError(f"run_s is {parameters.run_s}; allowed: 0.1 to 1000000")
    if not 0 <= parameters.persistence <= 1:
        raise ValueError(f"persistence is {parameters.persistence}; allowed: 0 to 1")
    if parameters.exponent != 0 and not 1 < parameters.exponent <= 3:
        raise ValueError(f"exponent is {parameters.exponent}; allowed: 0, or above 1 and up to 3")


def start(memory, parameters, random):
    """Begin the first run."""
    obstacle_avoidance.start(memory, parameters, random)
    memory.run_left_ms = run_ms(parameters, random)
    memory.turn_left_rad = 0.0


def run_ms(parameters, random):
    """Draw the duration of a run."""
    share = 1.0 - uniform(random)  # above 0
    if parameters.exponent > 0:
        longest = LONGEST_RUN_MS / (1000 * parameters.run_s)
        power = exp(min(-log(share) / (parameters.exponent - 1), log(longest)))
        return 1000 * parameters.run_s * power
    return -1000 * parameters.run_s * log(share)


def turn_rad(parameters, random):
    """Draw the angle of a turn, from -pi to pi."""
    narrowing = (1 - parameters.persistence) / (1 + parameters.persistence)
    return 2 * atan(narrowing * tan(math.pi * (uniform(random) - 0.5)))


def step(sensors, memory, actuators, parameters, random):
    """Avoid near objects; else continue the turn, or the run, and draw the next turn and run when a run is over."""
    obstacle_avoidance.step(sensors, memory, actuators, parameters, random)
    if memory.rotation_time > 0 or actuators.left_cm_s != actuators.right_cm_s:  # avoidance stands still to reverse
        return
    if memory.turn_left_rad == 0:
        memory.run_left_ms -= sensors.step_ms
        if memory.run_left_ms <= 0:
            memory.run_left_ms = run_ms(parameters, random)
            memory.turn_left_rad = turn_rad(parameters, random)
        return
    seconds = max(sensors.step_ms, 1) / 1000  # a faulty clock may stand still
    whole_cm_s = memory.turn_left_rad * sensors.wheels.base_cm / 2 / seconds  # wheel speed to end the turn in this step
    fastest_cm_s = min(parameters.rotation_speed_cm_s, sensors.wheels.limit_cm_s)
    wheel_cm_s = min(max(whole_cm_s, -fastest_cm_s), fastest_cm_s)
    actuators.left_cm_s = -wheel_cm_s
    actuators.right_cm_s = wheel_cm_s
    memory.turn_left_rad = 0.0 if wheel_cm_s == whole_cm_s else memory.turn_left_rad * (1 - wheel_cm_s / whole_cm_s)
