"""Fireflies flash as `oscillator` does and move in ways of their own, and neither depends on the other."""

import math

import numpy as np
import pytest
from scipy import stats

from epuck_sim.epuck import OUT_OF_RANGE_MM
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.testing import TestRobot
from epuck_sim.trial.model import run_trial, simulate
from tests.control.bench import Bench, settings
from tests.particles.distributions import UNLIKELY

MOTIONS = {"firefly": "obstacle_avoidance", "walking_firefly": "random_walk", "reorienting_firefly": "reorientation"}
"""Controllers that are an oscillator and this one at once."""

WHEELS = ["left_cm_s", "right_cm_s"]


@pytest.mark.parametrize("name", [*MOTIONS, "pushing", "switching", "varied_firefly"])
def test_a_firefly_flashes_as_an_oscillator_that_nothing_is_near_and_moves_as_its_motion_does_blindly(name):
    chance = np.random.default_rng(4)
    firefly, oscillator = (Bench(each, robots=10) for each in (name, "oscillator"))
    motion = Bench(MOTIONS[name], robots=10) if name in MOTIONS else None
    oscillator.memory["phase_ms"] = firefly.memory["phase_ms"]
    if motion:
        motion.streams[:] = firefly.streams  # after the phases were drawn
    for _ in range(120):
        firefly.sense(chance)
        oscillator.sense_like(firefly)
        oscillator.senses.distance_mm[:], oscillator.senses.infrared[:] = OUT_OF_RANGE_MM, 0
        firefly.control.step()
        oscillator.control.step()
        assert (firefly.actuators["ring_on"] == oscillator.actuators["ring_on"]).all()
        assert (firefly.memory["phase_ms"] == oscillator.memory["phase_ms"]).all()
        if motion:
            motion.sense_like(firefly)
            motion.senses.camera[:] = 0
            motion.control.step()
            assert (firefly.actuators[WHEELS] == motion.actuators[WHEELS]).all()
            assert (firefly.streams == motion.streams).all()


@pytest.mark.parametrize(("name", "motion"), MOTIONS.items())
def test_a_firefly_has_the_parameters_of_both_parts_with_their_defaults(name, motion):
    assert vars(settings(name)) == vars(settings(motion)) | vars(settings("oscillator"))


@pytest.mark.parametrize("name", ["switching", "varied_firefly"])
def test_with_a_speed_of_its_own_a_firefly_turns_away_from_walls_as_fast_as_ever(name):
    robot = TestRobot(name, speed_cm_s=2)
    if name == "switching":
        robot.memory.flashes_in_window = 5
    robot.distance_mm[0] = 10
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (-12.8, 12.8)


IN_WINDOW_MS, ELSEWHERE_MS = 300, 2000


def flash_at(robot: TestRobot, phase_ms: int) -> None:
    """Have the robot see a flash at a phase, and nothing before and after."""
    robot.memory.phase_ms = phase_ms
    robot.camera[:] = 1
    robot.step()
    robot.camera[:] = 0
    robot.step()


@pytest.fixture(params=[True, False], ids=["interpreted", "compiled"])
def switching(request) -> TestRobot:
    return TestRobot("switching", speed_cm_s=8, slow_cm_s=0.5, flashes_to_settle=3, interpret=request.param)


def test_it_is_slow_after_flashes_in_a_row_in_its_window_and_fast_after_one_elsewhere(switching):
    for phase_ms, speed in (
        *((IN_WINDOW_MS, 8), (IN_WINDOW_MS, 8), (ELSEWHERE_MS, 8)),
        *((IN_WINDOW_MS, 8), (IN_WINDOW_MS, 8), (IN_WINDOW_MS, 0.5), (IN_WINDOW_MS, 0.5), (ELSEWHERE_MS, 8)),
    ):
        flash_at(switching, phase_ms)
        assert (switching.left_cm_s, switching.right_cm_s) == (speed, speed)


def test_a_flash_that_lasts_counts_once_and_one_that_makes_it_fire_is_in_its_window(switching):
    switching.memory.phase_ms = 0
    switching.camera[:] = 1
    switching.step(4)
    assert switching.memory.flashes_in_window == 1
    switching.camera[:] = 0
    switching.step()
    flash_at(switching, 4800)  # times 1.1 it passes the period
    assert switching.memory.flashes_in_window == 2


VARIED = {"speed_cm_s": 2.0, "speed_spread": 0.5}


def speeds_of(robot: TestRobot, steps: int) -> list[float]:
    speeds = []
    for _ in range(steps):
        robot.step()
        assert robot.left_cm_s == robot.right_cm_s
        speeds.append(robot.left_cm_s)
    return speeds


def is_lognormal(speeds: list[float]) -> bool:
    sd = math.sqrt(math.log(1 + 0.5**2))
    return stats.kstest(speeds, "lognorm", args=(sd, 0, 2.0 * math.exp(-(sd**2) / 2))).pvalue > UNLIKELY


def test_robots_draw_lognormal_speeds_and_keep_them_and_without_spread_have_the_mean():
    speeds = [speeds_of(TestRobot("varied_firefly", VARIED, seed=seed), 2) for seed in range(150)]
    assert is_lognormal([first for first, _ in speeds])
    assert all(first == second for first, second in speeds)
    assert speeds_of(TestRobot("varied_firefly", VARIED | {"speed_spread": 0}), 1) == [2.0]


def test_a_robot_draws_a_new_speed_after_exponential_times():
    speeds = speeds_of(TestRobot("varied_firefly", VARIED, new_speed_s=0.5, seed=1, interpret=False), 1500)
    changed = np.flatnonzero(np.diff(speeds))
    assert is_lognormal([speeds[step] for step in changed])
    expected = len(speeds) * (1 - math.exp(-0.1 / 0.5))
    assert abs(len(changed) - expected) < 4 * math.sqrt(expected)


CYCLES_PER_HOUR = 720
LIT_S = 0.4  # of the steps at phases 0, 100, 200 and 300 ms


def test_it_drives_while_it_is_lit_and_stands_else():
    robot = TestRobot("pushing", speed_cm_s=3)
    robot.memory.phase_ms = 4800
    lit = []
    for _ in range(60):
        robot.step()
        assert (robot.left_cm_s, robot.right_cm_s) == ((3, 3) if robot.ring_on else (0, 0))
        lit.append(bool(robot.ring_on))
    assert sum(lit) == 8
    assert lit[1:5] == [True] * 4


@pytest.mark.parametrize("needed", [1, 2, 3, 4])
def test_a_disc_moves_at_the_flashes_of_as_many_as_it_takes(needed):
    """The claim of docs/open_questions.md: who flashes at once adds forces, who flashes at other times does not."""
    changes = {"arena.movables.0.friction": (needed - 0.5) * 0.5 / 9.81}  # times 1 kg
    changes |= {"robots.0.parameters.coupling": 0.000001, "noise": "off", "stop.max_cycles": 30}
    for together in {max(needed - 1, 1), needed}:
        changes["robots.0.memory"] = {"phase_ms": [2500] * together + [1500, 500, 3500][: 4 - together]}
        scenario = load_scenario("pushing", [f"{key}={value}" for key, value in changes.items()])
        share = run_trial(simulate(scenario, 1)).measures["moved"] / (CYCLES_PER_HOUR * LIT_S * 2)
        # of 30 cycles, up to 14 are over before all have come as far as the disc
        assert 0.4 < share < 1 if together == needed else share < 0.01
