"""Claims about the grid that robots are sorted into."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.embodied.cells import cells_needed, set_cells
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.scenario.robot_kind import EPUCK, cell_cm
from tests.embodied.scenes import Scene, block_of, scenes, sort_robots

REACH_CM = math.hypot(3.35, 1.05) + 12 + 3.7
"""Distance of two e-pucks at which an infrared ray of one can meet the other: sensors 0 and 7 are farthest out."""

sizes = st.floats(7.4, 1000)


@st.composite
def crowds(draw):
    """An arena's size, and poses of which some lie on its walls or a little beyond."""
    width, height = draw(sizes), draw(sizes)
    x = st.floats(-0.01, width + 0.01) | st.sampled_from([0.0, width, width / 2])
    y = st.floats(-0.01, height + 0.01) | st.sampled_from([0.0, height, height / 3])
    return width, height, draw(st.lists(st.tuples(x, y, st.just(0.0)), min_size=1, max_size=80))


def _grid(width, height, robots):
    """Return a block of robots in an arena of this size, and its arrays."""
    cells = cells_needed(width, height, robots, cell_cm([EPUCK]))
    block = make_block({"robots": robots, "cells": cells + 1, "members": robots})
    swarm = open_block(block)
    set_cells(swarm, width, height, cell_cm([EPUCK]))
    assert swarm.scene[0].columns * swarm.scene[0].rows == cells
    return block, swarm


def _sorted(grid, poses):
    block, swarm = grid
    swarm.robots.x, swarm.robots.y, swarm.robots.heading = np.array(poses).T
    sort_robots(block)
    return swarm


def _cell(x, y, scene):
    column = max(0, min(math.floor(x / scene.cell_width_cm), scene.columns - 1))
    row = max(0, min(math.floor(y / scene.cell_height_cm), scene.rows - 1))
    return row * scene.columns + column


@given(crowds())
def test_every_robot_is_in_the_cell_that_its_pose_says_by_number(crowd):
    width, height, poses = crowd
    swarm = _sorted(_grid(width, height, len(poses)), poses)
    twin = [[] for _ in range(len(swarm.cells) - 1)]
    for robot, (x, y, _) in enumerate(poses):
        twin[_cell(x, y, swarm.scene[0])].append(robot)
    bounds = zip(swarm.cells[:-1], swarm.cells[1:], strict=True)
    assert [swarm.members.robot[start:end].tolist() for start, end in bounds] == twin
    places = np.column_stack([swarm.members.x, swarm.members.y])
    np.testing.assert_array_equal(places, np.array(poses)[swarm.members.robot, :2])


@given(crowds())
def test_nothing_is_left_of_an_earlier_sorting(crowd):
    width, height, poses = crowd
    used = _grid(width, height, len(poses))
    _sorted(used, [(height - y, width - x, 0.0) for x, y, _ in poses])
    again, fresh = _sorted(used, poses), _sorted(_grid(width, height, len(poses)), poses)
    assert again.cells.tolist() == fresh.cells.tolist()
    assert again.members.tolist() == fresh.members.tolist()


@given(sizes, sizes, st.integers(1, 500))
def test_cells_share_the_floor_and_are_no_narrower_than_infrared_reaches(width, height, robots):
    scene = _grid(width, height, robots)[1].scene[0]
    assert scene.columns * scene.cell_width_cm == pytest.approx(width)
    assert scene.rows * scene.cell_height_cm == pytest.approx(height)
    assert scene.columns == 1 or scene.cell_width_cm >= REACH_CM - 1e-9
    assert scene.rows == 1 or scene.cell_height_cm >= REACH_CM - 1e-9


def test_a_large_arena_has_about_one_cell_a_robot():
    assert cells_needed(700.0, 700.0, 1000, cell_cm([EPUCK])) == pytest.approx(1000, rel=0.1)


@given(scenes(robots=(2, 10, 60)))
def test_robots_within_the_reach_of_infrared_are_in_neighbouring_cells(scene: Scene):
    swarm = block_of(scene).swarm
    place = np.empty((len(scene.poses), 2), int)
    for cell in range(len(swarm.cells) - 1):
        place[swarm.members.robot[swarm.cells[cell] : swarm.cells[cell + 1]]] = divmod(cell, swarm.scene[0].columns)
    apart = np.hypot(*(scene.poses[:, None, :2] - scene.poses[None, :, :2]).T)
    away = np.abs(place[:, None] - place[None]).max(axis=2)
    assert (away[apart <= REACH_CM - 1e-9] <= 1).all()
