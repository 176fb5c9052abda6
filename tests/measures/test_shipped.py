"""The shipped measures, each against a closed form or a slow twin, and how they are found by name or in files."""

import json
import math
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from epuck_sim import ParticleSimulation, load_scenario, points
from epuck_sim.measures import synchrony
from epuck_sim.measures.measure import SHIPPED, find_measure
from epuck_sim.measures.motion import Moved, correlation_time
from epuck_sim.measures.perturbations import growth_rates, mean_with_interval
from epuck_sim.order_parameter import METRICS
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.compatibility import stored_point
from epuck_sim.trial.model import run_trial, simulate
from tests.measures.files import COUNTER, TELLTALE, write

CYCLES = 12


def run(measure, observer=None, seed=5, more=(), **sections):
    """Return the simulation after a trial, and the value of the measure, and of more."""
    stop = {"max_cycles": CYCLES, **sections.get("stop", {})}
    simulation = simulate(load_scenario({"measures": [measure, *more], **sections, "stop": stop}), seed)
    watch = [lambda event, state: observer(event, state, simulation)] if observer else []
    return simulation, *run_trial(simulation, watch).measures.values()


def at_cycles(look):
    """Return an observer that looks at each firing of the reference, and the list of what it sees."""
    seen, cycles = [], []

    def observer(event, state, simulation):
        if state.cycles > len(cycles):
            cycles.append(state.cycles)
            seen.append(look(event, simulation))

    return observer, seen


AGENTS = {"model": "particles", "agents": {"count": 15, "speed_cm_s": 8.0}, "stop": {"order_parameter": None}}
ROBOTS = {"model": "embodied", "stop": {"order_parameter": 1.0}}
models = pytest.mark.parametrize("sections", [AGENTS, ROBOTS], ids=["agents", "robots"])


def phases(event, simulation):
    return simulation.phases() if hasattr(simulation, "phases") else event.phase_ms / simulation.period_ms


def positions(event, simulation):
    return simulation.positions() if hasattr(simulation, "phases") else event.poses[:, :2].copy()


def test_what_there_is_not_is_none_what_stays_is_the_same_and_what_a_sweep_s_points_mend_no_mistake():
    mute, at_once = {"robots": [{"controller": "obstacle_avoidance"}]}, {"stop": {"max_time_s": 0.1}}
    still = {**AGENTS, "agents": {"count": 15, "speed_cm_s": 0}}
    # in range of each other, with more links than there was room for at first
    crowd = {**AGENTS, "agents": {"count": 40, "speed_cm_s": 1}, "neighbourhood": {"kind": "range", "radius_cm": 150}}
    for measure, sections, value in [
        *((measure, mute, [None] * CYCLES) for measure in ("cluster_count", "largest_cluster")),
        ("threshold_cycles", mute, [None] * 5),
        *((measure, mute, None) for measure in ("below_threshold", "stays_above")),
        ("cluster_life", {**AGENTS, "response": {"coupling": 0}}, None),
        ("neighbour_change", still, [None] + [0.0] * (CYCLES - 1)),
        *((measure, still, None) for measure in ("link_life", "spanning_time")),
        ("degree", crowd, [39.0] * CYCLES),
        ("velocity_correlation_time", {**AGENTS, "space": {"side_cm": 1e6}}, None),
        *((measure, at_once, None) for measure in ("coverage", "near_walls", "mean_speed", "memory")),
        ("density", at_once, []),
    ]:
        assert run(measure, **sections)[1] == value
    further = {"stop": {"further_cycles": 30, "max_cycles": 500}}
    assert run("stays_above", seed=1, **further)[1] == (run("below_threshold", seed=1, **further)[1] == 0)
    given = {**AGENTS, "measures": ["perturbation"], "sweep": {"grid": {"start.displacement": [0.1]}}}
    (point,) = points({**given, "start": {"phases": "synchronised"}})
    assert point.scenario.start.displacement == 0.1


def slow_sizes(given_phases, gap):
    """Join oscillators pair by pair until no pair of clusters is within the gap."""
    clusters = [[phase] for phase in given_phases]
    while True:
        for first in clusters:
            for second in clusters:
                distances = [abs(a - b) for a in first for b in second]
                if first is not second and min(min(each, 1 - each) for each in distances) <= gap:
                    first.extend(second)
                    clusters.remove(second)
                    break
            else:
                continue
            break
        else:
            return sorted(map(len, clusters))


