"""Claims about rigid bodies: nothing overlaps or tunnels, contacts slide, none is missed, and movables are pushed."""

import math
import sys
import threading
from itertools import islice

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from epuck_sim import Simulation, epuck, load_scenario
from epuck_sim.arena import clearance_cm, make_arena
from epuck_sim.embodied.bodies import chipmunk
from epuck_sim.embodied.bodies.contacts import MARGIN_CM, NOBODY, PUSHED_CM, find_contact_candidates
from epuck_sim.embodied.bodies.world import DYNES_PER_NEWTON, GRAVITY_CM_S2
from epuck_sim.geometry import box_corners
from tests.embodied.bodies.worlds import FullSpaceWorld, MovedWorld, advanced, overlap_cm, squeeze
from tests.embodied.steps import constant

RADIUS_CM = 3.7
FULL_CM_S = 12.8
MILLIMETRE = 0.1
TOUCH_CM = 0.005  # bodies that press against each other touch within this
OBSTACLES = [
    {"shape": "circle", "x_cm": 15, "y_cm": 15, "radius_cm": 4},
    {"shape": "box", "x_cm": 38, "y_cm": 20, "width_cm": 10, "height_cm": 0.5, "heading_rad": 0.6},
    {"shape": "polygon", "corners_cm": [[20, 35], [32, 37], [24, 45]]},
]
PILLARS = ([(20, 20, 5)], [box_corners(40, 40, 10, 2, 0.5)])
CONTROL_S = 0.1
CONTACT_CM = 2 * (RADIUS_CM + MARGIN_CM)
WALL_CM = RADIUS_CM + 2 * MARGIN_CM
DISC_CM = 6.0
DIAMETER_CM = 2 * epuck.RADIUS_CM
STEP_S = 0.01
SETTLING = 25
"""Physics steps that forces take to balance: 18.0 were the most, with four pushers of 2 N each near the threshold."""
DISC = {"x_cm": 50, "y_cm": 30, "radius_cm": DISC_CM, "mass_kg": 1, "friction": 0.1}
MOVABLES = [(30, 60, 6, 500, 0.1), (42.5, 60, 6, 300, 0.2)]


def moved(groups, steps, **rest):
    arena = {"width_cm": 100, "height_cm": 60}
    simulation = Simulation({"arena": arena, "robots": groups, "noise": "off", **rest}, 0)
    return np.array([step.poses.copy() for step in islice(simulation, steps + 1)])


@pytest.mark.parametrize("group", [{}, constant(None, FULL_CM_S)], ids=["firefly", "constant"])
@pytest.mark.parametrize(("side", "obstacles"), [(45, []), (55, OBSTACLES)], ids=["bare", "obstacles"])
def test_robots_are_never_more_than_a_millimetre_in_each_other_a_wall_or_an_obstacle(group, side, obstacles):
    arena = {"width_cm": side, "height_cm": side, "obstacles": obstacles}
    simulation = Simulation({"arena": arena, "robots": [{**group, "count": 20}]}, 1)
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


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("obstacles", [([], []), PILLARS])
def test_robots_move_as_pymunk_moves_them_when_all_are_in_its_space(friction, obstacles):
    random = np.random.default_rng(3)
    differences, free = [], 0
    for _ in range(15):
        side = random.uniform(46, 80)
        arena, start = make_arena(side, side, *obstacles), []
        for x, y, heading in random.uniform([3.7, 3.7, -3], [side - 3.7, side - 3.7, 3], (60, 3)):
            apart = [math.hypot(x - other[0], y - other[1]) for other in start]
            if clearance_cm(arena, x, y) >= 3.7 and min(apart, default=9) >= 7.4:
                start.append([x, y, heading])
        velocities = random.uniform(-9, 9, (len(start), 3)) * random.choice([0, 0.1, 1], (len(start), 1))
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
    scene = make_arena(200, 200, [], []), [[20, 100, 0], [180, 100, 0]]
    worlds = [MovedWorld(*scene), FullSpaceWorld(*scene)]
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


