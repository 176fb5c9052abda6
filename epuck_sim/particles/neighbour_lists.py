"""Lists of neighbours at an instant, for observers and measures; the simulation shows nobody those that it finds."""

from collections.abc import Iterable, Iterator

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IndexArray
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.motion import start_trajectories
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import make_neighbourhood
from epuck_sim.scenario.particles import Everybody, ParticleScenario, RandomAgents


class NeighbourLists:
    """Finds the agents that receive a pulse, wherever the agents are."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Compile what finds neighbours, before any clock runs.

        Raises:
            ScenarioError: Receivers are drawn anew for each pulse, so that agents have no neighbours.
        """
        if isinstance(scenario.neighbourhood, RandomAgents):
            raise ScenarioError(
                f"{scenario.name}: neighbourhood.kind is 'random', whose receivers are drawn anew for each pulse; "
                "there are neighbours only by position"
            )
        agents, space = scenario.agents.count, scenario.space
        nowhere = np.zeros((space.dimensions, agents))
        streams = np.zeros((agents, 4), np.uint64)
        # these stand still and draw no directions: at each instant they are put where the agents are
        self._trajectories = start_trajectories(space, nowhere, nowhere.copy(), np.zeros(agents), streams)
        neighbourhood = make_neighbourhood(scenario, 0.0, streams[:0])
        # neighbours may change until the next instant, unless all agents are neighbours
        is_cached = neighbourhood.is_cached and isinstance(scenario.neighbourhood, Everybody)
        self._neighbourhood = neighbourhood._replace(is_cached=is_cached)
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

    def adjacency(self, positions: FloatArray, headings: FloatArray) -> BoolArray:
        """Return (agents, agents) the adjacency matrix of eq. 5.6: whether agent j receives the pulses of agent i.

        Args:
            positions: (agents, dimensions) cm.
            headings: (agents, dimensions) unit vectors.
        """
        agents = len(positions)
        matrix = np.zeros((agents, agents), np.bool_)
        for sender, receivers in enumerate(self.receivers(positions, headings, range(agents))):
            matrix[sender, receivers] = True
        return matrix
