"""The neighbourhood rule: which agents receive each agent's pulses (thesis 2.4, 3.1.2, 5.1.3).

No agent moves faster than the fastest one. Distances to other agents, and to the edges of cones, therefore bound the
time until which a neighbourhood cannot change; with slow agents that is many cycles, in which nothing is searched for.

A search looks at candidates: all agents, or, in large swarms, those that the cell list finds. Index k of an array of
`Candidates` belongs to the k-th of them.
"""

import math

import numpy as np

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.particles.cell_list import find_candidates
from epuck_sim.particles.motion import compute_end_times, compute_positions, distance_travelled, time_of_end
from epuck_sim.particles.oscillators import minimum
from epuck_sim.particles.selection import find_two_smallest, select_smallest
from epuck_sim.particles.swarm import (
    FLAG,
    SCENE,
    SCENE_BYTES,
    SEARCH,
    STREAM,
    Candidates,
    Neighbours,
    Trajectories,
    axis_at,
    candidates_at,
    entry_of,
    neighbours_at,
    trajectories_at,
)
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import array_at, call
from epuck_sim.util.rng import randint

NEAREST = 0
"""Kind of neighbourhood: the k agents nearest to the firing agent receive its pulse."""

VISION_CONE = 1
"""Kind of neighbourhood: the agents whose cones contain the firing agent receive its pulse."""

EMISSION_CONE = 2
"""Kind of neighbourhood: the agents inside the cone, or range, of the firing agent receive its pulse."""

RANDOM = 3
"""Kind of neighbourhood: k agents, which are drawn anew for each pulse, receive it."""

UNLIMITED_CM = 1e30
"""An unlimited radius: farther than any agent, but finite, as an agent's distance to itself is set to inf."""

FULL_CIRCLE_COS = -2.0
"""Stands for the cosine of a cone that is a full circle; below any cosine."""

SKIPPED_PULSES = 8
"""Number of pulses for which caching is skipped after a cached neighbourhood expired within a cycle."""

SKIPPED_PULSES_CONE = 32
"""The same for a cone or range, whose validity takes longer to compute."""

RADIUS_GROWTH = 1.5
"""Factor by which the search radius grows while fewer than k agents are found."""


@jit_inline
def find_receivers(
    block: ByteArray, addresses: IntArray, neighbours: Neighbours, agent: int, time: float, by_address: bool | None
) -> int:
    """Find the agents that receive a pulse which `agent` emits at `time`, unless those found before are valid still.

    Args:
        block: The swarm.
        addresses: Addresses of what compiled code calls.
        neighbours: Those of the block.
        agent: The agent that fires.
        time: Cycles since the start of the present cycle.
        by_address: None for a search in cones among all agents as part of the caller, which is not compiled if this is
            True: then the search is called by its address.

    Returns:
        The index in `neighbours.members` of the first of them; there are `neighbours.counts[agent]`.
    """
    if not time < neighbours.cached_until[agent]:
        if by_address is None:
            search_cone(block, addresses, agent, time)
        else:
            call(addresses[SEARCH], block, addresses, agent, time)
    return row_of(neighbours, agent)


@jit_inline
def row_of(neighbours: Neighbours, agent: int) -> int:
    """Return the index in `members` at which an agent's neighbours are kept."""
    row: int = agent * neighbours.scene[0].agents if neighbours.scene[0].is_cached else 0
    return row


@jit_inline
def should_cache(neighbours: Neighbours, agent: int) -> bool:
    """Return whether caching an agent's neighbours is likely to pay off; count the pulses for which it is skipped."""
    if neighbours.skip_count[agent] > 0:
        neighbours.skip_count[agent] -= 1
        return False
    is_cached: bool = neighbours.scene[0].is_cached
    return is_cached


@jit_inline
def cache_until(neighbours: Neighbours, agent: int, time: float, until: float) -> None:
    """Declare the neighbours of an agent, found at `time`, valid until a later time."""
    neighbours.cached_until[agent] = until
    if until < time + 1:
        neighbours.skip_count[agent] = SKIPPED_PULSES if neighbours.scene[0].kind == NEAREST else SKIPPED_PULSES_CONE


