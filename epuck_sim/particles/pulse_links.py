"""Pulse links: which agents the pulse of each firing agent reaches, and whose phases it shifts.

Events, which observers are shown, list the agents that fired and those whose phase was shifted, but not the pairs.
"""

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.particles.neighbour_lists import NeighbourLists
from epuck_sim.scenario.neighbourhoods import RandomAgents
from epuck_sim.scenario.particles import ParticleScenario

SHIFTS_ONLY = 50
"""Swarms of this size or larger have links only where a phase was shifted: if all fire at once, all receive all."""


class PulseLinks:
    """Finds the links between agents at an instant."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Compile what finds neighbours, before any clock runs."""
        # agents that are drawn anew for each pulse cannot be found from outside: they have no links
        self._neighbours = None if isinstance(scenario.neighbourhood, RandomAgents) else NeighbourLists(scenario)
        self._has_all = scenario.agents.count < SHIFTS_ONLY

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
        awaits_shift = np.zeros(len(positions), np.bool_)
        awaits_shift[received] = True
        links = [np.empty((0, 3), np.int64)]
        if self._neighbours is None:
            return links[0]
        for agent, receivers in zip(fired, self._neighbours.receivers(positions, headings, fired), strict=True):
            is_shifted = awaits_shift[receivers]
            awaits_shift[receivers] = False  # no agent receives two pulses at one instant
            found = np.column_stack([np.full(len(receivers), agent), receivers, is_shifted])
            links.append(found if self._has_all else found[is_shifted])
        return np.concatenate(links)