@given(st.lists(st.integers(0, 99), max_size=8), st.integers(0, 20))
def test_clusters_are_those_of_single_linkage_on_the_circle(hundredths, gap):
    given_phases = np.array(hundredths) / 100
    sizes = np.bincount(synchrony.cluster_numbers(given_phases, gap / 100 + 1e-9))
    assert sorted(sizes) == slow_sizes(given_phases, gap / 100 + 1e-9)


def near_walls(seen, side):
    near = [any(x <= 9 or x >= side - 9 for x in place) for places in seen for place in places]
    return sum(near) / len(near)


def squared_displacements(seen, _):
    return [sum(math.dist(a, b) ** 2 for a, b in zip(seen[0], each, strict=True)) / len(each) for each in seen]


def density(seen, side, cells=4):
    counts = np.zeros((cells, cells))
    for x, y in np.concatenate(seen):
        counts[min(int(y / side * cells), cells - 1), min(int(x / side * cells), cells - 1)] += 1
    return (counts / counts.sum()).ravel().tolist()


AT_CYCLES = [
    ("cluster_count", {"gap": 0.05}, phases, lambda seen, _: [len(slow_sizes(each, 0.05)) for each in seen]),
    ("largest_cluster", {"gap": 0.1}, phases, lambda seen, _: [slow_sizes(each, 0.1)[-1] / len(each) for each in seen]),
    ("mean_squared_displacement", {}, positions, squared_displacements),
    ("near_walls", {"within_cm": 9.0}, positions, near_walls),
    ("density", {"cells": 4}, positions, density),
    ("coverage", {"cells": 20}, positions, lambda seen, side: np.mean(np.array(density(seen, side, 20)) > 0)),
]
"""Measures with parameters, what they look at when the reference fires, and their value of all that is seen."""


@models
def test_what_is_measured_at_cycles_is_that_of_a_slow_twin(sections):
    observer, seen = at_cycles(lambda *at: {look: look(*at) for look in (phases, positions)})
    first, *more = ({measure: parameters} for measure, parameters, *_ in AT_CYCLES)
    _, *values = run(first, observer, more=more, **sections)
    assert len(seen) == CYCLES
    for (measure, _, look, expected), value in zip(AT_CYCLES, values, strict=True):
        looked = [each[look] for each in seen]
        assert value == pytest.approx(expected(looked, 60 if sections is ROBOTS else 100), rel=1e-12), measure
        assert len(set(value)) > 1 if isinstance(value, list) else 0 < value < 1


@models
@pytest.mark.parametrize("metric", METRICS)
def test_the_order_parameter_is_that_of_the_phases_at_each_cycle(sections, metric):
    observer, seen = at_cycles(phases)
    _, series = run("order_parameter", observer, **{**sections, "stop": {**sections["stop"], "metric": metric}})
    assert series == pytest.approx([float(METRICS[metric](each, 1.0)) for each in seen], abs=1e-12)


@pytest.mark.parametrize("metric", METRICS)
def test_the_order_of_a_group_is_that_of_its_phases(metric):
    robots = [{"count": 3}, {"count": 4}, {"controller": "constant"}, {"count": 0}]
    observer, seen = at_cycles(phases)
    more = [{"group_order": {"group": group, "as": f"of_{group}"}} for group in (2, 3)]
    sections = {"robots": robots, "stop": {"metric": metric, "order_parameter": None}}
    sections["schedule"] = [{"at_s": 20, "remove": [5]}]
    _, *series = run({"group_order": {"group": 1}}, observer, more=more, **sections)
    own = [each[3:7] - (metric == "reference") * each[0] for each in seen]
    assert series[0] == pytest.approx([float(METRICS[metric](each[~np.isnan(each)], 1.0)) for each in own], abs=1e-12)
    assert series[1:] == [[None] * CYCLES] * 2


def told(measure, *batches):
    first = 1
    for orders in batches:
        measure.batch(SimpleNamespace(order_parameter=np.array(orders, float), first=first), None)
        first += len(orders)
    return measure.value()


