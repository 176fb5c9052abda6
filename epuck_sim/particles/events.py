"""The event kernel: from one firing to the next, in continuous time (thesis 3.1.3, 5.1.1).

What happens at an instant, in frozen time:

1. All oscillators fire whose time lies within 1e-12 cycles of the earliest.
2. Each that fires sends a pulse to its neighbours, as they are then. One who hears it, and has neither fired nor heard
   a pulse at this instant, and whose phase is beyond the refractory period, shifts its phase by the response curve.
3. One whose phase reaches 1 by that fires at this instant too, and 2 goes on with it, until nobody is left.
4. All that have fired are at phase 0. Agents that are to reorient do so.
5. If the reference has fired, the order parameter is measured.

Nobody fires twice or hears two pulses at one instant, and a shift depends on one's own phase alone: the order in which
pulses are delivered makes no difference.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.particles.motion import Flights, begin_cycle, carry_on, ends_at, first_to_end, reorient, turn_next
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import Neighbourhood, begin_cycle_of_neighbours
from epuck_sim.particles.order_kernel import COMPLEX, REFERENCE, are_near, measure_order, near_enough
from epuck_sim.particles.oscillators import (
    Oscillators,
    begin_next_cycle,
    earliest_firing,
    firing_now,
    phase_at,
    set_next_firing,
)
from epuck_sim.particles.phase_response import CURVES, Response, shifted
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import jit_inline, jit_no_alloc

ENDLESS = 2**62
"""More than is ever counted."""

INSTANTS, CYCLES, FIRINGS, SYNCHRONISED = range(4)
"""What is counted: instants; firings of the reference, and of all; 1 if the last instant brought synchrony."""


class Rules(NamedTuple):
    """What the oscillators do, and when a trial ends."""

    response: Response
    reorients_on_emitting: bool
    reorients_on_receiving: bool
    reference: int
    metric: int
    threshold: float
    """Of the order parameter; inf where there is none."""
    near: float
    """If any phase is farther than this, in cycles, from the reference's, the threshold is not reached."""


class Instant(NamedTuple):
    """Who did what at the last instant."""

    fired: IntArray
    """(agents,) who fired, the first `counts[0]` of them, in the order of the cascade."""
    heard: IntArray
    """(agents,) who shifted its phase, the first `counts[1]`, those that fired by that among them."""
    counts: IntArray
    """(2,)"""
    is_done: BoolArray
    """(agents,) scratch: has fired or heard a pulse at this instant."""
    order: FloatArray
    """(1,) the order parameter at the last firing of the reference; NaN before it is measured."""
    tally: IntArray
    """(4,) see `INSTANTS` and so on."""


def make_rules(scenario: ParticleScenario) -> Rules:
    """Return a scenario's rules."""
    response, stop, reorient_on = scenario.response, scenario.stop, scenario.agents.reorient_on
    alone = scenario.agents.count == 1  # is never synchronised
    threshold = math.inf if alone or stop.order_parameter is None else stop.order_parameter
    return Rules(
        Response(CURVES.index(response.curve), response.coupling, response.refractory),
        "emitting" in reorient_on,
        "receiving" in reorient_on,
        stop.reference,
        COMPLEX if stop.metric == "complex" else REFERENCE,
        threshold,
        near_enough(scenario.agents.count, threshold) if threshold < math.inf else -1.0,
    )


def make_instant(agents: int) -> Instant:
    """Return an instant at which nothing has happened."""
    fired, heard = np.zeros((2, agents + 1), np.int64)
    counts, tally = np.zeros(2, np.int64), np.zeros(4, np.int64)
    return Instant(fired, heard, counts, np.zeros(agents, np.bool_), np.full(1, np.nan), tally)


@jit_no_alloc
def turn_if_next(flights: Flights, hood: Neighbourhood, clocks: Oscillators, instant: Instant) -> int:
    """Return who reaches a wall before anybody fires, and have it set out again; -1 if somebody fires before."""
    carry_on(flights, clocks.now[0])  # past what was not asked for until now
    while min(earliest_firing(clocks), ends_at(flights, first_to_end(flights))) >= 1.0:
        begin_next(flights, hood, clocks)
    turning = ends_at(flights, first_to_end(flights))
    if turning > earliest_firing(clocks):
        return -1
    clocks.now[0] = turning
    instant.tally[SYNCHRONISED] = 0
    return turn_next(flights)


