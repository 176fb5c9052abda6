"""`random_walk` goes straight ahead for runs of its distribution, and turns on the spot at their ends."""

import math

import numpy as np
import pytest
from scipy import stats

from epuck_sim.control.interface import Wheels
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.epuck import WHEEL_BASE_CM
from epuck_sim.testing import TestRobot
from epuck_sim.util.seeds import robot_streams
from tests.control.bench import function, settings
from tests.particles.distributions import UNLIKELY

STEP_S = 0.1


def runs_and_turns(count: int, **parameters) -> tuple[np.ndarray, np.ndarray]:
    """Return s: durations of the runs, and rad: angles of the turns, of one robot far from everything."""
    robot = TestRobot("random_walk", parameters, seed=4, interpret=False)
    runs, turns = [0.0], [0.0]
    was_turning = False
    while len(turns) <= count:
        robot.step()
        angle = (robot.right_cm_s - robot.left_cm_s) / WHEEL_BASE_CM * STEP_S
        if angle and not was_turning:
            turns.append(0.0)
        if was_turning and not angle:
            runs.append(0.0)
        if angle:
            turns[-1] += angle
        else:
            runs[-1] += STEP_S
        was_turning = bool(angle)
    return np.array(runs[1:-1]), np.array(turns[1:-1])


@pytest.mark.parametrize("persistence", [0.0, 0.7])
def test_turns_are_wrapped_cauchy_and_runs_exponential(persistence):
    runs, turns = runs_and_turns(400, run_s=2.0, persistence=persistence)
    angles = np.abs(turns)
    cauchy = stats.uniform(0, math.pi).cdf if persistence == 0 else lambda a: 2 * stats.wrapcauchy(persistence).cdf(a)
    assert stats.kstest(angles, cauchy).pvalue > UNLIKELY
    assert 0.4 < (turns > 0).mean() < 0.6
    steps = np.random.default_rng(0).uniform(-STEP_S, 0, len(runs))  # a run ends at the end of a step
    assert stats.kstest(runs + steps, "expon", args=(0, 2.0)).pvalue > UNLIKELY


def test_runs_of_a_levy_walk_have_a_power_law():
    draw, parameters = function("run_ms", "random_walk"), settings("random_walk", run_s=2.0, exponent=2.5)
    (stream,) = robot_streams(np.random.SeedSequence(4), 1)
    runs = [draw(parameters, stream) / 1000 for _ in range(20_000)]
    assert stats.kstest(runs, "pareto", args=(1.5, 0, 2.0)).pvalue > UNLIKELY


def test_it_avoids_what_is_near_and_then_goes_on_with_its_turn_by_its_own_wheels():
    wheels = Wheels(limit_cm_s=1.0, base_cm=2.5)
    robot = TestRobot("random_walk", {"speed_cm_s": 0.5}, wheels=wheels)
    robot.memory.turn_left_rad = 2.0
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (-1, 1)
    left = robot.memory.turn_left_rad
    assert left == pytest.approx(2.0 - 2 * 1 / 2.5 * STEP_S)
    robot.distance_mm[7] = 10  # front-left: it turns right
    robot.step()
    assert robot.left_cm_s > 0 > robot.right_cm_s
    assert robot.memory.turn_left_rad == left
    robot.distance_mm[7] = 65535
    robot.step(27)
    assert robot.memory.turn_left_rad == pytest.approx(0, abs=1e-12)
    assert (robot.left_cm_s, robot.right_cm_s) == (0.5, 0.5)


@pytest.mark.parametrize(("persistence", "kept", "off"), [(0.0, 0, 4 / math.sqrt(2 * 81)), (1.0, 1, 1e-6)])
def test_robots_without_persistence_forget_their_direction_and_those_with_all_of_it_do_not(persistence, kept, off):
    poses = [[x, y, 0.3] for x in range(500, 5000, 500) for y in range(500, 5000, 500)]
    parameters = {"speed_cm_s": 1, "run_s": 3.0, "persistence": persistence}
    group = {"poses": poses, "controller": "random_walk", "parameters": parameters}
    arena = {"width_cm": 5000, "height_cm": 5000}
    last = Simulation({"arena": arena, "noise": "off", "robots": [group]}, 2).advance(300)
    assert np.cos(last.poses[:, 2] - 0.3).mean() == pytest.approx(kept, abs=off)
