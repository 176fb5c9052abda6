"""A reward for learning: `from epuck_sim.environments import vector_env; vector_env("thesis", 8, reward="NAME.py")`.

It runs as it stands: how many of the rings are lit. Change what you need.
"""


# Called after each step with the `Situation` of a batch of swarms: time_s, poses (swarms, robots, 3), wheels_cm_s,
# ring_on, phase (NaN without an oscillator), width_cm, height_cm and movables.
# Return an array of one number for each swarm, or (swarms, robots) one for each robot.
def reward(situation):
    return situation.ring_on.mean(axis=-1)
