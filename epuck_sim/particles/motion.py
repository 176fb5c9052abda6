"""Agents on their way: straight flights from wall to wall, and where everybody is at any time (thesis 3.1, 5.1.2).

Nobody is moved while time passes. A flight knows where and when it began and when it ends; who asks where an agent is
has its flights carried on first. When that happens makes no difference, to the bit: each agent draws directions from a
stream of its own, and a flight's times are kept as a cycle and the time in it. So two swarms of one seed move alike
whatever their oscillators do. Times as arguments are in cycles since the present cycle began (see `clocks`).
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray, StreamArray
from epuck_sim.particles.oscillators import argmin
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.rng import uniform


class Flights(NamedTuple):
    """The present flight of each agent, in a segment, square or cube from 0 to `side_cm`."""

    side_cm: float
    is_cyclic: bool
    origin: FloatArray
    """(dimensions, agents) cm: where the flight began."""
    heading: FloatArray
    """(dimensions, agents) unit vectors."""
    speed: FloatArray
    """(agents,) cm in a cycle."""
    began_cycle: FloatArray
    """(agents,) the cycle in which the flight began."""
    began: FloatArray
    """(agents,) and when in that cycle, 0 to 1."""
    end_cycle: FloatArray
    """(agents,) the cycle in which a wall is reached; inf for who stands still."""
    ends: FloatArray
    """(agents,) and when in that cycle."""
    wall: IntArray
    """(agents,) which wall: twice the axis, and 1 more for the one at `side_cm`."""
    cycle: FloatArray
    """(1,) the present one."""
    soonest: FloatArray
    """(1,) when the first of all flights ends, counted from the present cycle; it may be too early."""
    left: FloatArray
    """(agents,) scratch: when each ends, counted likewise."""
    streams: StreamArray
    """(agents, 4) random numbers."""


def take_off(
    side_cm: float, is_cyclic: bool, origin: FloatArray, heading: FloatArray, speed: FloatArray, streams: StreamArray
) -> Flights:
    """Return the flights of agents that set out at time 0."""
    began_cycle, began, end_cycle, ends, left = np.zeros((5, len(speed)))
    wall = np.zeros(len(speed), np.int64)
    times = began_cycle, began, end_cycle, ends
    flights = Flights(side_cm, is_cyclic, origin, heading, speed, *times, wall, np.zeros(1), np.zeros(1), left, streams)
    plan_all(flights)
    return flights


@jit_inline
def plan_all(flights: Flights) -> None:
    """Find when all flights end."""
    for agent in range(len(flights.speed)):
        plan(flights, agent)
    flights.soonest[0] = ends_at(flights, first_to_end(flights))


@jit_inline
def ends_at(flights: Flights, agent: int) -> float:
    """Return when an agent's flight ends, in cycles since the present cycle began."""
    ends: float = (flights.end_cycle[agent] - flights.cycle[0]) + flights.ends[agent]
    return ends


@jit_inline
def flown_by(flights: Flights, agent: int, time: float) -> float:
    """Return how many cm of its flight an agent has behind it at `time`."""
    lasts = (flights.cycle[0] - flights.began_cycle[agent]) + (time - flights.began[agent])
    flown: float = flights.speed[agent] * lasts
    return flown


@jit_inline
def place_at(flights: Flights, agent: int, axis: int, time: float) -> float:
    """Return where an agent is along an axis, cm, at `time`, no later than its flight's end."""
    place: float = flights.origin[axis, agent] + flights.heading[axis, agent] * flown_by(flights, agent, time)
    return place


@jit_inline
def plan(flights: Flights, agent: int) -> None:
    """Find when an agent's flight ends, and where."""
    lasts = math.inf
    for axis in range(len(flights.origin)):
        velocity = flights.heading[axis, agent] * flights.speed[agent]
        if velocity > 0:
            until = (flights.side_cm - flights.origin[axis, agent]) / velocity
        elif velocity < 0:
            until = -flights.origin[axis, agent] / velocity
        else:
            continue
        if until < lasts:
            lasts = until
            flights.wall[agent] = 2 * axis + (velocity > 0)
    whole = math.floor(flights.began[agent] + lasts) if lasts < math.inf else math.inf
    flights.end_cycle[agent] = flights.began_cycle[agent] + whole
    flights.ends[agent] = flights.began[agent] + lasts - whole if lasts < math.inf else 0.0


@jit_inline
def land(flights: Flights, agent: int, flown: float, cycle: float, time: float) -> None:
    """Have an agent's flight begin at this time of this cycle, where it is after so many cm."""
    for axis in range(len(flights.origin)):
        reached = flights.origin[axis, agent] + flights.heading[axis, agent] * flown
        flights.origin[axis, agent] = min(max(reached, 0.0), flights.side_cm)
    flights.began_cycle[agent] = cycle
    flights.began[agent] = time


