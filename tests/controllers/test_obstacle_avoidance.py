"""The motion does what thesis Appendix B says: rule by rule, then beside its C listing."""

import numpy as np
import pytest

from epuck_sim.epuck import OUT_OF_RANGE_MM
from epuck_sim.testing import TestRobot
from epuck_sim.util.rng import randint
from tests.control.bench import Bench, random_distances

FRONT_RIGHT, RIGHT, LEFT, FRONT_LEFT = 0, 2, 5, 7
AHEAD, TURN_LEFT, TURN_RIGHT = (12.8, 12.8), (-12.8, 12.8), (12.8, -12.8)


class Robot(TestRobot):
    def wheels(self, **distance_mm):
        """Return the wheels' speeds after a step with e.g. `front_left=10`, and nothing else near."""
        self.distance_mm = OUT_OF_RANGE_MM
        for name, distance in distance_mm.items():
            self.distance_mm[globals()[name.upper()]] = distance
        self.step()
        return self.left_cm_s, self.right_cm_s


def robot(**parameters):
    return Robot("obstacle_avoidance", parameters)


# --- rule by rule ---------------------------------------------------------------------------------


def test_a_robot_drives_straight_ahead_and_turns_away_from_what_is_close_in_front():
    for speed_cm_s, near, wheels in [
        # with nothing near, straight ahead at its speed, and a speed below 1 mm/s keeps its fraction
        *((mm_s / 10, {}, (mm_s / 10, mm_s / 10)) for mm_s in (5, 7, 10, 14, 21, 30, 43, 62, 89, 128)),
        (0.03125, {}, (0.03125, 0.03125)),
        # an obstacle in front turns it on the spot away from it; what is not to the right of ahead counts as left
        (3.0, {"front_left": 10}, TURN_RIGHT),
        (3.0, {"front_right": 10}, TURN_LEFT),
        (3.0, {"front_left": 5, "front_right": 20}, TURN_RIGHT),
        (3.0, {"front_left": 20, "front_right": 5}, TURN_LEFT),
        (3.0, {"front_left": 10, "front_right": 10}, TURN_RIGHT),
        # one beside it does not stop it
        (12.8, {"left": 0}, AHEAD),
        (12.8, {"right": 0}, AHEAD),
        # nearer than 30 mm is close
        (12.8, {"front_left": 29, "front_right": 29}, TURN_RIGHT),
        *((12.8, {"front_left": mm, "front_right": mm}, AHEAD) for mm in (30, 100, OUT_OF_RANGE_MM)),
    ]:
        assert robot(speed_cm_s=speed_cm_s).wheels(**near) == wheels


def test_a_turn_goes_on_for_one_step_after_the_obstacle_has_gone():
    turning = robot()
    assert turning.wheels(front_left=10) == TURN_RIGHT
    assert turning.wheels() == TURN_RIGHT
    assert turning.wheels() == AHEAD


@pytest.mark.parametrize("steps", [1, 2, 25])
def test_a_rotation_goes_on_until_its_time_has_run_out(steps):
    turning = robot()
    turning.memory.rotation_time, turning.memory.left_mm_s, turning.memory.right_mm_s = steps, -128, 128
    assert [turning.wheels() for _ in range(steps + 1)] == [TURN_LEFT] * steps + [AHEAD]


@pytest.mark.parametrize(
    ("rotation_cm_s", "second", "third"),
    [
        (12.8, (0, 0), (-64, 64)),
        (12.7, (0, 0), (-63, 63)),  # -127 / 2 is -63
        (0.3, (0, 0), (-1, 1)),
    ],
)
def test_an_obstacle_that_stays_turns_the_robot_through_a_low_pass(rotation_cm_s, second, third):
    """It changes its side, and the wheels do not jump."""
    turning = robot(rotation_speed_cm_s=rotation_cm_s)
    turning.wheels(front_left=10)
    for mm_s in (second, third):
        assert turning.wheels(front_right=10) == (mm_s[0] / 10, mm_s[1] / 10)


def beside_a_wall(threshold, seed=1):
    """Return a robot that met something ahead and since then has had it `threshold` steps beside it."""
    near_wall = Robot("obstacle_avoidance", {"proximity_count_threshold": threshold}, seed=seed)
    near_wall.wheels(front_right=10)
    for _ in range(threshold):
        near_wall.wheels(right=5)
    return near_wall


@pytest.mark.parametrize("threshold", [1, 5])
def test_more_than_so_many_steps_close_to_something_and_it_is_a_wall_and_what_has_gone_is_forgotten(threshold):
    for distances, is_wall in (({"right": 5}, True), ({}, False)):
        near_wall = beside_a_wall(threshold)
        assert (near_wall.memory.proximity_count, near_wall.memory.rotation_time) == (threshold, 0)
        assert near_wall.wheels(**distances) == (TURN_LEFT if is_wall else AHEAD)
        assert near_wall.memory.proximity_count == 0
        assert 0 <= near_wall.memory.rotation_time < 25