ORDERS = st.lists(st.sampled_from([0.2, 0.5, 0.8, 0.95, 1.0]), min_size=1, max_size=6)


@given(st.lists(ORDERS, max_size=4), st.integers(1, 13))
def test_thresholds_are_passed_at_the_first_cycle_that_reaches_them_and_later_ones_are_above_or_not(batches, begin):
    series = [order for batch in batches for order in batch]

    def reached(threshold):
        return next((cycle for cycle, order in enumerate(series, 1) if order >= threshold), None)

    cycles = told(synchrony.ThresholdCycles(None, thresholds="0.9, 0.5, 0.9"), *batches)
    assert cycles == [*map(reached, (0.9, 0.5, 0.9))]
    counted = series[begin - 1 :]
    first = next((place for place, order in enumerate(counted) if order >= 0.8), len(series))
    later = counted[first + 1 :]
    below = [order < 0.8 for order in later]
    assert told(synchrony.BelowThreshold(None, 0.8, begin), *batches) == (sum(below) / len(below) if later else None)
    assert told(synchrony.StaysAbove(None, 0.8, begin), *batches) == (not any(below) if later else None)


@given(st.integers(1, 9).flatmap(lambda n: st.lists(st.tuples(*[st.integers(0, 3)] * n), min_size=1, max_size=4)))
def test_a_cluster_lives_on_in_one_with_more_than_half_of_both(cycles):
    numbers = np.array(cycles)
    lived = gone = 0
    for before, after in pairwise(numbers):
        for number in set(before.tolist()):
            members = set(np.flatnonzero(before == number).tolist())
            if len(members) < 2:
                continue
            later = [set(np.flatnonzero(after == other).tolist()) for other in set(after.tolist())]
            goes_on = any(2 * len(members & other) > len(members | other) for other in later)
            lived, gone = lived + goes_on, gone + (not goes_on)
    measure = synchrony.ClusterLife(None)
    for batch in (numbers[:1], numbers[1:]):
        measure.batch(SimpleNamespace(phases=batch / 4), None)
    assert measure.value() == ((lived + gone) / gone if gone else None)


def test_velocities_are_correlated_until_they_turn_and_growth_is_told_between_rounding_and_large():
    assert correlation_time(np.exp(-np.arange(50) / 8), 0.5) == pytest.approx(4.0)
    assert correlation_time(np.ones(5), 1.0) is None
    assert correlation_time(np.zeros(5), 1.0) is None
    assert growth_rates([1e-6, 2e-6, 0.2, 1e-14, 1e-13]) == [pytest.approx(math.log(2)), None, None, None]
    mean, low, high = mean_with_interval([1.0, 2.0, 3.0])
    assert (mean, high - mean) == (2.0, pytest.approx(4.303 / math.sqrt(3), rel=1e-3))  # Student's t of 2
    assert mean - low == pytest.approx(high - mean)
    assert mean_with_interval([]) == [None, None, None]
    assert mean_with_interval([1.0]) == [1.0, None, None]


@models
def test_the_correlation_time_is_that_of_all_velocities(sections):
    if sections is AGENTS:
        observer, seen = at_cycles(lambda event, its: (event.time_s, its.headings() * its.speeds_cm_s[:, None]))
    else:
        seen = []

        def observer(step, *_):
            seen.append(step.poses[:, :2].copy())

    lags = 8 if sections is AGENTS else 80
    _, value = run({"velocity_correlation_time": {"lags": lags}}, observer, **sections)
    if sections is AGENTS:
        times_s, velocities = map(np.array, zip(*seen, strict=True))
        interval = np.diff(times_s).mean()  # below a period: pulses shorten cycles
    else:
        velocities, interval = np.diff(np.array(seen), axis=0), 0.1
    correlation = [
        np.mean([(velocities[time] * velocities[time - lag]).sum() for time in range(lag, len(velocities))])
        for lag in range(lags + 1)
    ]
    assert value == pytest.approx(correlation_time(np.array(correlation), interval))
    assert value > 0
    assert run({"velocity_correlation_time": {"lags": lags}}, **sections)[1] == value  # to the bit, without an observer


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

    _, *values = run("avoiding", observer, more=["in_contact"], **ROBOTS)
    assert values == pytest.approx([np.mean(turning), np.mean(touching)])
    assert 0 < min(values) <= max(values) < 1


