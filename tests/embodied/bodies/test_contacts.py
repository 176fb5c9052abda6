"""Claims about contacts: none is missed, few are named in vain, and lone ones are settled as pymunk settles them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arena import make_arena
from epuck_sim.embodied.bodies.contacts import MARGIN_CM, NOBODY, PUSHED_CM
from epuck_sim.embodied.bodies.public_space import find_candidates
from epuck_sim.geometry import box_corners
from epuck_sim.scenario.robot_kind import EPUCK
from tests.embodied.bodies.worlds import FullSpaceWorld, MovedWorld, overlap_cm, squeeze

RADIUS_CM = 3.7
FULL_CM_S = 12.8
STEP_S = 0.1
TOUCH_CM = 2 * (RADIUS_CM + MARGIN_CM)
WALL_CM = RADIUS_CM + 2 * MARGIN_CM


def candidates(poses, velocities, side=100.0, obstacles=([], [])):
    """Return (robots,) whether each may touch something."""
    world = MovedWorld(make_arena(side, side, *obstacles), poses)
    world.velocities[:] = velocities
    find_candidates(world.block)
    robots = world.swarm.robots
    return (robots.may_touch | (robots.partner != NOBODY)).tolist()


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


# --- robots that come farther than candidates should --------------------------------------------------


@pytest.mark.parametrize("robots", [1, 3, 5, 7, 8, 10, 15, 16])
def test_whom_rows_squeeze_out_between_them_touches_the_next_one_in_time(robots):
    arena, poses, velocities = squeeze(robots)
    worlds = [kind(arena, poses) for kind in (MovedWorld, FullSpaceWorld)]
    for world in worlds:
        world.velocities[:] = velocities
        world.advance()
    world, twin = worlds
    assert overlap_cm(world.poses[:, :2]) <= max(overlap_cm(twin.poses[:, :2]), 0) + 0.005
    np.testing.assert_allclose(world.poses[[0, -1]], twin.poses[[0, -1]], rtol=0, atol=0.05)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    robots=st.integers(4, 12),
    aside=st.floats(0.2, 3),
    step=st.sampled_from([(10, 100), (5, 50), (20, 200)]),
)
def test_no_contact_is_missed_however_far_robots_are_squeezed_out(seed, robots, aside, step):
    """Who is not in the space has touched nobody, and has moved as in the slow twin, where all are in the space."""
    random = np.random.default_rng(seed)
    steps, physics_hz = step
    arena, poses, velocities = squeeze(robots, aside)
    for x, y in random.uniform(100, 150, (300, 2)):
        if np.hypot(poses[:, 0] - x, poses[:, 1] - y).min() > 2 * RADIUS_CM:
            poses = np.vstack([poses, [x, y, 0]])
    others = len(poses) - len(velocities)
    velocities = np.vstack([velocities, np.pad(random.uniform(-1, 1, (others, 2)), ((0, 0), (0, 1)))])
    worlds = [kind(arena, poses, 0.0, physics_hz) for kind in (MovedWorld, FullSpaceWorld)]
    for world in worlds:
        world.velocities[:] = velocities
        world.advance(steps)
    world, twin = worlds
    apart = np.linalg.norm(world.poses[:, None, :2] - world.poses[None, :, :2], axis=2) + 100 * np.eye(len(poses))
    assert apart[~world.is_in_space & (world.swarm.robots.partner == NOBODY)].min(initial=100) > TOUCH_CM
    free = ~world.is_in_space
    np.testing.assert_allclose(world.poses[free], twin.poses[free], rtol=0, atol=1e-9)
    assert overlap_cm(world.poses[:, :2]) <= max(overlap_cm(twin.poses[:, :2]), 0) + 0.05


# --- contacts of one robot with walls alone, or of two robots with each other alone ---------------------

KINDS = (EPUCK, EPUCK.model_copy(update={"radius_cm": 2.5, "mass_g": 400.0}))
WALLS = [[5.0, 30, 0], [54, 5, 1]], [(-1, 0), (1, -1)]  # two robots that press on a wall, and into a corner
PAIR = [[26.0, 30, 0], [34.5, 31, 1]], [(1, 0), (-1, 0)]


@pytest.mark.parametrize(("poses", "towards"), [WALLS, PAIR], ids=["walls", "pair"])
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("steps", [10, 3])
def test_lone_robots_move_as_in_the_space_of_pymunk(poses, towards, seed, steps):
    random = np.random.default_rng(seed)
    world, twin = (kind(make_arena(60, 60, [], []), poses, kinds=KINDS) for kind in (MovedWorld, FullSpaceWorld))
    alone = pressed = 0
    for _ in range(20):
        velocities = np.pad(9 * np.array(towards) + random.uniform(-4, 4, (2, 2)), ((0, 0), (0, 1)))
        velocities[:, 2] = random.uniform(-3, 3, 2)
        straight = world.poses + velocities * 0.01 * steps
        for each in (world, twin):
            each.velocities[:] = velocities
            each.advance(steps)
        np.testing.assert_allclose(world.poses, twin.poses, rtol=0, atol=1e-9)
        alone += not world.is_in_space.any()
        pressed += np.abs(world.poses - straight).max() > 1e-3
    assert alone >= 18  # where a contact has something left to correct, the space settles it
    assert pressed >= 5
