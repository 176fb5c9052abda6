"""Claims about the line camera: slow twins, what walls mirror, and which picture a controller has, and since when."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim import Simulation, load_scenario
from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.sensors.camera import begin_pictures, look, take_pictures
from epuck_sim.embodied.swarm import HIDE, make_block, open_block, swarm_at
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.native import INTP, address_of
from epuck_sim.util.rng import uniform
from epuck_sim.util.seeds import robot_streams
from tests.embodied import scenes
from tests.embodied.steps import steps_of

MIRRORS = st.sampled_from([0.0, 10_000.0, 10_000.0, 15.0, 40.0])
ONE_PIXEL = scenes.CameraSettings(1, 56.0, 1)


def test_of_two_robots_as_near_the_lit_one_is_seen():
    # either side of the middle pixel's ray, and overlapping by a hair, as robots that push each other do
    robots = [(100, 100, 0.0), (130, 100 + 3.6875, 0.0), (130, 100 - 3.6875, 0.0)]
    behind = [(10.0 + 8 * place, 10.0, 0.0) for place in range(10)]  # where many are lit, all are looked at alike
    for lit in ([False, True, False], [False, False, True]):
        for others in ([], behind):
            poses, rings = np.array([*robots, *others]), np.array([*lit, *[True] * len(others)])
            scene = scenes.Scene(poses, rings, scenes.empty_arena())
            assert scenes.rows(scene, ONE_PIXEL)[0] == [1]


@pytest.mark.parametrize("quarter", range(4))
def test_a_robot_in_a_farther_row_of_cells_may_hide_one_in_a_nearer(quarter):
    # the one pixel's ray has the far robot on its right side, and the near one, beyond the next border, on its left
    nose, ahead, right = np.array([(110, 119), (0.5, 0.75**0.5), (0.75**0.5, -0.5)])
    far, near = nose + 25.15 * ahead + 3.6 * right, nose + 23.35 * ahead - 3.6 * right
    places = np.array([nose - scenes.RADIUS_CM * ahead, far, near])
    for _ in range(quarter):
        places = np.column_stack([200 - places[:, 1], places[:, 0]])
    poses = np.column_stack([places, np.full(3, math.radians(60 + 90 * quarter))])
    parked = np.repeat([(-5e5, -5e5, 0.0)], 97, axis=0)
    for near_is_lit in (False, True):
        lit = np.array([False, not near_is_lit, near_is_lit])
        scene = scenes.Scene(np.vstack([poses, parked]), np.append(lit, np.zeros(97, bool)), scenes.empty_arena())
        block = scenes.block_of(scene, ONE_PIXEL)
        assert block.swarm.scene[0].columns == block.swarm.scene[0].rows == 10  # cells are 20 cm wide
        look(block.bytes, scenes.ADDRESSES, 0)
        assert block.swarm.pixels[0] == near_is_lit


def test_rows_are_those_of_the_slow_twin_with_and_without_what_walls_mirror():
    tally = Counter()

    @settings(max_examples=40)
    @given(scenes.any_scenes((1, 2, 3, 10, 60, 200), scenes.BODIES), scenes.camera_settings(), MIRRORS, scenes.SEEDS)
    def compare(scene, camera, mirrored_cm, seed):
        random = np.random.default_rng(seed)
        if random.random() < 0.5 and not mirrored_cm:  # robots that push each other overlap
            scene = scene._replace(poses=scene.poses + random.uniform(-0.05, 0.05, scene.poses.shape))
        every = 1 + len(scene.poses) // 16  # of 60 robots the twin does 15
        direct, camera = scenes.rows(scene, camera), camera._replace(reflection_range_cm=mirrored_cm)
        expected, doubtful = scenes.slow_rows(scene, camera, every)
        found = scenes.rows(scene, camera)
        np.testing.assert_array_equal(found[::every][~doubtful], expected[~doubtful])
        assert (found >= direct).all()
        mirrored = (found > direct)[::every]
        tally.update(pixels=doubtful.size, doubtful=doubtful.sum(), red=direct[::every].sum(), mirrored=mirrored.sum())

    compare()
    assert tally["pixels"] > 4000
    assert min(tally["red"], tally["mirrored"]) > 0.005 * tally["pixels"]
    assert tally["doubtful"] < 0.02 * tally["pixels"]


@jit_no_alloc
def hide_every_third(block: ByteArray, addresses: IntArray, robot: int) -> None:  # noqa: ARG001
    swarm = swarm_at(block)
    robots = len(swarm.robots)
    for sender in range(robots):
        swarm.numbers[robots + sender] = 1 if swarm.robots[sender].ring_on and (robot + sender) % 3 else 0


@settings(max_examples=12)
@given(scenes.any_scenes(robots=(3, 10, 30)), scenes.camera_settings())
def test_rings_that_faults_hide_from_a_robot_are_dark_to_it_alone(scene, camera):
    addresses = scenes.ADDRESSES.copy()
    addresses[HIDE] = address_of(hide_every_third, INTP)
    block = scenes.block_of(scene, camera)
    block.swarm.scene[0].hides_flashes = True
    look(block.bytes, addresses, 0)
    numbers = np.arange(len(scene.poses))
    for robot in range(0, len(scene.poses), 7):
        visible = scene._replace(lit=scene.lit & ((robot + numbers) % 3 > 0))
        found = block.swarm.pixels.reshape(-1, camera.pixels)[robot]
        np.testing.assert_array_equal(found, scenes.rows(visible, camera)[robot])


@pytest.mark.parametrize("beyond_cm", [0.0, 0.03])
@pytest.mark.parametrize("others_are_lit", [False, True])
def test_a_robot_that_presses_its_nose_against_a_wall_sees_its_own_ring_at_most(beyond_cm, others_are_lit):
    poses = np.array([(200 - scenes.RADIUS_CM + beyond_cm, 100.0, 0.0), (150.0, 100.0, 0.0), (170.0, 120.0, 0.0)])
    for own in (False, True):
        scene = scenes.Scene(poses, np.array([own, others_are_lit, others_are_lit]), scenes.empty_arena())
        assert scenes.rows(scene, scenes.CameraSettings(reflection_range_cm=10_000.0))[0].tolist() == [int(own)] * 60


def facing_a_wall(range_cm=200, **keys):
    """Return a scenario of a robot that faces a wall, and one behind it whose ring is lit from the start for 0.3 s."""
    still = {"speed_cm_s": 0.0, "flash_fraction": 0.075}
    robots = [{"poses": [[45, 30, 0], [20, 42, 0]], "parameters": still, "memory": {"phase_ms": [1000, 4900]}}]
    robots[0]["camera"] = {"reflection_range_cm": range_cm}
    return {"noise": "off", "robots": robots, **keys}


def test_robots_see_what_walls_mirror_where_the_key_is_set_and_faults_hide_it_as_they_hide_rings():
    shown = steps_of(facing_a_wall(), 60, 2)
    camera, lit = shown["camera"], shown["ring_on"]
    assert steps_of(facing_a_wall(0), 60, 2)["camera"][:, 0].sum() == 0
    seen = camera[:, 0].any(axis=1)
    assert 2 < seen.sum() < 30
    np.testing.assert_array_equal(seen[1:], lit[:-1].any(axis=1))  # its own ring, too
    first = np.flatnonzero(seen)[0]
    assert len(Simulation(facing_a_wall(), seed=2).advance(first + 1).sightings) == 0  # whom it sees directly
    healthy = camera[:30, 0]  # until its own flash
    assert healthy.any()
    dead, blind = {"kind": "ring_dead", "robots": [1]}, {"kind": "camera_blind", "robots": [0]}
    not_yet = {"kind": "camera_misses", "missed": 1, "at_s": 1000}
    for fault, expected in ((dead, 0), (blind, 0), (not_yet, healthy)):
        faulty = steps_of(facing_a_wall(faults=[fault]), 30, 2)["camera"]
        np.testing.assert_array_equal(faulty[:, 0], expected)


@st.composite
def paces(draw):
    interval = draw(st.sampled_from([1.0, 1.5, 40 / 15, 5.0, 12.5, 40.0]) | st.floats(1, 50))
    return interval, interval * draw(st.sampled_from([0.0, 0.4, 1.0]) | st.floats(0, 1))


def filmed(interval, latency, steps, robots, seed):
    """Return (steps, robots) the step whose picture each controller has, -1 for none, and whether it is new."""
    pixels = 3 * robots
    block, addresses = make_block({"robots": robots, "groups": 1, "pixels": 3 * pixels}), np.zeros(3, np.int64)
    swarm = open_block(block)
    swarm.robots.signal_random = robot_streams(np.random.SeedSequence(seed), robots)
    group = swarm.groups[0]
    group.count, group.pixels, group.in_view, group.waiting = robots, 3, pixels, 2 * pixels
    group.camera.interval, group.camera.latency = interval, latency
    begin_pictures(block, 0)
    camera, in_view = swarm.pixels[:pixels].reshape(robots, 3), swarm.pixels[pixels : 2 * pixels]
    shown, is_new = np.empty((steps, robots), np.int64), np.empty((steps, robots), bool)
    for step in range(steps):
        swarm.scene[0].step, in_view[:] = step, step + 1
        take_pictures(block, addresses, 0)
        assert (camera == camera[:, :1]).all()
        shown[step], is_new[step] = camera[:, 0] - 1, swarm.robots.sensors.new_picture
    return shown, is_new


def slow_twin(interval, latency, steps, stream):
    """Return what `filmed` does of a robot, from the list of all its pictures: when taken, when there."""
    first = interval * uniform(stream)
    instants = [first + number * interval for number in range(steps + 1)]
    pictures = [(math.floor(instant), math.floor(instant + latency * uniform(stream))) for instant in instants]
    shown = [max((taken for taken, there in pictures if there <= step), default=-1) for step in range(steps)]
    arrivals = {there for _, there in pictures}
    return shown, [step in arrivals for step in range(steps)]


@settings(max_examples=20)
@given(paces(), st.integers(0, 2**32 - 1))
@example((1.0, 0.0), 1)
@example((1.0, 1.0), 2)
def test_each_step_shows_the_last_picture_that_has_arrived(pace, seed):
    shown, is_new = filmed(*pace, 200, 3, seed)
    for robot, stream in enumerate(robot_streams(np.random.SeedSequence(seed), 3)):
        assert (shown[:, robot].tolist(), is_new[:, robot].tolist()) == slow_twin(*pace, 200, stream)


def test_a_picture_in_every_step_is_as_good_as_no_pace():
    plain, paced = Simulation("thesis", 3), Simulation(load_scenario("thesis", ["robots.0.camera.frames_per_s=10"]), 3)
    for one, other, _ in zip(plain, paced, range(100), strict=False):
        assert one.poses.tobytes() == other.poses.tobytes()
        assert one.memories[0].tobytes() == other.memories[0].tobytes()
        assert one.camera.tobytes() == other.camera.tobytes()
