"""Simulation from one instant at which oscillators fire to the next, in continuous time (thesis 3.1.3, 5.1.1).

An instant, in frozen time:

1. All oscillators fire whose firing times lie within 1e-12 cycles of the earliest.
2. Each oscillator that fires sends a pulse to its present neighbours. A receiver shifts its phase by the response
   curve, unless it has already fired or received a pulse at this instant, or is refractory. Only then does it count
   as receiving; the pulse has arrived in any case.
3. A receiver whose phase reaches 1 fires at the same instant, and step 2 is repeated until no oscillator is left.
4. The phases of all oscillators that fired are 0. Agents that reorient on pulses do so.
5. If the reference fired, the order parameter is measured.

At one instant, no oscillator fires twice or receives two pulses, and a shift depends on the receiver's phase alone:
the order in which pulses are delivered makes no difference.
"""

import math

from epuck_sim.arrays import ByteArray, IndexArray, IntArray
from epuck_sim.particles import swarm
from epuck_sim.particles.motion import advance_all, compute_positions, first_to_end, time_of_end
from epuck_sim.particles.neighbours import find_receivers
from epuck_sim.particles.oscillators import (
    SIMULTANEITY_CYCLES,
    are_phases_within,
    earliest_firing,
    firing_now,
    measure_order,
    phase_at,
    set_next_firing,
)
from epuck_sim.particles.phase_response import phase_after_pulse
from epuck_sim.particles.swarm import Instant, Neighbours, Observed, Oscillators, Trajectories, entry_of
from epuck_sim.util.jit import jit, jit_inline
from epuck_sim.util.native import call, carve, unlikely


@jit
def advance(block: ByteArray, addresses: IntArray) -> None:
    """Simulate until a limit of the scene is reached, or synchrony."""
    oscillators, neighbours, instant = carve(block, Oscillators), carve(block, Neighbours), carve(block, Instant)
    scene = oscillators.scene
    pulses, cycles, max_offset = scene.limits.pulses, scene.limits.cycles, scene.limits.max_offset
    last_cycle, last_time = scene.limits.last_cycle, scene.limits.last_time
    reorients = scene.reorients_on_emitting or scene.reorients_on_receiving or scene.reorients_on_arriving
    scene.is_synchronised = False
    is_measured = True
    while scene.pulses < pulses and scene.cycles < cycles and not scene.is_synchronised:
        time = earliest_firing(oscillators)
        while time >= 1.0 and scene.cycle < last_cycle:
            start_next_cycle(oscillators, neighbours)
            time = earliest_firing(oscillators)
        if scene.cycle > last_cycle or (scene.cycle == last_cycle and time > last_time):
            break
        fire(block, addresses, oscillators, neighbours, instant, time)
        if unlikely(reorients):
            call(addresses[swarm.REORIENT], block, addresses, 0, time)
        scene.instants += 1
        scene.firings += scene.fired
        is_measured = True
        for index in range(scene.fired):
            if instant.fired[index] == scene.reference:
                scene.cycles += 1
                is_measured = are_phases_within(oscillators, max_offset, time)
                scene.order_parameter = measure_order(oscillators, time) if is_measured else math.nan
                scene.is_synchronised = scene.order_parameter >= scene.threshold
    if not is_measured:
        scene.order_parameter = measure_order(oscillators, scene.now)


@jit_inline
def start_next_cycle(oscillators: Oscillators, neighbours: Neighbours) -> None:
    """Count all times from the start of the next cycle."""
    scene = oscillators.scene
    for agent in range(len(oscillators.next_firing)):
        oscillators.next_firing[agent] -= 1.0
    for agent in range(len(neighbours.cached_until)):
        neighbours.cached_until[agent] -= 1.0
    for level in (oscillators.block_earliest, oscillators.group_earliest, oscillators.part_earliest):
        for place in range(len(level)):
            level[place] -= 1.0
    scene.now -= 1.0
    scene.cycle += 1.0
    scene.earliest_end -= 1.0
    scene.sorted_at -= 1.0
    scene.positions_time = math.nan


