"""The neighbourhood rule: which agents receive each agent's pulses (thesis 2.4, 3.1.2, 5.1.3).

No agent moves faster than the fastest one. Distances to other agents, and to the edges of cones, therefore bound the
time until which a neighbourhood cannot change; with slow agents that is many cycles, in which nothing is searched for.

A search looks at candidates: all agents, or, in large swarms, those that the cell list finds. Index k of an array that
a search fills, see `swarm`, belongs to the k-th of them.
"""

import math
from typing import Any

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.elementary import cos, sin
from epuck_sim.particles.motion import advance_one, compute_positions, distance_travelled, time_of_end
from epuck_sim.particles.selection import find_two_smallest, minimum, select_smallest
from epuck_sim.particles.swarm import SEARCH, Neighbours, Trajectories, entry_of
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import call, carve, row_at
from epuck_sim.util.rng import randint

NEAREST, VISION_CONE, EMISSION_CONE, RANDOM = range(4)
"""Kinds of neighbourhood. A pulse is received by the k agents nearest to the firing agent; by those whose cones contain
it; by those inside its own cone, or range; or by k agents that are drawn anew for each pulse."""

KINDS = {
    "nearest": NEAREST,
    "all": EMISSION_CONE,
    "random": RANDOM,
    "range": EMISSION_CONE,
    "cone_of_vision": VISION_CONE,
    "cone_of_emission": EMISSION_CONE,
}
"""Kinds by their names in scenarios: a range, or all agents, are a full circle."""

UNLIMITED_CM = 1e30
"""An unlimited radius: farther than any agent, but finite, as an agent's distance to itself is set to inf."""

FULL_CIRCLE_COS = -2.0  # stands for the cosine of a cone that is a full circle; below any cosine

SKIPPED_PULSES, SKIPPED_PULSES_CONE = 8, 32
"""Number of pulses for which caching is skipped after a cached neighbourhood expired within a cycle; and the same for a
cone or range, whose validity takes longer to compute."""

RADIUS_GROWTH = 1.5  # factor by which the search radius grows while fewer than k agents are found
MAX_CACHED = 4_000_000  # largest number of neighbours that are cached, of all agents together: they take 16 MB
MIN_CELL_LIST_AGENTS = 400  # smallest swarm that uses a cell list; in smaller ones a search over all pairs is faster

MAX_SHARE, MAX_SHARE_NEAREST = 1 / 3, 1 / 6
"""Largest share of all agents that a search in the cell list looks at; otherwise a search over all pairs is faster."""

BALL_VOLUME = {1: 2.0, 2: math.pi, 3: 4 / 3 * math.pi}  # length, area or volume of a ball of radius 1, by dimensions


def neighbourhood_of(scenario: ParticleScenario) -> dict[str, Any]:
    """Return the fields of a scene that define which agents are neighbours, and how these are found."""
    rule, agents, dimensions = scenario.neighbourhood, scenario.agents.count, scenario.space.dimensions
    kind, k = KINDS[rule.kind], min(getattr(rule, "k", agents), agents - 1)
    radius_cm, angle_deg = getattr(rule, "radius_cm", None) or UNLIMITED_CM, getattr(rule, "angle_deg", 360.0)
    # cones jump when their agents reorient, and when the nearest image of an agent changes in a cyclic space
    jumps = angle_deg < 360 and (scenario.space.boundary == "cyclic" or bool(scenario.agents.reorient_on))
    side_cm, spacing_cm = scenario.space.side_cm, scenario.space.side_cm / agents ** (1 / dimensions)
    cell_cm = spacing_cm if kind == NEAREST else max(spacing_cm, radius_cm / 2)
    expected = k + 1 + 3 * math.sqrt(k + 1)  # agents in the radius: far from walls hardly ever too few
    reach_cm = spacing_cm * (expected / BALL_VOLUME[dimensions]) ** (1 / dimensions)
    search_cm = reach_cm if kind == NEAREST else radius_cm + cell_cm / 4
    share = ((2 * search_cm + 2 * cell_cm) / side_cm) ** dimensions  # of all agents which are candidates
    is_local = kind != RANDOM and share < (MAX_SHARE_NEAREST if kind == NEAREST else MAX_SHARE)
    row = max(k, 1) if kind == NEAREST else agents
    cells = max(1, int(side_cm / cell_cm)) if agents >= MIN_CELL_LIST_AGENTS and is_local else 0
    return {
        "kind": kind,
        "k": k,
        "radius_cm": radius_cm,
        "cos": FULL_CIRCLE_COS if angle_deg >= 360 else cos(math.radians(angle_deg / 2)),
        "sin": sin(math.radians(angle_deg / 2)),
        "row": row,
        "is_cached": agents * row <= MAX_CACHED and not jumps and kind != RANDOM,
        "search_radius_cm": search_cm,
        "cells": cells,
        "cell_cm": side_cm / max(cells, 1),
    }


