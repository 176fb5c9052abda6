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
def _of_another_version(monkeypatch):
    """Have this pymunk's `cpSpaceStep` be other than expected."""
    monkeypatch.setitem(chipmunk.FUNCTIONS, "cpSpaceStep", "void(*)(cpSpace *)")
    forget()
    yield
    monkeypatch.undo()
    forget()


def forget():
    """Have it tried again whether compiled code can call Chipmunk."""
    chipmunk.function_addresses.cache_clear()
    public_space.reason_for_public_way.cache_clear()


def ways(arena, poses, velocities, friction=0.0):
    """Return where robots are after each of twenty control steps, and movables, in three trials."""
    world = MovedWorld(arena, poses, friction)
    found = [np.full(1, world.world.is_public)]
    for trial in range(3):
        if trial:
            world.poses[:] = poses
            world.world.place()
        for step in range(20):
            world.velocities[:] = velocities[(step + trial) % len(velocities)]
            world.advance()
            found += [world.poses.copy(), np.array(world.swarm.circles.tolist()), world.is_in_space.copy()]
            if step == 10:
                world.world.move(0, (70.0, 6.0, 0.5))
    return found


def crowd(seed, movables=()):
    """Return an arena with obstacles, poses of robots and some velocities."""
    random = np.random.default_rng(seed)
    poses = [[x, y, random.uniform(-3, 3)] for x in range(5, 76, 10) for y in (5, 32, 75)]
    velocities = random.uniform(-9, 9, (4, len(poses), 3)) * random.choice([0, 1], (4, len(poses), 1))
    return make_arena(80, 80, *OBSTACLES, movables), np.array(poses), velocities


def scenes():
    """Return arenas, poses, velocities and coefficients of friction."""
    arena, poses, velocities = squeeze(10)
    return [(*crowd(1), 0.0), (*crowd(2), 0.5), (*crowd(3, MOVABLES), 0.3), (arena, poses, velocities[None], 0.0)]


def test_outcomes_are_equal_to_the_bit(request):
    compiled = [ways(*scene) for scene in scenes()]
    request.getfixturevalue("_of_another_version")
    with pytest.warns(UserWarning, match=r"pymunk .* numba .*cpSpaceStep is .*, not .*; install pymunk 7\.3"):
        public = [ways(*scene) for scene in scenes()]
    for one, other in zip(compiled, public, strict=True):
        assert (one[0], other[0]) == (False, True)
        for compiled_way, public_way in zip(one[1:], other[1:], strict=True):
            np.testing.assert_array_equal(compiled_way, public_way)


@pytest.mark.parametrize("lacks", ["function", "private module", "processor", "same outcome"])
def test_what_is_other_than_expected_is_found_and_named(monkeypatch, lacks):
    if lacks == "function":
        monkeypatch.setitem(chipmunk.FUNCTIONS, "cpSpaceFly", "void(*)(cpSpace *)")
    elif lacks == "private module":
        monkeypatch.setattr(chipmunk, "ffi", None)
    elif lacks == "processor":
        monkeypatch.setattr(public_space.platform, "machine", lambda: "vax")
    else:
        monkeypatch.setitem(public_space._FUNCTIONS, "cpBodyGetAngle", lambda _: 0.5)
    forget()
    named = {"function": "cpSpaceFly", "private module": "addressof", "processor": "vax", "same outcome": "elsewhere"}
    assert named[lacks] in public_space.reason_for_public_way()
    monkeypatch.undo()
    forget()
    assert not public_space.reason_for_public_way()
