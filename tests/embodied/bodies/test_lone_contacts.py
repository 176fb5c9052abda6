"""Claims about robots that touch walls alone, or one other robot alone: they move as pymunk moves them in its space."""

import numpy as np
import pytest

from epuck_sim.arena import make_arena
from epuck_sim.scenario.robot_kind import EPUCK
from tests.embodied.bodies.worlds import FullSpaceWorld, MovedWorld

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
