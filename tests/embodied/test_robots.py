"""Claims about robots: where they start, exact arcs of their wheels, imperfections, and other kinds than the e-puck."""

import math
from itertools import islice

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from epuck_sim import Simulation, load_scenario, points
from epuck_sim.arena import clearance_cm, make_arena
from epuck_sim.embodied import start
from epuck_sim.embodied.loop import act, stop_and_release, tick
from epuck_sim.embodied.observers import find_contacts, make_scene
from epuck_sim.embodied.swarm import make_block, open_block, poses_of
from epuck_sim.epuck import OUT_OF_RANGE_MM
from epuck_sim.scenario.robots import members
from epuck_sim.util.rng import uniform
from epuck_sim.util.seeds import robot_streams
from tests.control.bench import with_sense
from tests.embodied.bodies.worlds import MovedWorld
from tests.embodied.steps import NOWHERE, constant

shapes = st.tuples(st.sampled_from(["random", "grid"]), st.integers(1, 8), st.sampled_from([2.0, 3.7, 4.9]))
OBSTACLES = [
    {"shape": "circle", "x_cm": 20, "y_cm": 20, "radius_cm": 8},
    {"shape": "box", "x_cm": 60, "y_cm": 60, "width_cm": 40, "height_cm": 4, "heading_rad": 0.6},
]
BASE_CM = 5.1
LIMIT_CM_S = 12.8
ARENA = make_arena(1000, 1000, [], [])
starts = st.tuples(st.floats(300, 700), st.floats(300, 700), st.floats(-10, 10))
speeds = st.floats(-LIMIT_CM_S, LIMIT_CM_S)
differences = st.builds(lambda sign, exponent: sign * 10.0**exponent, st.sampled_from([-1, 1]), st.integers(-16, -2))
sides = st.sampled_from([(1, 1), (1, -1), (0, 1)])
wheels = st.one_of(
    st.tuples(speeds, speeds),
    st.builds(lambda speed, side: (side[0] * speed, side[1] * speed), speeds, sides),
    st.builds(lambda speed, difference: (0.9 * speed, 0.9 * speed + difference), speeds, differences),
)
gains = st.just((1.0, 1.0)) | st.tuples(st.floats(0, 2), st.floats(0, 2))
RADIO = {"kind": "radio"}
FLOOR = {"width_cm": 50, "height_cm": 50}


def placed_as(scenario, seed):
    """Return (robots, 3) the poses at the start of the trial of a scenario with this seed."""
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    start.draw_start(scene.block, seed)
    start.put_at_given_poses(scene.swarm, scenario)
    start.draw_places(scene.block, scenario)
    return poses_of(scene.swarm.robots).copy()


def placed_slowly(scenario, seed):
    """Return what `placed_as` does: with numpy's generator, and each robot compared with all before it."""
    arena, radii = scenario.arena.build(), [kind.radius_cm for kind in scenario.robot_kinds]
    random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(start.PLACEMENT,)))
    poses = {}

    def is_free_of_all(x, y, radius):
        apart = (
            (other_x - x) ** 2 + (other_y - y) ** 2 >= (radii[other] + radius) ** 2
            for other, (other_x, other_y, _) in poses.items()
        )
        return all(apart) and clearance_cm(arena, x, y) >= radius - 1e-6

    numbered = [(group, numbers) for _, group, numbers in members(scenario.robots)]
    for group, numbers in numbered:
        if group.placement == "poses":
            poses.update(zip(numbers, group.poses, strict=True))
    for group, numbers in numbered:
        if group.placement == "grid":
            sizes = [(length, max(1, math.floor(length / 10) - 1)) for length in (arena.width_cm, arena.height_cm)]
            lines = [length / 2 + 10 * (np.arange(n) - (n - 1) / 2) for length, n in sizes]
            free = np.array([(x, y) for y in lines[1] for x in lines[0] if is_free_of_all(x, y, radii[numbers[0]])])
            chosen = random.choice(free, group.count, replace=False)
            headings = random.integers(8, size=group.count) * (2 * math.pi / 8)
            poses.update(zip(numbers, np.column_stack([chosen, headings]).tolist(), strict=True))
    for group, numbers in numbered:
        if group.placement == "random":
            for number in numbers:
                free, radius = False, radii[number]
                while not free:
                    x = radius + (arena.width_cm - 2 * radius) * random.random()
                    y = radius + (arena.height_cm - 2 * radius) * random.random()
                    free = is_free_of_all(x, y, radius)
                poses[number] = (x, y, 2 * math.pi * random.random())
    return np.array([poses[number] for number in range(len(radii))])


