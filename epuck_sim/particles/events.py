"""The event kernel: from one firing to the next, in continuous time (thesis 3.1.3, 5.1.1).

What happens at an instant, in frozen time:

1. All oscillators fire whose firing times lie within 1e-12 cycles of the earliest.
2. Each oscillator that fires sends a pulse to its present neighbours. A receiver shifts its phase by the response
   curve, unless it has already fired or received a pulse at this instant, or is refractory.
3. A receiver whose phase reaches 1 fires at the same instant, and step 2 is repeated until no oscillator is left.
4. The phases of all oscillators that fired are 0. Agents that reorient on pulses do so.
5. If the reference fired, the order parameter is measured.

At one instant, no oscillator fires twice or receives two pulses, and a shift depends on the receiver's phase alone:
the order in which pulses are delivered makes no difference.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IndexArray, IntArray
from epuck_sim.particles.motion import (
    Trajectories,
    advance_all,
    first_to_hit_wall,
    rebase_trajectories,
    reflect_next,
    reorient,
    wall_hit_time,
)
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import Neighbourhood, rebase_neighbourhood
from epuck_sim.particles.order_kernel import METRIC_CODES, are_phases_within, max_phase_offset, measure_order
from epuck_sim.particles.oscillators import (
    Oscillators,
    earliest_firing,
    firing_now,
    phase_at,
    rebase_oscillators,
    set_next_firing,
)
from epuck_sim.particles.phase_response import CURVES, Response, phase_after_pulse
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import jit_inline, jit_no_alloc

UNLIMITED = 2**62
"""Larger than any count or cycle number."""

INSTANTS = 0
"""Index of the counter of instants at which agents fired."""

CYCLES = 1
"""Index of the counter of the reference's firings."""

FIRINGS = 2
"""Index of the counter of all agents' firings."""

PULSES = 3
"""Index of the counter of pulses whose receivers were looked for; an instant without any pulse counts as one."""

SYNCHRONISED = 4
"""Index of the flag that is 1 if the last instant brought synchrony, else 0."""


class Rules(NamedTuple):
    """How oscillators and agents respond to pulses, and when a trial ends."""

    response: Response
    """The phase response curve."""
    reorients_on_emitting: bool
    """Whether agents reorient when they emit a pulse."""
    reorients_on_receiving: bool
    """Whether agents reorient when they receive a pulse."""
    reference: int
    """Index of the agent whose firings are counted as cycles."""
    metric: int
    """`COMPLEX` or `REFERENCE`."""
    threshold: float
    """Order parameter at which the swarm is synchronised; inf if there is none."""
    max_offset: float
    """Cycles; if any phase is farther than this from the reference's, the threshold is not reached."""


class Instant(NamedTuple):
    """What happened at the last instant, and the counters of the trial."""

    fired: IndexArray
    """(agents + 1,) the agents that fired, in the order of the cascade: the first `counts[0]` entries."""
    received: IndexArray
    """(agents + 1,) the agents whose phases were shifted, even to 1: the first `counts[1]` entries."""
    counts: IntArray
    """(2,) numbers of agents in `fired` and `received`."""
    is_done: BoolArray
    """(agents,) scratch: whether each agent has fired or received a pulse at this instant."""
    order_parameter: FloatArray
    """(1,) the order parameter at the last firing of the reference; NaN before it is measured."""
    headings: FloatArray
    """(dimensions, agents) unit vectors: headings at this instant before any agent reoriented, if agents do so."""
    counters: IntArray
    """(5,) counts at the indices `INSTANTS`, `CYCLES`, `FIRINGS`, `PULSES` and `SYNCHRONISED`."""


def make_rules(scenario: ParticleScenario) -> Rules:
    """Return the rules of a scenario."""
    response, stop, reorient_on = scenario.response, scenario.stop, scenario.agents.reorient_on
    is_single = scenario.agents.count == 1  # a single agent is never synchronised
    threshold = math.inf if is_single or stop.order_parameter is None else stop.order_parameter
    max_offset = max_phase_offset(scenario.agents.count, threshold) if threshold < math.inf else -1.0
    return Rules(
        Response(CURVES.index(response.curve), response.coupling, response.refractory),
        "emitting" in reorient_on,
        "receiving" in reorient_on,
        stop.reference,
        METRIC_CODES[stop.metric],
        threshold,
        1.0 if stop.max_time_s is not None else max_offset,  # then a trial may end between two firings
    )


def make_instant(dimensions: int, agents: int) -> Instant:
    """Return an instant at which nothing has happened yet."""
    headings = np.zeros((dimensions, agents))
    fired, received = np.zeros((2, agents + 1), np.uint32)
    counts, counters = np.zeros(2, np.int64), np.zeros(5, np.int64)
    return Instant(fired, received, counts, np.zeros(agents, np.bool_), np.full(1, np.nan), headings, counters)


@jit_no_alloc
def reflect_if_next(
    trajectories: Trajectories, neighbourhood: Neighbourhood, oscillators: Oscillators, instant: Instant
) -> int:
    """Reflect the agent that reaches a wall before the next firing; return its index, or -1 if a firing comes first."""
    advance_all(trajectories, oscillators.now[0])  # wall hits that were passed without being asked for
    while min(earliest_firing(oscillators), wall_hit_time(trajectories, first_to_hit_wall(trajectories))) >= 1.0:
        start_next_cycle(trajectories, neighbourhood, oscillators)
    wall_time = wall_hit_time(trajectories, first_to_hit_wall(trajectories))
    if wall_time > earliest_firing(oscillators):
        return -1
    oscillators.now[0] = wall_time
    instant.counters[SYNCHRONISED] = 0
    return reflect_next(trajectories)


