"""`varied_firefly` draws lognormal speeds of the mean and spread asked for, once or again and again."""

import math

import numpy as np
import pytest
from scipy import stats

from epuck_sim.testing import TestRobot
from tests.particles.distributions import UNLIKELY

MEAN_CM_S, SPREAD = 2.0, 0.5


def speed_of(robot: TestRobot) -> float:
    robot.step()
    assert robot.left_cm_s == robot.right_cm_s
    return robot.left_cm_s


def is_lognormal(speeds: list[float]) -> bool:
    sd = math.sqrt(math.log(1 + SPREAD**2))
    return stats.kstest(speeds, "lognorm", args=(sd, 0, MEAN_CM_S * math.exp(-(sd**2) / 2))).pvalue > UNLIKELY


def test_robots_draw_lognormal_speeds_and_keep_them():
    robots = [TestRobot("varied_firefly", speed_cm_s=MEAN_CM_S, speed_spread=SPREAD, seed=seed) for seed in range(300)]
    speeds = [speed_of(robot) for robot in robots]
    assert is_lognormal(speeds)
    assert [speed_of(robot) for robot in robots[:10]] == speeds[:10]


def test_a_robot_draws_a_new_speed_after_exponential_times():
    robot = TestRobot(
        "varied_firefly", speed_cm_s=MEAN_CM_S, speed_spread=SPREAD, new_speed_s=0.5, seed=1, interpret=False
    )
    speeds = [speed_of(robot) for _ in range(5000)]
    changed = np.flatnonzero(np.diff(speeds))
    assert is_lognormal([speeds[step] for step in changed])
    expected = len(speeds) * (1 - math.exp(-0.1 / 0.5))
    assert abs(len(changed) - expected) < 4 * math.sqrt(expected)


def test_without_spread_it_is_a_firefly():
    assert speed_of(TestRobot("varied_firefly", speed_cm_s=MEAN_CM_S, speed_spread=0)) == MEAN_CM_S


def test_it_turns_away_from_walls_as_fast_as_ever():
    robot = TestRobot("varied_firefly", speed_cm_s=MEAN_CM_S)
    robot.distance_mm[0] = 10
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (-12.8, 12.8)


@pytest.mark.parametrize(("name", "value"), [("speed_spread", -0.1), ("speed_spread", 11.0), ("new_speed_s", -1.0)])
def test_what_makes_no_sense_is_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} is {value}; allowed"):
        TestRobot("varied_firefly", {name: value})
