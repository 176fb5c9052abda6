"""The motion does what thesis Appendix B says: it is compared with its C listing."""

import numpy as np
import pytest

from epuck_sim.testing import TestRobot
from epuck_sim.util.rng import randint
from tests.control.bench import Bench, random_distances


def test_a_speed_below_1_mm_s_keeps_its_fraction():
    robot = TestRobot("obstacle_avoidance", {"speed_cm_s": 0.03125})
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (0.03125, 0.03125)


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


CONSTANTS = {
    "vel": ("speed_cm_s", 10),
    "max_speed": ("rotation_speed_cm_s", 10),
    "prox_thres": ("proximity_threshold", 1),
    "prox_count_thres": ("proximity_count_threshold", 1),
}
"""Parameters for the listing's constants, by their names there, and how many of its units make one of theirs."""


def drive(distances, rotation_max=25, **c_constants):
    """Drive robots past `distances`, (steps, robots, 8) mm, by both; compare them at each step."""
    given_ = {name: c_constants[own] / unit for own, (name, unit) in CONSTANTS.items() if own in c_constants}
    given_ |= {"rotation_max": rotation_max} if rotation_max != 25 else {}
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
        {"max_speed": 3},
        {"vel": 0, "max_speed": 1, "prox_thres": 0, "rotation_max": 1},
        {"vel": 43, "max_speed": 51, "prox_thres": 40, "prox_count_thres": 0, "rotation_max": 100},
        {"prox_thres": 85, "prox_count_thres": 2},
    ],
    ids=str,
)
def test_long_drives_are_appendix_b_s(constants):
    drive(wandering(800, 20), **constants)
