"""Cell list: agents sorted into the cells of a grid, for large swarms in which a search over all pairs is too slow.

Agents are sorted only now and then. No agent moves faster than the fastest one, so every agent within a radius of a
point is still listed in a cell within that radius plus the distance which the fastest has moved since.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IndexArray, IntArray
from epuck_sim.particles.motion import Trajectories, advance_one, compute_positions, coordinate_at
from epuck_sim.util.jit import jit_inline


class CellList(NamedTuple):
    """The agents of each cell; along an axis which the space lacks there is one cell."""

    cells_per_axis: IntArray
    """(3,) number of cells along each axis."""
    cell_cm: float
    """Side of a cell."""
    max_drift_cm: float
    """Agents are sorted again when the fastest may have moved farther than this."""
    max_speed: float
    """Speed of the fastest agent in cm per cycle."""
    sorted_at: FloatArray
    """(1,) time of the last sorting, in cycles since the start of the present cycle; -inf before the first."""
    cell_start: IntArray
    """(cells + 1,) index in `agents_by_cell` at which each cell begins."""
    agents_by_cell: IndexArray
    """(agents,) agents, sorted by cell."""
    cell_of_agent: IndexArray
    """(agents,) scratch: the cell of each agent."""
    positions: FloatArray
    """(dimensions, agents) cm: scratch: positions at the last sorting."""


def make_cell_list(dimensions: int, side_cm: float, agents: int, cell_cm: float, max_speed: float) -> CellList:
    """Return an unsorted cell list for a space of `side_cm`, with cells of at least `cell_cm` where that fits."""
    along = max(1, int(side_cm / cell_cm))
    cells_per_axis = np.ones(3, np.int64)
    cells_per_axis[:dimensions] = along
    return CellList(
        cells_per_axis,
        side_cm / along,
        side_cm / along / 2,
        max_speed,
        np.full(1, -math.inf),
        np.zeros(along**dimensions + 1, np.int64),
        np.zeros(agents, np.uint32),
        np.zeros(agents, np.uint32),
        np.zeros((dimensions, agents)),
    )


@jit_inline
def sort_into_cells(cell_list: CellList, trajectories: Trajectories, time: float) -> None:
    """Sort all agents by the cells in which they are at `time`, by counting."""
    positions = cell_list.positions
    compute_positions(trajectories, time, positions)
    start, cells, agents = cell_list.cell_start, cell_list.cell_of_agent, cell_list.agents_by_cell
    for cell in range(len(start)):
        start[cell] = 0
    for agent in range(len(agents)):
        cell = 0
        for axis in range(len(positions)):
            cell = cell * cell_list.cells_per_axis[axis] + cell_index(cell_list, positions[axis, agent], axis)
        cells[agent] = cell
        start[cell + 1] += 1
    for cell in range(1, len(start)):
        start[cell] += start[cell - 1]
    for agent in range(len(agents) - 1, -1, -1):  # backwards, so that the end of each cell becomes its start
        start[cells[agent] + 1] -= 1
        agents[start[cells[agent] + 1]] = agent
    for cell in range(len(start) - 1):
        start[cell] = start[cell + 1]
    start[len(start) - 1] = len(agents)
    cell_list.sorted_at[0] = time


@jit_inline
def cell_index(cell_list: CellList, coordinate_cm: float, axis: int) -> int:
    """Return the index, along an axis, of the cell that contains a coordinate."""
    index: int = min(max(math.floor(coordinate_cm / cell_list.cell_cm), 0), cell_list.cells_per_axis[axis] - 1)
    return index


@jit_inline
def find_candidates(
    cell_list: CellList, trajectories: Trajectories, agent: int, time: float, radius_cm: float, found: IndexArray
) -> int:
    """Find all agents that may be within a radius of an agent, and the agent itself; advance them to `time`.

    Args:
        cell_list: Sorted again if that was too long ago.
        trajectories: Trajectories of all agents.
        agent: The agent at the centre.
        time: Cycles since the start of the present cycle.
        radius_cm: Radius of the search.
        found: (agents,) output: indices of the agents.

    Returns:
        The number of agents found.
    """
    moved_cm = cell_list.max_speed * (time - cell_list.sorted_at[0])
    if not moved_cm <= cell_list.max_drift_cm:
        sort_into_cells(cell_list, trajectories, time)
        moved_cm = 0.0
    advance_one(trajectories, agent, time)
    low0, count0 = cell_range(cell_list, trajectories, agent, time, radius_cm + moved_cm, 0)
    low1, count1 = cell_range(cell_list, trajectories, agent, time, radius_cm + moved_cm, 1)
    low2, count2 = cell_range(cell_list, trajectories, agent, time, radius_cm + moved_cm, 2)
    per_axis = cell_list.cells_per_axis
    count = 0
    for a in range(low0, low0 + count0):
        for b in range(low1, low1 + count1):
            row = ((a % per_axis[0]) * per_axis[1] + b % per_axis[1]) * per_axis[2]
            for c in range(low2, low2 + count2):
                cell = row + c % per_axis[2]
                for index in range(cell_list.cell_start[cell], cell_list.cell_start[cell + 1]):
                    other = cell_list.agents_by_cell[index]
                    advance_one(trajectories, other, time)
                    found[count] = other
                    count += 1
    return count


@jit_inline
def cell_range(
    cell_list: CellList, trajectories: Trajectories, agent: int, time: float, radius_cm: float, axis: int
) -> tuple[int, int]:
    """Return the first index of the cells within a radius along an axis, and their number.

    In a cyclic space the first index may be negative, and indices may exceed the number of cells: they wrap around.
    """
    cells = cell_list.cells_per_axis[axis]
    if axis >= len(trajectories.origin):
        return 0, 1
    centre = coordinate_at(trajectories, agent, axis, time)
    if trajectories.is_cyclic:
        low = math.floor((centre - radius_cm) / cell_list.cell_cm)
        count = math.floor((centre + radius_cm) / cell_list.cell_cm) - low + 1
        return (low, count) if count < cells else (0, cells)
    low = cell_index(cell_list, centre - radius_cm, axis)
    return low, cell_index(cell_list, centre + radius_cm, axis) - low + 1


@jit_inline
def rebase_cell_list(cell_list: CellList) -> None:
    """Count times from the start of the next cycle."""
    cell_list.sorted_at[0] -= 1.0
