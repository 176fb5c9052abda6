"""Cell list: agents sorted into the cells of a grid, for large swarms in which a search over all pairs is too slow.

Agents are sorted only now and then. No agent moves faster than the fastest one, so every agent within a radius of a
point is still listed in a cell within that radius plus the distance which the fastest has moved since.
"""

import math
from typing import Any

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.particles.motion import advance_one, compute_positions, distance_travelled
from epuck_sim.particles.swarm import INDEX, INT, Candidates, Trajectories, entry_of
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import array_at


@jit_inline
def cell_index(scene: Any, coordinate_cm: float) -> int:
    """Return the index, along an axis, of the cell that contains a coordinate."""
    index: int = min(max(math.floor(coordinate_cm / scene.cell_cm), 0), scene.cells - 1)
    return index


@jit_no_alloc
def sort_into_cells(
    block: ByteArray, addresses: IntArray, trajectories: Trajectories, candidates: Candidates, time: float
) -> None:
    """Sort all agents by the cells in which they are at `time`, by counting."""
    scene = trajectories.scene[0]
    start = array_at(block, scene.first.cell_start, scene.end.cell_start, INT)
    agents = array_at(block, scene.first.agents_by_cell, scene.end.agents_by_cell, INDEX)
    cells = array_at(block, scene.first.cell_of_agent, scene.end.cell_of_agent, INDEX)
    compute_positions(block, addresses, trajectories, time, scene.first.positions)
    for cell in range(len(start)):
        start[cell] = 0
    for agent in range(len(agents)):
        cell = 0
        for axis in range(scene.dimensions):
            cell = cell * scene.cells + cell_index(scene, candidates.positions[axis * len(agents) + agent])
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
def cell_range(scene: Any, centre_cm: float, radius_cm: float) -> tuple[int, int]:
    """Return the first index of the cells within a radius of a place along an axis, and their number.

    In a cyclic space the first index may be negative, and indices may exceed the number of cells: they wrap around.
    """
    if scene.is_cyclic:
        low = math.floor((centre_cm - radius_cm) / scene.cell_cm)
        count = math.floor((centre_cm + radius_cm) / scene.cell_cm) - low + 1
        return (low, count) if count < scene.cells else (0, scene.cells)
    low = cell_index(scene, centre_cm - radius_cm)
    return low, cell_index(scene, centre_cm + radius_cm) - low + 1


@jit_no_alloc
def find_candidates(
    block: ByteArray,
    addresses: IntArray,
    trajectories: Trajectories,
    agent: int,
    time: float,
    radius_cm: float,
    candidates: Candidates,
) -> int:
    """Find all agents that may be within a radius of an agent, and the agent itself; advance them to `time`.

    Args:
        block: The swarm, which is sorted again if that was too long ago.
        addresses: Addresses of what compiled code calls.
        trajectories: Trajectories of all agents.
        agent: The agent at the centre.
        time: Cycles since the start of the present cycle.
        radius_cm: Radius of the search.
        candidates: Receives the agents.

    Returns:
        The number of agents found.
    """
    scene, agents, dimensions = trajectories.scene[0], len(trajectories.speed), trajectories.scene[0].dimensions
    moved_cm = scene.max_speed * (time - scene.sorted_at)
    if not moved_cm <= scene.cell_cm / 2:
        sort_into_cells(block, addresses, trajectories, candidates, time)
        moved_cm = 0.0
    start = array_at(block, scene.first.cell_start, scene.end.cell_start, INT)
    by_cell = array_at(block, scene.first.agents_by_cell, scene.end.agents_by_cell, INDEX)
    advance_one(block, addresses, trajectories, agent, time)
    travelled_cm = distance_travelled(trajectories, agent, time)
    low0 = low1 = low2 = 0  # along an axis which the space lacks there is one cell
    count0 = count1 = count2 = 1
    cells0 = cells1 = cells2 = 1
    for axis in range(dimensions):
        place = axis * agents + agent
        centre_cm = trajectories.origin[place] + trajectories.heading[place] * travelled_cm
        low, count = cell_range(scene, centre_cm, radius_cm + moved_cm)
        if axis == 0:
            low0, count0, cells0 = low, count, scene.cells
        elif axis == 1:
            low1, count1, cells1 = low, count, scene.cells
        else:
            low2, count2, cells2 = low, count, scene.cells
    found = 0
    for a in range(low0, low0 + count0):
        for b in range(low1, low1 + count1):
            row = ((a % cells0) * cells1 + b % cells1) * cells2
            for c in range(low2, low2 + count2):
                cell = row + c % cells2
                for index in range(start[cell], start[cell + 1]):
                    other = entry_of(by_cell, index)
                    advance_one(block, addresses, trajectories, other, time)
                    candidates.agents[found] = other
                    found += 1
    return found
