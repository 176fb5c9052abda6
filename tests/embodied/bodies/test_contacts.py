"""Claims about contacts: none is missed, and few are named in vain."""

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim.arena import make_arena
from epuck_sim.embodied.bodies.contacts import MARGIN_CM, NOBODY, PUSHED_CM, find_contact_candidates
from tests.embodied.bodies.worlds import FullSpaceWorld, MovedWorld, advanced, overlap_cm, squeeze

RADIUS_CM = 3.7
FULL_CM_S = 12.8
STEP_S = 0.1
TOUCH_CM = 2 * (RADIUS_CM + MARGIN_CM)
WALL_CM = RADIUS_CM + 2 * MARGIN_CM


def candidates(poses, velocities, side):
    world = MovedWorld(make_arena(side, side, [], []), poses)
    world.velocities[:] = velocities
    find_contact_candidates(world.block)
    robots = world.swarm.robots
    return (robots.may_touch | (robots.partner != NOBODY)).tolist()


def slow_twin(positions, velocities, side, slack_cm):
    """Return what `candidates` does on a bare floor, from all pairs at many instants, with a slack."""
    times = np.linspace(0, STEP_S, 201)[:, None, None]
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


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.floats(24, 80))
def test_candidates_are_those_of_the_slow_twin(seed, robots, side):
    random = np.random.default_rng(seed)
    positions = random.uniform(4, side - 4, (robots, 2))
    velocities = random.uniform(-9, 9, (robots, 2)) * random.choice([0, 1], (robots, 1))
    found = candidates(np.column_stack([positions, np.zeros(robots)]), np.pad(velocities, ((0, 0), (0, 1))), side)
    surely, perhaps = (slow_twin(positions, velocities, side, slack_cm) for slack_cm in (-1e-3, 1e-3))
    assert (surely <= found).all()
    assert (found <= perhaps).all()


@settings(max_examples=20)
@given(
    seed=st.integers(0, 2**32 - 1),
    robots=st.integers(1, 16),
    aside=st.floats(0.2, 3),
    met=st.just((0.0, 0.0)) | st.tuples(st.floats(0.05, 0.095), st.sampled_from([6.0, 10.0, 12.8])),
    step=st.sampled_from([(10, 100), (5, 100), (20, 200)]),
    others=st.sampled_from([0, 300]),
)
@example(seed=0, robots=8, aside=1.1, met=(0.0, 0.0), step=(10, 100), others=300)
@example(seed=0, robots=15, aside=1.1, met=(0.0, 0.0), step=(10, 100), others=300)
@example(seed=0, robots=12, aside=0.536, met=(0.071, 10.0), step=(10, 100), others=0)  # far in the last physics step
def test_no_contact_is_missed_however_far_and_late_robots_are_squeezed_out(seed, robots, aside, met, step, others):
    """Who is not in the space has touched nobody, and has moved as in the slow twin, where all are in the space."""
    random = np.random.default_rng(seed)
    steps, physics_hz = step
    arena, poses, velocities = squeeze(robots, aside, *met)
    for x, y in random.uniform(100, 150, (others, 2)):
        if np.hypot(poses[:, 0] - x, poses[:, 1] - y).min() > 2 * RADIUS_CM:
            poses = np.vstack([poses, [x, y, 0]])
    placed = random.uniform(-1, 1, (len(poses) - len(velocities), 2))
    velocities = np.vstack([velocities, np.pad(placed, ((0, 0), (0, 1)))])
    worlds = [kind(arena, poses, 0.0, physics_hz) for kind in (MovedWorld, FullSpaceWorld)]
    world, twin = advanced(worlds, velocities, steps)
    apart = np.linalg.norm(world.poses[:, None, :2] - world.poses[None, :, :2], axis=2) + 100 * np.eye(len(poses))
    assert apart[~world.is_in_space & (world.swarm.robots.partner == NOBODY)].min(initial=100) > TOUCH_CM
    free = ~world.is_in_space
    np.testing.assert_allclose(world.poses[free], twin.poses[free], rtol=0, atol=1e-9)
    assert overlap_cm(world.poses[:, :2]) <= max(overlap_cm(twin.poses[:, :2]), 0) + 0.05
