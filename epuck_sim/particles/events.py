"""The event kernel: from one firing to the next, in continuous time (thesis 3.1.3, 5.1.1).

What happens at an instant is in `cascade`.
"""

import math

from epuck_sim.particles.cascade import (
    CYCLES,
    FIRINGS,
    INSTANTS,
    PULSES,
    SYNCHRONISED,
    Instant,
    fire,
    reorient_agents,
)
from epuck_sim.particles.motion import (
    Trajectories,
    advance_all,
    first_to_end,
    rebase_trajectories,
    time_of_end,
    turn_first,
)
from epuck_sim.particles.neighbourhood import Neighbourhood, rebase_neighbourhood
from epuck_sim.particles.order_kernel import are_phases_within, measure_order
from epuck_sim.particles.oscillators import Oscillators, earliest_firing, rebase_oscillators
from epuck_sim.particles.rules import Rules
from epuck_sim.util.jit import jit_inline, jit_no_alloc

UNLIMITED = 2**62
"""Larger than any count or cycle number."""


@jit_no_alloc
def turn_if_next(
    trajectories: Trajectories, neighbourhood: Neighbourhood, oscillators: Oscillators, instant: Instant
) -> int:
    """Continue the trajectory that ends before the next firing; return whose it is, or -1 if a firing comes first."""
    advance_all(trajectories, oscillators.now[0])  # ends that were passed without being asked for
    while min(earliest_firing(oscillators), time_of_end(trajectories, first_to_end(trajectories))) >= 1.0:
        start_next_cycle(trajectories, neighbourhood, oscillators)
    end_time = time_of_end(trajectories, first_to_end(trajectories))
    if end_time > earliest_firing(oscillators):
        return -1
    oscillators.now[0] = end_time
    instant.counters[SYNCHRONISED] = 0
    return turn_first(trajectories)


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
    max_offset: float,
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
        max_offset: The order parameter is measured when all phases are within so many cycles of the reference's.
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
        if rules.reorients_on_emitting or rules.reorients_on_receiving or rules.reorients_on_arriving:
            reorient_agents(trajectories, rules, instant, time)
        fired = instant.fired[: instant.counts[0]]
        counters[INSTANTS] += 1
        counters[FIRINGS] += instant.counts[0]
        is_measured = True
        for agent in fired:
            if agent == rules.reference:
                counters[CYCLES] += 1
                is_measured = are_phases_within(oscillators, max_offset, time)
                if is_measured:
                    instant.order_parameter[0] = measure_order(oscillators, rules.metric, time)
                    counters[SYNCHRONISED] = instant.order_parameter[0] >= rules.threshold
                else:
                    instant.order_parameter[0] = math.nan
    if not is_measured:
        instant.order_parameter[0] = measure_order(oscillators, rules.metric, oscillators.now[0])