@settings(max_examples=30)
@given(st.lists(shapes, min_size=1, max_size=4), st.booleans(), st.booleans(), st.integers(0, 2**70))
def test_robots_are_placed_where_a_slow_twin_places_them(groups, has_obstacles, has_poses, seed):
    robots = [
        {"placement": placement, "count": count, "kind": {"radius_cm": radius, "infrared": None, "wheel_base_cm": 2}}
        for placement, count, radius in groups
    ]
    robots += [{"poses": [[10.0, 70.0, 1.0], [20.0, 62.0, 0.0]]}] * has_poses
    arena = {"width_cm": 130, "height_cm": 90, "obstacles": OBSTACLES * has_obstacles}
    scenario = load_scenario({"arena": arena, "robots": robots})
    np.testing.assert_array_equal(placed_as(scenario, seed), placed_slowly(scenario, seed))


def test_poses_are_taken_as_given_and_may_touch_as_a_robot_that_joins_may():
    poses = [[3.7, 3.7, 1.0], [11.1, 3.7, -20.0], [3.7, 11.1, 0.0], [56.3, 56.3, 7.0]]
    scenario = load_scenario({"arena": {"width_cm": 60, "height_cm": 60}, "robots": [{"poses": poses}]})
    np.testing.assert_array_equal(placed_as(scenario, 0), poses)
    scenario = load_scenario({"robots": [{"poses": [[10.0, 10.0, 0.0]]}]})
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    start.put_at_given_poses(scene.swarm, scenario)
    start.begin_placement(scene.block)
    assert start.is_free(scene.swarm, 17.4001, 10.0, 3.7)
    assert not start.is_free(scene.swarm, 17.39, 10.0, 3.7)


def test_robots_that_pass_through_each_other_may_begin_and_join_at_one_place():
    robots = [{"controller": "constant", "poses": [[30, 30, 0], [30, 30, 1]]}, {"count": 1, "present": False}]
    joins = {"at_s": 1, "add": [2], "poses": [[30, 30, 0]]}
    swarm = Simulation({"robots": robots, "contact": {"robots": False}, "schedule": [joins]}, 1)
    assert np.isfinite(swarm.advance(20).poses).all()


def test_phases_may_be_given_all_else_is_as_the_controller_starts_and_another_one_gets_what_it_can_remember() -> None:
    def start_of(memory) -> np.ndarray:
        robots = [{"poses": [[15, 15, 0.5], [40, 40, 2.0], [15, 40, -1.0]], "memory": memory}]
        return Simulation({"robots": robots}, 4).last_step.memories[0]

    without, given = start_of({}), start_of({"phase_ms": [0, 1200, 4999]})
    assert given["phase_ms"].tolist() == [0, 1200, 4999]
    assert (without["phase_ms"] != given["phase_ms"]).any()
    others = [name for name in given.dtype.names if name != "phase_ms"]
    assert others
    assert all((without[name] == given[name]).all() for name in others)
    assert start_of({"phase_ms": 700})["phase_ms"].tolist() == [700] * 3
    given = {"robots": [{"memory": {"phase_ms": 700, "rotation_time": 3}}]}
    with pytest.warns(UserWarning, match=r"^scenario: oscillator lacks memory rotation_time: left out$"):
        replaced = load_scenario(given, controller="oscillator")
    assert replaced.robots[0].memory == {"phase_ms": 700}
    swept = points({**given, "sweep": {"grid": {"robots.0.controller": ["oscillator", "firefly"]}}})
    memories = [point.scenario.robots[0].memory for point in swept]
    assert memories == [{"phase_ms": 700}, {"phase_ms": 700, "rotation_time": 3}]