@jit_inline
def fire(
    block: ByteArray,
    addresses: IntArray,
    oscillators: Oscillators,
    neighbours: Neighbours,
    instant: Instant,
    time: float,
) -> None:
    """Fire all oscillators that are due, and all that fire because of their pulses."""
    scene, response, agents = oscillators.scene, oscillators.scene.response, len(oscillators.next_firing)
    fired, received, is_done = instant.fired, instant.received, instant.is_done
    fired_count, received_count = firing_now(oscillators, time, fired), 0
    for index in range(fired_count):
        is_done[fired[index]] = True
    done, sent, refractory = fired_count, 0, response.refractory
    has_faults = addresses[swarm.HEAR] != 0
    last_done = agents + scene.sends_every_pulse  # out of reach if every pulse is to be sent
    while sent < fired_count and done < last_done:
        agent = entry_of(fired, sent)
        row = find_receivers(block, addresses, neighbours, agent, time)
        receivers = neighbours.members[row : row + neighbours.counts[agent]]
        if unlikely(has_faults):
            call(addresses[swarm.HEAR], block, addresses, agent, time)
            receivers = instant.heard[: scene.heard]
        if unlikely(scene.reorients_on_arriving):
            note_arrivals(block, receivers)
        for index in range(len(receivers)):
            other = entry_of(receivers, index)
            if is_done[other]:
                continue
            phase = phase_at(oscillators, other, time)
            if phase <= refractory:
                continue
            is_done[other] = True
            done += 1
            received[received_count] = other
            received_count += 1
            phase = phase_after_pulse(response, instant.curve, addresses, phase)
            if phase >= 1.0 - SIMULTANEITY_CYCLES:  # `additive` may miss 1 by a rounding
                fired[fired_count] = other
                fired_count += 1
            else:
                set_next_firing(oscillators, other, time + (1 - phase) * oscillators.period[other])
        sent += 1
    for index in range(fired_count):
        agent = entry_of(fired, index)
        set_next_firing(oscillators, agent, time + oscillators.period[agent])
        is_done[agent] = False
    for index in range(received_count):
        is_done[received[index]] = False
    scene.now = time
    scene.fired = fired_count
    scene.received = received_count
    scene.pulses += max(sent, 1)


@jit
def note_arrivals(block: ByteArray, receivers: IndexArray) -> None:
    """Add the receivers of a pulse to the agents that pulses have reached at this instant."""
    instant = carve(block, Instant)
    scene = instant.scene
    for index in range(len(receivers)):
        agent = receivers[index]
        if not instant.is_reached[agent]:
            instant.is_reached[agent] = True
            instant.reached[scene.reached] = agent
            scene.reached += 1


@jit
def turn_if_next(block: ByteArray, addresses: IntArray) -> int:
    """Continue the trajectory that ends before the next firing; return its agent, or -1 if a firing comes first."""
    oscillators, trajectories = carve(block, Oscillators), carve(block, Trajectories)
    neighbours, scene = carve(block, Neighbours), oscillators.scene
    advance_all(block, addresses, trajectories, scene.now)  # ends that have passed already
    while min(earliest_firing(oscillators), time_of_end(trajectories, first_to_end(trajectories))) >= 1.0:
        start_next_cycle(oscillators, neighbours)
    agent = first_to_end(trajectories)
    end = time_of_end(trajectories, agent)
    if end > earliest_firing(oscillators):
        return -1
    scene.now = end
    scene.is_synchronised = False
    call(addresses[swarm.CONTINUE], block, addresses, agent, -math.inf)
    scene.earliest_end = time_of_end(trajectories, first_to_end(trajectories))
    return agent


@jit
def observe(block: ByteArray, addresses: IntArray) -> None:
    """Write the positions and phases at the present time; continue trajectories that have ended."""
    oscillators, observed = carve(block, Oscillators), carve(block, Observed)
    now = oscillators.scene.now
    compute_positions(block, addresses, carve(block, Trajectories), now, observed.positions_now)
    for agent in range(len(observed.phases_now)):
        # rounding may leave -1e-16 to an agent that has just fired
        observed.phases_now[agent] = max(phase_at(oscillators, agent, now), 0.0)
