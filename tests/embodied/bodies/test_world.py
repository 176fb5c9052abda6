"""Claims about the rigid bodies: nothing overlaps or tunnels, a push shares momentum, contacts slide."""

import math
import sys
import threading

import numpy as np
import pytest
from scipy.spatial import cKDTree

from epuck_sim.arena import clearance_cm, make_arena
from epuck_sim.embodied.bodies.contacts import NOBODY
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.geometry import box_corners
from tests.embodied.bodies.worlds import FullSpaceWorld, MovedWorld

RADIUS_CM = 3.7
FULL_CM_S = 12.8
MILLIMETRE = 0.1
TOUCH_CM = 0.005  # bodies that press against each other touch within this

CIRCLE = {"shape": "circle", "x_cm": 15, "y_cm": 15, "radius_cm": 4}
BOX = {"shape": "box", "x_cm": 38, "y_cm": 20, "width_cm": 10, "height_cm": 0.5, "heading_rad": 0.6}
POLYGON = {"shape": "polygon", "corners_cm": [[20, 35], [32, 37], [24, 45]]}


def constant(poses, speed=0.0):
    """Return a group that drives straight ahead."""
    return {"poses": poses, "controller": "constant", "parameters": {"left_cm_s": speed, "right_cm_s": speed}}


def moved(groups, steps, width=100, height=60, obstacles=(), interpret=False, **rest):
    """Return (steps + 1, robots, 3) the poses of robots without noise."""
    arena = {"width_cm": width, "height_cm": height, "obstacles": list(obstacles)}
    scenario = {"arena": arena, "robots": groups, "noise": "off", **rest}
    simulation = Simulation(scenario, 0, interpret=interpret)
    return np.array([step.poses.copy() for step, _ in zip(simulation, range(steps + 1), strict=False)])


# --- nothing overlaps -------------------------------------------------------------------------------

AHEAD = {"left_cm_s": FULL_CM_S, "right_cm_s": FULL_CM_S}
CROWDS = {"firefly": {"count": 20}, "constant": {"count": 20, "controller": "constant", "parameters": AHEAD}}
FLOORS = {
    "bare": {"width_cm": 45, "height_cm": 45},
    "obstacles": {"width_cm": 55, "height_cm": 55, "obstacles": [CIRCLE, BOX, POLYGON]},
}


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((crowd, floor, steps), id=f"{crowd}-{floor}-{steps}", marks=marks)
        for floor in FLOORS
        for crowd in CROWDS
        for steps, marks in ((2500, ()), (10_000, pytest.mark.slow))
    ],
)
def crowd(request):
    """Twenty robots at full speed with little room: (steps, 20, 2) cm where they were at each step, and their floor."""
    crowd, floor, steps = request.param
    arena = FLOORS[floor]
    simulation = Simulation({"arena": arena, "robots": [CROWDS[crowd]]}, 1)
    return np.array([step.poses[:, :2].copy() for step, _ in zip(simulation, range(steps), strict=False)]), arena


def to_polygon(points, corners):
    """Return the distances of (n, 2) points from a convex polygon, negative inside."""
    after = np.roll(corners, -1, axis=0)
    along = after - corners
    offset = points[:, None] - corners
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    distance = np.linalg.norm(offset - share[..., None] * along, axis=2).min(axis=1)
    inside = (along[:, 0] * offset[..., 1] - along[:, 1] * offset[..., 0] > 0).all(axis=1)
    return np.where(inside, -distance, distance)


def test_robots_never_overlap_by_more_than_a_millimetre_at_the_end_of_a_control_step(crowd):
    positions, _ = crowd
    one, other = np.triu_indices(positions.shape[1], 1)
    apart = np.linalg.norm(positions[:, one] - positions[:, other], axis=2).min(axis=1)
    overlap = 2 * RADIUS_CM - apart
    assert overlap.max() <= MILLIMETRE, f"in {(overlap > MILLIMETRE).sum()} of {len(overlap)} steps"


def test_robots_are_never_more_than_a_millimetre_in_a_wall_or_an_obstacle(crowd):
    positions, arena = crowd
    points = positions.reshape(-1, 2)
    size = arena["width_cm"], arena["height_cm"]
    gaps = {"wall": np.minimum(points, size - points).min(axis=1)}
    if "obstacles" in arena:
        gaps["circle"] = np.hypot(points[:, 0] - 15, points[:, 1] - 15) - 4
        gaps["box"] = to_polygon(points, box_corners(38, 20, 10, 0.5, 0.6))
        gaps["polygon"] = to_polygon(points, np.array(POLYGON["corners_cm"], float))
    within = {name: float((RADIUS_CM - gap).max()) for name, gap in gaps.items()}
    assert max(within.values()) <= MILLIMETRE, within


