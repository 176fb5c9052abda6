"""Claims about the grid that robots are sorted into."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.embodied.cell_list import make_cell_list, sort_into_cells
from tests.embodied.scenes import Scene, scenes, sorted_cells

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


def _cell(x, y, cells):
    column = max(0, min(math.floor(x / cells.width_cm), cells.columns - 1))
    row = max(0, min(math.floor(y / cells.height_cm), cells.rows - 1))
    return row * cells.columns + column


@given(crowds())
def test_every_robot_is_in_the_cell_that_its_pose_says_by_number(crowd):
    width, height, poses = crowd
    cells = make_cell_list(width, height, len(poses))
    sort_into_cells(np.array(poses), cells)
    twin = [[] for _ in range(cells.columns * cells.rows)]
    for robot, (x, y, _) in enumerate(poses):
        twin[_cell(x, y, cells)].append(robot)
    bounds = zip(cells.first[:-1], cells.first[1:], strict=True)
    assert [cells.members[start:end].tolist() for start, end in bounds] == twin
    np.testing.assert_array_equal(cells.positions, np.array(poses)[cells.members, :2])


@given(crowds())
def test_nothing_is_left_of_an_earlier_sorting(crowd):
    width, height, poses = crowd
    used, fresh = make_cell_list(width, height, len(poses)), make_cell_list(width, height, len(poses))
    sort_into_cells(np.array([(height - y, width - x, 0.0) for x, y, _ in poses]), used)
    sort_into_cells(np.array(poses), used)
    sort_into_cells(np.array(poses), fresh)
    assert used.first.tolist() == fresh.first.tolist()
    assert used.members.tolist() == fresh.members.tolist()


@given(sizes, sizes, st.integers(1, 500))
def test_cells_share_the_floor_and_are_no_narrower_than_infrared_reaches(width, height, robots):
    cells = make_cell_list(width, height, robots)
    assert cells.columns * cells.width_cm == pytest.approx(width)
    assert cells.rows * cells.height_cm == pytest.approx(height)
    assert cells.columns == 1 or cells.width_cm >= REACH_CM - 1e-9
    assert cells.rows == 1 or cells.height_cm >= REACH_CM - 1e-9


def test_a_large_arena_has_about_one_cell_a_robot():
    cells = make_cell_list(700.0, 700.0, 1000)
    assert cells.columns * cells.rows == pytest.approx(1000, rel=0.1)


@given(scenes(robots=(2, 10, 60)))
def test_robots_within_the_reach_of_infrared_are_in_neighbouring_cells(scene: Scene):
    cells = sorted_cells(scene)
    place = np.empty((len(scene.poses), 2), int)
    for cell in range(cells.columns * cells.rows):
        place[cells.members[cells.first[cell] : cells.first[cell + 1]]] = divmod(cell, cells.columns)
    apart = np.hypot(*(scene.poses[:, None, :2] - scene.poses[None, :, :2]).T)
    away = np.abs(place[:, None] - place[None]).max(axis=2)
    assert (away[apart <= REACH_CM - 1e-9] <= 1).all()
