"""Search for the receivers of a pulse: by distance or by a cone (thesis 5.1.3), or drawn at random (2.4)."""

import math

import numpy as np

from epuck_sim.arrays import FloatArray, IndexArray
from epuck_sim.particles.cell_list import find_candidates
from epuck_sim.particles.motion import Trajectories, compute_positions, distance_travelled, time_of_end
from epuck_sim.particles.neighbourhood import (
    EMISSION_CONE,
    FULL_CIRCLE_COS,
    NEAREST,
    RANDOM,
    VISION_CONE,
    Neighbourhood,
    cache_until,
    should_cache,
)
from epuck_sim.particles.oscillators import minimum
from epuck_sim.particles.selection import find_two_smallest, select_smallest
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.rng import randint

RADIUS_GROWTH = 1.5
"""Factor by which the search radius grows while fewer than k agents are found."""


@jit_inline
def find_neighbours(neighbourhood: Neighbourhood, trajectories: Trajectories, agent: int, time: float) -> int:
    """Find the agents that receive a pulse which `agent` emits at `time`.

    Args:
        neighbourhood: Receives the neighbours: the first `counts[agent]` numbers in a row of `members`.
        trajectories: Trajectories of all agents; continued as far as needed.
        agent: The agent that fires.
        time: Cycles since the start of the present cycle.

    Returns:
        The row of `members`.
    """
    row = agent if neighbourhood.is_cached else 0
    if time < neighbourhood.cached_until[agent]:
        return row
    if not neighbourhood.searches_all:
        find_otherwise(neighbourhood, trajectories, agent, time, neighbourhood.members[row])
        return row
    agents = len(trajectories.speed)
    if neighbourhood.positions_time[0] != time:
        compute_positions(trajectories, time, neighbourhood.positions)
        neighbourhood.positions_time[0] = time
    measure_distances(neighbourhood, trajectories, trajectories.heading, agent, agents)
    if neighbourhood.kind == NEAREST:
        select_nearest(neighbourhood, agent, time, agents, math.inf, neighbourhood.members[row])
    else:
        select_in_cone(neighbourhood, trajectories, agent, time, agents, math.inf, neighbourhood.members[row])
    return row


@jit_no_alloc
def find_otherwise(
    neighbourhood: Neighbourhood, trajectories: Trajectories, agent: int, time: float, members: IndexArray
) -> None:
    """Write an agent's neighbours to `members`, without a search over all agents."""
    if neighbourhood.kind == RANDOM:
        draw_receivers(neighbourhood, agent, members)
    else:
        search_cell_list(neighbourhood, trajectories, agent, time, members)


@jit_inline
def draw_receivers(neighbourhood: Neighbourhood, agent: int, members: IndexArray) -> None:
    """Write k distinct agents other than `agent` to `members`; each set of k has the same chance.

    Floyd's algorithm: k random numbers, and no array that a draw would leave in another order for the next one.
    """
    is_drawn, stream = neighbourhood.is_drawn, neighbourhood.streams[agent]
    others = len(is_drawn) - 1
    for rank in range(neighbourhood.k):
        last = others - neighbourhood.k + rank
        index = randint(stream, last + 1)
        drawn = index + (index >= agent)
        if is_drawn[drawn]:
            drawn = last + (last >= agent)
        is_drawn[drawn] = True
        members[rank] = drawn
    for rank in range(neighbourhood.k):
        is_drawn[members[rank]] = False
    neighbourhood.counts[agent] = neighbourhood.k


@jit_inline
def search_cell_list(
    neighbourhood: Neighbourhood, trajectories: Trajectories, agent: int, time: float, members: IndexArray
) -> None:
    """Write an agent's neighbours to `members`, with candidates from the cell list."""
    candidates = neighbourhood.candidates
    radius_cm = neighbourhood.search_radius_cm
    is_found = False
    while not is_found:
        count = find_candidates(neighbourhood.cell_list, trajectories, agent, time, radius_cm, candidates)
        own = gather_candidates(neighbourhood, trajectories, agent, time, count)
        measure_distances(neighbourhood, trajectories, neighbourhood.headings, own, count)
        if count == len(trajectories.speed):
            radius_cm = math.inf  # all agents are candidates
        if neighbourhood.kind == NEAREST:
            is_found = count > neighbourhood.k and select_nearest(neighbourhood, agent, time, count, radius_cm, members)
            radius_cm *= RADIUS_GROWTH
        else:
            select_in_cone(neighbourhood, trajectories, agent, time, count, radius_cm, members)
            is_found = True
    for rank in range(neighbourhood.counts[agent]):
        members[rank] = candidates[members[rank]]