def arc(pose, left, right, seconds=0.1):
    """Return where wheels that keep their speeds take a robot: v integrated along a heading that turns."""
    x, y, heading = pose
    length, turn = (left + right) / 2 * seconds, (right - left) / BASE_CM * seconds
    ahead = length * np.sinc(turn / math.pi)  # sin(turn) / turn
    aside = length * np.sin(turn / 2) * np.sinc(turn / 2 / math.pi)  # (1 - cos(turn)) / turn
    cos, sin = math.cos(heading), math.sin(heading)
    return x + ahead * cos - aside * sin, y + ahead * sin + aside * cos, heading + turn


def world_of(poses, physics_hz=100, **scene):
    world = MovedWorld(ARENA, poses, 0.0, physics_hz)
    for name, value in ({"step_s": 0.1} | scene).items():
        world.swarm.scene[0][name] = value
    return world


def command(world, commands, turn_rad=0.0):
    """Have actuators command (robots, 2) cm/s, and carry that out."""
    actuators = world.swarm.robots.actuators
    actuators["left_cm_s"], actuators["right_cm_s"] = np.transpose(commands)
    actuators["turn_rad"] = turn_rad
    assert act(world.block) == -1


def wheels_of(world):
    return np.column_stack([world.swarm.robots.left_cm_s, world.swarm.robots.right_cm_s])


