"""Firings of the reference in a row, which measures are told of together, and who would receive pulses then.

Compiled code takes the cycles and copies the swarm at each: Python is slow at a few microseconds a cycle.
"""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.particles.events import observe
from epuck_sim.particles.neighbours import find_receivers
from epuck_sim.particles.swarm import HEAR, SCENE, SCENE_BYTES, Instant, Neighbours, Oscillators, array_in, entry_of
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import jit
from epuck_sim.util.native import call, carve

MOST_CYCLES, MOST_LINKS = 128, 2**22
"""Most cycles of a batch, and most links that they may have together, unless one cycle has more."""

FIRST_ROOM = 8  # initial room for links, for each agent; it grows when needed


class Batch:
    """Firings of the reference in a row, with a row for each.

    The arrays are overwritten by the next batch: copy what you keep.
    """

    def __init__(self, scenario: ParticleScenario, states: ByteArray, find_links: Callable[[], IntArray]) -> None:
        """Refer to the states of a swarm, (cycles, bytes)."""
        period_s, space, scenes = scenario.clocks.period_s, scenario.space, states[:, :SCENE_BYTES].view(SCENE)[:, 0]
        rows = (array_in(states, name) for name in ("positions_now", "heading"))
        positions, headings = (each.reshape(len(states), space.dimensions, -1).transpose(0, 2, 1) for each in rows)
        self.first = int(scenes["cycles"][0])  # number of the first of these cycles, from 1
        self.time_s: FloatArray = (scenes["cycle"] + scenes["now"]) * period_s  # (cycles,)
        self.order_parameter: FloatArray = scenes["order_parameter"]  # (cycles,)
        self.phases: FloatArray = array_in(states, "phases_now")  # (cycles, agents), 0 to 1
        self.positions: FloatArray = positions  # (cycles, agents, dimensions) cm
        # (cycles, agents, dimensions) cm/s
        self.velocities: FloatArray = headings * (array_in(states, "speed") / period_s)[:, :, None]
        self.sides_cm = (space.side_cm,) * space.dimensions  # of the space
        self._find_links = find_links

    @cached_property
    def links(self) -> IntArray:
        """(links,) who would receive whose pulse, ascending: (row * agents + sender) * agents + receiver."""
        return self._find_links()


@jit
def record_cycles(block: ByteArray, addresses: IntArray, address: int, states: ByteArray, count: int) -> int:
    """Take cycles by the function at an address, and add each to `count` states; return how many there are then."""
    scene = carve(block, Oscillators).scene
    last_cycle = scene.limits.cycles
    while count < len(states):
        before = scene.cycles
        scene.limits.cycles = min(last_cycle, before + 1)
        call(address, block, addresses)
        if scene.cycles == before:
            break
        observe(block, addresses)
        for place in range(states.shape[1]):  # much faster than a slice
            states[count, place] = block[place]
        count += 1
        if scene.is_synchronised or scene.cycles >= last_cycle:
            break
    return count


@jit
def links_in(block: ByteArray, addresses: IntArray, states: ByteArray, senders: IntArray) -> IntArray:
    """Return (links,) as `Batch.links`, of some senders, in their order, in states that have been observed.

    Those whom faults keep from a pulse are left out if there is an address of `swarm.HEAR`. Links are found in another
    block, as observers must not change what the simulation itself has found.
    """
    neighbours = carve(block, Neighbours)
    scene, found = neighbours.scene, 0
    links = np.empty(FIRST_ROOM * len(neighbours.counts), np.int64)
    for row in range(len(states)):
        for place in range(states.shape[1]):
            block[place] = states[row, place]
        neighbours.cached_until[:] = scene.sorted_at = -np.inf
        scene.positions_time = np.nan
        scene.is_cached = False
        for index in range(len(senders)):
            sender = senders[index]
            find_receivers(block, addresses, neighbours, sender, scene.now)
            count, members = neighbours.counts[sender], neighbours.members
            if addresses[HEAR] != 0:
                call(addresses[HEAR], block, addresses, sender, scene.now)
                count, members = scene.heard, carve(block, Instant).heard
            if found + count > len(links):
                links = np.concatenate((links, np.empty(len(links) + count, np.int64)))
            for rank in range(count):
                links[found + rank] = (row * scene.agents + sender) * scene.agents + entry_of(members, rank)
            found += count
    return links[:found]
