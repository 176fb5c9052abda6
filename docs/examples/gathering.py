"""A policy as a controller: robots gather by the network that learnt it, in learnt_policy.npz.

    epuck-sim run thesis --controller docs/examples/gathering.py --set max_time_s=60 --set light=lit --film herd.mp4

It observes, draws and moves as the agents of `learnt_policy.py` do. It is compiled, since it is written in numpy.
"""

from pathlib import Path

import numpy as np

from epuck_sim.util.rng import uniform

with np.load(Path(__file__).with_name("learnt_policy.npz")) as file:
    FIRST, FIRST_BIAS = file["aggregation/first"], file["aggregation/first_bias"]
    SECOND, SECOND_BIAS = file["aggregation/second"], file["aggregation/second_bias"]
    LAST, LAST_BIAS = file["aggregation/last"], file["aggregation/last_bias"]

MOTIONS = np.array([(0.0, 0.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (0.5, 1.0), (1.0, 0.5)])
CONTROL_STEPS = 5  # a motion holds for half a second
PEAK_COUNTS = 3731  # infrared reading that is observed as 1

PARAMETERS = {}
MEMORY = {"steps": int}


def start(memory, parameters, random):
    """Start with a decision."""
    memory.steps = 0


def step(sensors, memory, actuators, parameters, random):
    """Draw a motion, and whether the ring is lit, every `CONTROL_STEPS` by the scores of the network."""
    memory.steps += 1
    if memory.steps % CONTROL_STEPS != 1:
        return
    limit = sensors.wheels.limit_cm_s
    observed = np.empty(71, np.float32)
    observed[:60] = sensors.camera
    observed[60:68] = np.minimum(np.maximum(sensors.infrared / PEAK_COUNTS, 0.0), 1.0)
    observed[68], observed[69] = actuators.left_cm_s / limit, actuators.right_cm_s / limit
    observed[70] = actuators.ring_on
    hidden = np.tanh(observed @ FIRST + FIRST_BIAS)
    scores = np.tanh(hidden @ SECOND + SECOND_BIAS) @ LAST + LAST_BIAS
    for action in range(len(scores)):
        scores[action] -= np.log(-np.log(uniform(random)))  # the largest is drawn with its probability
    action = scores.argmax()
    actuators.left_cm_s = limit * MOTIONS[action % len(MOTIONS), 0]
    actuators.right_cm_s = limit * MOTIONS[action % len(MOTIONS), 1]
    actuators.ring_on = action >= len(MOTIONS)
