"""Further shipped measures, each against a closed form or a slow twin."""

import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.errors import MeasureError
from epuck_sim.measures.clusters import surviving_clusters
from epuck_sim.measures.flashes import FlashesMissed, FlashesRepeated
from epuck_sim.measures.loader import find_measure
from epuck_sim.measures.motion import correlation_time
from epuck_sim.measures.order import BelowThreshold, StaysAbove, ThresholdCycles
from epuck_sim.measures.perturbations import growth_rates, mean_with_interval
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.scenario.loader import load_scenario
from tests.instruments.test_instruments import AGENTS, CYCLES, ROBOTS, at_cycles, positions, run

# --- thresholds -----------------------------------------------------------------------------------

orders = st.lists(st.sampled_from([0.2, 0.5, 0.8, 0.95, 1.0]), max_size=12)


def told(measure, series):
    for cycle, order in enumerate(series, 1):
        measure.cycle(None, SimpleNamespace(order_parameter=order, cycles=cycle))
    return measure.value()


@given(orders)
def test_thresholds_are_passed_at_the_first_cycle_that_reaches_them(series):
    found = told(ThresholdCycles(None, thresholds="0.5, 0.9"), series)
    expected = [
        next((cycle for cycle, order in enumerate(series, 1) if order >= threshold), None) for threshold in (0.5, 0.9)
    ]
    assert found == expected


@given(orders)
def test_later_cycles_are_those_after_the_threshold_is_reached(series):
    first = next((place for place, order in enumerate(series) if order >= 0.8), len(series))
    later = series[first + 1 :]
    below = [order < 0.8 for order in later]
    assert told(BelowThreshold(None, threshold=0.8), series) == (sum(below) / len(below) if later else None)
    assert told(StaysAbove(None, threshold=0.8), series) == (not any(below) if later else None)


def test_robots_without_oscillators_pass_no_thresholds():
    robots = [{"controller": "obstacle_avoidance"}]
    assert run("threshold_cycles", robots=robots)[1] == [None] * 5
    assert run("below_threshold", robots=robots)[1] is None


def test_a_trial_with_further_cycles_says_whether_it_stays_above():
    sections = {"stop": {"further_cycles": 30, "max_cycles": 500}}
    assert run("stays_above", seed=1, **sections)[1] == (run("below_threshold", seed=1, **sections)[1] == 0)


# --- life of clusters -----------------------------------------------------------------------------


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=9))
def test_a_cluster_lives_on_in_one_with_more_than_half_of_both(numbers):
    before, after = np.array(numbers).T
    lived = gone = 0
    for number in set(before.tolist()):
        members = set(np.flatnonzero(before == number).tolist())
        if len(members) < 2:
            continue
        later = [set(np.flatnonzero(after == other).tolist()) for other in set(after.tolist())]
        goes_on = any(2 * len(members & other) > len(members | other) for other in later)
        lived, gone = lived + goes_on, gone + (not goes_on)
    assert surviving_clusters(before, after) == (lived, gone)


def test_clusters_of_uncoupled_oscillators_never_end():
    assert run("cluster_life", **{**AGENTS, "response": {"coupling": 0}})[1] is None
    assert run({"cluster_life": {"gap": 0.05}}, **AGENTS)[1] >= 1


# --- motion and places ----------------------------------------------------------------------------


@pytest.mark.parametrize("sections", [AGENTS, ROBOTS], ids=["agents", "robots"])
@pytest.mark.parametrize("measure", ["coverage", "density"])
def test_the_map_counts_positions_at_cycles(measure, sections):
    observer, seen = at_cycles(positions)
    _, value = run({measure: {"cells": 4}}, observer, **sections)
    side = 60 if sections is ROBOTS else 100
    counts = np.zeros((4, 4))
    for places in seen:
        for x, y in places:
            counts[min(int(y / side * 4), 3), min(int(x / side * 4), 3)] += 1
    expected = (counts > 0).mean() if measure == "coverage" else (counts / counts.sum()).ravel().tolist()
    assert value == pytest.approx(expected)


@pytest.mark.parametrize("dimensions", [1, 3])
def test_maps_have_as_many_axes_as_the_space(dimensions):
    _, value = run({"density": {"cells": 3}}, **AGENTS, space={"dimensions": dimensions})
    assert len(value) == 3**dimensions
    assert sum(value) == pytest.approx(1)


def test_velocities_are_correlated_until_they_turn():
    decay = np.exp(-np.arange(50) / 8)
    assert correlation_time(decay, 0.5) == pytest.approx(4.0)
    assert correlation_time(np.ones(5), 1.0) is None
    assert correlation_time(np.zeros(5), 1.0) is None
    far = {**AGENTS, "space": {"side_cm": 1e6}}
    assert run("velocity_correlation_time", **far)[1] is None


