"""Oscillators and fireflies: each step is the thesis's own, and neither flashes nor motion depend on the other."""

import math
from fractions import Fraction
from math import floor
from types import SimpleNamespace

import hypothesis
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from epuck_sim import load_scenario, run_trial
from epuck_sim.control.loader import find_controller
from epuck_sim.epuck import OUT_OF_RANGE_MM
from epuck_sim.testing import TestRobot
from epuck_sim.trial.model import simulate
from tests.control.bench import MODES, Bench, function, settings
from tests.particles.simulations import UNLIKELY

ONCE = {"once_per_sighting": True}
MOTIONS = {"firefly": "obstacle_avoidance", "walking_firefly": "random_walk", "reorienting_firefly": "reorientation"}
"""Controllers that are an oscillator and this one at once."""
WHEELS = ["left_cm_s", "right_cm_s"]


def stepped(phase_ms, flash=False, ring_on=False, step_ms=100, seen=0, red=1, pixels=60, new=True, **parameters):
    robot = TestRobot("oscillator", parameters, pixels=pixels, step_ms=step_ms)
    robot.memory.phase_ms, robot.memory.flash_seen = phase_ms, seen
    robot.ring_on, robot.new_picture = ring_on, new
    robot.camera[: red if flash else 0] = 1
    robot.step()
    return robot.memory.phase_ms, robot.ring_on


@pytest.mark.parametrize(("pixels", "red"), [(60, 1), (60, 2), (1000, 255), (1000, 256), (1000, 512), (1000, 1000)])
def test_so_many_red_pixels_are_a_flash_however_wide_the_camera_is(pixels, red):
    assert stepped(1000, flash=True, red=red, pixels=pixels, flash_pixels=red) == (1210, False)
    assert stepped(1000, flash=True, red=red, pixels=pixels, flash_pixels=red + 1) == (1100, False)


@hypothesis.settings(max_examples=30)
@given(phase=st.integers(0, 4999), ring=st.booleans())
def test_a_picture_that_is_not_new_acts_like_a_dark_one(phase, ring):
    assert stepped(phase, flash=True, ring_on=ring, new=False) == stepped(phase, flash=False, ring_on=ring)


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