def test_two_that_meet_head_on_overlap_by_less_than_a_millimetre_and_no_longer_than_a_control_step():
    for gap in np.linspace(5, 7.56, 60):
        robots = [constant([[30, 30, 0]], FULL_CM_S), constant([[37.4 + gap, 30, math.pi]], FULL_CM_S)]
        overlap = 2 * RADIUS_CM - np.diff(moved(robots, 8)[:, :, 0], axis=1)
        assert overlap.max() <= MILLIMETRE
        assert overlap[-4:].max() <= TOUCH_CM + 1e-9


@pytest.mark.parametrize("robots", [100, pytest.param(1000, marks=pytest.mark.slow)])
def test_a_jam_of_robots_that_all_push_is_neither_squeezed_nor_set_in_motion(robots):
    side = 7.6 * math.ceil(math.sqrt(robots))
    headings = np.random.default_rng(1).uniform(0, 2 * math.pi, robots)
    places = [3.8 + 7.6 * np.array(divmod(robot, round(side / 7.6))) for robot in range(robots)]
    poses = [[x, y, heading] for (x, y), heading in zip(places, headings.tolist(), strict=True)]
    arena = {"width_cm": side, "height_cm": side}
    simulation = Simulation({"arena": arena, "robots": [constant(poses, FULL_CM_S)]}, 1)
    path = np.array([step.poses[:, :2].copy() for step, _ in zip(simulation, range(150), strict=False)])
    for positions in path:
        pairs = cKDTree(positions).query_pairs(2 * RADIUS_CM, output_type="ndarray")
        apart = np.linalg.norm(positions[pairs[:, 0]] - positions[pairs[:, 1]], axis=1)
        assert apart.min(initial=2 * RADIUS_CM) >= 2 * RADIUS_CM - MILLIMETRE
        assert min(positions.min(), (side - positions).min()) >= RADIUS_CM - MILLIMETRE
    energy = ((np.diff(path, axis=0) / 0.1) ** 2).sum(axis=2).mean(axis=1)
    assert energy.max() < FULL_CM_S**2 / 4
    assert energy[-50:].mean() < energy[:50].mean()


# --- nothing tunnels --------------------------------------------------------------------------------


@pytest.mark.parametrize("speed", [FULL_CM_S, -FULL_CM_S])
@pytest.mark.parametrize("behind", [0, 5])
def test_a_robot_stays_on_its_side_of_a_thin_box_even_with_others_pressing_from_behind(behind, speed):
    box = {"shape": "box", "x_cm": 60, "y_cm": 30, "width_cm": 0.5, "height_cm": 40}
    heading = 0 if speed > 0 else math.pi
    queue = [[52 - 7.5 * place, 30, heading] for place in range(1 + behind)]
    path = moved([constant(queue, speed)], 1000, obstacles=[box])
    assert path[:, 0, 0].max() <= 59.75 - RADIUS_CM + 0.13
    assert path[-1, 0, 0] > 59.75 - RADIUS_CM - 0.1  # it presses against the box


# --- pushing ----------------------------------------------------------------------------------------


