"""Claims about the rigid bodies: nothing overlaps or tunnels, a push shares momentum, contacts slide."""

import math
import sys
import threading
from itertools import islice

import numpy as np
import pytest

from epuck_sim.arena import clearance_cm, make_arena
from epuck_sim.embodied.bodies.contacts import NOBODY
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.geometry import box_corners
from tests.embodied.bodies.worlds import FullSpaceWorld, MovedWorld, advanced, overlap_cm

RADIUS_CM = 3.7
FULL_CM_S = 12.8
MILLIMETRE = 0.1
TOUCH_CM = 0.005  # bodies that press against each other touch within this


def constant(poses, speed=0.0):
    return {"poses": poses, "controller": "constant", "parameters": {"left_cm_s": speed, "right_cm_s": speed}}


def moved(groups, steps, **rest):
    arena = {"width_cm": 100, "height_cm": 60}
    simulation = Simulation({"arena": arena, "robots": groups, "noise": "off", **rest}, 0)
    return np.array([step.poses.copy() for step in islice(simulation, steps + 1)])


AHEAD = {"left_cm_s": FULL_CM_S, "right_cm_s": FULL_CM_S}
OBSTACLES = [
    {"shape": "circle", "x_cm": 15, "y_cm": 15, "radius_cm": 4},
    {"shape": "box", "x_cm": 38, "y_cm": 20, "width_cm": 10, "height_cm": 0.5, "heading_rad": 0.6},
    {"shape": "polygon", "corners_cm": [[20, 35], [32, 37], [24, 45]]},
]


@pytest.mark.parametrize("group", [{}, {"controller": "constant", "parameters": AHEAD}], ids=["firefly", "constant"])
@pytest.mark.parametrize(("side", "obstacles"), [(45, []), (55, OBSTACLES)], ids=["bare", "obstacles"])
def test_robots_are_never_more_than_a_millimetre_in_each_other_a_wall_or_an_obstacle(group, side, obstacles):
    arena = {"width_cm": side, "height_cm": side, "obstacles": obstacles}
    simulation = Simulation({"arena": arena, "robots": [{"count": 20, **group}]}, 1)
    for step in islice(simulation, 300):
        places = step.poses[:, :2]
        assert overlap_cm(places) <= MILLIMETRE, step.number
        clearances_cm = [clearance_cm(step.arena, x, y) for x, y in places.tolist()]
        assert min(clearances_cm) >= RADIUS_CM - MILLIMETRE, step.number


def test_two_that_meet_head_on_overlap_by_less_than_a_millimetre_and_no_longer_than_a_control_step():
    for gap in np.linspace(5, 7.56, 25):
        robots = [constant([[30, 30, 0]], FULL_CM_S), constant([[37.4 + gap, 30, math.pi]], FULL_CM_S)]
        overlap = 2 * RADIUS_CM - np.diff(moved(robots, 8)[:, :, 0], axis=1)
        assert overlap.max() <= MILLIMETRE
        assert overlap[-4:].max() <= TOUCH_CM + 1e-9


@pytest.mark.parametrize("friction", [0, 0.1, 0.5])
def test_a_robot_slides_along_what_it_touches_and_only_friction_turns_it(friction):
    groups = [constant([[20, 30, 0], [20, 10, -math.pi / 6]], FULL_CM_S), constant([[32, 34, 0]])]
    path = moved(groups, 50, contact={"friction": friction})
    pusher, wall, pushed = np.moveaxis(path, 1, 0)
    turned = path[12, [0, 2], 2]
    assert pushed[-1, 1] > 34
    assert turned[0] == pytest.approx(turned[1], abs=1e-9, rel=1e-6)  # discs that rub: the same torque on both
    if friction:
        assert turned[0] > 0.01
        assert wall[30, 2] < -math.pi / 6 - 0.01
    else:
        assert pusher[-1, 0] > pushed[-1, 0] + 2 * RADIUS_CM
        np.testing.assert_allclose(path[..., 2], np.broadcast_to(path[0, :, 2], path.shape[:2]), rtol=0, atol=1e-9)
        assert wall[20:, 1] == pytest.approx(RADIUS_CM, abs=2 * TOUCH_CM)
        np.testing.assert_allclose(np.diff(wall[20:, 0]), FULL_CM_S * math.cos(math.pi / 6) * 0.1, rtol=0, atol=1e-9)


