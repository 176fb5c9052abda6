"""Claims about robots' imperfections: in what they differ, their clocks, and how they get stuck."""

import math
from itertools import islice, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.embodied.loop import stop_and_release, tick
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.start import vary
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.trial.model import run_trial
from epuck_sim.util.seeds import robot_streams
from tests.embodied.changing import NOWHERE

SPREADS = {"wheel_speed": 0.03, "wheel_imbalance": 0.02, "clock_rate": 0.002, "infrared_gain": 0.2}
FACTORS = ("wheel_gain", "clock_rate", "infrared_gain")

shares = st.floats(0, 0.99)
spreads = st.fixed_dictionaries({**dict.fromkeys(SPREADS, shares), "clock_rate": st.floats(0, 0.1)})


def block_of(robots, seed=4, step_ms=100):
    """Return a block of robots with streams for what they differ in."""
    block = make_block({"robots": robots})
    swarm = open_block(block)
    swarm.scene[0].step_ms, swarm.scene[0].step_s = step_ms, step_ms / 1000
    swarm.robots.variation_random = robot_streams(np.random.SeedSequence(seed), robots)
    return block


def variation_of(spread, robots=1000):
    """Return the factors of robots with this spread, by name."""
    block = block_of(robots)
    swarm = open_block(block)
    swarm.scene[0].spread = [spread.get(name, 0) for name in SPREADS]
    vary(block)
    return {name: swarm.robots[name].copy() for name in FACTORS}


def assert_uniform(values, low, high):
    """By chi-square with 19 degrees of freedom, 99.9 %."""
    assert low <= values.min() <= values.max() <= high
    counts, _ = np.histogram(values, bins=20, range=(low, high))
    expected = values.size / 20
    assert ((counts - expected) ** 2 / expected).sum() < 43.8


# --- the physical experiments -----------------------------------------------------------------------


def test_fig_4_7_sweeps_the_speeds_of_the_robots_of_physical():
    def robots_and_room(scenario):
        own = {"name", "description", "stop", "trials", "sweep", "quick", "figure"}
        return {key: value for key, value in scenario.model_dump().items() if key not in own}

    physical = load_scenario("physical")
    for point in points(load_scenario("fig-4-7")):
        speed = point.scenario.robots[0].parameters["speed_cm_s"]
        same = load_scenario(physical, [f"robots.0.parameters.speed_cm_s={speed}"])
        assert robots_and_room(point.scenario) == robots_and_room(same)
    assert speed == physical.robots[0].parameters["speed_cm_s"]


def test_imperfect_robots_synchronise_at_full_speed():
    results = [run_trial(Simulation("physical", seed)) for seed in range(3)]
    assert not any(result.censored for result in results)
    assert max(result.cycles for result in results) < 100


# --- factors ----------------------------------------------------------------------------------------


def test_without_spread_all_robots_are_exactly_as_they_should_be():
    assert all((factors == 1.0).all() for factors in variation_of({}).values())


@pytest.mark.parametrize("name", SPREADS)
def test_each_spread_moves_only_what_it_says_and_does_not_decide_what_else_is_drawn(name):
    field = name if name in FACTORS else "wheel_gain"
    alone, together = variation_of({name: SPREADS[name]}), variation_of(SPREADS)
    assert [factors for factors, values in alone.items() if (values != 1.0).any()] == [field]
    if field == name:
        np.testing.assert_array_equal(together[field], alone[field])
    else:
        wheels = [variation_of({wheel: SPREADS[wheel]})[field] for wheel in ("wheel_speed", "wheel_imbalance")]
        np.testing.assert_array_equal(together[field], wheels[0] * wheels[1])


def test_factors_are_uniform_around_one_and_drawn_for_each_robot_wheel_and_sensor():
    both = variation_of({"wheel_speed": 0.03}, 4000)["wheel_gain"]
    np.testing.assert_array_equal(both[:, 0], both[:, 1])
    columns = [(both[:, 0] - 1) / 0.03]
    for name, field, spread in (
        *(("wheel_imbalance", "wheel_gain", 0.5), ("clock_rate", "clock_rate", 0.002)),
        ("infrared_gain", "infrared_gain", 0.2),
    ):
        columns.append((variation_of({name: spread}, 4000)[field] - 1) / spread)
    drawn = np.column_stack(columns)
    for column in drawn.T:
        assert_uniform(column, -1 - 1e-9, 1 + 1e-9)
    correlation = np.corrcoef(drawn.T)[np.triu_indices(12, 1)]
    assert np.abs(correlation).max() < 4 / math.sqrt(4000)
    assert np.abs([np.corrcoef(column[1:], column[:-1])[0, 1] for column in drawn.T]).max() < 4 / math.sqrt(4000)


@given(spreads, st.integers(1, 30), st.integers(0, 30))
def test_further_robots_leave_the_others_as_they_are(spread, robots, more):
    few, many = (variation_of(spread, number) for number in (robots, robots + more))
    for name in FACTORS:
        np.testing.assert_array_equal(few[name], many[name][:robots])