@pytest.mark.parametrize("timing", [(10, 100), (40, 200), (1, 50)], ids=lambda timing: "{} Hz of {} Hz".format(*timing))
@settings(max_examples=40)
@given(start=starts, commands=st.lists(wheels, max_size=9), gain=gains)
@example(start=(500.0, 500.0, 0.0), commands=[(6.0, 6.001)], gain=(1.0, 1.0))
def test_a_robot_that_touches_nothing_ends_each_control_step_on_the_exact_arc(timing, start, commands, gain):
    control_hz, physics_hz = timing
    world = world_of([start], physics_hz, step_s=1 / control_hz)
    world.swarm.robots.wheel_gain = gain
    for left, right in commands:
        command(world, [(left, right)])
        assert wheels_of(world).tolist() == [[left, right]]  # whatever the gain
        world.advance(physics_hz // control_hz)
        start = arc(start, gain[0] * left, gain[1] * right, 1 / control_hz)
        np.testing.assert_allclose(world.poses[0], start, rtol=0, atol=1e-9)


@settings(max_examples=30)
@given(st.lists(st.tuples(st.floats(allow_nan=False), st.floats(allow_nan=False)), min_size=1, max_size=5))
def test_wheels_never_turn_faster_than_their_limit(commands):
    world = world_of(np.zeros((len(commands), 3)))
    command(world, commands)
    np.testing.assert_array_equal(wheels_of(world), np.clip(commands, -LIMIT_CM_S, LIMIT_CM_S))


def test_a_turn_on_the_spot_comes_before_the_arc_rings_are_lit_at_once_and_what_is_no_number_is_told_with_its_robot():
    world = world_of([(500, 500, 1)])
    world.swarm.robots.actuators["ring_on"] = 7
    command(world, [(3, 4)], turn_rad=0.5)
    expected = arc((500, 500, 1.5), 3, 4)
    np.testing.assert_allclose(world.poses + world.velocities * 0.1, [expected], rtol=0, atol=1e-9)
    assert (world.swarm.robots.ring_on, world.swarm.robots.ring_command) == (True, True)
    world.swarm.robots.is_stuck = True
    command(world, [(3, 4)], turn_rad=0.5)
    assert not world.velocities.any()
    for part in ("left_cm_s", "right_cm_s", "turn_rad"):
        world = world_of(np.zeros((4, 3)))
        world.swarm.robots.actuators[part][2:] = np.nan
        assert act(world.block) == 2


def test_noise_makes_each_wheel_faster_or_slower_by_up_to_the_slip():
    noise = np.random.default_rng(1).random((3, 2))
    slipping, exact = world_of(np.zeros((3, 3)), slip=0.05), world_of(np.zeros((3, 3)))
    slipping.swarm.robots.wheel_noise = noise
    command(slipping, np.full((3, 2), 5.0))
    command(exact, 5.0 * (1 + 0.05 * (2 * noise - 1)))
    np.testing.assert_allclose(slipping.velocities, exact.velocities, rtol=1e-14)


def block_of(robots, step_ms=100):
    """Return a block of robots with streams for what they differ in."""
    block = make_block({"robots": robots})
    swarm = open_block(block)
    swarm.scene[0].step_ms, swarm.scene[0].step_s = step_ms, step_ms / 1000
    swarm.robots.variation_random = robot_streams(np.random.SeedSequence(4), robots)
    return block


@settings(max_examples=30)
@given(*[st.floats(0, 0.99)] * 3, st.floats(0, 0.1), st.integers(1, 30))
def test_robots_differ_as_a_slow_twin_draws_for_each_from_its_own_stream(speed, imbalance, gain, clock, robots):
    block = block_of(robots)
    swarm = open_block(block)
    swarm.scene[0].spread = speed, imbalance, clock, gain
    start.vary(block)
    for robot, stream in zip(swarm.robots, robot_streams(np.random.SeedSequence(4), robots), strict=True):
        drawn = np.array([2 * uniform(stream) - 1 for _ in range(12)])
        np.testing.assert_array_equal(robot.wheel_gain, (1 + speed * drawn[0]) * (1 + imbalance * drawn[1:3]))
        assert robot.own_step_ms == 100 * robot.clock_rate == 100 * (1 + clock * drawn[3])
        np.testing.assert_array_equal(robot.infrared_gain, 1 + gain * drawn[4:])


@settings(max_examples=15)
@given(st.lists(st.floats(0.9, 1.1), min_size=1, max_size=5), st.sampled_from([1, 25, 100]))
def test_no_millisecond_of_a_clock_is_lost_or_counted_twice(rates, step_ms):
    block = block_of(len(rates), step_ms=step_ms)
    swarm, own_ms = open_block(block), step_ms * np.array(rates)
    swarm.robots.own_step_ms = own_ms
    total = np.zeros(len(rates), np.int64)
    for step in range(300):
        swarm.scene[0].step = step
        tick(block, NOWHERE, 0)
        passed = swarm.robots.sensors.step_ms
        assert (np.abs(passed - own_ms) < 1).all()
        total += passed
    assert total.tolist() == [math.floor(300 * each) for each in own_ms]
    swarm.robots.own_step_ms, swarm.scene[0].step = step_ms, 10**12  # a clock that is right, after very long
    tick(block, NOWHERE, 0)
    assert (swarm.robots.sensors.step_ms == step_ms).all()


@pytest.mark.parametrize("step_ms", [100, 50])
def test_robots_are_free_and_stuck_by_turns_for_exponential_times_as_a_slow_twin_draws(step_ms):
    steps, robots = 5_000, 9
    changes = []
    for stream in robot_streams(np.random.SeedSequence(4), robots):
        times = [-mean_s * math.log(1 - uniform(stream)) for _ in range(100) for mean_s in (10, 5)]
        changes.append(np.searchsorted(np.cumsum(times), step_ms / 1000 * np.arange(steps), side="right"))
    block = block_of(robots, step_ms=step_ms)
    swarm = open_block(block)
    swarm.scene[0].mean_stuck_s, swarm.scene[0].mean_free_s = 5, 10
    swarm.robots.is_stuck, found = True, np.empty((steps, robots), bool)
    for step in range(steps):
        swarm.scene[0].step = step
        stop_and_release(block, NOWHERE, 0)
        found[step] = swarm.robots.is_stuck
    np.testing.assert_array_equal(found, np.transpose(changes) % 2 == 1)


def test_a_robot_turns_on_the_spot_by_its_wheels_limit_and_distance():
    for robot, limit, base in (
        ("epuck", 12.8, 5.1),
        ("kilobot", 1.0, 2.5),
        ({"kind": "kilobot", "wheel_limit_cm_s": 3, "wheel_base_cm": 2}, 3, 2),
    ):
        group = {**constant([[25, 25, 0]], left_cm_s=-12.8, right_cm_s=12.8), "signal": RADIO}
        step = Simulation({"arena": FLOOR, "noise": "off", "robot": robot, "robots": [group]}, 1).advance(11)
        assert step.wheels_cm_s.tolist() == [[-limit, limit]]
        np.testing.assert_allclose(step.poses[0], [25, 25, 2 * limit / base], rtol=0, atol=1e-9)  # in a second


def mixed(*groups, interpret=False, **sections) -> Simulation:
    """Return a simulation of robots of some kinds; groups: kind, poses, speed of both wheels, and further keys."""
    robots = [
        {"kind": kind, **constant(poses, speed, ring_on=True), "signal": RADIO, **further}
        for kind, poses, speed, further in groups
    ]
    return Simulation({"arena": FLOOR, "noise": "off", "robots": robots, **sections}, 1, interpret=interpret)


def test_each_robot_drives_with_its_own_wheels_and_stops_where_the_two_bodies_touch():
    step = mixed(("epuck", [[15, 25, 0]], 12.8, {}), ("kilobot", [[40, 25, math.pi]], 12.8, {})).advance(200)
    assert step.wheels_cm_s.tolist() == [[12.8, 12.8], [1, 1]]
    assert step.poses[1, 0] - step.poses[0, 0] == pytest.approx(3.7 + 1.65, abs=0.17)  # both are pressed
    assert [0, 1] in step.contacts.tolist()
    # the faster one has pushed the other one to the wall, where pymunk leaves it up to 0.2 mm short of a contact
    assert step.poses[1, 0] == pytest.approx(50 - 1.65, abs=0.2)
    around = {"parameters": {"left_cm_s": -1, "right_cm_s": 1}}
    turned = mixed(("epuck", [[25, 25, 0]], 0, around), ("kilobot", [[10, 10, 0]], 0, around))
    assert turned.advance(11).poses[:, 2].tolist() == pytest.approx([2 / 5.1, 2 / 2.5])


def test_heavy_robots_push_light_ones_and_the_contact_of_two_kinds_lies_between_their_surfaces():
    """Equal speeds meet at the share of the momentum: 152 and 24 g."""
    simulation = mixed(("epuck", [[20, 25, 0]], 1, {}), ("kilobot", [[30, 25, math.pi]], 1, {}))
    before, after = (simulation.advance(100).poses[:, 0].copy() for _ in range(2))
    speed = (152 - 24) / (152 + 24)
    assert (after - before) / 10 == pytest.approx([speed, speed], abs=0.01)
    simulation = mixed(("epuck", [[20, 25, 0]], 0, {}), ("kilobot", [[20 + 3.7 + 1.65 + 0.01, 25, 0]], 0, {}))
    poses = simulation.advance(1).poses[None].copy()
    scenario = simulation.scenario
    found, points = find_contacts(make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build()), poses)
    assert found.tolist() == [[0, 0, 1]]
    assert points[0] == pytest.approx([23.7, 25], abs=0.01)


