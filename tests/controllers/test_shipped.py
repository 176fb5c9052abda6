"""Shipped controllers: each moves and flashes as the thesis or its distribution has it, within its limits."""

import math
from fractions import Fraction
from math import floor
from pathlib import Path
from types import SimpleNamespace

import hypothesis
import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import stats

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.control.interface import Wheels
from epuck_sim.control.loader import find_controller
from epuck_sim.epuck import OUT_OF_RANGE_MM, WHEEL_BASE_CM
from epuck_sim.testing import TestRobot
from epuck_sim.trial.model import simulate
from epuck_sim.util.seeds import robot_streams
from tests.control.bench import MODES, Bench, function, random_distances, settings
from tests.embodied.steps import constant
from tests.particles.simulations import UNLIKELY
from tests.tools import needs_compiler

LIMIT_CM_S, BEYOND_CM_S = 12.8, np.nextafter(12.8, 13)
SPEEDS_CM_S, TOO_FAST_CM_S = (-LIMIT_CM_S, LIMIT_CM_S), (-BEYOND_CM_S, BEYOND_CM_S)

LIMITS = [  # controller, parameter, its values at limits and beyond, and other parameters
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


def test_a_robot_turns_to_within_90_degrees_of_the_normal_of_a_wall_and_never_touches_one():
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


ONCE = {"once_per_sighting": True}
MOTIONS = {"firefly": "obstacle_avoidance", "walking_firefly": "random_walk", "reorienting_firefly": "reorientation"}
"""Controllers that are an oscillator and this one at once."""
WHEELS = ["left_cm_s", "right_cm_s"]


def stepped(phase_ms, flash=False, ring_on=False, red=1, pixels=60, **parameters):
    robot = TestRobot("oscillator", parameters, pixels=pixels)
    robot.memory.phase_ms, robot.ring_on = phase_ms, ring_on
    robot.camera[: red if flash else 0] = 1
    robot.step()
    return robot.memory.phase_ms, robot.ring_on


@pytest.mark.parametrize(("pixels", "red"), [(60, 1), (60, 2), (1000, 255), (1000, 256), (1000, 512), (1000, 1000)])
def test_so_many_red_pixels_are_a_flash_however_wide_the_camera_is(pixels, red):
    assert stepped(1000, flash=True, red=red, pixels=pixels, flash_pixels=red) == (1210, False)
    assert stepped(1000, flash=True, red=red, pixels=pixels, flash_pixels=red + 1) == (1100, False)


def test_each_new_picture_of_a_flash_updates_or_the_first_of_a_sighting_alone():
    for flashes, new_pictures, given_, phases in (
        ([1, 1, 1, 0], None, {}, [1210, 1441, 1695, 1795]),
        ([1, 1, 0, 1, 1], None, ONCE, [1210, 1310, 1410, 1661, 1761]),
        ([1, 1, 1], None, ONCE | {"refractory_fraction": 0.23}, [1100, 1200, 1300]),  # used up while it is refractory
        ([1, 1, 1, 1, 0], [1, 0, 0, 1, 1], {}, [1210, 1310, 1410, 1661, 1761]),
        ([1, 1, 1, 0, 0, 1, 1], [1, 0, 1, 1, 0, 1, 0], ONCE, [1210, 1310, 1410, 1510, 1610, 1881, 1981]),
    ):
        robot = TestRobot("oscillator", given_)
        robot.memory.phase_ms, found = 1000, []
        for robot.camera, robot.new_picture in zip(flashes, new_pictures or [1] * len(flashes), strict=True):
            robot.step()
            found.append(robot.memory.phase_ms)
        assert found == phases


def phase_update_2(phi, ring, world):
    """Algorithm 2; in line 7 a new cycle begins at phase 0.

    Line 2's modulo must not swallow a cycle that is complete: with no delay that would not be Algorithm 1.
    """
    phi = phi - world.delta
    if phi < world.tau:
        phi = phi % world.tau
    if phi > world.phi_ref:
        phi = floor((1 + world.epsilon) * phi)
    if phi > world.tau:
        phi = 0
        ring = True
    phi = phi + world.delta
    return phi, ring


def algorithm_1(phi, ring, was_flash_detected, world):
    """Algorithm 1, with the update of Algorithm 2 where there is a delay."""
    phi = phi + world.dt
    if phi > world.phi_ref and was_flash_detected and not world.delta:
        phi = floor((1 + world.epsilon) * phi)  # line 5
    elif phi > world.phi_ref and was_flash_detected:
        phi, ring = phase_update_2(phi, ring, world)
    if phi >= world.tau:
        phi = 0
        ring = True
    if phi > world.phi_led:
        ring = False
    return phi, ring


@st.composite
def worlds(draw):
    """Return the thesis's symbols, as exact numbers, and the parameters that mean them."""
    tau, refractory = draw(st.integers(100, 20_000)), draw(st.integers(0, 999))
    flash = draw(st.integers(0, refractory))
    delta = draw(st.just(0) | st.integers(0, flash * tau // 1000))
    coupling = draw(st.integers(1, 999_999)) / 10 ** draw(st.integers(5, 6))
    shares = {"flash_fraction": flash / 1000, "refractory_fraction": refractory / 1000}
    return SimpleNamespace(
        dt=draw(st.sampled_from([1, 10, 25, 100])),
        tau=tau,
        delta=delta,
        epsilon=Fraction(repr(coupling)),  # the decimal number that was written, not its nearest binary one
        phi_led=Fraction(flash * tau, 1000),
        phi_ref=Fraction(refractory * tau, 1000),
        parameters={"period_s": tau / 1000, "coupling": coupling, "delay_ms": delta, **shares},
    )


@hypothesis.settings(max_examples=40)
@given(world=worlds(), chance=st.randoms(use_true_random=False))
def test_each_step_is_the_thesis_s_own(world, chance):
    """Forty worlds, thirty states in each, and the states around each of its limits."""
    step, parameters = find_controller("oscillator").step, settings("oscillator", **world.parameters)
    limits = [0, world.phi_led, world.phi_ref, world.phi_ref + world.delta, world.tau / (1 + world.epsilon), world.tau]
    near = [floor(limit) - world.dt + offset for limit in limits for offset in (-1, 0, 1)]
    phases = [chance.randrange(world.tau) for _ in range(30)]
    phases += [phase for phase in near if 0 <= phase < world.tau]
    for phase in phases:
        flash, ring = chance.random() < 0.7, chance.random() < 0.5
        memory = SimpleNamespace(phase_ms=phase, flash_seen=0)
        actuators = SimpleNamespace(ring_on=ring)
        sensed = SimpleNamespace(step_ms=world.dt, camera=np.array([int(flash)]), new_picture=True)
        step(sensed, memory, actuators, parameters, None)
        assert (memory.phase_ms, actuators.ring_on) == algorithm_1(phase, ring, flash, world), f"from {phase}, {flash}"


def test_phases_begin_uniform_over_all_whole_milliseconds_below_tau():
    phases = Bench("oscillator", {"period_s": 0.02}, robots=20_000, interpret=False).memory["phase_ms"]
    counts = np.bincount(phases, minlength=20)
    assert len(counts) == 20
    assert ((counts - 1000) ** 2 / 1000).sum() < 43.8  # chi-square, 19 degrees of freedom, 0.1 %


@given(millionths=st.integers(1, 10_000_000), phase=st.integers(1, 7_854_545), ms=st.integers(0, 20_000))
def test_couplings_of_whole_millionths_and_seconds_of_whole_milliseconds_are_taken_as_written(millionths, phase, ms):
    """Of 1.001 s, say, binary fractions alone would make 1000 ms."""
    given_ = {"coupling": millionths / 1e6, "flash_fraction": 0.0, "refractory_fraction": 0.0}
    day = settings("oscillator", period_s=86_400.0, **given_)
    assert function("updated", "oscillator")(phase, day) == (phase + phase * millionths // 1_000_000, False)
    assert function("whole_ms", "oscillator")(ms / 1000) == ms


@pytest.mark.parametrize("name", [*MOTIONS, "pushing", "switching", "varied_firefly"])
def test_a_firefly_flashes_as_an_oscillator_that_nothing_is_near_and_moves_as_its_motion_does_blindly(name):
    chance = np.random.default_rng(4)
    firefly, oscillator = (Bench(each, robots=10) for each in (name, "oscillator"))
    motion = Bench(MOTIONS[name], robots=10) if name in MOTIONS else None
    oscillator.memory["phase_ms"] = firefly.memory["phase_ms"]
    if motion:
        assert vars(settings(name)) == vars(settings(MOTIONS[name])) | vars(settings("oscillator"))
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


@pytest.mark.parametrize("name", ["switching", "varied_firefly"])
def test_with_a_speed_of_its_own_a_firefly_turns_away_from_walls_as_fast_as_ever(name):
    robot = TestRobot(name, speed_cm_s=2)
    if name == "switching":
        robot.memory.flashes_in_window = 5
    robot.distance_mm[0] = 10
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (-12.8, 12.8)


def flash_at(robot: TestRobot, phase_ms: int) -> None:
    """Have the robot see a flash at a phase, and nothing before and after."""
    robot.memory.phase_ms = phase_ms
    robot.camera[:] = 1
    robot.step()
    robot.camera[:] = 0
    robot.step()


@MODES
def test_switching_is_slow_after_flashes_in_a_row_in_its_window_and_fast_after_one_elsewhere(interpret):
    """A flash that lasts counts once, and one that makes it fire is in its window."""
    robot = TestRobot("switching", speed_cm_s=8, slow_cm_s=0.5, flashes_to_settle=3, interpret=interpret)
    within, elsewhere = 300, 2000  # ms
    for phase_ms, speed in (
        *((within, 8), (within, 8), (elsewhere, 8)),
        *((within, 8), (within, 8), (within, 0.5), (within, 0.5), (elsewhere, 8)),
    ):
        flash_at(robot, phase_ms)
        assert (robot.left_cm_s, robot.right_cm_s) == (speed, speed)
    robot.memory.phase_ms = 0
    robot.camera[:] = 1
    robot.step(4)
    assert robot.memory.flashes_in_window == 1
    robot.camera[:] = 0
    robot.step()
    flash_at(robot, 4800)  # times 1.1 it passes the period
    assert robot.memory.flashes_in_window == 2
    robot.memory.flashes_in_window = 3
    for near, far in ((0, 7), (7, 0)):  # an obstacle on its right, then on its left: it stands still between turns
        robot.distance_mm[[near, far]] = 10, 65535
        robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (0, 0)


def speeds_of(steps: int, **parameters) -> list[float]:
    robot, speeds = TestRobot("varied_firefly", {"speed_cm_s": 2.0, "speed_spread": 0.5}, **parameters), []
    for _ in range(steps):
        robot.step()
        assert robot.left_cm_s == robot.right_cm_s
        speeds.append(robot.left_cm_s)
    return speeds


def test_robots_draw_lognormal_speeds_and_keep_them_or_draw_new_ones_after_exponential_times():
    """Without spread they have the mean."""
    sd = math.sqrt(math.log(1 + 0.5**2))
    lognormal = stats.lognorm(sd, 0, 2.0 * math.exp(-(sd**2) / 2)).cdf
    drawn = [speeds_of(2, seed=seed) for seed in range(150)]
    assert stats.kstest([first for first, _ in drawn], lognormal).pvalue > UNLIKELY
    assert all(first == second for first, second in drawn)
    assert speeds_of(1, speed_spread=0) == [2.0]
    speeds = speeds_of(1500, new_speed_s=0.5, seed=1, interpret=False)
    changed = np.flatnonzero(np.diff(speeds))
    assert stats.kstest([speeds[step] for step in changed], lognormal).pvalue > UNLIKELY
    expected = len(speeds) * (1 - math.exp(-0.1 / 0.5))
    assert abs(len(changed) - expected) < 4 * math.sqrt(expected)


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
        # in an hour are 720 cycles with 0.4 s of light, of the steps at phases 0, 100, 200 and 300 ms
        share = run_trial(simulate(scenario, 1)).measures["moved"] / (720 * 0.4 * 2)
        # of 30 cycles, up to 14 are over before all have come as far as the disc
        assert 0.4 < share < 1 if together == needed else share < 0.01