def moved(spread, robots=10):
    """Return (robots, 2) cm, rad: how far robots on a grid drive ahead, and turn, in half a second."""
    group = {"count": robots, "placement": "grid", "controller": "constant"}
    group["parameters"] = {"left_cm_s": 1.0, "right_cm_s": 1.0}
    simulation = Simulation({"robots": [group], "noise": "off", "spread": spread}, 3)
    poses = [step.poses.copy() for step in islice(simulation, 6)]
    way = poses[-1] - poses[0]
    return np.column_stack([np.hypot(way[:, 0], way[:, 1]), way[:, 2]])


def test_wheels_that_differ_together_change_the_speed_and_wheels_that_differ_alone_the_course():
    ideal = moved({})
    np.testing.assert_allclose(ideal, [(0.5, 0)] * 10, atol=1e-12)
    faster = moved({"wheel_speed": 0.1})
    assert (np.abs(faster[:, 0] - 0.5) < 0.05 + 1e-9).all()
    assert np.ptp(faster[:, 0]) > 0.05
    np.testing.assert_allclose(faster[:, 1], 0, atol=1e-12)
    crooked = moved({"wheel_imbalance": 0.1})
    assert (np.abs(crooked[:, 1]) < 2 * 0.1 * 0.5 / 5.1).all()
    assert np.ptp(crooked[:, 1]) > 0.01


def test_each_sensor_s_gain_multiplies_its_reading():
    scenario = {"robots": [{"poses": [[52, 20, 0], [54, 40, 0.3]], "controller": "constant"}], "noise": "off"}
    true, read = (
        next(Simulation({**scenario, "spread": {"infrared_gain": gain}}, 3)).infrared.copy() for gain in (0, 0.2)
    )
    inside = (true > 0) & (true < 3731 / 1.2)
    assert inside.sum() > 4
    assert (read[true == 0] == 0).all()
    gains = read[inside] / true[inside]
    assert ((gains > 0.8) & (gains < 1.2)).all()
    assert len(np.unique(gains.round(6))) == len(gains)


# --- clocks -----------------------------------------------------------------------------------------


@given(st.lists(st.floats(0.9, 1.1), min_size=1, max_size=5), st.sampled_from([1, 25, 100]))
def test_no_millisecond_of_a_clock_is_lost_or_counted_twice(rates, step_ms):
    block = block_of(len(rates), step_ms=step_ms)
    swarm, own_ms = open_block(block), step_ms * np.array(rates)
    swarm.robots.own_step_ms = own_ms
    total = np.zeros(len(rates), np.int64)
    for step in range(1000):
        swarm.scene[0].step = step
        tick(block, NOWHERE, 0)
        passed = swarm.robots.sensors.step_ms
        assert (np.abs(passed - own_ms) < 1).all()
        total += passed
    assert total.tolist() == [math.floor(1000 * each) for each in own_ms]


def test_a_clock_that_is_right_always_counts_the_control_step():
    block = block_of(1)
    swarm = open_block(block)
    swarm.robots.own_step_ms = 25.0
    for step in (0, 1, 7, 10**6, 10**12):
        swarm.scene[0].step = step
        tick(block, NOWHERE, 0)
        assert swarm.robots.sensors.step_ms.tolist() == [25]


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


# --- getting stuck ----------------------------------------------------------------------------------


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


def lengths(stuck):
    """Return how many steps in a row robots are stuck, and how many free, without the first and the last of a row."""
    runs = {False: [], True: []}
    for robot in stuck.T:
        edges = np.flatnonzero(np.diff(robot)) + 1
        for begin, end in pairwise(edges):
            runs[bool(robot[begin])].append(end - begin)
    return np.array(runs[True]), np.array(runs[False])


def test_robots_begin_free_and_the_share_of_time_stuck_is_that_of_the_means():
    stuck = stuck_over(20_000, 50)
    assert not stuck[0].any()
    share = 5 / (5 + 10)
    cycles = stuck.size * 0.1 / 15
    assert stuck.mean() == pytest.approx(share, abs=4 * share * (1 - share) * math.sqrt(2 / cycles))


def test_times_stuck_and_free_are_exponential_with_their_means():
    held, free = lengths(stuck_over(20_000, 50))
    for steps, mean_s in ((held, 5), (free, 10)):
        assert len(steps) > 3000
        assert 0.1 * steps.mean() == pytest.approx(mean_s, rel=0.06)
        for quantile in (0.25, 0.5, 0.75):
            assert 0.1 * np.quantile(steps, quantile) == pytest.approx(-mean_s * math.log(1 - quantile), rel=0.08)


def test_times_stuck_do_not_depend_on_other_robots_nor_on_the_control_step():
    few, many = (stuck_over(2000, robots) for robots in (3, 9))
    np.testing.assert_array_equal(few, many[:, :3])
    finer = stuck_over(20_000, 3, step_ms=10)
    np.testing.assert_array_equal(finer[::10], few)


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


def test_stuck_robots_change_nothing_before_the_first_is_stuck():
    ideal, real = Simulation("thesis", 2), Simulation(load_scenario("thesis", ["stuck.per_hour=60"]), 2)
    differ = [(one.poses != other.poses).any() for one, other, _ in zip(ideal, real, range(400), strict=False)]
    first = differ.index(True)
    assert first > 5
    assert all(differ[first:])