@jit_inline
def gather_candidates(
    neighbourhood: Neighbourhood, trajectories: Trajectories, agent: int, time: float, count: int
) -> int:
    """Compute the candidates' positions, and their headings for a cone; return the firing agent's index among them."""
    candidates, travelled_cm = neighbourhood.candidates, neighbourhood.end_times
    own = 0
    for index in range(count):
        own = index if candidates[index] == agent else own
        travelled_cm[index] = distance_travelled(trajectories, candidates[index], time)
    for axis in range(len(neighbourhood.positions)):
        origin, heading = trajectories.origin[axis], trajectories.heading[axis]
        positions, headings = neighbourhood.positions[axis], neighbourhood.headings[axis]
        for index in range(count):
            positions[index] = origin[candidates[index]] + heading[candidates[index]] * travelled_cm[index]
        if neighbourhood.cos != FULL_CIRCLE_COS:
            for index in range(count):
                headings[index] = heading[candidates[index]]
    return own


@jit_inline
def measure_distances(
    neighbourhood: Neighbourhood, trajectories: Trajectories, headings: FloatArray, own: int, count: int
) -> None:
    """Compute the candidates' squared distances from the firing agent, and those along the axes of the cones.

    Branch-free loops over contiguous arrays, which vectorise.

    Args:
        neighbourhood: Holds the positions; receives the distances.
        trajectories: The space.
        headings: (dimensions, count) unit vectors: headings of the candidates.
        own: Index of the firing agent among the candidates.
        count: Number of candidates.
    """
    square, along = neighbourhood.square_distance, neighbourhood.axial_distance
    is_round = neighbourhood.kind == NEAREST or neighbourhood.cos == FULL_CIRCLE_COS
    for axis in range(len(neighbourhood.positions)):
        positions, directions = neighbourhood.positions[axis], headings[axis]
        own_position, own_direction = positions[own], directions[own]
        if is_round:
            for index in range(count):
                offset = nearest_image(trajectories, positions[index] - own_position)
                square[index] = offset * offset + (square[index] if axis else 0.0)
        elif neighbourhood.kind == VISION_CONE:
            for index in range(count):
                offset = nearest_image(trajectories, positions[index] - own_position)
                square[index] = offset * offset + (square[index] if axis else 0.0)
                along[index] = (along[index] if axis else 0.0) - offset * directions[index]
        else:
            for index in range(count):
                offset = nearest_image(trajectories, positions[index] - own_position)
                square[index] = offset * offset + (square[index] if axis else 0.0)
                along[index] = (along[index] if axis else 0.0) + offset * own_direction
    square[own] = math.inf


@jit_inline
def nearest_image(trajectories: Trajectories, offset_cm: float) -> float:
    """Return the distance along an axis to the nearest image of an agent, in a cyclic space; else `offset_cm`."""
    if trajectories.is_cyclic:
        offset_cm -= trajectories.side_cm * float(np.rint(offset_cm * (1 / trajectories.side_cm)))
    return offset_cm


@jit_inline
def select_nearest(
    neighbourhood: Neighbourhood, agent: int, time: float, count: int, radius_cm: float, members: IndexArray
) -> bool:
    """Write the indices of the k nearest candidates to `members`: the nearest first, equally near ones as they come.

    Args:
        neighbourhood: Holds the distances.
        agent: The agent that fires.
        time: Cycles since the start of the present cycle.
        count: Number of candidates.
        radius_cm: All agents within this radius are candidates.
        members: (agents,) output.

    Returns:
        Whether these are the nearest for certain: no agent beyond the radius may be nearer.
    """
    square = neighbourhood.square_distance
    bucket_of, bucket_end = neighbourhood.bucket_of, neighbourhood.bucket_end
    if neighbourhood.k == 1:
        nearest, farthest, next_square = find_two_smallest(square, count)
        members[0] = nearest
    else:
        farthest = select_smallest(square, count, neighbourhood.k, bucket_of, bucket_end, members)
        next_square = minimum(square, 0, count)
    if farthest > radius_cm * radius_cm:
        return False
    neighbourhood.counts[agent] = neighbourhood.k
    if should_cache(neighbourhood, agent):
        # the farthest neighbour may recede while another agent approaches: each has half of the gap
        gap_cm = min(math.sqrt(next_square), radius_cm) - math.sqrt(farthest)
        cache_until(neighbourhood, agent, time, time + gap_cm / 2 * neighbourhood.inverse_closing_speed)
    return True


