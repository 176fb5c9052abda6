"""Claims about the line camera: closed forms, and a slow twin on random scenes."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.sensors.camera import look
from epuck_sim.embodied.swarm import HIDE, swarm_at
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.native import address_of
from tests.embodied.scenes import (
    ADDRESSES,
    BODIES,
    RADIUS_CM,
    CameraSettings,
    Scene,
    block_of,
    camera_settings,
    empty_arena,
    rows,
    scenes,
    slow_rows,
)

SEEDS = st.integers(0, 2**32 - 1)
MIRRORED_CM = st.sampled_from([0.0, 0.0, 10_000.0, 15.0, 40.0])
ONE_PIXEL = CameraSettings(1, 56.0, 1)


def test_of_two_robots_as_near_the_lit_one_is_seen():
    # either side of the middle pixel's ray, and overlapping by a hair, as robots that push each other do
    robots = [(100, 100, 0.0), (130, 100 + 3.6875, 0.0), (130, 100 - 3.6875, 0.0)]
    behind = [(10.0 + 8 * place, 10.0, 0.0) for place in range(10)]  # where many are lit, all are looked at alike
    for lit in ([False, True, False], [False, False, True]):
        for others in ([], behind):
            scene = Scene(np.array([*robots, *others]), np.array([*lit, *[True] * len(others)]), empty_arena())
            assert rows(scene, ONE_PIXEL)[0] == [1]


@pytest.mark.parametrize("quarter", range(4))
def test_a_robot_in_a_farther_row_of_cells_may_hide_one_in_a_nearer(quarter):
    # the one pixel's ray has the far robot on its right side, and the near one, beyond the next border, on its left
    nose, ahead, right = np.array([(110, 119), (0.5, 0.75**0.5), (0.75**0.5, -0.5)])
    places = np.array(
        [nose - RADIUS_CM * ahead, nose + 25.15 * ahead + 3.6 * right, nose + 23.35 * ahead - 3.6 * right]
    )
    for _ in range(quarter):
        places = np.column_stack([200 - places[:, 1], places[:, 0]])
    poses = np.column_stack([places, np.full(3, math.radians(60 + 90 * quarter))])
    parked = np.repeat([(-5e5, -5e5, 0.0)], 97, axis=0)
    for near_is_lit in (False, True):
        lit = np.array([False, not near_is_lit, near_is_lit])
        scene = Scene(np.vstack([poses, parked]), np.append(lit, np.zeros(97, bool)), empty_arena())
        block = block_of(scene, ONE_PIXEL)
        assert block.swarm.scene[0].columns == block.swarm.scene[0].rows == 10  # cells are 20 cm wide
        look(block.bytes, ADDRESSES, 0)
        assert block.swarm.pixels[0] == near_is_lit


def test_rows_are_those_of_the_slow_twin_with_and_without_what_walls_mirror():
    tally = Counter()

    @settings(max_examples=40)
    @given(scenes(robots=(1, 2, 3, 10, 60, 200), bodies=BODIES), camera_settings(), MIRRORED_CM, SEEDS)
    def compare(scene, camera, mirrored_cm, seed):
        random = np.random.default_rng(seed)
        if random.random() < 0.5 and not mirrored_cm:  # robots that push each other overlap
            scene = scene._replace(poses=scene.poses + random.uniform(-0.05, 0.05, scene.poses.shape))
        every = 1 + len(scene.poses) // 16  # of 60 robots the twin does 15
        direct, camera = rows(scene, camera), camera._replace(reflection_range_cm=mirrored_cm)
        expected, doubtful = slow_rows(scene, camera, every)
        found = rows(scene, camera)
        np.testing.assert_array_equal(found[::every][~doubtful], expected[~doubtful])
        assert (found >= direct).all()
        mirrored = (found > direct)[::every]
        tally.update(pixels=doubtful.size, doubtful=doubtful.sum(), red=direct[::every].sum(), mirrored=mirrored.sum())

    compare()
    assert tally["pixels"] > 4000
    assert min(tally["red"], tally["mirrored"]) > 0.01 * tally["pixels"]
    assert tally["doubtful"] < 0.02 * tally["pixels"]


@jit_no_alloc
def hide_every_third(block: ByteArray, addresses: IntArray, robot: int) -> None:  # noqa: ARG001
    swarm = swarm_at(block)
    robots = len(swarm.robots)
    for sender in range(robots):
        swarm.numbers[robots + sender] = 1 if swarm.robots[sender].ring_on and (robot + sender) % 3 else 0


@settings(max_examples=12)
@given(scenes(robots=(3, 10, 30)), camera_settings())
def test_rings_that_faults_hide_from_a_robot_are_dark_to_it_alone(scene, camera):
    addresses = ADDRESSES.copy()
    addresses[HIDE] = address_of(hide_every_third)
    block = block_of(scene, camera)
    block.swarm.scene[0].hides_flashes = True
    look(block.bytes, addresses, 0)
    numbers = np.arange(len(scene.poses))
    for robot in range(0, len(scene.poses), 7):
        visible = scene._replace(lit=scene.lit & ((robot + numbers) % 3 > 0))
        found = block.swarm.pixels.reshape(-1, camera.pixels)[robot]
        np.testing.assert_array_equal(found, rows(visible, camera)[robot])