def slow_candidates(positions, velocities, side, slack_cm):
    """Return who may touch something on a bare floor, from all pairs at many instants, with a slack."""
    times = np.linspace(0, CONTROL_S, 201)[:, None, None]
    paths = positions + times * velocities
    apart = np.linalg.norm(paths[:, :, None] - paths[:, None], axis=3).min(axis=0)
    np.fill_diagonal(apart, np.inf)
    gaps = np.minimum(paths, side - paths).min(axis=(0, 2))
    meets = (apart <= CONTACT_CM + slack_cm).any(axis=1) | (gaps <= WALL_CM + slack_cm)
    start = np.linalg.norm(positions[:, None] - positions, axis=2)
    reach = start <= CONTACT_CM + 2 * (np.linalg.norm(velocities, axis=1).max() * CONTROL_S + PUSHED_CM) + slack_cm
    for _ in positions:
        meets |= (reach & meets).any(axis=1)
    return meets


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.floats(24, 80))
def test_candidates_are_those_of_the_slow_twin(seed, robots, side):
    random = np.random.default_rng(seed)
    positions = random.uniform(4, side - 4, (robots, 2))
    velocities = random.uniform(-9, 9, (robots, 2)) * random.choice([0, 1], (robots, 1))
    world = MovedWorld(make_arena(side, side, [], []), np.pad(positions, ((0, 0), (0, 1))))
    world.velocities[:] = np.pad(velocities, ((0, 0), (0, 1)))
    find_contact_candidates(world.block)
    found = (world.swarm.robots.may_touch | (world.swarm.robots.partner != NOBODY)).tolist()
    surely, perhaps = (slow_candidates(positions, velocities, side, slack_cm) for slack_cm in (-1e-3, 1e-3))
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
    assert apart[~world.is_in_space & (world.swarm.robots.partner == NOBODY)].min(initial=100) > CONTACT_CM
    free = ~world.is_in_space
    np.testing.assert_allclose(world.poses[free], twin.poses[free], rtol=0, atol=1e-9)
    assert overlap_cm(world.poses[:, :2]) <= max(overlap_cm(twin.poses[:, :2]), 0) + 0.05


def row_of(pushers, force_n, friction_n, mass_g, discs=1):
    """Return a world with robots in a row that touch each other, and discs in a row ahead of them."""
    first = 10 + DIAMETER_CM * (pushers - 1) + epuck.RADIUS_CM + DISC_CM
    friction = friction_n * DYNES_PER_NEWTON / (mass_g * GRAVITY_CM_S2)
    movables = [(first + 2 * DISC_CM * place, 30, DISC_CM, mass_g, friction) for place in range(discs)]
    poses = np.array([[10 + DIAMETER_CM * place, 30, 0] for place in range(pushers)])
    return MovedWorld(make_arena(900, 60, [], [], movables), poses, drive_force_n=force_n)


def way_cm(world, speed, seconds):
    """Return how far the first disc comes in some seconds when all robots drive at a speed, cm/s."""
    disc = world.swarm.circles[0]
    start = disc.x
    for _ in range(round(10 * seconds)):
        advanced([world], (speed, 0, 0))
    return disc.x - start


@settings(max_examples=12)
@given(
    pushers=st.integers(1, 4),
    force_n=st.floats(0.1, 2),
    share=st.one_of(st.floats(0.1, 0.95), st.floats(1.05, 3)),
    mass_g=st.floats(200, 2000),
    speed=st.floats(0.5, 12.8),
)
def test_a_disc_moves_if_its_pushers_forces_sum_to_more_than_its_friction(pushers, force_n, share, mass_g, speed):
    """The closed form: it accelerates by what forces are left over to the pushers' speed, which it keeps; or stays."""
    friction_n = share * pushers * force_n
    found = way_cm(row_of(pushers, force_n, friction_n, mass_g), speed, seconds=5)
    if share > 1:
        assert found == pytest.approx(0, abs=SETTLING * STEP_S * speed)
    else:
        left_over = (pushers * force_n - friction_n) * DYNES_PER_NEWTON
        acceleration = left_over / (mass_g + pushers * epuck.MASS_G)
        until_s = min(speed / acceleration, 5)
        expected = acceleration * until_s**2 / 2 + speed * (5 - until_s)
        assert found == pytest.approx(expected, abs=SETTLING * STEP_S * speed)


def test_of_two_with_different_speeds_the_faster_moves_it_if_it_can_alone_and_else_the_slower_holds_it_up():
    """Of a disc in a lane; the way is that of 10 s."""
    for speeds, friction_n, way in (((2, 4), 0.3, 40), ((2, 4), 0.8, 20), ((2, 4), 1.2, 0), ((4, 0), 0.8, 0)):
        friction = friction_n * DYNES_PER_NEWTON / (1000 * GRAVITY_CM_S2)
        arena = make_arena(300, 14.9, [], [], [(25, 7.45, 7, 1000, friction)])
        world, places = MovedWorld(arena, [[10, 3.74, 0], [10, 11.16, 0]], drive_force_n=0.5), []
        for _ in range(250):
            advanced([world], [[speed, 0, 0] for speed in speeds])
            places.append(world.swarm.circles[0].x)
        assert places[-1] - places[-101] == pytest.approx(way, abs=0.01 if way else 1e-6), (speeds, friction_n)


