"""A cell list: a grid over the arena with the robots in each cell, so that sensors look at near robots only."""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.scenario.robot_kind import EPUCK
from epuck_sim.util.jit import jit


class CellList(NamedTuple):
    """The robots in each cell; cell (column, row) has the number row * columns + column."""

    columns: int
    rows: int
    width_cm: float
    """Width of a cell in cm, at least the least side unless there is only one column."""
    height_cm: float
    """Height of a cell in cm, at least the least side unless there is only one row."""
    first: IntArray
    """(cells + 1,) index in `members` at which each cell's robots begin; the last is the number of robots."""
    members: IntArray
    """(robots,) numbers of the robots, cell by cell."""
    positions: FloatArray
    """(robots, 2) cm: x, y of the robots, in the order of `members`."""


def make_cell_list(width_cm: float, height_cm: float, robots: int, least_cm: float = EPUCK.cell_cm) -> CellList:
    """Return an empty cell list with about one cell per robot, but no cell smaller than a least side.

    Args:
        width_cm: Width of the arena.
        height_cm: Height of the arena.
        robots: Number of robots.
        least_cm: Least side of a cell, the `cell_cm` of their kind.
    """
    side = max(least_cm, math.sqrt(width_cm * height_cm / robots))
    columns = max(1, int(width_cm / side))
    rows = max(1, int(height_cm / side))
    return CellList(
        columns,
        rows,
        width_cm / columns,
        height_cm / rows,
        np.zeros(columns * rows + 1, np.int64),
        np.zeros(robots, np.int64),
        np.zeros((robots, 2)),
    )


@jit
def cell_index(position: float, size: float, count: int) -> int:
    """Return the column (or row) of a position; a position beyond a wall belongs to the cell at that wall."""
    return min(max(int(position / size), 0), count - 1)


class CellBlock(NamedTuple):
    """The cells within one row and one column of a position; robots in others are at least a cell away."""

    first_row: int
    end_row: int
    """Row after the last one."""
    first_column: int
    last_column: int


@jit
def cells_around(x: float, y: float, cells: CellList) -> CellBlock:
    """Return the up to nine cells around a position."""
    column = cell_index(x, cells.width_cm, cells.columns)
    row = cell_index(y, cells.height_cm, cells.rows)
    return CellBlock(max(row - 1, 0), min(row + 2, cells.rows), max(column - 1, 0), min(column + 1, cells.columns - 1))


@jit
def members_in_row(block: CellBlock, row: int, cells: CellList) -> tuple[int, int]:
    """Return where the robots in a row of a block begin in `cells.members`, and where they end."""
    first_cell = row * cells.columns
    return cells.first[first_cell + block.first_column], cells.first[first_cell + block.last_column + 1]


@jit
def sort_into_cells(poses: FloatArray, cells: CellList) -> None:
    """Fill `cells` with the robots at (robots, 3) `poses`; within a cell in the order of their numbers."""
    first = cells.first
    first[:] = 0
    for robot in range(len(poses)):
        column = cell_index(poses[robot, 0], cells.width_cm, cells.columns)
        row = cell_index(poses[robot, 1], cells.height_cm, cells.rows)
        first[row * cells.columns + column] += 1
    total = 0
    for cell in range(len(first)):  # from counts to ends
        total += first[cell]
        first[cell] = total
    for robot in range(len(poses) - 1, -1, -1):  # backwards, so that ends become beginnings
        column = cell_index(poses[robot, 0], cells.width_cm, cells.columns)
        row = cell_index(poses[robot, 1], cells.height_cm, cells.rows)
        cell = row * cells.columns + column
        first[cell] -= 1
        cells.members[first[cell]] = robot
        cells.positions[first[cell], 0] = poses[robot, 0]
        cells.positions[first[cell], 1] = poses[robot, 1]
