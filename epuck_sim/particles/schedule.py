"""What a schedule changes in a swarm of point agents, at an instant between two events.

Nothing here is compiled, so that a trial without a schedule runs the same code as ever.
"""

import math

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.particles.oscillators import SIMULTANEITY_CYCLES, forget_earliest
from epuck_sim.particles.swarm import Arrays
from epuck_sim.scenario.changes import AgentDisplacement

Moment = tuple[float, float]
"""A cycle, from 0, and the time in it, 0 to 1."""

NEVER: Moment = (math.inf, 0.0)
"""Later than any moment of a trial."""

SCHEDULE_SEED = 4
"""Index of the seed of schedules among the children of a trial's seed, after those of `initial_conditions`."""


def last_firing_before(moment: Moment) -> Moment:
    """Return cycle and time up to which oscillators fire at the same instant as a moment, and thus before a change."""
    cycle, time = moment
    later, within = divmod(time + SIMULTANEITY_CYCLES, 1.0)
    return cycle + later, within


def any_ends_by(swarm: Arrays, moment: Moment) -> bool:
    """Return whether any agent reaches a wall, or the end of a run, up to a moment."""
    cycle, time = moment
    ends = swarm.end_cycle
    return bool(((ends < cycle) | ((ends == cycle) & (swarm.end_time <= time))).any())


def change_speeds(swarm: Arrays, speed: FloatArray) -> None:
    """Set the speeds of all agents, (agents,) cm per cycle, and begin their trajectories where they were last seen."""
    swarm.origin[:] = np.clip(swarm.positions_now, 0.0, swarm.scene.side_cm)
    swarm.start_cycle[:] = swarm.scene.cycle
    swarm.start_time[:] = swarm.scene.now
    swarm.speed[:] = speed


def displace_phases(swarm: Arrays, displacement: AgentDisplacement, sequence: np.random.SeedSequence) -> None:
    """Displace phases, which are as they were last seen; random ones are drawn for all agents, whoever is displaced."""
    by_cycles = displacement.by_cycles
    if isinstance(by_cycles, str):
        displaced = np.random.Generator(np.random.SFC64(sequence)).random(len(swarm.phases_now))
    else:
        displaced = (swarm.phases_now + by_cycles % 1.0) % 1.0
    agents = slice(None) if displacement.agents is None else list(displacement.agents)
    until_firing = (1 - displaced) * swarm.period
    swarm.next_firing[agents] = swarm.scene.now + until_firing[agents]
    forget_earliest(swarm)