def test_in_scene_push_both_move_at_half_the_pushers_speed_from_contact_on():
    simulation = Simulation("push")
    path = np.array([step.poses.copy() for step, _ in zip(simulation, range(41), strict=False)])
    time = 0.1 * np.arange(41)[:, None]
    before = np.array([20, 30]) + FULL_CM_S * time * (1, 0)
    # together they have the momentum of the pusher alone, 7.4 cm apart
    after = (50 + FULL_CM_S * time) / 2 + np.array([-RADIUS_CM, RADIUS_CM])
    touches = time > (30 - 20 - 2 * RADIUS_CM) / FULL_CM_S
    np.testing.assert_allclose(path[:, :, 0], np.where(touches, after, before), rtol=0, atol=TOUCH_CM)
    np.testing.assert_allclose(np.diff(path[5:, :, 0], axis=0), FULL_CM_S / 2 * 0.1, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(path[:, :, 1:], np.broadcast_to([30, 0], (41, 2, 2)))


@pytest.mark.parametrize("robots", [2, 3])
def test_a_row_that_one_robot_pushes_moves_at_its_share_of_the_speed(robots):
    row = [[27.4 + 7.4 * place, 30, 0] for place in range(robots - 1)]
    path = moved([constant([[20, 30, 0]], FULL_CM_S), constant(row)], 100, width=200)
    np.testing.assert_allclose(np.diff(path[50:, :, 0], axis=0) / 0.1, FULL_CM_S / robots, rtol=1e-3)


@pytest.mark.parametrize("robots", [2, 3, 10])
def test_a_push_takes_from_the_pusher_what_it_gives_to_others(robots):
    row = [[28 + 7.6 * place, 30 + (-1) ** place, 0] for place in range(robots - 1)]
    path = moved([constant([[20, 30, 0]], FULL_CM_S), constant(row)], 60, width=200)
    together = np.diff(path[:, :, :2].sum(axis=1), axis=0)
    np.testing.assert_allclose(together, np.broadcast_to([FULL_CM_S * 0.1, 0], (60, 2)), rtol=0, atol=1e-9)
    assert path[-1, 1, 0] > path[0, 1, 0] + 1


BACK_OFF = """
PARAMETERS = {"steps": 20}
MEMORY = {"taken": int}


def start(memory, parameters, random):
    memory.taken = 0


def step(sensors, memory, actuators, parameters, random):
    speed = 12.8 if memory.taken < parameters.steps else -12.8
    actuators.left_cm_s = speed
    actuators.right_cm_s = speed
    memory.taken += 1
"""


@pytest.mark.parametrize("robots", [1, 2])
def test_when_the_pusher_backs_off_those_it_pushed_hold_still_from_that_control_step_on(tmp_path, robots):
    controller = tmp_path / "back_off.py"
    controller.write_text(BACK_OFF)
    pusher = {"poses": [[20, 30, 0]], "controller": str(controller)}
    row = [[30 + 8 * place, 30, 0] for place in range(robots)]
    path = moved([pusher, constant(row)], 30, interpret=True)
    assert (path[20, 1:, 0] > path[19, 1:, 0] + 0.4).all()
    np.testing.assert_allclose(path[21:, 1:], np.broadcast_to(path[20, 1:], (10, robots, 3)), rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.diff(path[20:, 0, 0]), -FULL_CM_S * 0.1, rtol=0, atol=1e-4)


# --- sliding and friction ---------------------------------------------------------------------------


def test_contacts_without_friction_never_turn_a_robot():
    random = np.random.default_rng(5)
    rows = {5: (5, 15, 25, 35, 50), 25: (5, 15, 25), 38: (5, 38, 50), 50: (5, 15, 25, 35, 50)}
    places = [[x, y, random.uniform(-math.pi, math.pi)] for x, ys in rows.items() for y in ys]
    path = moved([constant(places, FULL_CM_S)], 500, width=55, height=55, obstacles=[CIRCLE, BOX, POLYGON])
    assert np.abs(path[-1, :, :2] - path[-2, :, :2]).max() < 0.1 * FULL_CM_S / 2  # all have met something
    np.testing.assert_allclose(path[..., 2], np.broadcast_to(path[0, :, 2], path.shape[:2]), rtol=0, atol=1e-9)


def test_a_robot_slides_along_a_wall_with_the_part_of_its_speed_that_lies_along_it():
    path = moved([constant([[20, 10, -math.pi / 6]], FULL_CM_S)], 60)[:, 0]
    assert path[20:, 1] == pytest.approx(RADIUS_CM, abs=2 * TOUCH_CM)
    np.testing.assert_allclose(np.diff(path[20:, 0]), FULL_CM_S * math.cos(math.pi / 6) * 0.1, rtol=0, atol=1e-9)


GLANCING = [constant([[20, 30, 0]], FULL_CM_S), constant([[32, 34, 0]])]


def test_a_robot_slides_past_another_one_that_it_touches_beside_its_middle():
    pusher, pushed = moved(GLANCING, 50)[-1]
    assert pusher[0] > pushed[0] + 2 * RADIUS_CM
    assert pusher[1] < 30  # both have given way
    assert pushed[1] > 34
    np.testing.assert_allclose([pusher[2], pushed[2]], 0, atol=1e-9)


@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_with_friction_a_glancing_contact_turns_both_robots_the_same_way(friction):
    headings = moved(GLANCING, 12, contact={"friction": friction})[-1, :, 2]
    assert headings[0] > 0.01
    assert headings[1] == pytest.approx(headings[0], rel=1e-6)  # discs that rub: the same torque on both


def test_with_friction_a_wall_turns_a_robot_that_rubs_along_it_towards_the_wall():
    path = moved([constant([[20, 10, -math.pi / 6]], FULL_CM_S)], 30, contact={"friction": 0.5})[:, 0]
    assert path[-1, 2] < -math.pi / 6 - 0.1
    assert path[-1, 0] < 20 + FULL_CM_S * math.cos(math.pi / 6) * 3 - 1


# --- scene wall -------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_in_scene_wall_the_robot_turns_away_from_the_wall_and_gets_further_from_it(seed):
    path = np.array([step.poses[0].copy() for step, _ in zip(Simulation("wall", seed), range(80), strict=False)])
    arrival = np.flatnonzero(path[:, 0] > 60 - RADIUS_CM - 3)[0]
    x, heading = path[arrival : arrival + 51, 0], path[arrival : arrival + 51, 2]
    assert path[:, 0].max() <= 60 - RADIUS_CM + 2 * TOUCH_CM
    assert np.abs(heading[10]) > math.pi / 4  # one second later it looks elsewhere
    assert x.min() < x[0] - 1  # and within five seconds it has left


# --- only robots that may touch something are in the space --------------------------------------------

OBSTACLES = [([], []), ([(20, 20, 5)], [box_corners(40, 40, 10, 2, 0.5)])]


def crowded_worlds(random, obstacles, friction, kinds=(MovedWorld, FullSpaceWorld)):
    """Return worlds of each kind with the same robots, some at rest, some slow, some quick."""
    side = random.uniform(46, 80)
    arena = make_arena(side, side, *obstacles)
    placed: list[list[float]] = []
    for x, y, heading in random.uniform([3.7, 3.7, -3], [side - 3.7, side - 3.7, 3], (60, 3)):
        if clearance_cm(arena, x, y) >= 3.7 and all(math.hypot(x - other[0], y - other[1]) >= 7.4 for other in placed):
            placed.append([x, y, heading])
    velocities = random.uniform(-9, 9, (len(placed), 3)) * random.choice([0, 0.1, 1], (len(placed), 1))
    worlds = [kind(arena, placed, friction) for kind in kinds]
    for world in worlds:
        world.velocities[:] = velocities
    return worlds


@pytest.mark.parametrize("friction", [0.0, 0.5])
@pytest.mark.parametrize("obstacles", OBSTACLES)
def test_robots_move_as_pymunk_moves_them_when_all_are_in_its_space(friction, obstacles):
    random = np.random.default_rng(3)
    differences, free = [], 0
    for _ in range(60):
        world, twin = crowded_worlds(random, obstacles, friction)
        start = world.poses.copy()
        for each in (world, twin):
            each.advance(10)
        apart = ~world.is_in_space
        free += apart.sum()
        np.testing.assert_allclose(world.poses[apart], twin.poses[apart], rtol=0, atol=1e-9)
        apart &= world.swarm.robots.partner == NOBODY
        straight = start + 0.1 * world.velocities
        np.testing.assert_allclose(world.poses[apart], straight[apart], rtol=0, atol=1e-12)
        differences.append(np.abs(world.poses - twin.poses).max())
    assert free > 300
    # several contacts at once may be settled in another order
    assert np.quantile(differences, 0.9) < 1e-9
    assert max(differences) < 0.3


def test_who_is_pushed_is_in_the_space_with_who_pushes_it_and_nobody_else():
    row = [[20 + 7.4 * place, 30, 0] for place in range(5)]
    world = MovedWorld(make_arena(100, 60, [], []), np.array([*row, [80, 10, 0], [80, 50, 0]], float))
    world.velocities[0, 0] = FULL_CM_S
    world.velocities[5, 1] = FULL_CM_S
    world.advance(10)
    assert world.is_in_space.tolist() == [True] * 5 + [False] * 2
    world.velocities[0, 0] = -FULL_CM_S
    for _ in range(5):
        world.advance(10)
    assert not world.is_in_space[0]


def test_robots_take_their_turns_in_the_space_without_a_trace():
    """A robot that was in the space, left it and met something again moves as one that is new there."""
    arena = make_arena(60, 60, [], [])
    used = MovedWorld(arena, np.array([[30.0, 30, 0], [40, 30, 0]]))
    for speed in (*[FULL_CM_S] * 4, *[-FULL_CM_S] * 4):
        used.velocities[0, 0] = speed
        used.advance(10)
    assert not used.is_in_space.any()
    fresh = MovedWorld(arena, used.poses)
    for world in (used, fresh):
        world.velocities[:] = 0
        world.velocities[0, 0] = FULL_CM_S
        for _ in range(5):
            world.advance(10)
    np.testing.assert_array_equal(used.poses, fresh.poses)


def test_steps_too_long_for_the_cell_list_leave_no_robot_out():
    world, twin = (
        kind(make_arena(200, 200, [], []), np.array([[20.0, 100, 0], [180, 100, 0]]))
        for kind in (MovedWorld, FullSpaceWorld)
    )
    for each in (world, twin):
        each.velocities[:, 0] = FULL_CM_S, -FULL_CM_S
        each.advance(1000)
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