def test_own_sensors_know_the_radius_of_the_robot_that_senses_and_of_others(tmp_path):
    lines = """other = world.robots[1 - robot.number]
    readings.sizes[0], readings.sizes[1] = robot.radius_cm, other.radius_cm
    readings.sizes[2] = distance_cm(world, robot.x, robot.y, robot.heading, 30.0, robot.number)"""
    text = with_sense(lines, "{'sizes': (float, 3)}")
    (tmp_path / "sizes.py").write_text("from epuck_sim.embodied.sensing import distance_cm\n" + text)
    sensors = {"sensors": [str(tmp_path / "sizes.py")]}
    groups = ("epuck", [[10, 25, 0]], 0, sensors), ("kilobot", [[30, 25, math.pi]], 0, sensors)
    sizes = mixed(*groups, interpret=True).advance(1).readings["sizes"]
    assert sizes == pytest.approx(np.array([[3.7, 1.65, 20 - 1.65], [1.65, 3.7, 20 - 3.7]]))


def test_a_robot_without_infrared_sensors_reads_nothing_in_range_from_all():
    group = {"count": 40, "controller": "constant", "signal": RADIO}
    simulation = Simulation({"arena": FLOOR, "robot": "kilobot", "robots": [group]}, 1)
    for step in islice(simulation, 10):  # the noise of readings is on
        assert (step.infrared == 0).all()
        assert (step.distance_mm == OUT_OF_RANGE_MM).all()
