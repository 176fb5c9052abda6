"""Claims about the differential drive: exact arcs, the wheels' limit, and the noise of the wheels."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.arena import make_arena
from epuck_sim.embodied.loop import act
from epuck_sim.embodied.simulation import Simulation
from tests.embodied.bodies.worlds import MovedWorld

BASE_CM = 5.1
LIMIT_CM_S = 12.8
ARENA = make_arena(1000, 1000, [], [])

starts = st.tuples(st.floats(300, 700), st.floats(300, 700), st.floats(-10, 10))
speeds = st.floats(-LIMIT_CM_S, LIMIT_CM_S)
differences = st.builds(lambda sign, exponent: sign * 10.0**exponent, st.sampled_from([-1, 1]), st.integers(-16, -2))
wheels = st.one_of(
    st.tuples(speeds, speeds),
    speeds.map(lambda speed: (speed, speed)),
    speeds.map(lambda speed: (speed, -speed)),
    speeds.map(lambda speed: (0.0, speed)),
    speeds.map(lambda speed: (speed, 0.0)),
    st.builds(lambda speed, difference: (0.9 * speed, 0.9 * speed + difference), speeds, differences),
)


def arc(pose, left, right, seconds):
    """Return where wheels that keep their speeds take a robot: v integrated along a heading that turns."""
    x, y, heading = pose
    length, turn = (left + right) / 2 * seconds, (right - left) / BASE_CM * seconds
    ahead = length * np.sinc(turn / math.pi)  # sin(turn) / turn
    aside = length * np.sin(turn / 2) * np.sinc(turn / 2 / math.pi)  # (1 - cos(turn)) / turn
    cos, sin = math.cos(heading), math.sin(heading)
    return x + ahead * cos - aside * sin, y + ahead * sin + aside * cos, heading + turn


def driving(poses, commands, gains=1.0, slip=0.0, noise=0.0, step_s=0.1, physics_hz=100):
    """Return a world whose robots have been commanded; commands: (robots, 2) cm/s."""
    world = MovedWorld(ARENA, poses, 0.0, physics_hz)
    scene, robots = world.swarm.scene[0], world.swarm.robots
    scene.step_s, scene.slip = step_s, slip
    robots.wheel_gain, robots.wheel_noise = gains, noise
    command(world, commands)
    return world


def command(world, commands):
    """Have actuators command wheels, and carry that out."""
    actuators = world.swarm.robots.actuators
    actuators["left_cm_s"], actuators["right_cm_s"] = np.transpose(commands)
    assert act(world.block) == -1


def wheels_of(world):
    """Return (robots, 2) cm/s: left and right wheel as commanded."""
    return np.column_stack([world.swarm.robots.left_cm_s, world.swarm.robots.right_cm_s])


@pytest.mark.parametrize("timing", [(10, 100), (40, 200), (1, 50)], ids=lambda timing: "{} Hz of {} Hz".format(*timing))
@given(start=starts, commands=st.lists(wheels, max_size=9))
def test_a_robot_that_touches_nothing_ends_each_control_step_on_the_exact_arc(timing, start, commands):
    control_hz, physics_hz = timing
    world = driving([start], [(0, 0)], step_s=1 / control_hz, physics_hz=physics_hz)
    expected = start
    for left, right in commands:
        command(world, [(left, right)])
        world.advance(physics_hz // control_hz)
        expected = arc(expected, left, right, 1 / control_hz)
        np.testing.assert_allclose(world.poses[0], expected, rtol=0, atol=1e-9)


def test_scene_arc_stays_on_its_circle_for_a_minute():
    radius, rate = BASE_CM / 2 * (6 + 7) / (7 - 6), (7 - 6) / BASE_CM
    poses = np.array([step.poses[0].copy() for step, _ in zip(Simulation("arc"), range(601), strict=False)])
    angle = rate * 0.1 * np.arange(601)
    circle = np.column_stack([50 + radius * np.sin(angle), 20 + radius * (1 - np.cos(angle)), angle])
    np.testing.assert_allclose(poses, circle, rtol=0, atol=1e-9)
    assert angle[-1] > 2 * math.pi  # the circle has closed


@given(st.lists(st.tuples(st.floats(allow_nan=False), st.floats(allow_nan=False)), min_size=1, max_size=5))
def test_wheels_never_turn_faster_than_their_limit(commands):
    world = driving(np.zeros((len(commands), 3)), commands)
    np.testing.assert_array_equal(wheels_of(world), np.clip(commands, -LIMIT_CM_S, LIMIT_CM_S))
    ends = [arc((0, 0, 0), left, right, 0.1) for left, right in wheels_of(world)]
    np.testing.assert_allclose(world.velocities * 0.1, ends, rtol=0, atol=1e-9)


@pytest.mark.parametrize("part", ["left_cm_s", "right_cm_s", "turn_rad"])
def test_a_command_that_is_not_a_number_is_reported_with_its_robot(part):
    world = driving(np.zeros((4, 3)), np.zeros((4, 2)))
    world.swarm.robots.actuators[part][2:] = np.nan
    assert act(world.block) == 2


@given(start=starts, wheels=wheels, gains=st.tuples(st.floats(0, 2), st.floats(0, 2)))
def test_a_wheel_with_a_gain_turns_that_much_faster_and_its_command_is_reported_as_given(start, wheels, gains):
    world = driving([start], [wheels], gains)
    np.testing.assert_array_equal(wheels_of(world), [wheels])
    expected = arc(start, wheels[0] * gains[0], wheels[1] * gains[1], 0.1)
    np.testing.assert_allclose(world.poses + world.velocities * 0.1, [expected], rtol=0, atol=1e-9)


def test_a_turn_on_the_spot_comes_before_the_arc():
    world = driving([(500, 500, 1)], [(3, 4)])
    world.swarm.robots.actuators["turn_rad"] = 0.5
    assert act(world.block) == -1
    expected = arc((500, 500, 1.5), 3, 4, 0.1)
    np.testing.assert_allclose(world.poses + world.velocities * 0.1, [expected], rtol=0, atol=1e-9)


def test_noise_makes_each_wheel_faster_or_slower_by_up_to_the_slip():
    noise = np.random.default_rng(1).random((3, 2))
    slipping = driving(np.zeros((3, 3)), np.full((3, 2), 5.0), slip=0.05, noise=noise)
    exact = driving(np.zeros((3, 3)), 5.0 * (1 + 0.05 * (2 * noise - 1)))
    np.testing.assert_allclose(slipping.velocities, exact.velocities, rtol=1e-14)


def test_rings_are_lit_as_commanded_and_seen_as_they_were():
    world = driving(np.zeros((2, 3)), np.zeros((2, 2)))
    robots = world.swarm.robots
    robots.actuators["ring_on"] = [0, 7]
    act(world.block)
    assert robots.ring_command.tolist() == robots.ring_on.tolist() == [False, True]
    assert not robots.ring_before.any()


# --- noise of the wheels ----------------------------------------------------------------------------