@jit_inline
def start_next_cycle(trajectories: Trajectories, neighbourhood: Neighbourhood, oscillators: Oscillators) -> None:
    """Count all times from the start of the next cycle."""
    rebase_oscillators(oscillators)
    rebase_trajectories(trajectories)
    rebase_neighbourhood(neighbourhood)


@jit_no_alloc
def advance(
    trajectories: Trajectories,
    neighbourhood: Neighbourhood,
    oscillators: Oscillators,
    rules: Rules,
    instant: Instant,
    pulses: int,
    cycles: int,
    last_cycle: int,
    last_time: float,
) -> None:
    """Simulate until one of several limits is reached, or until the swarm is synchronised.

    Args:
        trajectories: Motion of the agents.
        neighbourhood: Rule and cache of neighbours.
        oscillators: Firing times.
        rules: Responses to pulses, and the threshold of synchrony.
        instant: Receives what happened, and counts it.
        pulses: Limit of pulses, counted from the beginning of the trial; the instant that reaches it is completed.
        cycles: Limit of firings of the reference, counted from the beginning of the trial.
        last_cycle: Nothing happens after `last_time` of this cycle.
        last_time: Cycles since the start of that cycle.
    """
    counters = instant.counters
    counters[SYNCHRONISED] = 0
    is_measured = True
    while counters[PULSES] < pulses and counters[CYCLES] < cycles and not counters[SYNCHRONISED]:
        time = earliest_firing(oscillators)
        while time >= 1.0 and oscillators.cycle[0] < last_cycle:
            start_next_cycle(trajectories, neighbourhood, oscillators)
            time = earliest_firing(oscillators)
        if oscillators.cycle[0] > last_cycle or (oscillators.cycle[0] == last_cycle and time > last_time):
            break
        fire(trajectories, neighbourhood, oscillators, rules, instant, time)
        if rules.reorients_on_emitting or rules.reorients_on_receiving:
            reorient_agents(trajectories, rules, instant, time)
        fired = instant.fired[: instant.counts[0]]
        counters[INSTANTS] += 1
        counters[FIRINGS] += instant.counts[0]
        is_measured = True
        for agent in fired:
            if agent == rules.reference:
                counters[CYCLES] += 1
                is_measured = are_phases_within(oscillators, rules.max_offset, time)
                if is_measured:
                    instant.order_parameter[0] = measure_order(oscillators, rules.metric, time)
                    counters[SYNCHRONISED] = instant.order_parameter[0] >= rules.threshold
                else:
                    instant.order_parameter[0] = math.nan
    if not is_measured:
        instant.order_parameter[0] = measure_order(oscillators, rules.metric, oscillators.now[0])


@jit_inline
def fire(
    trajectories: Trajectories,
    neighbourhood: Neighbourhood,
    oscillators: Oscillators,
    rules: Rules,
    instant: Instant,
    time: float,
) -> None:
    """Fire all oscillators whose time has come, and all that their pulses make fire."""
    agents = len(oscillators.next_firing)
    fired, received, is_done = instant.fired, instant.received, instant.is_done
    fired_count, received_count = firing_now(oscillators, time, fired), 0
    for agent in fired[:fired_count]:
        is_done[agent] = True
    done = fired_count
    sent = 0
    while sent < fired_count and done < agents:
        row = find_neighbours(neighbourhood, trajectories, fired[sent], time)
        for other in neighbourhood.members[row, : neighbourhood.counts[fired[sent]]]:
            if is_done[other]:
                continue
            phase = phase_at(oscillators, other, time)
            if phase <= rules.response.refractory:
                continue
            is_done[other] = True
            done += 1
            received[received_count] = other
            received_count += 1
            phase = phase_after_pulse(rules.response, phase)
            if phase >= 1.0:
                fired[fired_count] = other
                fired_count += 1
            else:
                set_next_firing(oscillators, other, time + (1 - phase) * oscillators.period[other])
        sent += 1
    for agent in fired[:fired_count]:
        set_next_firing(oscillators, agent, time + oscillators.period[agent])
        is_done[agent] = False
    for agent in received[:received_count]:
        is_done[agent] = False
    oscillators.now[0] = time
    instant.counts[0] = fired_count
    instant.counts[1] = received_count
    instant.counters[PULSES] += max(sent, 1)


@jit_inline
def reorient_agents(trajectories: Trajectories, rules: Rules, instant: Instant, time: float) -> None:
    """Reorient the agents that emitted, or received, a pulse, whichever the rules ask for; none of them twice."""
    advance_all(trajectories, time)
    for axis in range(len(trajectories.heading)):
        for agent in range(len(trajectories.speed)):
            instant.headings[axis, agent] = trajectories.heading[axis, agent]
    fired, received = instant.fired[: instant.counts[0]], instant.received[: instant.counts[1]]
    if rules.reorients_on_emitting:
        for agent in fired:
            reorient(trajectories, agent, time)
            instant.is_done[agent] = True
    if rules.reorients_on_receiving:
        for agent in received:
            if not instant.is_done[agent]:
                reorient(trajectories, agent, time)
    for agent in fired:
        instant.is_done[agent] = False
