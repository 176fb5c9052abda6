"""Controllers that move: each as the thesis or its distribution has it, within the limits of its parameters."""

import math
from pathlib import Path

import hypothesis
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from epuck_sim import Simulation, run_trial
from epuck_sim.control.interface import Wheels
from epuck_sim.epuck import WHEEL_BASE_CM
from epuck_sim.testing import TestRobot
from epuck_sim.util.seeds import robot_streams
from tests.control.bench import Bench, function, random_distances, settings
from tests.embodied.steps import constant
from tests.particles.simulations import UNLIKELY
from tests.tools import needs_compiler

LIMIT_CM_S, BEYOND_CM_S = 12.8, np.nextafter(12.8, 13)
SPEEDS_CM_S, TOO_FAST_CM_S = (-LIMIT_CM_S, LIMIT_CM_S), (-BEYOND_CM_S, BEYOND_CM_S)

LIMITS = [
    ("obstacle_avoidance", "speed_cm_s", (0.0, LIMIT_CM_S), (-5e-324, BEYOND_CM_S), {}),
    ("obstacle_avoidance", "rotation_speed_cm_s", (0.0, LIMIT_CM_S), (-5e-324, BEYOND_CM_S), {}),
    ("obstacle_avoidance", "proximity_threshold", (0, 99), (-1, 100), {}),
    ("obstacle_avoidance", "proximity_count_threshold", (0,), (-1,), {}),
    ("obstacle_avoidance", "rotation_max", (1, 1_000_000), (0, 1_000_001), {}),
    ("oscillator", "period_s", (0.001, 86_400.0), (np.nextafter(0.001, 0), np.nextafter(86_400, 1e6)), {}),
    ("oscillator", "coupling", (0.0, 1e-6, 10.0), (-1e-6, 1e-7, np.nextafter(10, 11)), {}),
    ("oscillator", "refractory_fraction", (np.nextafter(1, 0), 0.0), (1.0, -1e-300), {"flash_fraction": 0.0}),
    ("oscillator", "flash_fraction", (0.0, 0.15), (-1e-300, np.nextafter(0.15, 1)), {}),
    ("oscillator", "delay_ms", (0, 125), (-1, 126), {"period_s": 1.0, "flash_fraction": 0.125}),
    ("oscillator", "flash_pixels", (1,), (0,), {}),
    ("firefly", "speed_cm_s", (LIMIT_CM_S,), (13.0,), {}),
    ("firefly", "coupling", (10.0,), (-0.1,), {}),
    ("firefly", "delay_ms", (375,), (376,), {}),
    ("constant", "left_cm_s", SPEEDS_CM_S, TOO_FAST_CM_S, {}),
    ("constant", "right_cm_s", SPEEDS_CM_S, TOO_FAST_CM_S, {}),
    ("random_walk", "run_s", (0.1,), (0.05,), {}),
    ("random_walk", "persistence", (1.0,), (1.1,), {}),
    ("random_walk", "exponent", (2.0, 3.0), (1.0, 3.5), {}),
    ("random_walk", "rotation_speed_cm_s", (12.8,), (0,), {}),
    ("pushing", "speed_cm_s", (LIMIT_CM_S,), (13.0,), {}),
    ("switching", "slow_cm_s", (LIMIT_CM_S,), (12.9,), {}),
    ("switching", "flashes_to_settle", (1,), (0,), {}),
    ("switching", "coupling", (10.0,), (-0.1,), {}),
    ("varied_firefly", "speed_spread", (0.0, 10.0), (-0.1, 11.0), {}),
    ("varied_firefly", "new_speed_s", (0.0,), (-1.0,), {}),
]
"""Controller, parameter, its values at limits and beyond, and other parameters."""
SPEEDS = st.floats(-12.8, 12.8)
STEP_S = 0.1
ARENA = {"width_cm": 100, "height_cm": 100}


def test_up_to_its_limits_a_parameter_is_allowed_and_what_lies_beyond_is_named_and_small_speeds_keep_fractions():
    for controller, name, inside, outside, others in LIMITS:
        for value in inside:
            settings(controller, **others, **{name: value})
        for value in outside:
            with pytest.raises(ValueError, match=rf"^{name} is {value}; allowed: ."):
                settings(controller, **others, **{name: value})
    robot = TestRobot("obstacle_avoidance", {"speed_cm_s": 0.03125})
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (0.03125, 0.03125)


@hypothesis.settings(max_examples=20)
@given(left=SPEEDS, right=SPEEDS, ring=st.booleans(), seed=st.integers(0, 2**32))
def test_constant_commands_the_same_whatever_it_senses(left, right, ring, seed):
    bench = Bench("constant", {"left_cm_s": left, "right_cm_s": right, "ring_on": ring}, robots=3)
    bench.actuators["ring_on"] = not ring
    for _ in range(3):
        bench.sense(np.random.default_rng(seed))
        bench.control.step()
        assert bench.actuators.tolist() == [(left, right, ring, 0, 0)] * 3