def test_at_a_wall_the_robot_turns_for_a_random_time_of_up_to_25_steps():
    """Over many robots every length from 1 to 25 steps comes up, and none else."""
    lengths = set()
    for seed in range(120):
        near_wall = beside_a_wall(5, seed)
        turns = [near_wall.wheels(right=5)] + [near_wall.wheels() for _ in range(30)]
        length = turns.index(AHEAD)
        assert turns == [TURN_LEFT] * length + [AHEAD] * (31 - length)
        lengths.add(length)
    assert lengths == set(range(1, 26))


# --- beside Appendix B's C ------------------------------------------------------------------------


def over(dividend, divisor):
    return dividend // divisor if dividend >= 0 else -(-dividend // divisor)


class AppendixB:
    """The C listing, line by line; facts that it leaves open are its arguments."""

    # the components are in hundredths, so that products are divided by 100; y is positive to the right
    ANGLE_COMPONENT_X = (96, 70, 0, -88, -88, 0, 70, 96)
    ANGLE_COMPONENT_Y = (30, 72, 100, 48, -48, -100, -72, -30)

    def __init__(self, rand_mod, vel=128, max_speed=128, prox_thres=70, prox_count_thres=5):
        """rand_mod: the next rand() % rotMax."""
        self.rand_mod, self.vel, self.max = rand_mod, vel, max_speed
        self.prox_thres, self.prox_count_thres = prox_thres, prox_count_thres
        self.left = self.right = 0
        self.rot_time = self.prox_count = 0

    def motion_algorithm(self, sys_get_prox):
        proximity_values = [0 if prox > 100 else 100 - prox for prox in sys_get_prox]
        prox_x = prox_y = 0
        for i in range(5, 11):
            j = i % 8
            if proximity_values[j] > self.prox_thres:
                prox_x += over(proximity_values[j] * self.ANGLE_COMPONENT_X[j], 100)
                prox_y += over(proximity_values[j] * self.ANGLE_COMPONENT_Y[j], 100)
        self.calculate_motor_speed(prox_x, prox_y)

    def calculate_motor_speed(self, x, y):
        if self.rot_time > 0 or self.prox_count > 0:
            if abs(x) > self.prox_thres or abs(y) > self.prox_thres:
                self.prox_count += 1
            else:
                self.prox_count = 0
        rot_dir = 1 if y > 0 else -1
        if self.prox_count > self.prox_count_thres:
            self.left = -self.max * rot_dir
            self.right = self.max * rot_dir
            self.rot_time += 1 + self.rand_mod()
            self.prox_count = 0
        if x > self.prox_thres:
            if self.prox_count == 0:
                self.left = -self.max * rot_dir
                self.right = self.max * rot_dir
            else:
                self.left = over(self.left, 2) - over(self.max * rot_dir, 2)
                self.right = over(self.right, 2) + over(self.max * rot_dir, 2)
            self.rot_time = 1
        elif self.rot_time == 0:
            self.right = self.left = self.vel
        else:
            self.rot_time -= 1


def drive(distances, rotation_max=25, **c_constants):
    """Drive robots past `distances`, (steps, robots, 8) mm, by both; compare them at each step."""
    c_constants = {"vel": 128, "max_speed": 128, "prox_thres": 70, "prox_count_thres": 5} | c_constants
    given_ = {
        "speed_cm_s": c_constants["vel"] / 10,
        "rotation_speed_cm_s": c_constants["max_speed"] / 10,
        "proximity_threshold": c_constants["prox_thres"],
        "proximity_count_threshold": c_constants["prox_count_thres"],
        "rotation_max": rotation_max,
    }
    robots = distances.shape[1]
    bench = Bench("obstacle_avoidance", given_, robots=robots, interpret=False)
    streams = bench.streams.copy()
    expected = [AppendixB(lambda stream=stream: randint(stream, rotation_max), **c_constants) for stream in streams]
    for number, row in enumerate(distances):
        bench.senses.distance_mm[:] = row
        bench.control.step()
        for c_robot, distance in zip(expected, row.tolist(), strict=True):
            c_robot.motion_algorithm(distance)
        wheels = [(c.left / 10, c.right / 10) for c in expected]
        remembered = [(c.rot_time, c.prox_count, c.left, c.right) for c in expected]
        assert bench.actuators[["left_cm_s", "right_cm_s"]].tolist() == wheels, f"step {number}"
        assert bench.memory.tolist() == remembered, f"step {number}"
    assert (bench.streams == streams).all(), "both drew as often"
    assert (streams != Bench("obstacle_avoidance", robots=robots).streams).any(), "walls were met"


def wandering(steps, robots, seed=3):
    """Return (steps, robots, 8) mm: what is near stays for a while, as walls do."""
    chance = np.random.default_rng(seed)
    distances = random_distances(chance, (steps, robots, 8))
    for step in range(1, steps):
        stays = chance.random((robots, 1)) < 0.6
        distances[step] = np.where(stays, distances[step - 1], distances[step])
    return distances


@pytest.mark.parametrize(
    "constants",
    [
        {},
        {"vel": 7, "max_speed": 127},
        {"vel": 0, "max_speed": 1, "prox_thres": 0, "rotation_max": 1},
        {"vel": 43, "max_speed": 51, "prox_thres": 40, "prox_count_thres": 0, "rotation_max": 100},
        {"prox_thres": 85, "prox_count_thres": 2},
    ],
    ids=str,
)
def test_long_drives_are_appendix_b_s(constants):
    drive(wandering(800, 20), **constants)
