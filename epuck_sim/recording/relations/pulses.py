"""Who hears whom: whom a pulse of each agent that fires reaches, and whose phase it shifts.

For onlookers, who are told who fired and whose phase was shifted, but not by whom.
"""

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.particles.motion import start_trajectories
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import make_neighbourhood
from epuck_sim.scenario.particles import Everybody, ParticleScenario

MANY = 50
"""Of so many agents, only those are told whose phase was shifted: when all fire at once, all would hear all."""


class Hearing:
    """The neighbourhoods of a scenario's agents, each found when it is asked for."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Have compiled what is needed, before any clock runs."""
        agents, space = scenario.agents.count, scenario.space
        nowhere = np.zeros((space.dimensions, agents))
        streams = np.zeros((agents, 4), np.uint64)
        is_cyclic = space.boundary == "cyclic"
        # these stand still and draw no directions: at each instant they are put where the swarm's are
        self._trajectories = start_trajectories(
            space.side_cm, is_cyclic, nowhere, nowhere.copy(), np.zeros(agents), streams
        )
        neighbourhood = make_neighbourhood(scenario, 0.0)
        # whose neighbours may be others at the next one, but where all are neighbours
        is_cached = neighbourhood.is_cached and isinstance(scenario.neighbourhood, Everybody)
        self._neighbourhood = neighbourhood._replace(is_cached=is_cached)
        self._tells_all = agents < MANY
        find_neighbours(self._neighbourhood, self._trajectories, 0, 0.0)

    def find_links(self, positions: FloatArray, headings: FloatArray, fired: IntArray, received: IntArray) -> IntArray:
        """Return (links, 3) who fires, who hears it, and 1 where that shifts a phase, in the order of the cascade.

        positions, headings: (agents, dimensions) cm and unit vectors at the instant, before anybody reorients;
        fired: in the order of the cascade; received: whose phase was shifted.
        """
        self._trajectories.origin[:] = positions.T
        self._trajectories.heading[:] = headings.T
        self._neighbourhood.positions_time[0] = np.nan
        self._neighbourhood.cell_list.sorted_at[0] = -np.inf
        waits = np.zeros(len(positions), np.bool_)
        waits[received] = True
        links = [np.empty((0, 3), np.int64)]
        for agent in fired:
            row = find_neighbours(self._neighbourhood, self._trajectories, agent, 0.0)
            hearers = self._neighbourhood.members[row, : self._neighbourhood.counts[agent]]
            is_shifted = waits[hearers]
            waits[hearers] = False  # nobody hears two pulses at one instant
            told = np.column_stack([np.full(len(hearers), agent), hearers, is_shifted])
            links.append(told if self._tells_all else told[is_shifted])
        return np.concatenate(links)
