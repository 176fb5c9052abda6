"""Lists of neighbours at an instant, for observers and measures; the simulation shows nobody those that it finds."""

from collections.abc import Iterable, Iterator

import numpy as np

from epuck_sim.arrays import FloatArray, IndexArray
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.motion import Trajectories, start_trajectories
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import Neighbourhood, make_neighbourhood
from epuck_sim.particles.walks import make_walk
from epuck_sim.scenario.agents import AgentsSection
from epuck_sim.scenario.neighbourhoods import Everybody, RandomAgents
from epuck_sim.scenario.particles import ParticleScenario


def make_search(scenario: ParticleScenario) -> tuple[Trajectories, Neighbourhood]:
    """Return what finds neighbours of agents that stand still and draw no directions, and are put where agents are.

    Raises:
        ScenarioError: Receivers are drawn anew for each pulse, so that agents have no neighbours.
    """
    if isinstance(scenario.neighbourhood, RandomAgents):
        raise ScenarioError(
            f"{scenario.name}: neighbourhood.kind is 'random', whose receivers are drawn anew for each pulse; "
            "there are neighbours only by position"
        )
    agents, space = scenario.agents.count, scenario.space
    still = AgentsSection(count=agents)
    nowhere = np.zeros((space.dimensions, agents))
    streams = np.zeros((agents, 4), np.uint64)
    trajectories = start_trajectories(space, make_walk(still, 1.0), nowhere, nowhere.copy(), np.zeros(agents), streams)
    neighbourhood = make_neighbourhood(scenario, 0.0, streams[:0])
    # neighbours may change until the next instant, unless all agents are neighbours
    is_cached = neighbourhood.is_cached and isinstance(scenario.neighbourhood, Everybody)
    return trajectories, neighbourhood._replace(is_cached=is_cached)


class NeighbourLists:
    """Finds the agents that receive a pulse, wherever the agents are."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Compile what finds neighbours, before any clock runs; `make_search` says what is refused."""
        self._trajectories, self._neighbourhood = make_search(scenario)
        find_neighbours(self._neighbourhood, self._trajectories, 0, 0.0)

    def receivers(self, positions: FloatArray, headings: FloatArray, senders: Iterable[int]) -> Iterator[IndexArray]:
        """Yield the agents that receive the pulse of each sender; each array is overwritten by the next.

        Args:
            positions: (agents, dimensions) cm.
            headings: (agents, dimensions) unit vectors.
            senders: Indices of agents.
        """
        self._trajectories.origin[:] = positions.T
        self._trajectories.heading[:] = headings.T
        self._neighbourhood.positions_time[0] = np.nan
        self._neighbourhood.cell_list.sorted_at[0] = -np.inf
        for agent in senders:
            row = find_neighbours(self._neighbourhood, self._trajectories, agent, 0.0)
            yield self._neighbourhood.members[row, : self._neighbourhood.counts[agent]]
