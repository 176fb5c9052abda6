"""Environments for learning: swarms whose robots are driven from outside, one by one or in batches.

`parallel_env` is a PettingZoo `ParallelEnv` of one swarm; `vector_env` a Gymnasium `VectorEnv` of all robots of many
swarms. The package `epuck-sim[learning]` brings what both need. See docs/learning.md.
"""

from epuck_sim.environments.parallel import parallel_env
from epuck_sim.environments.rewards import Situation, aggregation, coverage, synchrony
from epuck_sim.environments.vector import vector_env

__all__ = ["Situation", "aggregation", "coverage", "parallel_env", "synchrony", "vector_env"]
