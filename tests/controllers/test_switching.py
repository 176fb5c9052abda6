"""`switching` goes slowly once it has seen flashes with its own, and fast again after one at another time."""

import pytest

from epuck_sim.testing import TestRobot
from tests.control.bench import settings

IN_WINDOW_MS, ELSEWHERE_MS = 300, 2000


def flash_at(robot: TestRobot, phase_ms: int) -> None:
    """Have the robot see a flash at a phase, and nothing before and after."""
    robot.memory.phase_ms = phase_ms
    robot.camera[:] = 1
    robot.step()
    robot.camera[:] = 0
    robot.step()


@pytest.fixture(params=[True, False], ids=["interpreted", "compiled"])
def robot(request) -> TestRobot:
    return TestRobot("switching", speed_cm_s=8, slow_cm_s=0.5, flashes_to_settle=3, interpret=request.param)


def test_it_is_slow_after_flashes_in_its_window_and_fast_after_one_elsewhere(robot):
    for flashes in range(6):
        expected = 0.5 if flashes >= 3 else 8
        robot.step()
        assert (robot.left_cm_s, robot.right_cm_s) == (expected, expected)
        flash_at(robot, IN_WINDOW_MS)
    flash_at(robot, ELSEWHERE_MS)
    assert robot.left_cm_s == robot.right_cm_s == 8


def test_only_flashes_in_a_row_count(robot):
    for phase_ms in (IN_WINDOW_MS, IN_WINDOW_MS, ELSEWHERE_MS, IN_WINDOW_MS, IN_WINDOW_MS):
        flash_at(robot, phase_ms)
    assert robot.left_cm_s == 8
    flash_at(robot, IN_WINDOW_MS)
    assert robot.left_cm_s == 0.5


def test_a_flash_that_lasts_counts_once(robot):
    robot.memory.phase_ms = 0
    robot.camera[:] = 1
    robot.step(4)
    assert robot.memory.flashes_in_window == 1


def test_a_flash_that_makes_it_fire_is_in_its_window(robot):
    flash_at(robot, 4800)  # times 1.1 it passes the period
    assert robot.memory.flashes_in_window == 1


def test_it_turns_away_from_walls_as_fast_as_ever(robot):
    for _ in range(3):
        flash_at(robot, IN_WINDOW_MS)
    robot.distance_mm[0] = 10
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (-12.8, 12.8)


@pytest.mark.parametrize(("name", "value"), [("slow_cm_s", 12.9), ("flashes_to_settle", 0), ("coupling", 0.0)])
def test_it_refuses_what_makes_no_sense(name, value):
    with pytest.raises(ValueError, match=rf"^{name} is {value}; allowed: "):
        settings("switching", **{name: value})