@pytest.mark.parametrize(("discs", "moves"), [(1, True), (2, True), (3, False)])
def test_what_is_pushed_by_what_is_pushed_adds_its_friction_and_may_begin_beside_it(discs, moves):
    load_scenario({"arena": {"width_cm": 150, "movables": [DISC, DISC | {"x_cm": 62}]}, "robots": [{"count": 1}]})
    found = way_cm(row_of(2, force_n=0.5, friction_n=0.4, mass_g=500, discs=discs), 3.0, seconds=10)
    assert (found > 25) if moves else (abs(found) < 1e-3)


def test_sensors_see_a_disc_where_it_was_pushed_to_as_an_obstacle_that_stands_there():
    def simulation(poses, **arena):
        robots = [constant([pose], speed) for pose, speed in zip(poses, (5.0, 0.0), strict=True)]
        return Simulation({"arena": {"width_cm": 150, "height_cm": 100, **arena}, "robots": robots, "noise": "off"}, 1)

    poses = [50 - DISC_CM - epuck.RADIUS_CM, 30, 0], [90, 34, 3]
    pushed = simulation(poses, movables=[DISC | {"friction": 0.02}]).advance(60)
    ((x, y),) = pushed.movables
    assert x > 75
    obstacle = {"shape": "circle", "x_cm": x, "y_cm": y, "radius_cm": DISC_CM - 1e-6}
    still = next(simulation(pushed.poses.tolist(), obstacles=[obstacle]))
    assert (pushed.infrared[1] > 100).any()
    np.testing.assert_allclose(pushed.infrared, still.infrared, rtol=0, atol=0.5)
    assert pushed.contacts.tolist() == [[0, -1]] == still.contacts.tolist()


def test_a_strong_robot_that_touches_nothing_moves_as_where_there_is_nothing_to_push_a_physics_step_later():
    speed = 5
    robots, arena = [constant([[50, 50, 1]], left_cm_s=3, right_cm_s=7)], {"width_cm": 100, "height_cm": 100}
    without, movables = {"arena": arena, "robots": robots}, [DISC | {"x_cm": 90, "y_cm": 90}]
    with_disc = {"arena": {**arena, "movables": movables}, "robots": robots, "contact": {"drive_force_n": 1000}}
    ways = [Simulation(each, 1).advance(200).poses.copy() for each in (without, with_disc)]
    assert 0 < np.hypot(*(ways[0] - ways[1])[0, :2]) < 1.1 * speed * STEP_S
    assert ways[0][0, 2] == pytest.approx(ways[1][0, 2], abs=1e-9)


@pytest.fixture
def patches(monkeypatch):
    """Have it tried again whether compiled code can call Chipmunk, when something was changed, and afterwards."""
    yield monkeypatch
    monkeypatch.undo()
    forget()


def forget():
    chipmunk.function_addresses.cache_clear()
    chipmunk.reason_for_public_way.cache_clear()


def ways(arena, poses, velocities, friction=0.0):
    """Return where robots are after each of twelve control steps, and movables, in two trials."""
    world = MovedWorld(arena, poses, friction)
    found = [np.full(1, world.world.is_public)]
    for trial in range(2):
        if trial:
            world.poses[:] = poses
            world.world.place()
        for step in range(12):
            advanced([world], velocities[(step + trial) % len(velocities)])
            found += [world.poses.copy(), np.array(world.swarm.circles.tolist()), world.is_in_space.copy()]
            if step == 6:
                world.world.move(0, (70.0, 6.0, 0.5))
    return found


def crowd(seed, movables=()):
    random = np.random.default_rng(seed)
    poses = [[x, y, random.uniform(-3, 3)] for x in range(5, 76, 10) for y in (5, 32, 75)]
    velocities = random.uniform(-9, 9, (4, len(poses), 3)) * random.choice([0, 1], (4, len(poses), 1))
    return make_arena(80, 80, *PILLARS, movables), np.array(poses), velocities


def test_outcomes_are_equal_to_the_bit(patches):
    arena, poses, velocities = squeeze(10)
    scenes = [(*crowd(1), 0.0), (*crowd(2), 0.5), (*crowd(3, MOVABLES), 0.3), (arena, poses, velocities[None], 0.0)]
    compiled = [ways(*scene) for scene in scenes]
    patches.setitem(chipmunk.FUNCTIONS, "cpSpaceStep", ("void(*)(cpSpace *)", chipmunk.pymunk.Space.step))
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
        (lambda to: to.setitem(chipmunk.FUNCTIONS, "cpSpaceFly", ("void(*)(cpSpace *)", None)), "cpSpaceFly"),
        (lambda to: to.setattr(chipmunk, "ffi", None), "addressof"),
        (lambda to: to.setitem(chipmunk._KINDS, chipmunk.pymunk.Body, "Corps"), "'_corps'"),
        (lambda to: to.setattr(chipmunk.platform, "machine", lambda: "vax"), "vax"),
    ],
)
def test_what_is_other_than_expected_is_found_and_named(patches, change, named):
    change(patches)
    forget()
    assert named in chipmunk.reason_for_public_way()
