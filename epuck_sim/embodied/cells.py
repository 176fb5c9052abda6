"""A cell list: a grid over the arena with the robots in each cell, so that sensors look at near robots only."""

import math
from typing import Any, NamedTuple

from epuck_sim.arrays import ByteArray
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.util.jit import jit_inline, jit_no_alloc


def count_cells(width_cm: float, height_cm: float, robots: int, least_cm: float) -> tuple[int, int]:
    """Return the numbers of columns and rows: about one cell per robot, but no cell smaller than a least side."""
    side = max(least_cm, math.sqrt(width_cm * height_cm / robots))
    return max(1, int(width_cm / side)), max(1, int(height_cm / side))


def set_cells(swarm: Swarm, width_cm: float, height_cm: float, least_cm: float) -> None:
    """Set the size of the arena, cm, and with it the grid, whose cells are no narrower than `least_cm`."""
    scene = swarm.scene[0]
    scene.width_cm, scene.height_cm = width_cm, height_cm
    scene.columns, scene.rows = count_cells(width_cm, height_cm, len(swarm.robots), least_cm)
    scene.cell_width_cm, scene.cell_height_cm = width_cm / scene.columns, height_cm / scene.rows


@jit_inline
def cell_index(position: float, size: float, count: int) -> int:
    """Return the column (or row) of a position; a position beyond a wall belongs to the cell at that wall."""
    return min(max(int(position / size), 0), count - 1)


class NearCells(NamedTuple):
    """The cells within one row and one column of a position; robots in others are at least a cell away."""

    first_row: int
    end_row: int  # row after the last one
    first_column: int
    last_column: int


@jit_inline
def cells_around(x: float, y: float, scene: Any) -> NearCells:
    """Return the up to nine cells around a position."""
    column = cell_index(x, scene.cell_width_cm, scene.columns)
    row = cell_index(y, scene.cell_height_cm, scene.rows)
    return NearCells(max(row - 1, 0), min(row + 2, scene.rows), max(column - 1, 0), min(column + 1, scene.columns - 1))


@jit_inline
def members_in_row(near: NearCells, row: int, swarm: Swarm) -> tuple[int, int]:
    """Return first and end in `Swarm.members` of the robots in the near cells of a row."""
    first_cell = row * swarm.scene[0].columns
    return swarm.cells[first_cell + near.first_column], swarm.cells[first_cell + near.last_column + 1]


@jit_no_alloc
def sort_into_cells(block: ByteArray) -> None:
    """Sort the robots into the cells where they are now."""
    swarm = swarm_at(block)
    scene, cells, members = swarm.scene[0], swarm.cells, swarm.members
    last = scene.columns * scene.rows
    for cell in range(last + 1):
        cells[cell] = 0
    for number in range(len(swarm.robots)):
        cells[cell_of(swarm.robots[number], scene)] += 1
    total = 0
    for cell in range(last + 1):  # from counts to ends
        total += cells[cell]
        cells[cell] = total
    for number in range(len(swarm.robots) - 1, -1, -1):  # backwards, so that ends become beginnings
        robot = swarm.robots[number]
        cell = cell_of(robot, scene)
        cells[cell] -= 1
        member = members[cells[cell]]
        member.x, member.y, member.radius_cm, member.robot = robot.x, robot.y, robot.radius_cm, number


@jit_inline
def cell_of(robot: Any, scene: Any) -> int:
    """Return the cell in which a robot is."""
    column = cell_index(robot.x, scene.cell_width_cm, scene.columns)
    row = cell_index(robot.y, scene.cell_height_cm, scene.rows)
    return row * int(scene.columns) + column


@jit_inline
def rows_along(ay: float, by: float, reach: float, scene: Any) -> tuple[int, int]:
    """Return the first and the last row of cells with centres within reach, cm, of a line from y = ay to by."""
    height, rows = scene.cell_height_cm, scene.rows
    return cell_index(min(ay, by) - reach, height, rows), cell_index(max(ay, by) + reach, height, rows)


@jit_inline
def members_along(ax: float, ay: float, bx: float, by: float, reach: float, row: int, swarm: Swarm) -> tuple[int, int]:
    """Return first and end in `Swarm.members` of the robots in a row's cells that are within reach, cm, of a line."""
    scene = swarm.scene[0]
    height = scene.cell_height_cm
    low = -math.inf if row == 0 else row * height - reach
    high = math.inf if row == scene.rows - 1 else (row + 1) * height + reach
    if ay == by:
        one, other = ax, bx
    else:
        begin = min(max((low - ay) / (by - ay), 0.0), 1.0)
        end = min(max((high - ay) / (by - ay), 0.0), 1.0)
        one, other = ax + begin * (bx - ax), ax + end * (bx - ax)
    first = row * scene.columns + cell_index(min(one, other) - reach, scene.cell_width_cm, scene.columns)
    last = row * scene.columns + cell_index(max(one, other) + reach, scene.cell_width_cm, scene.columns)
    return swarm.cells[first], swarm.cells[last + 1]