@pytest.mark.parametrize("sections", [AGENTS, ROBOTS], ids=["agents", "robots"])
def test_the_correlation_time_is_that_of_all_velocities(sections):
    seen = []
    if sections is AGENTS:
        observer, seen = at_cycles(lambda _, simulation: simulation.headings() * simulation.speeds_cm_s[:, None])
        lags, interval = 8, 1.0
    else:
        lags, interval = 80, 0.1

        def observer(step, *_):
            seen.append(step.poses[:, :2].copy())

    _, value = run({"velocity_correlation_time": {"lags": lags}}, observer, **sections)
    velocities = np.array(seen) if sections is AGENTS else np.diff(np.array(seen), axis=0)
    correlation = [
        np.mean([(velocities[time] * velocities[time - lag]).sum() for time in range(lag, len(velocities))])
        for lag in range(lags + 1)
    ]
    assert value == correlation_time(np.array(correlation), interval) or value == pytest.approx(
        correlation_time(np.array(correlation), interval)
    )
    assert value > 0


def test_time_in_avoidance_and_in_contact_is_counted_in_steps():
    turning, touching = [], []

    def observer(step, *_):
        turning.append((step.wheels_cm_s[:, 0] != step.wheels_cm_s[:, 1]).mean())
        middles, walls = step.poses[:, :2], [0.0, 60.0]
        near = [
            any(math.dist(a, b) <= 7.4 + 0.16 for other, b in enumerate(middles) if other != robot)
            or min(abs(axis - wall) for axis in a for wall in walls) <= 3.7 + 0.16
            for robot, a in enumerate(middles)
        ]
        touching.append(np.mean(near))

    assert run("avoiding", observer, **ROBOTS)[1] == pytest.approx(np.mean(turning))
    turning.clear()
    touching.clear()
    value = run("in_contact", observer, **ROBOTS)[1]
    assert value == pytest.approx(np.mean(touching))
    assert 0 < value < 1


# --- flashes --------------------------------------------------------------------------------------


def test_a_flash_is_missed_seen_or_seen_again():
    """Robot 0 flashes for three steps; robot 1 sees two of them, robot 2 one, and robot 3 none."""
    rings = [[], [0], [0], [0], [], []]
    sightings = [[], [], [(1, 0)], [(1, 0)], [(2, 0)], []]
    simulation = SimpleNamespace(period_ms=np.full(4, 5000.0))
    missed, repeated = FlashesMissed(simulation), FlashesRepeated(simulation)
    assert (missed.value(), repeated.value()) == (None, None)
    stretch = SimpleNamespace(
        poses=np.zeros((6, 4, 3)),
        ring_on=np.array([np.isin(np.arange(4), lit) for lit in rings]),
        sightings=np.array([(step, *each) for step, seen in enumerate(sightings) for each in seen]),
    )
    missed.stretch(stretch, None)
    repeated.stretch(stretch, None)
    assert missed.value() == pytest.approx(1 / 3)
    assert repeated.value() == pytest.approx(1 / 2)


def test_flashes_of_others_are_counted_one_by_one():
    rings, sightings = [], []

    def observer(step, *_):
        rings.append(step.ring_on.copy())
        sightings.append({(looks, lit) for looks, lit in step.sightings.tolist()})

    _, missed = run("flashes_missed", observer, **ROBOTS)
    flashes, views = 0, []
    for robot in range(10):
        lit = [False, *(bool(step[robot]) for step in rings)]  # as seen, a step later
        for begin in range(1, len(lit)):
            if lit[begin] and not lit[begin - 1]:
                end = next((step for step in range(begin, len(lit)) if not lit[step]), None)
                if end is None or end >= len(rings):
                    continue
                flashes += 1
                views += [
                    sum((other, robot) in sightings[step] for step in range(begin, end))
                    for other in range(10)
                    if other != robot
                ]
    assert missed == pytest.approx(np.mean([number == 0 for number in views]))
    _, repeated = run("flashes_repeated", **ROBOTS)
    assert repeated == pytest.approx(np.mean([number > 1 for number in views if number]))
    assert 0 < missed < 1
    assert flashes > CYCLES


# --- perturbations --------------------------------------------------------------------------------

DISTURBED = {
    "model": "particles",
    "agents": {"count": 10, "speed_cm_s": 1.0},
    "start": {"phases": "synchronised", "displacement": 1e-3},
    "stop": {"order_parameter": None},
}