def test_flashes_of_others_are_counted_one_by_one():
    rings, sightings, in_view = [], [], []

    def observer(step, *_):
        in_view.append(step.flash_seen.tolist())
        rings.append(step.ring_on.copy())
        sightings.append({(looks, lit) for looks, lit in step.sightings.tolist()})

    _, missed, repeated, seen = run("flashes_missed", observer, more=["flashes_repeated", "flashes_seen"], **ROBOTS)
    flashes, views = 0, []
    for robot in range(10):
        lit = [False, *(bool(step[robot]) for step in rings)]  # as seen, a step later
        for begin in range(1, len(lit)):
            if lit[begin] and not lit[begin - 1]:
                end = next((step for step in range(begin, len(lit)) if not lit[step]), None)
                if end is None or end >= len(rings):
                    continue
                flashes += 1
                others = [other for other in range(10) if other != robot]
                views += [sum((other, robot) in sightings[step] for step in range(begin, end)) for other in others]
    assert missed == pytest.approx(np.mean([number == 0 for number in views]))
    assert repeated == pytest.approx(np.mean([number > 1 for number in views if number]))
    assert 0 < missed < 1
    assert flashes > CYCLES
    before = [[False] * 10, *in_view]
    began = sum(step[robot] and not last[robot] for last, step in pairwise(before) for robot in range(10))
    assert seen == began / (10 * CYCLES) > 0


START = {"phases": "synchronised", "displacement": 1e-3}
SLOW = {"model": "particles", "agents": {"count": 10, "speed_cm_s": 1.0}}
DISTURBED = {**SLOW, "start": START, "stop": {"order_parameter": None}}


def test_the_perturbation_is_the_distance_from_the_twin():
    observer, times = at_cycles(lambda event, _: event.time_s)
    others = ["perturbation_growth", "perturbation_exponent"]
    simulation, series, growth, exponent = run("perturbation", observer, more=others, **DISTURBED)
    comparison = simulate_with_twin(simulation.scenario, simulation.seed, np.array(times))
    assert series == pytest.approx(comparison.deviation.max(axis=1).tolist(), abs=1e-9)
    # a firing of one trial that the other has not had yet is no deviation, or any would be one of coupling x phase
    assert max(run({"perturbation": {"displacement": 1e-9}}, **AGENTS)[1]) < 1e-6
    assert max(series) > 0
    # what a schedule changes at the very time of a firing comes after it, in both
    push = {"at_s": 3, "displace": {"by_cycles": 0.25}}
    apart = {**DISTURBED, "response": {"coupling": 0}, "stop": {"order_parameter": None, "reference": 1}}
    assert max(run("perturbation", schedule=[push], **apart)[1]) == pytest.approx(1e-3)
    assert growth == [None, *growth_rates(series)]
    assert exponent == mean_with_interval([rate for rate in growth_rates(series) if rate is not None])


def test_an_agent_is_displaced_before_anything_has_happened_and_so_may_a_twin_be():
    simulation = ParticleSimulation(load_scenario(AGENTS), 3)
    before = simulation.phases()
    simulation.displace(2, 0.01)
    assert simulation.phases()[2] == pytest.approx(min(before[2] + 0.01, 1))
    for agent, by, said in ((-1, 0.1, "agent is -1"), (15, 0.1, "allowed: 0 to 14"), (0, math.nan, "cycles is nan")):
        with pytest.raises(ValueError, match=said):
            simulation.displace(agent, by)
    simulation.run(2)
    with pytest.raises(ValueError, match=r"after \d+ instants; allowed: 0 or more"):
        simulation.displace(2, 0.01)
    uncoupled = {**AGENTS, "response": {"coupling": 0}}
    _, series = run({"perturbation": {"displacement": 1e-6}}, **uncoupled)
    assert series == pytest.approx([1e-6] * CYCLES, rel=1e-6)
    assert run({"perturbation_transient": {"displacement": 1e-3, "tolerance": 1e-2}}, **uncoupled)[1] == 0
    assert run({"perturbation_transient": {"displacement": 1e-1, "tolerance": 1e-2}}, **uncoupled)[1] is None


