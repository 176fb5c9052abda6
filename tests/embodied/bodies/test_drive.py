"""Claims about the differential drive: exact arcs, the wheels' limit, and the noise of the wheels."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim.arena import make_arena
from epuck_sim.embodied.loop import act
from tests.embodied.bodies.worlds import MovedWorld

BASE_CM = 5.1
LIMIT_CM_S = 12.8
ARENA = make_arena(1000, 1000, [], [])

starts = st.tuples(st.floats(300, 700), st.floats(300, 700), st.floats(-10, 10))
speeds = st.floats(-LIMIT_CM_S, LIMIT_CM_S)
differences = st.builds(lambda sign, exponent: sign * 10.0**exponent, st.sampled_from([-1, 1]), st.integers(-16, -2))
wheels = st.one_of(
    st.tuples(speeds, speeds),
    *(
        speeds.map(lambda speed, sides=sides: (sides[0] * speed, sides[1] * speed))
        for sides in ((1, 1), (1, -1), (0, 1))
    ),
    st.builds(lambda speed, difference: (0.9 * speed, 0.9 * speed + difference), speeds, differences),
)
gains = st.just((1.0, 1.0)) | st.tuples(st.floats(0, 2), st.floats(0, 2))


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


@pytest.mark.parametrize("part", ["left_cm_s", "right_cm_s", "turn_rad"])
def test_a_command_that_is_not_a_number_is_reported_with_its_robot(part):
    world = world_of(np.zeros((4, 3)))
    world.swarm.robots.actuators[part][2:] = np.nan
    assert act(world.block) == 2


def test_a_turn_on_the_spot_comes_before_the_arc_and_rings_are_lit_at_once():
    world = world_of([(500, 500, 1)])
    world.swarm.robots.actuators["ring_on"] = 7
    command(world, [(3, 4)], turn_rad=0.5)
    expected = arc((500, 500, 1.5), 3, 4)
    np.testing.assert_allclose(world.poses + world.velocities * 0.1, [expected], rtol=0, atol=1e-9)
    assert (world.swarm.robots.ring_on, world.swarm.robots.ring_command) == (True, True)


def test_noise_makes_each_wheel_faster_or_slower_by_up_to_the_slip():
    noise = np.random.default_rng(1).random((3, 2))
    slipping, exact = world_of(np.zeros((3, 3)), slip=0.05), world_of(np.zeros((3, 3)))
    slipping.swarm.robots.wheel_noise = noise
    command(slipping, np.full((3, 2), 5.0))
    command(exact, 5.0 * (1 + 0.05 * (2 * noise - 1)))
    np.testing.assert_allclose(slipping.velocities, exact.velocities, rtol=1e-14)