def crowded(random, obstacles):
    """Return an arena, and poses and velocities of robots, some at rest, some slow, some quick."""
    side = random.uniform(46, 80)
    arena = make_arena(side, side, *obstacles)
    placed: list[list[float]] = []
    for x, y, heading in random.uniform([3.7, 3.7, -3], [side - 3.7, side - 3.7, 3], (60, 3)):
        if clearance_cm(arena, x, y) >= 3.7 and all(math.hypot(x - other[0], y - other[1]) >= 7.4 for other in placed):
            placed.append([x, y, heading])
    return arena, placed, random.uniform(-9, 9, (len(placed), 3)) * random.choice([0, 0.1, 1], (len(placed), 1))


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("obstacles", [([], []), ([(20, 20, 5)], [box_corners(40, 40, 10, 2, 0.5)])])
def test_robots_move_as_pymunk_moves_them_when_all_are_in_its_space(friction, obstacles):
    random = np.random.default_rng(3)
    differences, free = [], 0
    for _ in range(15):
        arena, start, velocities = crowded(random, obstacles)
        world, twin = advanced([kind(arena, start, friction) for kind in (MovedWorld, FullSpaceWorld)], velocities)
        apart = ~world.is_in_space
        free += apart.sum()
        np.testing.assert_allclose(world.poses[apart], twin.poses[apart], rtol=0, atol=1e-9)
        apart &= world.swarm.robots.partner == NOBODY
        straight = start + 0.1 * velocities
        np.testing.assert_allclose(world.poses[apart], straight[apart], rtol=0, atol=1e-12)
        differences.append(np.abs(world.poses - twin.poses).max())
    assert free > 60
    # several contacts at once may be settled in another order
    assert np.quantile(differences, 0.9) < 1e-9
    assert max(differences) < 0.3


def test_robots_take_their_turns_in_the_space_without_a_trace():
    """A robot that was in the space, left it and met something again moves as one that is new there."""
    arena = make_arena(60, 60, [], [])
    used = MovedWorld(arena, [[30, 30, 0], [40, 30, 0]])
    for speed in (*[FULL_CM_S] * 4, *[-FULL_CM_S] * 4):
        advanced([used], [[speed, 0, 0], [0, 0, 0]])
    assert not used.is_in_space.any()
    fresh = MovedWorld(arena, used.poses)
    for _ in range(5):
        advanced([used, fresh], [[FULL_CM_S, 0, 0], [0, 0, 0]])
    np.testing.assert_array_equal(used.poses, fresh.poses)


def test_steps_too_long_for_the_cell_list_leave_no_robot_out():
    worlds = [
        kind(make_arena(200, 200, [], []), [[20, 100, 0], [180, 100, 0]]) for kind in (MovedWorld, FullSpaceWorld)
    ]
    world, twin = advanced(worlds, [[FULL_CM_S, 0, 0], [-FULL_CM_S, 0, 0]], 1000)
    np.testing.assert_array_equal(world.poses, twin.poses)
    assert world.poses[1, 0] - world.poses[0, 0] == pytest.approx(2 * RADIUS_CM, abs=2 * MILLIMETRE)


def test_other_threads_run_while_bodies_move():
    world = MovedWorld(make_arena(60, 60, [], []), np.array([[30.0, 30.0, 0.0]]))
    world.advance(1)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000)  # this thread gives way where it must, and nowhere else
    try:
        begun, other = threading.Event(), threading.Event()
        thread = threading.Thread(target=lambda: begun.wait() and other.set())
        thread.start()
        begun.set()
        calls = 0
        while not other.is_set() and calls < 10_000:
            world.advance(1000)
            calls += 1
    finally:
        sys.setswitchinterval(interval)
    assert other.is_set()
    thread.join()