def test_the_perturbation_is_the_distance_from_the_twin():
    observer, times = at_cycles(lambda event, _: event.time_s)
    simulation, series = run("perturbation", observer, **DISTURBED)
    comparison = simulate_with_twin(simulation.scenario, simulation.seed, np.array(times))
    assert series == pytest.approx(comparison.deviation.max(axis=1).tolist(), abs=1e-9)
    assert max(series) > 0
    _, growth = run("perturbation_growth", **DISTURBED)
    assert growth == [None, *growth_rates(series)]
    _, exponent = run("perturbation_exponent", **DISTURBED)
    assert exponent == mean_with_interval([rate for rate in growth_rates(series) if rate is not None])


def test_growth_is_told_where_a_deviation_is_neither_rounding_nor_large():
    assert growth_rates([1e-6, 2e-6, 0.2, 1e-14, 1e-13]) == [pytest.approx(math.log(2)), None, None, None]
    mean, low, high = mean_with_interval([1.0, 2.0, 3.0])
    assert (mean, high - mean) == (2.0, pytest.approx(4.303 / math.sqrt(3), rel=1e-3))  # Student's t of 2
    assert mean - low == pytest.approx(high - mean)
    assert mean_with_interval([]) == [None, None, None]
    assert mean_with_interval([1.0]) == [1.0, None, None]


def test_a_twin_may_be_displaced_itself():
    uncoupled = {**AGENTS, "response": {"coupling": 0}}
    _, series = run({"perturbation": {"displacement": 1e-6}}, **uncoupled)
    assert series == pytest.approx([1e-6] * CYCLES, rel=1e-6)
    assert run({"perturbation_transient": {"displacement": 1e-3, "tolerance": 1e-2}}, **uncoupled)[1] == 0
    assert run({"perturbation_transient": {"displacement": 1e-1, "tolerance": 1e-2}}, **uncoupled)[1] is None
    with pytest.raises(MeasureError, match="a perturbation is measured where there is one"):
        run("perturbation", **AGENTS)


def test_an_agent_is_displaced_before_anything_has_happened():
    simulation = ParticleSimulation(load_scenario(AGENTS), 3)
    before = simulation.phases()
    simulation.displace(2, 0.01)
    assert simulation.phases()[2] == pytest.approx(min(before[2] + 0.01, 1))
    simulation.run(2)
    with pytest.raises(ValueError, match=r"after \d+ instants; allowed: 0 or more"):
        simulation.displace(2, 0.01)


# --- parameters -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("degree", {"direction": "up"}, "direction is 'up'; allowed: in, out, both"),
        ("degree", {"statistic": "mode"}, "statistic is 'mode'; allowed: mean, smallest, largest, sd"),
        ("component_count", {"cycles": 0}, "cycles is 0; allowed: 1 and above"),
        ("spanning_time", {"connection": "loose"}, "connection is 'loose'; allowed: weak, strong"),
        ("threshold_cycles", {"thresholds": "0.5 2"}, "thresholds is '0.5 2'; allowed: numbers above 0"),
        ("below_threshold", {"threshold": 0}, "threshold is 0; allowed: above 0 and up to 1"),
        ("coverage", {"cells": 0}, "cells is 0; allowed: 1 to 1000000"),
        ("velocity_correlation_time", {"lags": 0}, "lags is 0; allowed: 1 to 100000"),
        ("perturbation", {"displacement": 0.5}, "displacement is 0.5; allowed: 0 up to 0.5, in cycles"),
        ("perturbation_transient", {"tolerance": 0}, "tolerance is 0; allowed: above 0 up to 0.5"),
        ("memory", {"take": "all"}, "take is 'all'; allowed: final, mean, series"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(name, given, said):
    with pytest.raises(ValueError, match=said):
        find_measure(name).resolve(given)


# --- mean speed -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("left", "right", "speed"), [(5, 5, 5), (5, -5, 0), (6, 0, 3)])
def test_the_mean_speed_of_robots_is_that_of_their_wheels(left, right, speed):
    group = {"poses": [[30, 30, 0]], "controller": "constant", "parameters": {"left_cm_s": left, "right_cm_s": right}}
    stop = {"max_time_s": 3, "order_parameter": None}
    _, found = run("mean_speed", noise="off", robots=[group], stop=stop)
    assert found == pytest.approx(speed, rel=0.01, abs=1e-9)  # a chord is shorter than its arc


def test_the_mean_speed_of_robots_is_that_of_their_places():
    places = []
    _, found = run("mean_speed", lambda step, *_: places.append(step.poses[:, :2].copy()), **ROBOTS)
    ways = [math.dist(before, after) for steps in pairwise(places) for before, after in zip(*steps, strict=True)]
    assert found == pytest.approx(10 * sum(ways) / len(ways))
    assert 0 < found < 12.8
