"""The shipped measures, each against a closed form or a slow twin."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.errors import MeasureError
from epuck_sim.measures.clusters import cluster_numbers
from epuck_sim.measures.links import changed_share
from epuck_sim.measures.loader import find_measure
from epuck_sim.order_parameter import METRICS
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial, simulate

CYCLES = 12


def run(measure, observer=None, seed=5, **sections):
    """Return the simulation after a trial, and the value of the measure."""
    loaded = load_scenario(
        {"measures": [measure], **sections, "stop": {"max_cycles": CYCLES, **sections.get("stop", {})}}
    )
    simulation = simulate(loaded, seed)
    watch = [lambda event, state: observer(event, state, simulation)] if observer else []
    (value,) = run_trial(simulation, watch).measures.values()
    return simulation, value


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


def phases(event, simulation):
    return simulation.phases() if hasattr(simulation, "phases") else event.phase_ms / simulation.period_ms


def positions(event, simulation):
    return simulation.positions() if hasattr(simulation, "phases") else event.poses[:, :2].copy()


# --- order parameter ------------------------------------------------------------------------------


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("sections", [AGENTS, ROBOTS], ids=["agents", "robots"])
def test_the_order_parameter_is_that_of_the_phases_at_each_cycle(sections, metric):
    observer, seen = at_cycles(phases)
    sections = {**sections, "stop": {**sections["stop"], "metric": metric}}
    _, series = run("order_parameter", observer, **sections)
    assert len(series) == CYCLES
    assert series == pytest.approx([float(METRICS[metric](each, 1.0)) for each in seen], abs=1e-12)


# --- clusters -------------------------------------------------------------------------------------


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
    sizes = np.bincount(cluster_numbers(given_phases, gap / 100 + 1e-9))
    assert sorted(sizes) == slow_sizes(given_phases, gap / 100 + 1e-9)


@pytest.mark.parametrize("sections", [AGENTS, ROBOTS], ids=["agents", "robots"])
@pytest.mark.parametrize("measure", ["cluster_count", "largest_cluster"])
def test_clusters_are_found_at_each_cycle(measure, sections):
    observer, seen = at_cycles(phases)
    _, series = run({measure: {"gap": 0.05}}, observer, **sections)
    sizes = [slow_sizes(each, 0.05) for each in seen]
    expected = [len(each) if measure == "cluster_count" else max(each) / sum(each) for each in sizes]
    assert series == expected
    assert len(set(series)) > 1


def test_robots_without_oscillators_have_no_clusters():
    robots = [{"controller": "obstacle_avoidance"}]
    assert run("cluster_count", robots=robots)[1] == [0] * CYCLES
    assert run("largest_cluster", robots=robots)[1] == [None] * CYCLES


# --- neighbours -----------------------------------------------------------------------------------

KINDS = [
    {"kind": "nearest", "k": 3},
    {"kind": "range", "radius_cm": 25},
    {"kind": "cone_of_vision", "radius_cm": 60, "angle_deg": 100},
    {"kind": "cone_of_emission", "angle_deg": 70},
    {"kind": "all"},
]


def slow_links(simulation):
    """Return the pairs of a sender and a receiver, from the definition of each neighbourhood."""
    rule, side = simulation.scenario.neighbourhood, simulation.scenario.space.side_cm
    places, headings = simulation.positions(), simulation.headings()
    found = set()
    for sender in range(len(places)):
        offsets = places - places[sender]
        if simulation.scenario.space.boundary == "cyclic":
            offsets -= side * np.rint(offsets / side)
        distances = np.linalg.norm(offsets, axis=1)
        others = [agent for agent in range(len(places)) if agent != sender]
        if rule.kind == "nearest":
            others = sorted(others, key=lambda agent: distances[agent])[: rule.k]
        if rule.kind == "range" or (rule.kind.startswith("cone") and rule.radius_cm is not None):
            others = [agent for agent in others if distances[agent] <= rule.radius_cm]
        if rule.kind.startswith("cone"):
            along = [
                float(
                    offsets[agent] @ headings[sender]
                    if rule.kind == "cone_of_emission"
                    else -offsets[agent] @ headings[agent]
                )
                for agent in others
            ]
            cosine = math.cos(math.radians(rule.angle_deg / 2))
            others = [agent for agent, part in zip(others, along, strict=True) if part >= cosine * distances[agent]]
        found |= {(sender, agent) for agent in others}
    return found


@pytest.mark.parametrize("boundary", ["bounded", "cyclic"])
@pytest.mark.parametrize("rule", KINDS, ids=lambda rule: rule["kind"])
def test_neighbour_change_compares_the_links_of_successive_cycles(rule, boundary):
    observer, seen = at_cycles(lambda _, simulation: slow_links(simulation))
    _, series = run("neighbour_change", observer, **AGENTS, neighbourhood=rule, space={"boundary": boundary})
    expected = [1 - len(a & b) / len(a | b) for a, b in pairwise(seen)]
    assert series[0] is None
    assert series[1:] == pytest.approx(expected, abs=1e-12)
    assert (max(expected) > 0) == (rule["kind"] != "all")


def test_neighbours_of_resting_agents_do_not_change():
    sections = {**AGENTS, "agents": {"count": 15, "speed_cm_s": 0}}
    assert run("neighbour_change", **sections)[1] == [None] + [0.0] * (CYCLES - 1)


def test_no_links_have_no_share_that_changed():
    empty = np.zeros(0, np.int64)
    assert changed_share(empty, empty) is None
    assert changed_share(empty, np.array([1])) == 1.0


def test_a_search_for_links_leaves_the_simulation_as_it_is():
    simulation, twin = (simulate(load_scenario(AGENTS), 1) for _ in range(2))
    for _ in range(5):
        assert len(simulation.neighbour_links()) > 0
        simulation.run(simulation.cycles + 1)
        twin.run(twin.cycles + 1)
    assert simulation.positions().tobytes() == twin.positions().tobytes()
    assert simulation.phases().tobytes() == twin.phases().tobytes()


# --- motion ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("sections", [AGENTS, ROBOTS], ids=["agents", "robots"])
def test_the_mean_squared_displacement_is_counted_from_the_first_cycle(sections):
    observer, seen = at_cycles(positions)
    _, series = run("mean_squared_displacement", observer, **sections)
    expected = [sum(math.dist(a, b) ** 2 for a, b in zip(seen[0], each, strict=True)) / len(each) for each in seen]
    assert series == pytest.approx(expected, rel=1e-12)
    assert series[0] == 0
    assert min(series[1:]) > 0


def test_far_from_walls_agents_move_in_straight_lines():
    side = 1e6
    sections = {"space": {"side_cm": side}, "agents": {"count": 5, "speed_cm_s": 2.0}, "response": {"coupling": 0}}
    _, series = run("mean_squared_displacement", **{**AGENTS, **sections})
    assert series == pytest.approx([(2.0 * cycle) ** 2 for cycle in range(CYCLES)], rel=1e-6)


def test_in_a_cyclic_space_there_is_no_displacement():
    with pytest.raises(MeasureError, match="mean_squared_displacement needs walls"):
        run("mean_squared_displacement", **AGENTS, space={"boundary": "cyclic"})


@pytest.mark.parametrize("sections", [AGENTS, ROBOTS], ids=["agents", "robots"])
def test_the_share_near_walls_is_counted_at_each_cycle(sections):
    observer, seen = at_cycles(positions)
    _, value = run({"near_walls": {"within_cm": 9.0}}, observer, **sections)
    sides = [60, 60] if sections is ROBOTS else [100, 100]
    near = [
        any(x <= 9 or x >= side - 9 for x, side in zip(place, sides, strict=True)) for each in seen for place in each
    ]
    assert value == sum(near) / len(near)
    assert 0 < value < 1


@pytest.mark.parametrize(
    ("measure", "said"),
    [
        ({"near_walls": {"within_cm": 0}}, "within_cm is 0; allowed: above 0"),
        ({"cluster_count": {"gap": 0.5}}, "gap is 0.5; allowed: 0 up to 0.5, in cycles"),
        ({"largest_cluster": {"gap": -0.1}}, "gap is -0.1; allowed: 0 up to 0.5, in cycles"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(measure, said):
    ((name, parameters),) = measure.items()
    with pytest.raises(ValueError, match=re.escape(said)):
        find_measure(name).resolve(parameters)


# --- flashes --------------------------------------------------------------------------------------


def test_flashes_are_counted_when_they_come_into_view():
    seen = []
    _, value = run("flashes_seen", lambda step, *_: seen.append(step.flash_seen.tolist()), **ROBOTS)
    began = 0
    for robot in range(10):
        before = False
        for step in seen:
            began += step[robot] and not before
            before = step[robot]
    assert value == began / (10 * CYCLES)
    assert value > 0
