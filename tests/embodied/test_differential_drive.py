"""Claims about the differential drive: exact arcs, the wheels' limit, and the noise of the wheels."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.arena import make_arena
from epuck_sim.control.interface import ACTUATORS
from epuck_sim.embodied.differential_drive import apply_commands, chord_velocities
from epuck_sim.embodied.rigid_bodies import World
from epuck_sim.embodied.simulation import Simulation

BASE_CM = 5.1
LIMIT_CM_S = 12.8

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


@pytest.mark.parametrize("timing", [(10, 100), (40, 200), (1, 50)], ids=lambda timing: "{} Hz of {} Hz".format(*timing))
@given(start=starts, commands=st.lists(wheels, max_size=9))
def test_a_robot_that_touches_nothing_ends_each_control_step_on_the_exact_arc(timing, start, commands):
    control_hz, physics_hz = timing
    world = World(make_arena(1000, 1000, [], []), np.array([start]), 0.0, physics_hz)
    expected = start
    for left, right in commands:
        wheel_speeds = np.array([(left, right)])
        still = np.zeros((1, 2))
        chord_velocities(
            world.poses, np.zeros(1), wheel_speeds, still + 1, still, 0.0, 1 / control_hz, world.velocities
        )
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
    robots = len(commands)
    actuators = np.zeros(robots, ACTUATORS)
    actuators["left_cm_s"], actuators["right_cm_s"] = np.transpose(commands)
    poses, driven, velocities = np.zeros((robots, 3)), np.full((robots, 2), np.nan), np.zeros((robots, 3))
    gain, noise = np.ones((robots, 2)), np.zeros((1, robots, 2))
    invalid = apply_commands(
        actuators, driven, np.zeros(robots, bool), np.zeros(robots), poses, gain, 0.0, 0.1, velocities, noise, 0
    )
    assert invalid == -1
    np.testing.assert_array_equal(driven, np.clip(commands, -LIMIT_CM_S, LIMIT_CM_S))
    ends = [arc((0, 0, 0), left, right, 0.1) for left, right in driven]
    np.testing.assert_allclose(velocities * 0.1, ends, rtol=0, atol=1e-9)


@pytest.mark.parametrize("command", ["left_cm_s", "right_cm_s", "turn_rad"])
def test_a_command_that_is_not_a_number_is_reported_with_its_robot(command):
    actuators = np.zeros(4, ACTUATORS)
    actuators[command][2:] = np.nan
    arrays = np.zeros((4, 2)), np.zeros(4, bool), np.zeros(4), np.zeros((4, 3)), np.ones((4, 2))
    assert apply_commands(actuators, *arrays, 0.0, 0.1, np.zeros((4, 3)), np.zeros((1, 4, 2)), 0) == 2


@given(start=starts, command=wheels, gains=st.tuples(st.floats(0, 2), st.floats(0, 2)))
def test_a_wheel_with_a_gain_turns_that_much_faster_and_its_command_is_reported_as_given(start, command, gains):
    actuators, driven, velocities = np.zeros(1, ACTUATORS), np.empty((1, 2)), np.empty((1, 3))
    actuators["left_cm_s"], actuators["right_cm_s"] = command
    poses, noise = np.array([start]), np.zeros((1, 1, 2))
    apply_commands(
        actuators, driven, np.zeros(1, bool), np.zeros(1), poses, np.array([gains]), 0.0, 0.1, velocities, noise, 0
    )
    np.testing.assert_array_equal(driven, [command])
    expected = arc(start, command[0] * gains[0], command[1] * gains[1], 0.1)
    np.testing.assert_allclose(poses + velocities * 0.1, [expected], rtol=0, atol=1e-9)


def test_the_noise_of_the_given_step_is_used():
    actuators, velocities, expected = np.zeros(3, ACTUATORS), np.empty((3, 3)), np.empty((3, 3))
    actuators["left_cm_s"], actuators["right_cm_s"] = 5.0, -3.0
    driven, poses, gain = np.empty((3, 2)), np.zeros((3, 3)), np.ones((3, 2))
    noise = np.random.default_rng(1).random((4, 3, 2))
    for step in range(4):
        apply_commands(
            actuators, driven, np.zeros(3, bool), np.zeros(3), poses, gain, 0.05, 0.1, velocities, noise, step
        )
        chord_velocities(poses, np.zeros(3), driven, gain, noise[step], 0.05, 0.1, expected)
        np.testing.assert_array_equal(velocities, expected)


# --- noise of the wheels ----------------------------------------------------------------------------

SPIN_CM_S = 5.0


def _factors(slip, steps=400):
    """Return (steps, robots, 2) by what each wheel's speed was multiplied, found from how 25 spinning robots moved."""
    group = {"count": 25, "placement": "grid", "controller": "constant"}
    group["parameters"] = {"left_cm_s": -SPIN_CM_S, "right_cm_s": SPIN_CM_S}
    simulation = Simulation({"robots": [group], "noise": {"wheel_speed": slip, "infrared_counts": 0}}, 3)
    poses = np.array([step.poses.copy() for step, _ in zip(simulation, range(steps + 1), strict=False)])
    dx, dy, turn = np.moveaxis(np.diff(poses, axis=0), 2, 0)
    middle = poses[:-1, :, 2] + turn / 2
    ahead = (dx * np.cos(middle) + dy * np.sin(middle)) * (turn / 2) / np.sin(turn / 2)
    left, right = (ahead - turn * BASE_CM / 2) / 0.1, (ahead + turn * BASE_CM / 2) / 0.1
    return np.stack([left / -SPIN_CM_S, right / SPIN_CM_S], axis=2)


@pytest.mark.parametrize("slip", [0.05, 0.3])
def test_wheel_noise_is_a_uniform_factor_around_one(slip):
    factors = _factors(slip)
    assert 1 - slip - 1e-9 <= factors.min() < 1 - 0.99 * slip
    assert 1 + 0.99 * slip < factors.max() <= 1 + slip + 1e-9
    for wheel in (0, 1):
        counts, _ = np.histogram(factors[..., wheel], bins=20, range=(1 - slip - 1e-9, 1 + slip + 1e-9))
        expected = factors[..., wheel].size / 20
        assert ((counts - expected) ** 2 / expected).sum() < 43.8  # chi-square, 19 degrees of freedom, 99.9 %


def test_wheel_noise_is_drawn_anew_for_each_wheel_robot_and_step():
    factors = _factors(0.05)
    pairs = {
        "wheels": (factors[..., 0], factors[..., 1]),
        "robots": (factors[:, :-1], factors[:, 1:]),
        "steps": (factors[:-1], factors[1:]),
        "blocks of 16 steps": (factors[:-16], factors[16:]),
    }
    for name, (one, other) in pairs.items():
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 4 / math.sqrt(one.size), name


def test_without_wheel_noise_wheels_turn_as_commanded():
    np.testing.assert_allclose(_factors(0.0, steps=20), 1, rtol=0, atol=1e-9)
