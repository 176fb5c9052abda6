"""Who hears whom: whom a pulse of each agent that fires reaches, and whose phase it shifts.

For onlookers, who are told who fired and whose phase was shifted, but not by whom.
"""

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.particles.motion import take_off
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
        self._flights = take_off(space.side_cm, is_cyclic, nowhere, nowhere.copy(), np.zeros(agents), streams)
        hood = make_neighbourhood(scenario, 0.0)
        # whose neighbours may be others at the next one, but where all are neighbours
        self._hood = hood._replace(keeps=hood.keeps and isinstance(scenario.neighbourhood, Everybody))
        self._tells_all = agents < MANY
        find_neighbours(self._hood, self._flights, 0, 0.0)

    def find_links(self, positions: FloatArray, headings: FloatArray, fired: IntArray, heard: IntArray) -> IntArray:
        """Return (links, 3) who fires, who hears it, and 1 where that shifts a phase, in the order of the cascade.

        positions, headings: (agents, dimensions) cm and unit vectors at the instant, before anybody reorients;
        fired: in the order of the cascade; heard: whose phase was shifted.
        """
        self._flights.origin[:] = positions.T
        self._flights.heading[:] = headings.T
        self._hood.placed[0] = np.nan
        self._hood.lattice.sorted[0] = -np.inf
        waits = np.zeros(len(positions), np.bool_)
        waits[heard] = True
        links = [np.empty((0, 3), np.int64)]
        for agent in fired:
            row = find_neighbours(self._hood, self._flights, agent, 0.0)
            hearers = self._hood.members[row, : self._hood.counts[agent]]
            is_shifted = waits[hearers]
            waits[hearers] = False  # nobody hears two pulses at one instant
            told = np.column_stack([np.full(len(hearers), agent), hearers, is_shifted])
            links.append(told if self._tells_all else told[is_shifted])
        return np.concatenate(links)
