"""Who hears the pulse of an agent that fires: the k nearest, or those in whose cone, or in its cone (thesis 5.1.3)."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.particles.cell_list import look_around
from epuck_sim.particles.motion import Flights, ends_at, locate, place_at
from epuck_sim.particles.neighbourhood import FULL_CIRCLE, NEAREST, REACHED, SEEN, Neighbourhood, is_worth_keeping, keep
from epuck_sim.particles.oscillators import argmin, minimum
from epuck_sim.util.jit import jit_inline, jit_no_alloc

FARTHER = 1.5
"""If fewer than k are found within reach, the reach is so many times as far."""


@jit_inline
def find_neighbours(hood: Neighbourhood, flights: Flights, agent: int, time: float) -> int:
    """Have a row of `members` begin with the `counts[agent]` who hear `agent` fire at `time`; return the row."""
    row = agent if hood.keeps else 0
    if time < hood.until[agent]:
        return row
    if hood.has_lattice:
        find_in_lattice(hood, flights, agent, time, hood.members[row])
        return row
    agents = len(flights.speed)
    if hood.placed[0] != time:
        locate(flights, time, hood.places)
        hood.placed[0] = time
    measure(hood, flights, flights.heading, agent, agents)
    if hood.kind == NEAREST:
        take_nearest(hood, agent, time, agents, math.inf, hood.members[row])
    else:
        take_cone(hood, flights, agent, time, agents, math.inf, hood.members[row])
    return row


@jit_no_alloc
def find_in_lattice(hood: Neighbourhood, flights: Flights, agent: int, time: float, members: IntArray) -> None:
    """Write an agent's neighbours to `members`, looking at those alone that are near enough."""
    reach_cm = hood.reach_cm
    is_found = False
    while not is_found:
        candidates = look_around(hood.lattice, flights, agent, time, reach_cm, hood.who)
        own = 0
        for place in range(candidates):
            other = hood.who[place]
            own = place if other == agent else own
            for axis in range(len(hood.places)):
                hood.facing[axis, place] = flights.heading[axis, other]
                hood.places[axis, place] = place_at(flights, other, axis, time)
        measure(hood, flights, hood.facing, own, candidates)
        if candidates == len(flights.speed):
            reach_cm = math.inf  # nobody is left
        if hood.kind == NEAREST:
            is_found = candidates > hood.k and take_nearest(hood, agent, time, candidates, reach_cm, members)
            reach_cm *= FARTHER
        else:
            take_cone(hood, flights, agent, time, candidates, reach_cm, members)
            is_found = True
    for rank in range(hood.counts[agent]):
        members[rank] = hood.who[members[rank]]


@jit_inline
def measure(hood: Neighbourhood, flights: Flights, facing: FloatArray, own: int, candidates: int) -> None:
    """Find how far all candidates are from the agent at place `own`, and how far ahead in the cones that count.

    facing: (dimensions, candidates) where they go. Loops without branches over arrays in a row are what a processor is
    quickest at.
    """
    square, along = hood.square, hood.along
    is_round = hood.kind == NEAREST or hood.cos == FULL_CIRCLE
    # in a cyclic space the nearest image counts; in another one nothing is taken off
    cycle_cm, a_cycle = (flights.side_cm, 1 / flights.side_cm) if flights.is_cyclic else (0.0, 0.0)
    for place in range(candidates):
        square[place] = 0.0
        along[place] = 0.0
    for axis in range(len(hood.places)):
        places, towards = hood.places[axis], facing[axis]
        here, ahead = places[own], towards[own]
        if is_round:
            for place in range(candidates):
                apart = places[place] - here
                apart -= cycle_cm * np.rint(apart * a_cycle)
                square[place] += apart * apart
        elif hood.kind == SEEN:
            for place in range(candidates):
                apart = places[place] - here
                apart -= cycle_cm * np.rint(apart * a_cycle)
                square[place] += apart * apart
                along[place] -= apart * towards[place]
        else:
            for place in range(candidates):
                apart = places[place] - here
                apart -= cycle_cm * np.rint(apart * a_cycle)
                square[place] += apart * apart
                along[place] += apart * ahead
    square[own] = math.inf


@jit_inline
def take_nearest(
    hood: Neighbourhood, agent: int, time: float, candidates: int, reach_cm: float, members: IntArray
) -> bool:
    """Write the places of the k nearest to `members`; return False if others, beyond reach_cm, may be nearer."""
    square = hood.square
    farthest = 0.0
    for rank in range(hood.k):
        place = argmin(square, candidates)
        members[rank] = place
        farthest = square[place]
        square[place] = math.inf
    if farthest > reach_cm * reach_cm:
        return False
    hood.counts[agent] = hood.k
    if is_worth_keeping(hood, agent):
        # both distances may change
        gap = min(math.sqrt(minimum(square, 0, candidates)), reach_cm) - math.sqrt(farthest)
        keep(hood, agent, time, time + gap / 2 * hood.patience)
    return True


@jit_inline
def take_cone(
    hood: Neighbourhood,
    flights: Flights,
    agent: int,
    time: float,
    candidates: int,
    reach_cm: float,
    members: IntArray,
) -> None:
    """Write the places of those to `members` to, or from, whom the cone reaches; who is where the agent is, is inside.

    reach_cm: whoever is no candidate is farther away.
    """
    square, along, inside = hood.square, hood.along, hood.inside
    is_round, limit = hood.cos == FULL_CIRCLE, hood.radius_cm * hood.radius_cm
    found = 0
    if is_round:
        for place in range(candidates):
            members[found] = place  # overwritten by the next one if it is out of reach: no branch
            found += square[place] <= limit
    else:
        for place in range(candidates):  # along >= cos * distance, without a root
            inside[place] = along[place] * abs(along[place]) - hood.cos * abs(hood.cos) * square[place]
        for place in range(candidates):
            members[found] = place
            found += (square[place] <= limit) & (inside[place] >= 0)
    hood.counts[agent] = found
    if is_worth_keeping(hood, agent):
        until = time + hood.patience * (reach_cm - hood.radius_cm) if reach_cm < math.inf else math.inf
        stays = hood.inside
        if is_round:
            for place in range(candidates):
                stays[place] = time + hood.patience * abs(math.sqrt(square[place]) - hood.radius_cm)
        else:
            if hood.kind == REACHED:
                until = min(until, ends_at(flights, agent))
            for place in range(candidates):
                hood.ends[place] = ends_at(flights, hood.who[place])
            find_stays(hood, time, candidates)
        keep(hood, agent, time, min(until, minimum(stays, 0, candidates)))


@jit_inline
def find_stays(hood: Neighbourhood, time: float, candidates: int) -> None:
    """Replace what is known of cones in `inside` by a time until which each is, or is not, in the cone for sure.

    Agents can enter or leave it over its arc, or over an edge, and a cone of vision turns when its agent does.
    """
    square, along, inside, ends = hood.square, hood.along, hood.inside, hood.ends
    is_of_one = hood.kind == REACHED  # the cone is the firing agent's, and not another for each
    for place in range(candidates):
        beyond = math.sqrt(square[place]) - hood.radius_cm
        # how far the cone's edge, or its extension beyond the apex, is
        across = math.sqrt(max(square[place] - along[place] * along[place], 0.0))
        edge = abs(across * hood.cos - along[place] * hood.sin)
        within = min(edge, -beyond) if inside[place] >= 0 else edge
        crossing = time + hood.patience * (beyond if beyond > 0 else within)
        turning = math.inf if is_of_one or beyond > 0 else ends[place]
        inside[place] = min(crossing, turning)