@jit_inline
def find_receivers(block: ByteArray, addresses: IntArray, neighbours: Neighbours, agent: int, time: float) -> int:
    """Find the receivers of a pulse, unless cached ones are still valid; return the index of the first in `members`."""
    if not time < neighbours.cached_until[agent]:
        call(addresses[SEARCH], block, addresses, agent, time)
    return row_of(neighbours, agent)


@jit_inline
def row_of(neighbours: Neighbours, agent: int) -> int:
    """Return the index in `members` at which an agent's neighbours are kept."""
    row: int = agent * neighbours.scene.row if neighbours.scene.is_cached else 0
    return row


@jit_inline
def _should_cache(neighbours: Neighbours, agent: int) -> bool:
    """Return whether caching is likely to pay off; count the pulses for which it is skipped."""
    if neighbours.skip_count[agent] > 0:
        neighbours.skip_count[agent] -= 1
        return False
    is_cached: bool = neighbours.scene.is_cached
    return is_cached


@jit_inline
def _cache_until(neighbours: Neighbours, agent: int, time: float, until: float) -> None:
    neighbours.cached_until[agent] = until
    if until < time + 1:
        neighbours.skip_count[agent] = SKIPPED_PULSES if neighbours.scene.kind == NEAREST else SKIPPED_PULSES_CONE


