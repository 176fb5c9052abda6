"""An instant: oscillators fire, and their pulses make others fire, in frozen time (thesis 3.1.3, 5.1.1).

What happens at an instant, in frozen time:

1. All oscillators fire whose firing times lie within 1e-12 cycles of the earliest.
2. Each oscillator that fires sends a pulse to its present neighbours. A receiver shifts its phase by the response
   curve, unless it has already fired or received a pulse at this instant, or is refractory. Only then does it count
   as receiving; in any case the pulse has arrived.
3. A receiver whose phase reaches 1 fires at the same instant, and step 2 is repeated until no oscillator is left.
4. The phases of all oscillators that fired are 0. Agents that reorient on pulses do so.
5. If the reference fired, the order parameter is measured.

At one instant, no oscillator fires twice or receives two pulses, and a shift depends on the receiver's phase alone:
the order in which pulses are delivered makes no difference.
"""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IndexArray, IntArray
from epuck_sim.particles.motion import Trajectories, advance_all, reorient
from epuck_sim.particles.neighbour_search import find_neighbours
from epuck_sim.particles.neighbourhood import Neighbourhood
from epuck_sim.particles.oscillators import Oscillators, firing_now, phase_at, set_next_firing
from epuck_sim.particles.phase_response import phase_after_pulse
from epuck_sim.particles.rules import Rules
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.native import unlikely

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


class Instant(NamedTuple):
    """What happened at the last instant, and the counters of the trial."""

    fired: IndexArray
    """(agents + 1,) the agents that fired, in the order of the cascade: the first `counts[0]` entries."""
    received: IndexArray
    """(agents + 1,) the agents whose phases were shifted, even to 1: the first `counts[1]` entries."""
    reached: IndexArray
    """(agents + 1,) scratch: agents at which a pulse arrived, until they are turned: the first `counts[2]` entries."""
    counts: IntArray
    """(3,) numbers of agents in `fired`, `received` and `reached`."""
    is_done: BoolArray
    """(agents,) scratch: whether each agent has fired or received a pulse at this instant."""
    is_reached: BoolArray
    """(agents,) scratch: whether each agent is in `reached`."""
    order_parameter: FloatArray
    """(1,) the order parameter at the last firing of the reference; NaN before it is measured."""
    headings: FloatArray
    """(dimensions, agents) unit vectors: headings at this instant before any agent reoriented, if agents do so."""
    counters: IntArray
    """(5,) counts at the indices `INSTANTS`, `CYCLES`, `FIRINGS`, `PULSES` and `SYNCHRONISED`."""


def make_instant(dimensions: int, agents: int) -> Instant:
    """Return an instant at which nothing has happened yet."""
    fired, received, reached = np.zeros((3, agents + 1), np.uint32)
    counts, counters = np.zeros(3, np.int64), np.zeros(5, np.int64)
    is_done, is_reached = np.zeros((2, agents), np.bool_)
    order_parameter, headings = np.full(1, np.nan), np.zeros((dimensions, agents))
    return Instant(fired, received, reached, counts, is_done, is_reached, order_parameter, headings, counters)


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
    done, sent = fired_count, 0
    last_done = agents + rules.sends_every_pulse  # one more than there can be, if every pulse is sent
    while sent < fired_count and done < last_done:
        row = find_neighbours(neighbourhood, trajectories, fired[sent], time)
        if unlikely(rules.reorients_on_arriving):
            note_arrivals(instant, neighbourhood.members[row, : neighbourhood.counts[fired[sent]]])
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
def note_arrivals(instant: Instant, receivers: IndexArray) -> None:
    """Add the agents that a pulse reaches to those that pulses have reached at this instant."""
    for agent in receivers:
        if not instant.is_reached[agent]:
            instant.is_reached[agent] = True
            instant.reached[instant.counts[2]] = agent
            instant.counts[2] += 1


@jit_inline
def reorient_agents(trajectories: Trajectories, rules: Rules, instant: Instant, time: float) -> None:
    """Reorient the agents that emitted, received or were reached by a pulse, as the rules ask; none of them twice."""
    advance_all(trajectories, time)
    for axis in range(len(trajectories.heading)):
        for agent in range(len(trajectories.speed)):
            instant.headings[axis, agent] = trajectories.heading[axis, agent]
    fired, received = instant.fired[: instant.counts[0]], instant.received[: instant.counts[1]]
    if rules.reorients_on_emitting:
        turn(trajectories, instant, fired, time)
    if rules.reorients_on_receiving:
        turn(trajectories, instant, received, time)
    if rules.reorients_on_arriving:
        reached = instant.reached[: instant.counts[2]]
        turn(trajectories, instant, reached, time)
        for agent in reached:
            instant.is_reached[agent] = instant.is_done[agent] = False
        instant.counts[2] = 0
    for agent in fired:
        instant.is_done[agent] = False
    for agent in received:
        instant.is_done[agent] = False


@jit_inline
def turn(trajectories: Trajectories, instant: Instant, agents: IndexArray, time: float) -> None:
    """Reorient agents that have not been turned at this instant."""
    for agent in agents:
        if not instant.is_done[agent]:
            reorient(trajectories, agent, time)
            instant.is_done[agent] = True