def test_the_mean_speed_of_robots_and_the_path_of_movables_are_those_of_their_places():
    places = []
    _, found = run("mean_speed", lambda step, *_: places.append(step.poses[:, :2].copy()), **ROBOTS)
    ways = [math.dist(before, after) for steps in pairwise(places) for before, after in zip(*steps, strict=True)]
    assert found == pytest.approx(10 * sum(ways) / len(ways))
    assert 0 < found < 12.8
    assert moved([4], [[(1, 1)]]) is None
    there_and_back = [[(0, 0), (9, 9)], [(3, 4), (9, 9)], [(0, 0), (9, 9)]]
    assert moved([10, 15, 20], there_and_back) == pytest.approx((10 + 0) / 2 * 360)
    assert moved([5, 3605], [[(0, 0)], [(0, 7)]]) == pytest.approx(7)


def moved(times_s, places):
    measure = Moved(None)
    for time_s, movables in zip(times_s, places, strict=True):
        measure.cycle(SimpleNamespace(time_s=time_s, movables=np.array(movables, float)), None)
    return measure.value()


def test_a_field_of_one_robot_is_that_of_its_memory_and_of_all_the_mean_over_those_who_have_it():
    observer, seen = at_cycles(lambda step, _: float(step.memories[0]["rotation_time"][0]))
    field = {"name": "rotation_time", "robot": 0}
    first, *more = ({"memory": {**field, "take": take, "as": take}} for take in ("final", "mean", "series"))
    _, *values = run(first, observer, more=more, **ROBOTS)
    assert values == [seen[-1], sum(seen) / CYCLES, seen]
    assert seen[0] != seen[-1]
    observer, seen = at_cycles(lambda step, _: step.memories[1]["phase_ms"].mean())
    mixed = [{"controller": "obstacle_avoidance", "count": 2}, {"count": 3}]
    _, value = run({"memory": {"take": "series"}}, observer, **ROBOTS | {"robots": mixed, "stop": {}})
    assert value == pytest.approx(seen)


def test_one_measure_may_be_there_under_two_names_and_one_of_several_is_chosen_by_name(tmp_path):
    measures = [{"memory": {"as": "phase"}}, {"memory": {"name": "rotation_time", "as": "turning"}}, "memory"]
    scenario = load_scenario({"measures": measures})
    assert load_scenario(scenario.model_dump()) == scenario
    (point,) = points(scenario)
    assert list(json.loads(stored_point(point).measures)) == ["phase", "turning", "memory"]
    write(tmp_path / "mine.py", COUNTER + TELLTALE + "\ndef helper(): pass\n")
    for name in SHIPPED:
        measure = find_measure(name)
        assert (measure.name, measure.stored_name, dict(measure.sources)) == (name, name, {})
        assert not measure.is_function
        assert measure.make.__doc__.strip()
    measure = find_measure("mine.py:Telltale", tmp_path)
    assert (measure.name, measure.stored_name) == ("Telltale", f"{tmp_path}/mine.py:Telltale")


def test_parameters_have_the_types_of_their_defaults_and_models_must_tell_what_a_measure_asks_for(tmp_path):
    write(tmp_path / "mine.py", COUNTER)
    counter = find_measure("mine.py", tmp_path)
    assert counter.resolve({}) == {"weight": 1.0, "offset": 0, "loud": False, "label": "all"}
    given = counter.resolve({"weight": 2, "offset": 3.0, "label": "none"})
    assert (given["weight"], given["offset"], given["label"]) == (2.0, 3, "none")
    assert (type(given["weight"]), type(given["offset"])) == (float, int)
    write(tmp_path / "steps.py", TELLTALE.replace("def event", "def _event"))
    write(tmp_path / "both.py", TELLTALE)
    write(tmp_path / "named.py", COUNTER + "    MODELS = ('particles',)\n")
    for measure in (counter, find_measure("both.py", tmp_path)):
        measure.check_model("particles", "event")
        measure.check_model("embodied", "step")
    only_steps, only_agents = (find_measure(name, tmp_path) for name in ("steps.py", "named.py"))
    only_steps.check_model("embodied", "step")
    only_agents.check_model("particles", "event")
