"""Cells in which agents are looked up where all pairs would be wasted.

Agents are sorted into cells now and then. Since nobody moves faster than the fastest, who is within reach of a point is
still in the cells within reach and the distance moved since.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.particles.motion import Flights, carry_one_on, locate, place_at
from epuck_sim.util.jit import jit_inline


class CellList(NamedTuple):
    """Which agents were in which cell; along an axis that the space lacks there is one cell."""

    across: IntArray
    """(3,) cells along each axis."""
    cell_cm: float
    """Side of a cell."""
    drift_cm: float
    """Agents are sorted anew when they may have moved by more than this."""
    fastest: float
    """cm in a cycle."""
    sorted: FloatArray
    """(1,) when that was, in cycles since the present one began; -inf before."""
    first: IntArray
    """(cells + 1,) where in `agents` each cell's begin."""
    agents: IntArray
    """(agents,) cell by cell."""
    cell: IntArray
    """(agents,) the cell of each."""
    places: FloatArray
    """(dimensions, agents) cm: where they were."""


def make_cell_list(dimensions: int, side_cm: float, agents: int, cell_cm: float, fastest: float) -> CellList:
    """Return cells of about this side; nobody is in them yet."""
    along = max(1, int(side_cm / cell_cm))
    across = np.ones(3, np.int64)
    across[:dimensions] = along
    return CellList(
        across,
        side_cm / along,
        side_cm / along / 2,
        fastest,
        np.full(1, -math.inf),
        np.zeros(along**dimensions + 1, np.int64),
        np.zeros(agents, np.int64),
        np.zeros(agents, np.int64),
        np.zeros((dimensions, agents)),
    )


@jit_inline
def sort_into_cells(lattice: CellList, flights: Flights, time: float) -> None:
    """Take note of who is in which cell."""
    locate(flights, time, lattice.places)
    first, cell, agents = lattice.first, lattice.cell, lattice.agents
    for place in range(len(first)):
        first[place] = 0
    for agent in range(len(agents)):
        number = 0
        for axis in range(len(lattice.places)):
            number = number * lattice.across[axis] + along_axis(lattice, lattice.places[axis, agent], axis)
        cell[agent] = number
        first[number + 1] += 1
    for place in range(1, len(first)):
        first[place] += first[place - 1]
    for agent in range(len(agents) - 1, -1, -1):  # from behind, so that each cell's end becomes its beginning
        first[cell[agent] + 1] -= 1
        agents[first[cell[agent] + 1]] = agent
    for place in range(len(first) - 1):
        first[place] = first[place + 1]
    first[len(first) - 1] = len(agents)
    lattice.sorted[0] = time


@jit_inline
def along_axis(lattice: CellList, place_cm: float, axis: int) -> int:
    """Return in which cell along an axis a coordinate lies."""
    cell: int = min(max(math.floor(place_cm / lattice.cell_cm), 0), lattice.across[axis] - 1)
    return cell


@jit_inline
def look_around(lattice: CellList, flights: Flights, agent: int, time: float, reach_cm: float, found: IntArray) -> int:
    """Write to `found`, (agents,), all who may be within reach of `agent` at `time`, itself too; return how many.

    Everybody found is carried on to `time`.
    """
    moved = lattice.fastest * (time - lattice.sorted[0])
    if not moved <= lattice.drift_cm:
        sort_into_cells(lattice, flights, time)
        moved = 0.0
    carry_one_on(flights, agent, time)
    low0, count0 = cells_within(lattice, flights, agent, time, reach_cm + moved, 0)
    low1, count1 = cells_within(lattice, flights, agent, time, reach_cm + moved, 1)
    low2, count2 = cells_within(lattice, flights, agent, time, reach_cm + moved, 2)
    across = lattice.across
    count = 0
    for a in range(low0, low0 + count0):
        for b in range(low1, low1 + count1):
            row = ((a % across[0]) * across[1] + b % across[1]) * across[2]
            for c in range(low2, low2 + count2):
                number = row + c % across[2]
                for place in range(lattice.first[number], lattice.first[number + 1]):
                    other = lattice.agents[place]
                    carry_one_on(flights, other, time)
                    found[count] = other
                    count += 1
    return count


@jit_inline
def cells_within(
    lattice: CellList, flights: Flights, agent: int, time: float, reach_cm: float, axis: int
) -> tuple[int, int]:
    """Return the first cell along an axis that is within reach, below 0 across a cyclic edge, and how many are."""
    across = lattice.across[axis]
    if axis >= len(flights.origin):
        return 0, 1
    here = place_at(flights, agent, axis, time)
    if flights.is_cyclic:
        low = math.floor((here - reach_cm) / lattice.cell_cm)
        count = math.floor((here + reach_cm) / lattice.cell_cm) - low + 1
        return (low, count) if count < across else (0, across)
    low = along_axis(lattice, here - reach_cm, axis)
    return low, along_axis(lattice, here + reach_cm, axis) - low + 1


@jit_inline
def begin_cycle_of_lattice(lattice: CellList) -> None:
    """Count times from a cycle later."""
    lattice.sorted[0] -= 1.0