@jit_inline
def select_in_cone(
    neighbourhood: Neighbourhood,
    trajectories: Trajectories,
    agent: int,
    time: float,
    count: int,
    radius_cm: float,
    members: IndexArray,
) -> None:
    """Write the indices of all candidates inside the cone to `members`; coincident agents count as inside.

    Args:
        neighbourhood: Holds the distances.
        trajectories: Trajectories of all agents.
        agent: The agent that fires.
        time: Cycles since the start of the present cycle.
        count: Number of candidates.
        radius_cm: All agents within this radius are candidates.
        members: (agents,) output.
    """
    square, along, margin = neighbourhood.square_distance, neighbourhood.axial_distance, neighbourhood.angle_margin
    is_round, limit = neighbourhood.cos == FULL_CIRCLE_COS, neighbourhood.radius_cm * neighbourhood.radius_cm
    found = np.uint64(0)  # unsigned: see `IndexArray`
    if is_round:
        for index in range(count):
            members[found] = index  # overwritten by the next one if this one is out of reach: no branch
            found += np.uint64(square[index] <= limit)
    else:
        for index in range(count):  # along >= cos * distance, without a root, and within the radius
            margin[index] = min(
                along[index] * abs(along[index]) - neighbourhood.cos * abs(neighbourhood.cos) * square[index],
                limit - square[index],
            )
        for index in range(count):
            members[found] = index
            found += np.uint64(margin[index] >= 0)
    neighbourhood.counts[agent] = found
    if should_cache(neighbourhood, agent):
        per_cm = neighbourhood.inverse_closing_speed
        until = time + per_cm * (radius_cm - neighbourhood.radius_cm) if radius_cm < math.inf else math.inf
        valid_until = neighbourhood.angle_margin
        if is_round:
            for index in range(count):
                valid_until[index] = time + per_cm * abs(math.sqrt(square[index]) - neighbourhood.radius_cm)
        else:
            if neighbourhood.kind == EMISSION_CONE:
                until = min(until, time_of_end(trajectories, agent))
            for index in range(count):
                neighbourhood.end_times[index] = time_of_end(trajectories, neighbourhood.candidates[index])
            bound_crossing_times(neighbourhood, time, count)
        cache_until(neighbourhood, agent, time, min(until, minimum(valid_until, 0, count)))


@jit_inline
def bound_crossing_times(neighbourhood: Neighbourhood, time: float, count: int) -> None:
    """Overwrite `angle_margin` with times until which each candidate certainly stays inside, or outside, the cone.

    An agent enters or leaves a cone across its arc or an edge, and a cone of vision turns when its agent is reflected.
    """
    square, along, margin = neighbourhood.square_distance, neighbourhood.axial_distance, neighbourhood.angle_margin
    is_own_cone = neighbourhood.kind == EMISSION_CONE  # of the firing agent, not one of each candidate
    for index in range(count):
        beyond = math.sqrt(square[index]) - neighbourhood.radius_cm
        # distance from the cone's edge, or from its extension beyond the apex
        across = math.sqrt(max(square[index] - along[index] * along[index], 0.0))
        edge = abs(across * neighbourhood.cos - along[index] * neighbourhood.sin)
        within = min(edge, -beyond) if margin[index] >= 0 or beyond == 0 else edge
        crossing = time + neighbourhood.inverse_closing_speed * (beyond if beyond > 0 else within)
        turning = math.inf if is_own_cone or beyond > 0 else neighbourhood.end_times[index]
        margin[index] = min(crossing, turning)