# --- searches, which are called by their addresses; see `swarm.SEARCH` ---------------------------------


@jit_no_alloc
def search_nearest(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """Find the agents nearest to an agent, among all."""
    candidates, trajectories = candidates_at(block), trajectories_at(block)
    place_all(block, addresses, trajectories, time)
    agents = len(trajectories.speed)
    measure_distances(block, agent, agents)
    select_nearest(neighbours_at(block), candidates, agent, time, agents, math.inf)


@jit_inline
def search_cone(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """Find the agents in a cone or range, among all."""
    candidates, trajectories = candidates_at(block), trajectories_at(block)
    place_all(block, addresses, trajectories, time)
    agents = len(trajectories.speed)
    measure_cone(block, trajectories.scene[0].first.heading, agent, agents)
    select_in_cone(neighbours_at(block), trajectories, candidates, agent, time, agents, math.inf)


@jit_no_alloc
def search_cells(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """Find an agent's neighbours among the candidates from the cell list."""
    candidates, trajectories, neighbours = candidates_at(block), trajectories_at(block), neighbours_at(block)
    scene = trajectories.scene[0]
    is_nearest, radius_cm = scene.kind == NEAREST, scene.search_radius_cm
    is_found = False
    while not is_found:
        count = find_candidates(block, addresses, trajectories, agent, time, radius_cm, candidates)
        own = gather_candidates(block, trajectories, candidates, agent, time, count)
        if count == len(trajectories.speed):
            radius_cm = math.inf  # all agents are candidates
        if is_nearest:
            measure_distances(block, own, count)
            is_found = count > scene.k and select_nearest(neighbours, candidates, agent, time, count, radius_cm)
            radius_cm *= RADIUS_GROWTH
        else:
            measure_cone(block, scene.first.headings, own, count)
            select_in_cone(neighbours, trajectories, candidates, agent, time, count, radius_cm)
            is_found = True
    members = neighbours.members[row_of(neighbours, agent) :]
    for rank in range(neighbours.counts[agent]):
        members[rank] = candidates.agents[members[rank]]


@jit_no_alloc
def draw_receivers(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:  # noqa: ARG001
    """Draw k distinct agents other than `agent`; each set of k has the same chance.

    Floyd's algorithm: k random numbers, and no array that a draw would leave in another order for the next one.
    """
    scene, neighbours = array_at(block, 0, SCENE_BYTES, SCENE)[0], neighbours_at(block)
    is_drawn = array_at(block, scene.first.is_drawn, scene.end.is_drawn, FLAG)
    streams = array_at(block, scene.first.receiver_streams, scene.end.receiver_streams, STREAM)
    members, stream = neighbours.members[row_of(neighbours, agent) :], streams[agent].words
    others = len(is_drawn) - 1
    for rank in range(scene.k):
        last = others - scene.k + rank
        index = randint(stream, last + 1)
        drawn = index + (index >= agent)
        if is_drawn[drawn]:
            drawn = last + (last >= agent)
        is_drawn[drawn] = True
        members[rank] = drawn
    for rank in range(scene.k):
        is_drawn[members[rank]] = False
    neighbours.counts[agent] = scene.k


# --- parts of searches -------------------------------------------------------------------------------


@jit_inline
def place_all(block: ByteArray, addresses: IntArray, trajectories: Trajectories, time: float) -> None:
    """Compute the positions of all agents, unless that is done."""
    if trajectories.scene[0].positions_time != time:
        compute_positions(block, addresses, trajectories, time, trajectories.scene[0].first.positions)
        trajectories.scene[0].positions_time = time


@jit_inline
def gather_candidates(
    block: ByteArray, trajectories: Trajectories, candidates: Candidates, agent: int, time: float, count: int
) -> int:
    """Compute the candidates' positions, and their headings for a cone; return the firing agent's index among them."""
    scene, found = trajectories.scene[0], candidates.agents
    travelled_cm = trajectories.end_times
    own = 0
    for index in range(count):
        own = index if found[index] == agent else own
        travelled_cm[index] = distance_travelled(trajectories, entry_of(found, index), time)
    for axis in range(scene.dimensions):
        rows = axis_at(block, axis, scene.first.positions, scene.first.headings)
        for index in range(count):
            rows.positions[index] = rows.origin[found[index]] + rows.heading[found[index]] * travelled_cm[index]
        if scene.cos != FULL_CIRCLE_COS:
            for index in range(count):
                rows.headings[index] = rows.heading[found[index]]
    return own


@jit_no_alloc
def measure_distances(block: ByteArray, own: int, count: int) -> None:
    """Compute the candidates' squared distances from the firing agent, whose index among them is `own`.

    Loops over contiguous arrays, which vectorise, here and in `measure_cone`: not inlined, so that their branches
    are taken out of the loops.
    """
    scene, square = array_at(block, 0, SCENE_BYTES, SCENE)[0], candidates_at(block).square_distance
    is_cyclic, side_cm = scene.is_cyclic, scene.side_cm
    for axis in range(scene.dimensions):
        positions = axis_at(block, axis, scene.first.positions, 0).positions
        own_position = positions[own]
        for index in range(count):
            offset = nearest_image(is_cyclic, side_cm, positions[index] - own_position)
            square[index] = offset * offset + (square[index] if axis else 0.0)
    square[own] = math.inf


@jit_inline
def measure_cone(block: ByteArray, headings: int, own: int, count: int) -> None:
    """Compute the candidates' squared distances from the firing agent, and those along the axes of the cones.

    Args:
        block: The swarm, with the candidates' positions.
        headings: Offset in the block of the array (dimensions * agents,) of the candidates' headings.
        own: Index of the firing agent among the candidates.
        count: Number of candidates.
    """
    scene, candidates = array_at(block, 0, SCENE_BYTES, SCENE)[0], candidates_at(block)
    if scene.cos == FULL_CIRCLE_COS:
        measure_distances(block, own, count)
        return
    square, along = candidates.square_distance, candidates.axial_distance
    is_cyclic, side_cm, is_vision = scene.is_cyclic, scene.side_cm, scene.kind == VISION_CONE
    for axis in range(scene.dimensions):
        rows = axis_at(block, axis, scene.first.positions, headings)
        positions, directions = rows.positions, rows.headings
        own_position, own_direction = positions[own], directions[own]
        if is_vision:
            for index in range(count):
                offset = nearest_image(is_cyclic, side_cm, positions[index] - own_position)
                square[index] = offset * offset + (square[index] if axis else 0.0)
                along[index] = (along[index] if axis else 0.0) - offset * directions[index]
        else:
            for index in range(count):
                offset = nearest_image(is_cyclic, side_cm, positions[index] - own_position)
                square[index] = offset * offset + (square[index] if axis else 0.0)
                along[index] = (along[index] if axis else 0.0) + offset * own_direction
    square[own] = math.inf


@jit_inline
def nearest_image(is_cyclic: bool, side_cm: float, offset_cm: float) -> float:
    """Return the distance along an axis to the nearest image of an agent, in a cyclic space; else `offset_cm`."""
    if is_cyclic:
        offset_cm -= side_cm * float(np.rint(offset_cm * (1 / side_cm)))
    return offset_cm


@jit_inline
def select_nearest(
    neighbours: Neighbours, candidates: Candidates, agent: int, time: float, count: int, radius_cm: float
) -> bool:
    """Write the indices of the k nearest candidates to the agent's row: the nearest first, equally near as they come.

    Args:
        neighbours: Receives the indices.
        candidates: Holds the distances.
        agent: The agent that fires.
        time: Cycles since the start of the present cycle.
        count: Number of candidates.
        radius_cm: All agents within this radius are candidates.

    Returns:
        Whether these are the nearest for certain: no agent beyond the radius may be nearer.
    """
    square, k, members = (
        candidates.square_distance,
        neighbours.scene[0].k,
        neighbours.members[row_of(neighbours, agent) :],
    )
    if k == 1:
        nearest, farthest, next_square = find_two_smallest(square, count)
        members[0] = nearest
    else:
        farthest = select_smallest(square, count, k, candidates.bucket_of, candidates.bucket_end, members)
        next_square = minimum(square, 0, count)
    if farthest > radius_cm * radius_cm:
        return False
    neighbours.counts[agent] = k
    if should_cache(neighbours, agent):
        # the farthest neighbour may recede while another agent approaches: each has half of the gap
        gap_cm = min(math.sqrt(next_square), radius_cm) - math.sqrt(farthest)
        cache_until(neighbours, agent, time, time + gap_cm / 2 * neighbours.scene[0].closing_time)
    return True


@jit_inline
def select_in_cone(
    neighbours: Neighbours,
    trajectories: Trajectories,
    candidates: Candidates,
    agent: int,
    time: float,
    count: int,
    radius_cm: float,
) -> None:
    """Write the indices of all candidates inside the cone to the agent's row; coincident agents count as inside.

    Args:
        neighbours: Receives the indices.
        trajectories: Trajectories of all agents.
        candidates: Holds the distances.
        agent: The agent that fires.
        time: Cycles since the start of the present cycle.
        count: Number of candidates.
        radius_cm: All agents within this radius are candidates.
    """
    scene, members, row = neighbours.scene[0], neighbours.members, row_of(neighbours, agent)
    square, along, margin = candidates.square_distance, candidates.axial_distance, candidates.margin
    cosine, is_round, own_radius_cm = scene.cos, scene.cos == FULL_CIRCLE_COS, scene.radius_cm
    limit = own_radius_cm * own_radius_cm
    found = np.uint64(row)  # unsigned: compiled code tests a signed index for counting from the end
    if is_round:
        for index in range(count):
            members[found] = index  # overwritten by the next one if this one is out of reach: no branch
            found += np.uint64(square[index] <= limit)
    else:
        for index in range(count):  # along >= cos * distance, without a root, and within the radius
            margin[index] = min(
                along[index] * abs(along[index]) - cosine * abs(cosine) * square[index], limit - square[index]
            )
        for index in range(count):
            members[found] = index
            found += np.uint64(margin[index] >= 0)
    neighbours.counts[agent] = np.int64(found) - row
    if should_cache(neighbours, agent):
        per_cm = scene.closing_time
        until = time + per_cm * (radius_cm - own_radius_cm) if radius_cm < math.inf else math.inf
        if is_round:
            for index in range(count):
                margin[index] = time + per_cm * abs(math.sqrt(square[index]) - own_radius_cm)
        else:
            if scene.kind == EMISSION_CONE:
                until = min(until, time_of_end(trajectories, agent))
            else:
                find_turning_times(trajectories, candidates, count)
            bound_crossing_times(trajectories, candidates, time, count)
        cache_until(neighbours, agent, time, min(until, minimum(margin, 0, count)))


@jit_inline
def find_turning_times(trajectories: Trajectories, candidates: Candidates, count: int) -> None:
    """Write to `end_times` when each candidate's trajectory ends."""
    if trajectories.scene[0].cells == 0:
        compute_end_times(trajectories)
        return
    for index in range(count):
        trajectories.end_times[index] = time_of_end(trajectories, entry_of(candidates.agents, index))


@jit_inline
def bound_crossing_times(trajectories: Trajectories, candidates: Candidates, time: float, count: int) -> None:
    """Overwrite `margin` with times until which each candidate certainly stays inside, or outside, the cone.

    An agent enters or leaves a cone across its arc or an edge, and a cone of vision turns when its agent is reflected.
    """
    scene, end_times = trajectories.scene[0], trajectories.end_times
    square, along, margin = candidates.square_distance, candidates.axial_distance, candidates.margin
    radius_cm, cosine, sine, per_cm = scene.radius_cm, scene.cos, scene.sin, scene.closing_time
    is_own_cone = scene.kind == EMISSION_CONE  # of the firing agent, not one of each candidate
    for index in range(count):
        beyond = math.sqrt(square[index]) - radius_cm
        # distance from the cone's edge, or from its extension beyond the apex
        across = math.sqrt(max(square[index] - along[index] * along[index], 0.0))
        edge = abs(across * cosine - along[index] * sine)
        within = min(edge, -beyond) if margin[index] >= 0 or beyond == 0 else edge
        crossing = time + per_cm * (beyond if beyond > 0 else within)
        turning = math.inf if is_own_cone or beyond > 0 else end_times[index]
        margin[index] = min(crossing, turning)
