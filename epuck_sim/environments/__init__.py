"""Environments for learning: swarms whose robots are driven from outside, one by one or in batches.

`parallel_env` is a PettingZoo `ParallelEnv` of one swarm; `vector_env` a Gymnasium `VectorEnv` of all robots of many
swarms; `RobotEnv` a Gymnasium `Env` of one robot among others, registered as `ROBOT_ENV`. The package
`epuck-sim[learning]` brings what they need. See docs/learning.md.
"""

from epuck_sim.errors import extras_named

with extras_named():
    from epuck_sim.environments.one_swarm import ROBOT_ENV, RobotEnv, parallel_env
    from epuck_sim.environments.rewards import Situation, aggregation, coverage, synchrony
    from epuck_sim.environments.vector import Task, vector_env

__all__ = [
    "ROBOT_ENV",
    "RobotEnv",
    "Situation",
    "Task",
    "aggregation",
    "coverage",
    "parallel_env",
    "synchrony",
    "vector_env",
]
