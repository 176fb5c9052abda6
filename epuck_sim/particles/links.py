"""Links: which agents the pulse of each agent reaches, for observers and measures.

A simulation shows nobody the neighbours that it finds: they are looked for again, in a swarm that stands still.
"""

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.motion import begin_motion
from epuck_sim.particles.neighbours import find_receivers
from epuck_sim.particles.rules import rules_of
from epuck_sim.particles.swarm import Arrays, Neighbours, entry_of
from epuck_sim.scenario.particles import AgentsSection, Everybody, ParticleScenario, RandomAgents, StartSection
from epuck_sim.util.jit import jit
from epuck_sim.util.native import carve

SHIFTS_ONLY = 50
"""Swarms of this size or larger have links of pulses only where a phase was shifted: if all fire, all receive all."""

FIRST_ROOM = 8
"""Links for each agent for which there is room at first; more are made when they are needed."""


@jit
def write_links(block: ByteArray, addresses: IntArray, senders: IntArray, links: IntArray) -> int:
    """Write the links of some agents to `links`, as far as there is room; return their number."""
    neighbours = carve(block, Neighbours)
    scene, found = neighbours.scene, 0
    scene.positions_time = np.nan
    scene.sorted_at = -np.inf
    for index in range(len(senders)):
        sender = senders[index]
        row = find_receivers(block, addresses, neighbours, sender, 0.0)
        for rank in range(neighbours.counts[sender]):
            if found < len(links):
                links[found] = sender * scene.agents + entry_of(neighbours.members, row + rank)
            found += 1
    return found


class LinkSearch:
    """Finds the links between agents, wherever they are."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Make a swarm that stands still; raise ScenarioError where there are no links by position."""
        if isinstance(scenario.neighbourhood, RandomAgents):
            raise ScenarioError(
                f"{scenario.name}: neighbourhood.kind is 'random', whose receivers are drawn anew for each pulse; "
                "there are neighbours only by position"
            )
        still = AgentsSection(count=scenario.agents.count, speed_cm_s=0)
        rules = rules_of(scenario.model_copy(update={"agents": still, "start": StartSection()}))
        self._swarm, self._addresses = Arrays(rules.new_block()), rules.addresses
        begin_motion(self._swarm.block)
        # neighbours may change until the next instant, unless all agents are neighbours
        self._swarm.scene.is_cached &= isinstance(scenario.neighbourhood, Everybody)
        self._links = np.zeros(FIRST_ROOM * scenario.agents.count, np.int64)

    def find(self, positions: FloatArray, headings: FloatArray, senders: IntArray) -> IntArray:
        """Return (links,) the sender times the number of agents, plus the receiver: sender by sender, as given."""
        self._swarm.origin[:] = positions.T
        self._swarm.heading[:] = headings.T
        found = write_links(self._swarm.block, self._addresses, senders, self._links)
        if found > len(self._links):
            self._links = np.zeros(2 * found, np.int64)
            write_links(self._swarm.block, self._addresses, senders, self._links)
        return self._links[:found].copy()
