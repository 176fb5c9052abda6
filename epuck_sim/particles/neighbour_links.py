"""The links from all agents to those that would receive their pulses now, for observers and measures."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.particles.motion import Trajectories, compute_positions
from epuck_sim.particles.neighbour_lists import make_search
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import Neighbourhood
from epuck_sim.particles.oscillators import Oscillators
from epuck_sim.particles.state import SwarmState
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.addresses import compiled_for
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import jit_no_alloc

FIRST_ROOM = 8
"""Links for each agent for which there is room at first; more are made when they are needed."""


class LinkSearch(NamedTuple):
    """A swarm, and a copy of it that stands still, in which neighbours are looked for."""

    swarm: Trajectories
    oscillators: Oscillators
    copy: Trajectories
    neighbourhood: Neighbourhood
    """That of the copy: the swarm's own, and what it caches, are left alone."""
    links: IntArray
    """(room,) output: the sender times the number of agents, plus the receiver."""


@jit_no_alloc
def write_links(search: LinkSearch) -> int:
    """Write all links, as far as there is room; return their number."""
    swarm, copy, neighbourhood = search.swarm, search.copy, search.neighbourhood
    agents = len(swarm.speed)
    compute_positions(swarm, search.oscillators.now[0], copy.origin)
    for axis in range(len(swarm.heading)):
        for agent in range(agents):
            copy.heading[axis, agent] = swarm.heading[axis, agent]
    neighbourhood.positions_time[0] = np.nan
    neighbourhood.cell_list.sorted_at[0] = -np.inf
    found = 0
    for sender in range(agents):
        row = find_neighbours(neighbourhood, copy, sender, 0.0)
        for rank in range(neighbourhood.counts[sender]):
            if found < len(search.links):
                search.links[found] = sender * agents + int(neighbourhood.members[row, rank])
            found += 1
    return found


if TYPE_CHECKING:  # `bind` provides it
    value_at: Callable[[int], LinkSearch]


def _write_links(address: int) -> int:
    """Carry out `write_links`."""
    return write_links(value_at(address))  # noqa: F821 see `bind`


class NeighbourLinks:
    """Finds the links of a swarm at its present time."""

    def __init__(self, scenario: ParticleScenario, state: SwarmState) -> None:
        """Compile what finds links, before any clock runs."""
        agents = scenario.agents.count
        room = np.zeros(FIRST_ROOM * agents, np.int64)
        self._search = LinkSearch(state.trajectories, state.oscillators, *make_search(scenario), room)
        self._owner, self._address = hold(self._search)
        self._write_links = compiled_for(_write_links, self._search)

    def find(self) -> IntArray:
        """Return the links, ascending: each is the sender times the number of agents, plus the receiver."""
        found = int(self._write_links(self._address))
        if found > len(self._search.links):
            self._search = self._search._replace(links=np.zeros(2 * found, np.int64))
            self._owner, self._address = hold(self._search)
            self._write_links(self._address)
        links = self._search.links[:found].copy()
        links.sort()
        return links
