"""Claims about robots' imperfections: in what they differ, their clocks, and how they get stuck."""

import math
from itertools import islice

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.loop import stop_and_release, tick
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.start import vary
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.util.rng import uniform
from epuck_sim.util.seeds import robot_streams
from tests.embodied.changing import NOWHERE

SPREADS = ("wheel_speed", "wheel_imbalance", "clock_rate", "infrared_gain")

shares = st.floats(0, 0.99)
spreads = st.fixed_dictionaries({**dict.fromkeys(SPREADS, shares), "clock_rate": st.floats(0, 0.1)})


def block_of(robots, seed=4, step_ms=100):
    """Return a block of robots with streams for what they differ in."""
    block = make_block({"robots": robots})
    swarm = open_block(block)
    swarm.scene[0].step_ms, swarm.scene[0].step_s = step_ms, step_ms / 1000
    swarm.robots.variation_random = robot_streams(np.random.SeedSequence(seed), robots)
    return block


@settings(max_examples=30)
@given(spreads, st.integers(1, 30))
def test_robots_differ_as_a_slow_twin_draws_for_each_from_its_own_stream(spread, robots):
    block = block_of(robots)
    swarm = open_block(block)
    swarm.scene[0].spread = [spread[name] for name in SPREADS]
    vary(block)
    speed, imbalance, clock, gain = (spread[name] for name in SPREADS)
    for robot, stream in zip(swarm.robots, robot_streams(np.random.SeedSequence(4), robots), strict=True):
        drawn = np.array([2 * uniform(stream) - 1 for _ in range(12)])
        np.testing.assert_array_equal(robot.wheel_gain, (1 + speed * drawn[0]) * (1 + imbalance * drawn[1:3]))
        np.testing.assert_array_equal(robot.free_gain, robot.wheel_gain)
        assert robot.own_step_ms == 100 * robot.clock_rate == 100 * (1 + clock * drawn[3])
        np.testing.assert_array_equal(robot.infrared_gain, 1 + gain * drawn[4:])


@settings(max_examples=15)
@given(st.lists(st.floats(0.9, 1.1), min_size=1, max_size=5), st.sampled_from([1, 25, 100]))
def test_no_millisecond_of_a_clock_is_lost_or_counted_twice(rates, step_ms):
    block = block_of(len(rates), step_ms=step_ms)
    swarm, own_ms = open_block(block), step_ms * np.array(rates)
    swarm.robots.own_step_ms = own_ms
    total = np.zeros(len(rates), np.int64)
    for step in range(300):
        swarm.scene[0].step = step
        tick(block, NOWHERE, 0)
        passed = swarm.robots.sensors.step_ms
        assert (np.abs(passed - own_ms) < 1).all()
        total += passed
    assert total.tolist() == [math.floor(300 * each) for each in own_ms]
    swarm.robots.own_step_ms, swarm.scene[0].step = step_ms, 10**12  # a clock that is right, after very long
    tick(block, NOWHERE, 0)
    assert (swarm.robots.sensors.step_ms == step_ms).all()


def test_phases_run_by_the_robots_own_clocks():
    settings = ["timing.control_hz=40", "timing.physics_hz=120", "robots.0.controller=oscillator"]
    scenario = {"robots": [{"count": 10, "controller": "oscillator"}], "spread": {"clock_rate": 0.05}, "noise": "off"}
    simulation = Simulation(load_scenario(scenario, settings), 5)
    simulation_of_ideal = Simulation(load_scenario({**scenario, "spread": {}}, settings), 5)
    for steps, _ in zip(zip(simulation, simulation_of_ideal, strict=True), range(12), strict=False):
        ahead = steps[0].phase_ms - steps[1].phase_ms
    assert (np.abs(ahead) < 12 * 25 * 0.05 + 1).all()
    assert np.ptp(ahead) > 5
    np.testing.assert_array_equal(steps[0].poses, steps[1].poses)
    assert steps[0].time_s == steps[1].time_s


def stuck_over(steps, robots=1, step_ms=100):
    """Return (steps, robots) whether robots are stuck that are so for 5 s and free for 10 s on average."""
    block = block_of(robots, step_ms=step_ms)
    swarm = open_block(block)
    swarm.scene[0].mean_stuck_s, swarm.scene[0].mean_free_s = 5, 10
    swarm.robots.free_gain, swarm.robots.is_stuck = 0.75, True
    gain, found = swarm.robots.wheel_gain, np.empty((steps, robots), bool)
    for step in range(steps):
        swarm.scene[0].step = step
        stop_and_release(block, NOWHERE, 0)
        assert ((gain == 0.75) | (gain == 0)).all()
        found[step] = gain[:, 0] == 0
        np.testing.assert_array_equal(gain[:, 0], gain[:, 1])
    return found


@pytest.mark.parametrize("step_ms", [100, 50])
def test_robots_are_free_and_stuck_by_turns_for_exponential_times_as_a_slow_twin_draws(step_ms):
    steps, robots = 5_000, 9
    changes = []
    for stream in robot_streams(np.random.SeedSequence(4), robots):
        times = [-mean_s * math.log(1 - uniform(stream)) for _ in range(100) for mean_s in (10, 5)]
        changes.append(np.searchsorted(np.cumsum(times), step_ms / 1000 * np.arange(steps), side="right"))
    np.testing.assert_array_equal(stuck_over(steps, robots, step_ms), np.transpose(changes) % 2 == 1)


def test_a_robot_that_is_stuck_stands_still_with_its_wheels_turning_and_its_oscillator_running():
    settings = ["stuck.per_hour=600", "stuck.mean_s=5", "arena.width_cm=400", "arena.height_cm=400", "noise=off"]
    simulation = Simulation(load_scenario("thesis", settings), 2)
    poses, wheels, phases = [], [], []
    for step in islice(simulation, 600):
        poses.append(step.poses.copy())
        wheels.append(step.wheels_cm_s.copy())
        phases.append(step.phase_ms)
    still = (np.diff(poses, axis=0) == 0).all(axis=2)
    assert 0.2 < still.mean() < 0.7
    assert (np.abs(wheels[:-1])[still] > 0).mean() > 0.95
    assert (np.diff(phases, axis=0) != 0).all()