@jit_inline
def begin_next(flights: Flights, hood: Neighbourhood, clocks: Oscillators) -> None:
    """Count all times from a cycle later."""
    begin_next_cycle(clocks)
    begin_cycle(flights)
    begin_cycle_of_neighbours(hood)


@jit_no_alloc
def advance(
    flights: Flights,
    hood: Neighbourhood,
    clocks: Oscillators,
    rules: Rules,
    instant: Instant,
    instants: int,
    cycles: int,
    last_cycle: int,
    last_time: float,
) -> None:
    """Go on until so many instants, or firings of the reference, have been counted in all, or until synchrony.

    last_cycle, last_time: nothing happens after this time of this cycle.
    """
    tally = instant.tally
    tally[SYNCHRONISED] = 0
    is_measured = True
    while tally[INSTANTS] < instants and tally[CYCLES] < cycles and not tally[SYNCHRONISED]:
        time = earliest_firing(clocks)
        while time >= 1.0 and clocks.cycle[0] < last_cycle:
            begin_next(flights, hood, clocks)
            time = earliest_firing(clocks)
        if clocks.cycle[0] > last_cycle or (clocks.cycle[0] == last_cycle and time > last_time):
            break
        fire(flights, hood, clocks, rules, instant, time)
        if rules.reorients_on_emitting or rules.reorients_on_receiving:
            reorient_all(flights, rules, instant, time)
        fired = instant.fired[: instant.counts[0]]
        tally[INSTANTS] += 1
        tally[FIRINGS] += instant.counts[0]
        is_measured = True
        for agent in fired:
            if agent == rules.reference:
                tally[CYCLES] += 1
                is_measured = are_near(clocks, rules.near, time)
                if is_measured:
                    instant.order[0] = measure_order(clocks, rules.metric, time)
                    tally[SYNCHRONISED] = instant.order[0] >= rules.threshold
                else:
                    instant.order[0] = math.nan
    if not is_measured:
        instant.order[0] = measure_order(clocks, rules.metric, clocks.now[0])


@jit_inline
def fire(
    flights: Flights, hood: Neighbourhood, clocks: Oscillators, rules: Rules, instant: Instant, time: float
) -> None:
    """Let all fire that are due at `time`, and all that they make fire."""
    agents = len(clocks.due)
    fired, heard, is_done = instant.fired, instant.heard, instant.is_done
    firing, hearing = firing_now(clocks, time, fired), 0
    for agent in fired[:firing]:
        is_done[agent] = True
    done = firing
    place = 0
    while place < firing and done < agents:
        row = find_neighbours(hood, flights, fired[place], time)
        for other in hood.members[row, : hood.counts[fired[place]]]:
            if is_done[other]:
                continue
            phase = phase_at(clocks, other, time)
            if phase <= rules.response.refractory:
                continue
            is_done[other] = True
            done += 1
            heard[hearing] = other
            hearing += 1
            phase = shifted(rules.response, phase)
            if phase >= 1.0:
                fired[firing] = other
                firing += 1
            else:
                set_next_firing(clocks, other, time + (1 - phase) * clocks.period[other])
        place += 1
    for agent in fired[:firing]:
        set_next_firing(clocks, agent, time + clocks.period[agent])
        is_done[agent] = False
    for agent in heard[:hearing]:
        is_done[agent] = False
    clocks.now[0] = time
    instant.counts[0] = firing
    instant.counts[1] = hearing


@jit_inline
def reorient_all(flights: Flights, rules: Rules, instant: Instant, time: float) -> None:
    """Have those set out anywhere who emitted, or received, a pulse; nobody twice."""
    carry_on(flights, time)
    fired, heard = instant.fired[: instant.counts[0]], instant.heard[: instant.counts[1]]
    if rules.reorients_on_emitting:
        for agent in fired:
            reorient(flights, agent, time)
            instant.is_done[agent] = True
    if rules.reorients_on_receiving:
        for agent in heard:
            if not instant.is_done[agent]:
                reorient(flights, agent, time)
    for agent in fired:
        instant.is_done[agent] = False
