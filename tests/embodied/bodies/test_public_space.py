"""Claims about versions whose C functions compiled code cannot call: bodies move all the same, to the same outcome."""

import numpy as np
import pytest

from epuck_sim.arena import make_arena
from epuck_sim.embodied.bodies import chipmunk, public_space
from epuck_sim.geometry import box_corners
from tests.embodied.bodies.worlds import MovedWorld, squeeze

OBSTACLES = ([(20, 20, 5)], [box_corners(40, 40, 10, 2, 0.5)])
MOVABLES = [(30, 60, 6, 500, 0.1), (42.5, 60, 6, 300, 0.2)]


@pytest.fixture
def patches(monkeypatch):
    """Have it tried again whether compiled code can call Chipmunk, when something was changed, and afterwards."""
    yield monkeypatch
    monkeypatch.undo()
    forget()


def forget():
    chipmunk.function_addresses.cache_clear()
    public_space.reason_for_public_way.cache_clear()


def ways(arena, poses, velocities, friction=0.0):
    """Return where robots are after each of twelve control steps, and movables, in two trials."""
    world = MovedWorld(arena, poses, friction)
    found = [np.full(1, world.world.is_public)]
    for trial in range(2):
        if trial:
            world.poses[:] = poses
            world.world.place()
        for step in range(12):
            world.velocities[:] = velocities[(step + trial) % len(velocities)]
            world.advance()
            found += [world.poses.copy(), np.array(world.swarm.circles.tolist()), world.is_in_space.copy()]
            if step == 6:
                world.world.move(0, (70.0, 6.0, 0.5))
    return found


def crowd(seed, movables=()):
    random = np.random.default_rng(seed)
    poses = [[x, y, random.uniform(-3, 3)] for x in range(5, 76, 10) for y in (5, 32, 75)]
    velocities = random.uniform(-9, 9, (4, len(poses), 3)) * random.choice([0, 1], (4, len(poses), 1))
    return make_arena(80, 80, *OBSTACLES, movables), np.array(poses), velocities


def test_outcomes_are_equal_to_the_bit(patches):
    arena, poses, velocities = squeeze(10)
    scenes = [(*crowd(1), 0.0), (*crowd(2), 0.5), (*crowd(3, MOVABLES), 0.3), (arena, poses, velocities[None], 0.0)]
    compiled = [ways(*scene) for scene in scenes]
    patches.setitem(chipmunk.FUNCTIONS, "cpSpaceStep", "void(*)(cpSpace *)")
    forget()
    with pytest.warns(UserWarning, match=r"pymunk .* numba .*cpSpaceStep is .*, not .*; install pymunk 7\.3"):
        public = [ways(*scene) for scene in scenes]
    for one, other in zip(compiled, public, strict=True):
        assert (one[0], other[0]) == (False, True)
        for compiled_way, public_way in zip(one[1:], other[1:], strict=True):
            np.testing.assert_array_equal(compiled_way, public_way)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda to: to.setitem(chipmunk.FUNCTIONS, "cpSpaceFly", "void(*)(cpSpace *)"), "cpSpaceFly"),
        (lambda to: to.setattr(chipmunk, "ffi", None), "addressof"),
        (lambda to: to.setattr(public_space.platform, "machine", lambda: "vax"), "vax"),
    ],
)
def test_what_is_other_than_expected_is_found_and_named(patches, change, named):
    change(patches)
    forget()
    assert named in public_space.reason_for_public_way()
