"""Claims about who may touch something within a control step: none is missed, and few are named in vain."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.arena import make_arena
from epuck_sim.embodied.cell_list import sort_into_cells
from epuck_sim.embodied.contact_candidates import MARGIN_CM, PUSHED_CM, find_contact_candidates
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.geometry import box_corners

RADIUS_CM = 3.7
FULL_CM_S = 12.8
STEP_S = 0.1
TOUCH_CM = 2 * (RADIUS_CM + MARGIN_CM)
WALL_CM = RADIUS_CM + 2 * MARGIN_CM


def candidates(poses, velocities, side=100.0, obstacles=([], [])):
    """Return (robots,) whether each may touch something."""
    world = World(make_arena(side, side, *obstacles), np.array(poses, float), 0.0, 100)
    world.velocities[:] = velocities
    find_contact_candidates(world.bodies, STEP_S)
    return world.bodies.is_candidate.tolist()


def slow_twin(positions, velocities, side, slack_cm):
    """Return what `candidates` does on a bare floor, from all pairs at many instants, with a slack."""
    times = np.linspace(0, STEP_S, 2001)[:, None, None]
    paths = positions + times * velocities
    apart = np.linalg.norm(paths[:, :, None] - paths[:, None], axis=3).min(axis=0)
    np.fill_diagonal(apart, np.inf)
    gaps = np.minimum(paths, side - paths).min(axis=(0, 2))
    meets = (apart <= TOUCH_CM + slack_cm).any(axis=1) | (gaps <= WALL_CM + slack_cm)
    start = np.linalg.norm(positions[:, None] - positions, axis=2)
    reach = start <= TOUCH_CM + 2 * (np.linalg.norm(velocities, axis=1).max() * STEP_S + PUSHED_CM) + slack_cm
    for _ in positions:
        meets |= (reach & meets).any(axis=1)
    return meets


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.floats(24, 80))
def test_candidates_are_those_of_the_slow_twin(seed, robots, side):
    random = np.random.default_rng(seed)
    positions = random.uniform(4, side - 4, (robots, 2))
    velocities = random.uniform(-9, 9, (robots, 2)) * random.choice([0, 1], (robots, 1))
    found = candidates(np.column_stack([positions, np.zeros(robots)]), np.pad(velocities, ((0, 0), (0, 1))), side)
    surely, perhaps = (slow_twin(positions, velocities, side, slack_cm) for slack_cm in (-1e-3, 1e-3))
    assert (surely <= found).all()
    assert (found <= perhaps).all()


@pytest.mark.parametrize(("more", "meet"), [(-0.01, True), (0.01, False)])
def test_two_that_drive_at_each_other_meet_where_their_paths_are_as_long_as_the_gap(more, meet):
    poses = [[20, 50, 0], [20 + TOUCH_CM + 2 * FULL_CM_S * STEP_S + more, 50, 0]]
    assert candidates(poses, [[FULL_CM_S, 0, 0], [-FULL_CM_S, 0, 0]]) == [meet, meet]


def test_robots_that_turn_on_the_spot_or_part_are_no_candidates_however_near():
    poses = [[20, 50, 0], [20 + TOUCH_CM + 0.01, 50, 0]]
    assert candidates(poses, [[0, 0, 5], [0, 0, -5]]) == [False, False]
    assert candidates(poses, [[-FULL_CM_S, 0, 0], [FULL_CM_S, 0, 0]]) == [False, False]


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("end", [0, 100])
def test_a_robot_that_ends_at_a_wall_is_a_candidate(axis, end):
    towards = -1 if end == 0 else 1
    velocity = np.zeros(3)
    velocity[axis] = towards * FULL_CM_S
    for beyond, expected in ((0.01, True), (-0.01, False)):
        pose = np.array([50.0, 50, 0])
        pose[axis] = end - towards * (WALL_CM + FULL_CM_S * STEP_S - beyond)
        assert candidates([pose], [velocity]) == [expected]


def test_robots_near_an_obstacle_are_candidates():
    obstacles = ([(50, 50, 5)], [box_corners(20, 20, 10, 2, 0.0)])
    poses = [[50 + 5 + WALL_CM, 50, 0], [20, 21 + WALL_CM, 0], [50, 70, 0], [20, 40, 0]]
    assert candidates(poses, np.zeros((4, 3)), obstacles=obstacles) == [True, True, False, False]


def test_whom_a_pushed_robot_may_reach_is_a_candidate_and_so_on_along_the_row():
    row = [[10 + 8.5 * place, 50, 0] for place in range(6)]
    velocities = np.zeros((6, 3))
    assert candidates(row, velocities) == [False] * 6
    velocities[0, 0] = FULL_CM_S
    assert candidates(row, velocities) == [True] * 6
    row[3:] = [[x + 3, y, heading] for x, y, heading in row[3:]]
    assert candidates(row, velocities) == [True] * 3 + [False] * 3


def test_where_paths_are_longer_than_a_cell_all_are_candidates():
    world = World(make_arena(200, 200, [], []), np.array([[50.0, 50, 0], [150, 150, 0]]), 0.0, 100)
    world.velocities[0, 0] = FULL_CM_S
    sort_into_cells(world.poses, world.bodies.cells)
    find_contact_candidates(world.bodies, 10.0)
    assert world.bodies.is_candidate.all()
