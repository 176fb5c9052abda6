"""Pulse links: which agents the pulse of each firing agent reaches, and whose phases it shifts.

Events, which observers are shown, list the agents that fired and those whose phase was shifted, but not the pairs.
"""

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.particles.motion import start_trajectories
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import make_neighbourhood
from epuck_sim.scenario.particles import Everybody, ParticleScenario

SHIFTS_ONLY = 50
"""Swarms of this size or larger have links only where a phase was shifted: if all fire at once, all receive all."""


class PulseLinks:
    """Finds the links between agents at an instant."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Compile what finds neighbours, before any clock runs."""
        agents, space = scenario.agents.count, scenario.space
        nowhere = np.zeros((space.dimensions, agents))
        streams = np.zeros((agents, 4), np.uint64)
        is_cyclic = space.boundary == "cyclic"
        # these stand still and draw no directions: at each instant they are put where the agents are
        self._trajectories = start_trajectories(
            space.side_cm, is_cyclic, nowhere, nowhere.copy(), np.zeros(agents), streams
        )
        neighbourhood = make_neighbourhood(scenario, 0.0)
        # neighbours may change until the next instant, unless all agents are neighbours
        is_cached = neighbourhood.is_cached and isinstance(scenario.neighbourhood, Everybody)
        self._neighbourhood = neighbourhood._replace(is_cached=is_cached)
        self._has_all = agents < SHIFTS_ONLY
        find_neighbours(self._neighbourhood, self._trajectories, 0, 0.0)

    def find(self, positions: FloatArray, headings: FloatArray, fired: IntArray, received: IntArray) -> IntArray:
        """Return the links of an instant, in the order of its cascade.

        Args:
            positions: (agents, dimensions) cm.
            headings: (agents, dimensions) unit vectors, before any agent reorients.
            fired: (firing,) agents that fire, in the order of the cascade.
            received: Agents whose phase was shifted.

        Returns:
            (links, 3) agent that fires, agent that receives, and 1 where that shifts its phase.
        """
        self._trajectories.origin[:] = positions.T
        self._trajectories.heading[:] = headings.T
        self._neighbourhood.positions_time[0] = np.nan
        self._neighbourhood.cell_list.sorted_at[0] = -np.inf
        awaits_shift = np.zeros(len(positions), np.bool_)
        awaits_shift[received] = True
        links = [np.empty((0, 3), np.int64)]
        for agent in fired:
            row = find_neighbours(self._neighbourhood, self._trajectories, agent, 0.0)
            receivers = self._neighbourhood.members[row, : self._neighbourhood.counts[agent]]
            is_shifted = awaits_shift[receivers]
            awaits_shift[receivers] = False  # no agent receives two pulses at one instant
            found = np.column_stack([np.full(len(receivers), agent), receivers, is_shifted])
            links.append(found if self._has_all else found[is_shifted])
        return np.concatenate(links)