@needs_compiler
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"speed_cm_s": 0.7, "rotation_speed_cm_s": 12.7},
        {"rotation_speed_cm_s": 0.3, "rotation_max": 100},
        {"speed_cm_s": 0.0, "rotation_speed_cm_s": 0.1, "proximity_threshold": 0, "rotation_max": 1},
        {"speed_cm_s": 4.3, "rotation_speed_cm_s": 5.1, "proximity_threshold": 40, "proximity_count_threshold": 0},
        {"proximity_threshold": 85, "proximity_count_threshold": 2},
        {"delay_ms": 62, "flash_pixels": 2, "once_per_sighting": True, "coupling": 0.37},
    ],
    ids=str,
)
def test_long_drives_and_flashes_are_the_thesis_s(given):
    names = str(Path(__file__).with_name("firmware") / "firefly.c"), "firefly"
    benches = in_c, in_python = [Bench(name, given, robots=20, interpret=False) for name in names]
    streams, chance, lit = in_python.streams.copy(), np.random.default_rng(4), 0
    distances = random_distances(chance, (20, 8))
    for number in range(500):
        stays = chance.random((20, 1)) < 0.6  # for a while, as walls do
        distances = np.where(stays, distances, random_distances(chance, (20, 8)))
        in_python.sense(chance)
        in_c.sense_like(in_python)
        for bench in benches:
            bench.senses.distance_mm[:] = distances
            bench.control.step()
        for name in ("left_cm_s", "right_cm_s"):
            np.testing.assert_array_equal(in_c.actuators[name], in_python.actuators[name], f"step {number}")
        rings = in_python.actuators["ring_on"] > 0
        np.testing.assert_array_equal(in_c.actuators["ring_on"] > 0, rings, f"step {number}")
        assert in_c.memory.tobytes() == in_python.memory.tobytes(), f"step {number}"
        lit += rings.sum()
    assert (in_c.streams == in_python.streams).all(), "both drew as often"
    assert (streams != in_python.streams).any(), "walls were met"
    assert 0 < lit < 20 * 500


@pytest.mark.parametrize("persistence", [0.0, 0.7])
def test_turns_are_wrapped_cauchy_and_runs_exponential(persistence):
    robot = TestRobot("random_walk", run_s=2.0, persistence=persistence, seed=4, interpret=False)
    runs, turns = [0.0], [0.0]  # s, rad: of a robot far from everything
    was_turning = False
    while len(turns) <= 400:
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
    runs, turns = np.array(runs[1:-1]), np.array(turns[1:-1])
    cauchy = stats.uniform(0, math.pi).cdf if persistence == 0 else lambda a: 2 * stats.wrapcauchy(persistence).cdf(a)
    assert stats.kstest(np.abs(turns), cauchy).pvalue > UNLIKELY
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
    robot.distance_mm[[7, 0]] = 65535, 10  # front-right: Appendix B stands still for a step before it turns left
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s, robot.memory.turn_left_rad) == (0, 0, left)
    robot.distance_mm[0] = 65535
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


def swarm(group, **sections) -> Simulation:
    return Simulation({"arena": ARENA, "noise": "off", "robots": [group], **sections}, 5)


def reorienting(**sections) -> dict[str, object]:
    return {"controller": "reorientation", "infrared": {"robots": False}, **sections}


def test_a_robot_turns_to_within_90_degrees_of_the_normal_of_a_wall_that_it_meets():
    poses = [[90.0, 5.0 + 9 * place, 0.0] for place in range(1, 10)]
    simulation, found = swarm(reorienting(poses=poses)), []
    before = np.zeros(9)
    for _ in range(30):
        step = simulation.advance(1)
        turned = np.abs(step.poses[:, 2] - before) > 1e-12
        found.extend(step.poses[turned & (step.poses[:, 0] > 90), 2])
        before = step.poses[:, 2].copy()
    angles = np.array(found) % (2 * math.pi) - math.pi  # from the normal of the right wall
    assert len(angles) >= 9
    assert (np.abs(angles) <= math.pi / 2 + 1e-9).all()
    assert angles.min() < -0.5 < 0.5 < angles.max()


def test_a_robot_goes_straight_ahead_between_walls_and_never_touches_one():
    simulation = swarm(reorienting(count=5))
    poses = np.array([simulation.advance(1).poses.copy() for _ in range(2000)])
    moved = np.diff(poses, axis=0)
    assert poses[..., :2].min() > 3.7
    assert poses[..., :2].max() < 100 - 3.7
    straight = moved[:-1][np.abs(moved[:-1, :, 2]) < 1e-12]
    way = np.hypot(straight[:, 0], straight[:, 1])
    assert np.median(way) == pytest.approx(1.28)
    assert len(straight) > 0.8 * moved[..., 2].size


@pytest.mark.parametrize(("robots", "x_cm", "off_cm"), [(False, [50, 30], 1e-9), (True, [40 - 3.7, 40 + 3.7], 0.1)])
def test_robots_that_do_not_touch_pass_through_each_other_but_not_through_walls(robots, x_cm, off_cm):
    poses = [[30.0, 50.0, 0.0], [50.0, 50.0, math.pi], [90.0, 10.0, 0.0]]
    step = swarm(constant(poses, 5), contact={"robots": robots}).advance(41)
    np.testing.assert_allclose(step.poses[:2, 0], x_cm, atol=off_cm)
    assert step.poses[2, 0] == pytest.approx(100 - 3.7, abs=0.1)


def test_robots_of_chapter_3_synchronise_fast_when_they_see_far_and_all_around():
    parameters = {"period_s": 8, "flash_fraction": 0.0375, "refractory_fraction": 0.1}
    group = reorienting(count=20) | {"controller": "reorienting_firefly", "parameters": parameters}
    stop, cycles = {"metric": "reference", "max_cycles": 200}, []
    for signal in ({"kind": "cone"}, {"kind": "cone", "range_cm": 10, "angle_deg": 30}):
        trial = run_trial(Simulation({"arena": ARENA, "robots": [{**group, "signal": signal}], "stop": stop}, 4))
        cycles.append(trial.t_sync_cycles if trial.t_sync_cycles is not None else 200)
    assert cycles[0] < 30 < cycles[1]
