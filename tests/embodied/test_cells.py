"""Claims about the grid that robots are sorted into."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.cells import cells_needed, sort_into_cells
from epuck_sim.scenario.robot_kind import EPUCK, cell_cm
from tests.embodied.scenes import Scene, block_of, empty_arena

REACH_CM = math.hypot(3.35, 1.05) + 12 + 3.7
"""Distance of two e-pucks at which an infrared ray of one can meet the other: sensors 0 and 7 are farthest out."""

sizes = st.floats(7.4, 1000)


@st.composite
def crowds(draw):
    """An arena's size, and poses of which some lie on its walls or a little beyond."""
    width, height = draw(sizes), draw(sizes)
    x = st.floats(-0.01, width + 0.01) | st.sampled_from([0.0, width, width / 2])
    y = st.floats(-0.01, height + 0.01) | st.sampled_from([0.0, height, height / 3])
    return width, height, draw(st.lists(st.tuples(x, y, st.just(0.0)), min_size=1, max_size=40))


def block_at(width, height, poses):
    return block_of(Scene(np.array(poses), np.zeros(len(poses), bool), empty_arena(width, height)))


@settings(max_examples=30)
@given(crowds())
def test_every_robot_is_in_the_cell_that_its_pose_says_by_number_and_nothing_is_left_of_an_earlier_sorting(crowd):
    width, height, poses = crowd
    block = block_at(width, height, [(height - y, width - x, 0) for x, y, _ in poses])
    block.swarm.robots.x, block.swarm.robots.y, _ = np.array(poses).T
    sort_into_cells(block.bytes)
    swarm, scene = block.swarm, block.swarm.scene[0]
    twin = [[] for _ in range(len(swarm.cells) - 1)]
    for robot, (x, y, _) in enumerate(poses):
        column = max(0, min(math.floor(x / scene.cell_width_cm), scene.columns - 1))
        row = max(0, min(math.floor(y / scene.cell_height_cm), scene.rows - 1))
        twin[row * scene.columns + column].append(robot)
    bounds = zip(swarm.cells[:-1], swarm.cells[1:], strict=True)
    assert [swarm.members.robot[start:end].tolist() for start, end in bounds] == twin
    places = np.column_stack([swarm.members.x, swarm.members.y])
    np.testing.assert_array_equal(places, np.array(poses)[swarm.members.robot, :2])


@settings(max_examples=30)
@given(sizes, sizes, st.integers(1, 500))
def test_cells_share_the_floor_and_are_no_narrower_than_infrared_reaches(width, height, robots):
    scene = block_at(width, height, np.ones((robots, 3))).swarm.scene[0]
    assert scene.columns * scene.cell_width_cm == pytest.approx(width)
    assert scene.rows * scene.cell_height_cm == pytest.approx(height)
    assert scene.columns == 1 or scene.cell_width_cm >= REACH_CM - 1e-9
    assert scene.rows == 1 or scene.cell_height_cm >= REACH_CM - 1e-9


def test_a_large_arena_has_about_one_cell_a_robot():
    assert cells_needed(700.0, 700.0, 1000, cell_cm([EPUCK])) == pytest.approx(1000, rel=0.1)