@jit_no_alloc
def search_nearest(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """Find the agents nearest to an agent, among all."""
    trajectories = carve(block, Trajectories)
    agents = _place_all(block, addresses, trajectories, time)
    _measure_distances(block, agent, agents)
    _select_nearest(block, agent, time, agents, math.inf)


@jit_no_alloc
def search_cone(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """Find the agents in a cone or range, among all."""
    trajectories = carve(block, Trajectories)
    agents = _place_all(block, addresses, trajectories, time)
    _measure_cone(block, trajectories.heading, agent, agents)
    _select_in_cone(block, trajectories, agent, time, agents, math.inf)


@jit_no_alloc
def search_cells(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """Find an agent's neighbours among the candidates from the cell list."""
    neighbours, trajectories = carve(block, Neighbours), carve(block, Trajectories)
    scene = trajectories.scene
    is_nearest, radius_cm = scene.kind == NEAREST, scene.search_radius_cm
    is_found = False
    while not is_found:
        count = find_candidates(block, addresses, agent, time, radius_cm)
        own = _gather_candidates(trajectories, neighbours, agent, time, count)
        if count == scene.agents:
            radius_cm = math.inf  # all agents are candidates
        if is_nearest:
            _measure_distances(block, own, count)
            is_found = count > scene.k and _select_nearest(block, agent, time, count, radius_cm)
            radius_cm *= RADIUS_GROWTH
        else:
            _measure_cone(block, neighbours.headings, own, count)
            _select_in_cone(block, trajectories, agent, time, count, radius_cm)
            is_found = True
            members = neighbours.members[row_of(neighbours, agent) :]
            for rank in range(neighbours.counts[agent]):
                members[rank] = neighbours.candidates[members[rank]]


@jit_no_alloc
def draw_receivers(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:  # noqa: ARG001
    """Draw k distinct agents other than `agent`; each set of k has the same chance.

    Floyd's algorithm takes k random numbers, and no array whose order would depend on earlier draws.
    """
    neighbours = carve(block, Neighbours)
    k, is_drawn, stream = neighbours.scene.k, neighbours.is_drawn, neighbours.receiver_streams[agent].words
    members = neighbours.members[row_of(neighbours, agent) :]
    others = len(is_drawn) - 1
    for rank in range(k):
        last = others - k + rank
        index = randint(stream, last + 1)
        drawn = index + (index >= agent)
        if is_drawn[drawn]:
            drawn = last + (last >= agent)
        is_drawn[drawn] = True
        members[rank] = drawn
    for rank in range(k):
        is_drawn[members[rank]] = False
    neighbours.counts[agent] = k


def search_of(scene: Any) -> Any:
    """Return the kernel that finds the receivers of a pulse in swarms with this scene."""
    searches = {NEAREST: search_nearest, RANDOM: draw_receivers}
    return search_cells if scene.cells else searches.get(scene.kind, search_cone)


@jit_inline
def _place_all(block: ByteArray, addresses: IntArray, trajectories: Trajectories, time: float) -> int:
    """Compute the positions of all agents at a time, unless that is done; return the number of agents."""
    if trajectories.scene.positions_time != time:
        compute_positions(block, addresses, trajectories, time, carve(block, Neighbours).positions)
        trajectories.scene.positions_time = time
    return len(trajectories.speed)


@jit_inline
def _gather_candidates(trajectories: Trajectories, neighbours: Neighbours, agent: int, time: float, count: int) -> int:
    """Compute the candidates' positions, and their headings for a cone; return the firing agent's index among them."""
    scene, found, travelled_cm = trajectories.scene, neighbours.candidates, trajectories.end_times
    agents = scene.agents
    own = 0
    for index in range(count):
        own = index if found[index] == agent else own
        travelled_cm[index] = distance_travelled(trajectories, entry_of(found, index), time)
    for axis in range(scene.dimensions):
        origin, heading = row_at(trajectories.origin, axis, agents), row_at(trajectories.heading, axis, agents)
        positions, headings = row_at(neighbours.positions, axis, agents), row_at(neighbours.headings, axis, agents)
        for index in range(count):
            positions[index] = origin[found[index]] + heading[found[index]] * travelled_cm[index]
        if scene.cos != FULL_CIRCLE_COS:
            for index in range(count):
                headings[index] = heading[found[index]]
    return own


@jit_no_alloc
def _measure_distances(block: ByteArray, own: int, count: int) -> None:
    """Compute the candidates' squared distances from the firing agent, whose index among them is `own`.

    Loops over contiguous arrays, which vectorise, here and in `_measure_cone`: not inlined, so that their branches
    are taken out of the loops.
    """
    neighbours = carve(block, Neighbours)
    scene = neighbours.scene
    square, is_cyclic, side_cm = neighbours.square_distance, scene.is_cyclic, scene.side_cm
    for axis in range(scene.dimensions):
        positions = row_at(neighbours.positions, axis, scene.agents)
        own_position = positions[own]
        for index in range(count):
            offset = nearest_image(is_cyclic, side_cm, positions[index] - own_position)
            square[index] = offset * offset + (square[index] if axis else 0.0)
    square[own] = math.inf


@jit_inline
def _measure_cone(block: ByteArray, headings: FloatArray, own: int, count: int) -> None:
    """Compute squared distances as `_measure_distances` does, and those along the axes of the candidates' cones."""
    neighbours = carve(block, Neighbours)
    scene = neighbours.scene
    if scene.cos == FULL_CIRCLE_COS:
        _measure_distances(block, own, count)
        return
    square, along = neighbours.square_distance, neighbours.axial_distance
    is_cyclic, side_cm, is_vision = scene.is_cyclic, scene.side_cm, scene.kind == VISION_CONE
    for axis in range(scene.dimensions):
        positions = row_at(neighbours.positions, axis, scene.agents)
        directions = row_at(headings, axis, scene.agents)
        own_position, own_direction = positions[own], directions[own]
        for index in range(count):
            offset = nearest_image(is_cyclic, side_cm, positions[index] - own_position)
            square[index] = offset * offset + (square[index] if axis else 0.0)
            direction = -directions[index] if is_vision else own_direction
            along[index] = (along[index] if axis else 0.0) + offset * direction
    square[own] = math.inf


@jit_inline
def nearest_image(is_cyclic: bool, side_cm: float, offset_cm: float) -> float:
    """Return the distance along an axis to the nearest image of an agent, in a cyclic space; else `offset_cm`."""
    if is_cyclic:
        offset_cm -= side_cm * float(np.rint(offset_cm * (1 / side_cm)))
    return offset_cm


@jit_inline
def _select_nearest(block: ByteArray, agent: int, time: float, count: int, radius_cm: float) -> bool:
    """Find the k nearest candidates; return False if an agent beyond the radius, not a candidate, may be nearer."""
    neighbours = carve(block, Neighbours)
    square, selected, k = neighbours.square_distance, neighbours.selected, neighbours.scene.k
    members = neighbours.members[row_of(neighbours, agent) :]
    if k == 1:
        selected[0], farthest, next_square = find_two_smallest(square, count)
    else:
        select_smallest(square, count, k + 1, neighbours.bucket_of, neighbours.bucket_end, selected)
        farthest, next_square = square[selected[k - 1]], square[selected[k]]
    if farthest > radius_cm * radius_cm:
        return False
    neighbours.counts[agent] = k
    for rank in range(k):
        members[rank] = neighbours.candidates[selected[rank]]
    if _should_cache(neighbours, agent):
        # the farthest neighbour may recede while another agent approaches: each has half of the gap
        gap_cm = min(math.sqrt(next_square), radius_cm) - math.sqrt(farthest)
        _cache_until(neighbours, agent, time, time + gap_cm / 2 * neighbours.scene.closing_time)
    return True


@jit_inline
def _select_in_cone(
    block: ByteArray, trajectories: Trajectories, agent: int, time: float, count: int, radius_cm: float
) -> None:
    """Find all candidates inside the cone, coincident ones included; all agents within the radius are candidates."""
    neighbours = carve(block, Neighbours)
    scene, members, row = neighbours.scene, neighbours.members, row_of(neighbours, agent)
    square, along, margin = neighbours.square_distance, neighbours.axial_distance, neighbours.margin
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
    if not _should_cache(neighbours, agent):
        return
    per_cm = scene.closing_time
    until = time + per_cm * (radius_cm - own_radius_cm) if radius_cm < math.inf else math.inf
    if is_round:
        for index in range(count):
            margin[index] = time + per_cm * abs(math.sqrt(square[index]) - own_radius_cm)
    else:
        if scene.kind == EMISSION_CONE:
            until = min(until, time_of_end(trajectories, agent))
        _bound_crossing_times(trajectories, neighbours, time, count)
    _cache_until(neighbours, agent, time, min(until, minimum(margin, 0, count)))


@jit_inline
def _bound_crossing_times(trajectories: Trajectories, neighbours: Neighbours, time: float, count: int) -> None:
    """Overwrite `margin` with times until which each candidate certainly stays inside, or outside, the cone.

    An agent enters or leaves a cone across its arc or an edge, and a cone of vision turns when its agent is reflected.
    """
    scene, end_times = trajectories.scene, trajectories.end_times
    square, along, margin = neighbours.square_distance, neighbours.axial_distance, neighbours.margin
    radius_cm, cosine, sine, per_cm = scene.radius_cm, scene.cos, scene.sin, scene.closing_time
    is_own_cone = scene.kind == EMISSION_CONE  # of the firing agent, not one of each candidate
    for index in range(0 if is_own_cone else count):
        end_times[index] = time_of_end(trajectories, entry_of(neighbours.candidates, index))
    for index in range(count):
        beyond = math.sqrt(square[index]) - radius_cm
        # distance from the cone's edge, or from its extension beyond the apex
        across = math.sqrt(max(square[index] - along[index] * along[index], 0.0))
        edge = abs(across * cosine - along[index] * sine)
        within = min(edge, -beyond) if margin[index] >= 0 or beyond == 0 else edge
        crossing = time + per_cm * (beyond if beyond > 0 else within)
        turning = math.inf if is_own_cone or beyond > 0 else end_times[index]
        margin[index] = min(crossing, turning)


# --- cell list: agents sorted into the cells of a grid -------------------------------------------------
#
# They are sorted only now and then. No agent moves faster than the fastest one, so every agent within a radius of a
# point is still listed in a cell within that radius plus the distance which the fastest has moved since.


@jit_inline
def _cell_index(scene: Any, coordinate_cm: float) -> int:
    index: int = min(max(math.floor(coordinate_cm / scene.cell_cm), 0), scene.cells - 1)
    return index


@jit_no_alloc
def _sort_into_cells(block: ByteArray, addresses: IntArray, trajectories: Trajectories, time: float) -> None:
    """Sort all agents by the cells in which they are at `time`, by counting."""
    neighbours, scene = carve(block, Neighbours), trajectories.scene
    positions, start = neighbours.positions, neighbours.cell_start
    agents, cells = neighbours.agents_by_cell, neighbours.cell_of_agent
    compute_positions(block, addresses, trajectories, time, positions)
    for cell in range(len(start)):
        start[cell] = 0
    for agent in range(len(agents)):
        cell = 0
        for axis in range(scene.dimensions):
            cell = cell * scene.cells + _cell_index(scene, positions[axis * len(agents) + agent])
        cells[agent] = cell
        start[cell + 1] += 1
    for cell in range(1, len(start)):
        start[cell] += start[cell - 1]
    for agent in range(len(agents) - 1, -1, -1):  # backwards, so that the end of each cell becomes its start
        cell = entry_of(cells, agent) + 1
        start[cell] -= 1
        agents[start[cell]] = agent
    for cell in range(len(start) - 1):
        start[cell] = start[cell + 1]
    start[len(start) - 1] = len(agents)
    scene.sorted_at = time


@jit_no_alloc
def _cell_range(
    trajectories: Trajectories, axis: int, agent: int, travelled_cm: float, radius_cm: float
) -> tuple[int, int, int]:
    """Return the first index, which may wrap around, and number of cells within a radius, and the number of all."""
    scene = trajectories.scene
    if axis >= scene.dimensions:
        return 0, 1, 1
    place = axis * scene.agents + agent
    centre_cm = trajectories.origin[place] + trajectories.heading[place] * travelled_cm
    if not scene.is_cyclic:
        low = _cell_index(scene, centre_cm - radius_cm)
        return low, _cell_index(scene, centre_cm + radius_cm) - low + 1, scene.cells
    low = math.floor((centre_cm - radius_cm) / scene.cell_cm)
    count = math.floor((centre_cm + radius_cm) / scene.cell_cm) - low + 1
    return (low, count, scene.cells) if count < scene.cells else (0, scene.cells, scene.cells)


@jit_no_alloc
def find_candidates(block: ByteArray, addresses: IntArray, agent: int, time: float, radius_cm: float) -> int:
    """Find all agents that may be within a radius of an agent, itself included; advance them; return their number."""
    trajectories, neighbours = carve(block, Trajectories), carve(block, Neighbours)
    scene, start, candidates = trajectories.scene, neighbours.cell_start, neighbours.candidates
    moved_cm = scene.max_speed * (time - scene.sorted_at)
    if not moved_cm <= scene.cell_cm / 2:
        _sort_into_cells(block, addresses, trajectories, time)
        moved_cm = 0.0
    advance_one(block, addresses, trajectories, agent, time)
    travelled_cm = distance_travelled(trajectories, agent, time)
    low0, count0, cells0 = _cell_range(trajectories, 0, agent, travelled_cm, radius_cm + moved_cm)
    low1, count1, cells1 = _cell_range(trajectories, 1, agent, travelled_cm, radius_cm + moved_cm)
    low2, count2, cells2 = _cell_range(trajectories, 2, agent, travelled_cm, radius_cm + moved_cm)
    found = 0
    for a in range(low0, low0 + count0):
        for b in range(low1, low1 + count1):
            row = ((a % cells0) * cells1 + b % cells1) * cells2
            for c in range(low2, low2 + count2):
                cell = row + c % cells2
                for index in range(start[cell], start[cell + 1]):
                    other = entry_of(neighbours.agents_by_cell, index)
                    advance_one(block, addresses, trajectories, other, time)
                    candidates[found] = other
                    found += 1
    return found
