"""Claims about robots' imperfections: in what they differ, their clocks, and how they get stuck."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.loop import stop_and_release, tick
from epuck_sim.embodied.start import vary
from epuck_sim.embodied.swarm import make_block, open_block
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
