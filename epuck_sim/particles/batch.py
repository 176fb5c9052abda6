"""Firings of the reference in a row, which measures are told of together, and who would receive pulses then.

Compiled code takes the cycles and writes down where agents are at each: Python is slow at a few microseconds a cycle.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.events import advance, observe
from epuck_sim.particles.initial_conditions import rules_of
from epuck_sim.particles.motion import begin_motion
from epuck_sim.particles.neighbours import write_links
from epuck_sim.particles.swarm import Arrays, Observed, Trajectories
from epuck_sim.scenario.particles import AgentsSection, Everybody, ParticleScenario, RandomAgents, StartSection
from epuck_sim.util.jit import jit
from epuck_sim.util.native import address_of, call, carve

MOST_CYCLES, MOST_LINKS = 128, 2**22
"""Most cycles of a batch, and most links that they may have together, unless one cycle has more."""

FIRST_ROOM = 8  # initial room for links, for each agent; it grows when needed


@dataclass
class Batch:
    """Firings of the reference in a row, with a row for each.

    The arrays are overwritten by the next batch: copy what you keep.
    """

    first: int  # number of the first of these cycles, from 1
    time_s: FloatArray  # (cycles,)
    order_parameter: FloatArray  # (cycles,)
    phases: FloatArray  # (cycles, agents), 0 to 1
    positions: FloatArray  # (cycles, agents, dimensions) cm
    velocities: FloatArray  # (cycles, agents, dimensions) cm/s
    sides_cm: tuple[float, ...]  # of the space
    find_links: Callable[[], IntArray]

    @cached_property
    def links(self) -> IntArray:
        """(links,) who would receive whose pulse, ascending: (row * agents + sender) * agents + receiver."""
        return self.find_links()


class StillSwarm:
    """A swarm that stands still at given places, in which receivers of pulses are looked for."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Make a swarm with the neighbourhood of a scenario; raise ScenarioError if receivers are drawn at random."""
        if isinstance(scenario.neighbourhood, RandomAgents):
            raise ScenarioError(
                f"{scenario.name}: neighbourhood.kind is 'random', whose receivers are drawn anew for each pulse; "
                "there are neighbours only by position"
            )
        stands = {"agents": AgentsSection(count=scenario.agents.count, speed_cm_s=0), "start": StartSection()}
        rules = rules_of(scenario.model_copy(update=stands))
        self._block, self._addresses = rules.new_block(), rules.addresses
        begin_motion(self._block)
        # neighbours may change until the next instant, unless all agents are neighbours
        Arrays(self._block).scene.is_cached &= isinstance(scenario.neighbourhood, Everybody)
        self._room = FIRST_ROOM * scenario.agents.count

    def links(self, positions: FloatArray, headings: FloatArray, senders: IntArray) -> IntArray:
        """Return (links,) as `Batch.links`, of some senders, in their order.

        Positions and headings are (rows, dimensions * agents) cm and unit vectors, one dimension after the other.
        """
        links = np.zeros(self._room, np.int64)
        found = write_links(self._block, self._addresses, positions, headings, senders, links)
        if found > len(links):
            self._room, links = found, np.zeros(found, np.int64)
            write_links(self._block, self._addresses, positions, headings, senders, links)
        return links[:found]


class Recorder:
    """The cycles of a batch that have been taken."""

    def __init__(self, scenario: ParticleScenario) -> None:
        """Make room for the swarm of a scenario."""
        agents, dimensions = scenario.agents.count, scenario.space.dimensions
        self.room = max(1, min(MOST_CYCLES, MOST_LINKS // agents**2))
        self.count = 0
        self._moments = np.zeros((self.room, 3))
        self._phases, self._speeds = np.zeros((2, self.room, agents))
        self._positions, self._headings = np.zeros((2, self.room, dimensions * agents))

    def advance(self, block: ByteArray, addresses: IntArray) -> None:
        """Simulate until a limit is reached, as `events.advance` does, and add each cycle."""
        arrays = self._moments, self._phases, self._speeds, self._positions, self._headings
        self.count = record_cycles(block, addresses, address_of(advance), *arrays, self.count)

    def take(self, simulation: Any) -> Batch:
        """Return the cycles, the last of which is the simulation's last one, and begin anew."""
        count, self.count, period_s = self.count, 0, simulation.scenario.clocks.period_s
        (cycle, now, order), phases = self._moments[:count].T, self._phases[:count]
        agents, flat = phases.shape[1], (self._positions[:count], self._headings[:count])
        positions, headings = (each.reshape(count, -1, agents).transpose(0, 2, 1) for each in flat)
        velocities = headings * (self._speeds[:count] / period_s)[:, :, None]

        def find_links() -> IntArray:
            return np.sort(simulation.still_swarm.links(*flat, np.arange(agents)))

        space, first, time_s = simulation.scenario.space, simulation.cycles + 1 - count, (cycle + now) * period_s
        sides_cm = (space.side_cm,) * space.dimensions
        return Batch(first, time_s, order, phases, positions, velocities, sides_cm, find_links)


@jit
def record_cycles(
    block: ByteArray,
    addresses: IntArray,
    address: int,
    moments: FloatArray,
    phases: FloatArray,
    speeds: FloatArray,
    positions: FloatArray,
    headings: FloatArray,
    count: int,
) -> int:
    """Take cycles by the function at an address, and add each to `count` rows; return how many there are then.

    A moment is the number of the nominal period, the share of it that has passed, and the order parameter.
    """
    trajectories, observed = carve(block, Trajectories), carve(block, Observed)
    scene = trajectories.scene
    last_cycle = scene.limits.cycles
    while count < len(moments):
        before = scene.cycles
        scene.limits.cycles = min(last_cycle, before + 1)
        call(address, block, addresses)
        if scene.cycles == before:
            break
        observe(block, addresses)
        moments[count, 0], moments[count, 1], moments[count, 2] = scene.cycle, scene.now, scene.order_parameter
        for agent in range(scene.agents):
            phases[count, agent], speeds[count, agent] = observed.phases_now[agent], trajectories.speed[agent]
        for place in range(len(trajectories.heading)):
            positions[count, place] = observed.positions_now[place]
            headings[count, place] = trajectories.heading[place]
        count += 1
        if scene.is_synchronised or scene.cycles >= last_cycle:
            break
    return count