@jit_inline
def turn(flights: Flights, agent: int) -> None:
    """End an agent's flight at its wall: it comes in at the opposite one, or sets out in a new direction."""
    axis, is_far = flights.wall[agent] // 2, flights.wall[agent] % 2 == 1
    lasted = (flights.end_cycle[agent] - flights.began_cycle[agent]) + (flights.ends[agent] - flights.began[agent])
    land(flights, agent, flights.speed[agent] * lasted, flights.end_cycle[agent], flights.ends[agent])
    flights.origin[axis, agent] = flights.side_cm if is_far != flights.is_cyclic else 0.0
    if not flights.is_cyclic:
        set_out(flights.heading[:, agent], axis, -1.0 if is_far else 1.0, flights.streams[agent])
    plan(flights, agent)


@jit_inline
def carry_on(flights: Flights, time: float) -> None:
    """Have everybody whose flight ends before `time` set out again, as often as that takes."""
    if time < flights.soonest[0]:
        return
    for agent in range(len(flights.speed)):
        carry_one_on(flights, agent, time)
    flights.soonest[0] = ends_at(flights, first_to_end(flights))


@jit_inline
def carry_one_on(flights: Flights, agent: int, time: float) -> None:
    """Have an agent set out again as often as its flight has ended by `time`."""
    while ends_at(flights, agent) <= time:
        turn(flights, agent)


@jit_inline
def first_to_end(flights: Flights) -> int:
    """Return who reaches a wall first."""
    for agent in range(len(flights.left)):
        flights.left[agent] = ends_at(flights, agent)
    return argmin(flights.left, len(flights.left))


@jit_inline
def turn_next(flights: Flights) -> int:
    """Have the one set out again whose flight ends first; return who it is."""
    agent = first_to_end(flights)
    turn(flights, agent)
    flights.soonest[0] = ends_at(flights, first_to_end(flights))
    return agent


@jit_inline
def reorient(flights: Flights, agent: int, time: float) -> None:
    """Have an agent set out anywhere at `time`, no later than its flight's end (D.1)."""
    land(flights, agent, flown_by(flights, agent, time), flights.cycle[0], time)
    set_out_anywhere(flights.heading[:, agent], flights.streams[agent])
    plan(flights, agent)
    flights.soonest[0] = min(flights.soonest[0], ends_at(flights, agent))


@jit_inline
def begin_cycle(flights: Flights) -> None:
    """Count times from a cycle later."""
    flights.cycle[0] += 1.0
    flights.soonest[0] -= 1.0


@jit_inline
def locate(flights: Flights, time: float, places: FloatArray) -> None:
    """Write (dimensions, agents) cm where everybody is at `time` to `places`; flights go on."""
    carry_on(flights, time)
    for axis in range(len(places)):
        for agent in range(len(flights.speed)):
            places[axis, agent] = place_at(flights, agent, axis, time)


@jit_inline
def set_out(heading: FloatArray, axis: int, inward: float, stream: StreamArray) -> None:
    """Point a heading, (dimensions,), away from a wall: anywhere within 90 degrees of its normal.

    axis, inward: the normal's axis, and 1 or -1, its sign. In a square the angle to it is uniform (thesis 3.1), in a
    cube the direction, over the hemisphere; in a segment there is but one.
    """
    if len(heading) == 1:
        heading[0] = inward
    elif len(heading) == 2:
        angle = math.pi * (uniform(stream) - 0.5)
        heading[axis] = inward * math.cos(angle)
        heading[1 - axis] = math.sin(angle)
    else:
        point(heading, axis, inward * (1.0 - uniform(stream)), uniform(stream))


@jit_inline
def set_out_anywhere(heading: FloatArray, stream: StreamArray) -> None:
    """Point a heading, (dimensions,), in a direction that is uniform over all of them."""
    if len(heading) == 1:
        heading[0] = 1.0 if uniform(stream) < 0.5 else -1.0
    elif len(heading) == 2:
        angle = 2 * math.pi * uniform(stream)
        heading[0] = math.cos(angle)
        heading[1] = math.sin(angle)
    else:
        point(heading, 2, 2 * uniform(stream) - 1, uniform(stream))


@jit_inline
def point(heading: FloatArray, axis: int, height: float, turned: float) -> None:
    """Point a heading, (3,), to this height, -1 to 1, along an axis, turned by a share of a circle around it."""
    rim = math.sqrt(1 - height * height)
    heading[axis] = height
    heading[(axis + 1) % 3] = rim * math.cos(2 * math.pi * turned)
    heading[(axis + 2) % 3] = rim * math.sin(2 * math.pi * turned)
