"""Measures of links: each against the graph as a set of pairs."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.measures.links import component_sizes, degrees
from tests.measures.test_shipped import AGENTS, CYCLES, ROBOTS, at_cycles, run
from tests.particles.naive_model import receivers_of

CROWD = {**ROBOTS, "robots": [{"count": 8, "camera": {"field_of_view_deg": 90}}]}
COMPONENTS = ("component_count", "largest_component")
LIVELY = {**AGENTS, "neighbourhood": {"kind": "cone_of_vision", "angle_deg": 100, "radius_cm": 60}}


def slow_links(_, simulation):
    """Return the pairs of a sender and a receiver, from the definition of each neighbourhood."""
    places, headings = simulation.positions(), simulation.headings()
    receivers = (receivers_of(simulation.scenario, places, headings, sender)[0] for sender in range(len(places)))
    return {(sender, receiver) for sender, row in enumerate(receivers) for receiver in np.flatnonzero(row).tolist()}


def links_of_agents():
    """Return an observer, and the list of the sets of links that it sees at each cycle."""
    return at_cycles(slow_links)


def links_of_robots():
    """Return an observer, and the list of (sender, receiver) pairs of each cycle, from sightings in its steps."""
    seen, now, cycles = [], set(), []

    def observer(step, state, _):
        now.update((lit, looks) for looks, lit in step.sightings.tolist())
        if state.cycles > len(cycles):
            cycles.append(state.cycles)
            seen.append(set(now))
            now.clear()

    return observer, seen


MODELS = pytest.mark.parametrize(
    ("sections", "watch", "population"),
    [(LIVELY, links_of_agents, 15), (CROWD, links_of_robots, 8)],
    ids=["agents", "robots"],
)


def slow_components(links, population, connection):
    """Return the components: who reaches whom, by adding what is reached until nothing is added."""
    ways = links | {(b, a) for a, b in links} if connection == "weak" else links
    reached = {one: {one} for one in range(population)}
    changed = True
    while changed:
        changed = False
        for a, b in ways:
            for one in range(population):
                if a in reached[one] and not reached[b] <= reached[one]:
                    reached[one] |= reached[b]
                    changed = True
    return {frozenset(b for b in range(population) if b in reached[a] and a in reached[b]) for a in range(population)}


@settings(max_examples=40)
@given(st.sets(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=12), st.sampled_from(["weak", "strong"]))
def test_components_are_those_who_reach_each_other(pairs, connection):
    links = {(a, b) for a, b in pairs if a != b}
    numbers = np.array(sorted(a * 6 + b for a, b in links), np.int64)
    assert sorted(component_sizes(numbers, 6, connection)) == sorted(map(len, slow_components(links, 6, connection)))
    for direction, ends in (("out", [a for a, _ in links]), ("in", [b for _, b in links])):
        assert degrees(numbers, 6, direction).tolist() == [ends.count(one) for one in range(6)]


STATISTICS = {"mean": np.mean, "smallest": min, "largest": max, "sd": np.std}


@MODELS
def test_degrees_count_links_and_the_isolated_have_none(sections, watch, population):
    observer, seen = watch()
    told = list(zip(("both", "in", "out", "in", "out", "in"), [*STATISTICS, "isolated", "isolated"], strict=True))
    degrees = [{"degree": {"direction": way, "statistic": what, "as": what}} for way, what in told[:4]]
    isolated = [{"isolated": {"direction": way, "as": f"isolated_{way}"}} for way, _ in told[4:]]
    _, *values = run(degrees[0], observer, more=[*degrees[1:], *isolated], **sections)
    for (direction, statistic), series in zip(told, values, strict=True):
        expected = []
        for links in seen:
            ends = [end for a, b in links for end in {"out": [a], "in": [b], "both": [a, b]}[direction]]
            counts = [ends.count(one) for one in range(population)]
            reduce = STATISTICS.get(statistic)
            expected.append(float(reduce(counts) if reduce else counts.count(0) / population))
        assert series == pytest.approx(expected)
        assert len(series) == CYCLES
        assert max(series) > 0 or statistic in ("smallest", "isolated")


@MODELS
def test_links_change_and_end(sections, watch, population):  # noqa: ARG001
    observer, seen = watch()
    _, series, life = run("neighbour_change", observer, more=["link_life"], **sections)
    expected = [1 - len(a & b) / len(a | b) if a | b else None for a, b in pairwise(seen)]
    assert series[0] is None
    assert series[1:] == expected
    assert life == sum(map(len, seen[:-1])) / sum(len(a - b) for a, b in pairwise(seen))
    assert life > 1


@MODELS
@pytest.mark.parametrize(("connection", "cycles"), [("weak", 1), ("strong", 3)])
def test_components_are_those_of_the_last_cycles_together(sections, watch, population, connection, cycles):
    observer, seen = watch()
    count, largest = ({each: {"connection": connection, "cycles": cycles}} for each in COMPONENTS)
    _, *found = run(count, observer, more=[largest], **sections)
    expected = [(None, None)] * (cycles - 1)
    for last in range(cycles - 1, CYCLES):
        together = set().union(*seen[last - cycles + 1 : last + 1])
        components = slow_components(together, population, connection)
        expected.append((len(components), max(map(len, components)) / population))
    assert list(zip(*found, strict=True)) == expected


@MODELS
def test_the_spanning_time_is_when_the_links_so_far_connect_all(sections, watch, population):
    observer, seen = watch()
    weak, strong = ({"spanning_time": {"connection": each, "as": each}} for each in ("weak", "strong"))
    _, *values = run(weak, observer, more=[strong], **sections)
    for connection, value in zip(("weak", "strong"), values, strict=True):
        together, found = set(), []
        for links in seen:
            together |= links
            found.append(len(slow_components(together, population, connection)) == 1)
        assert value == (found.index(True) + 1 if True in found else None)


@pytest.mark.parametrize("boundary", ["bounded", "cyclic"])
def test_links_are_found_by_cells_as_without(boundary):
    sections = {"model": "particles", "agents": {"count": 450, "speed_cm_s": 5}, "space": {"boundary": boundary}}
    for rule in ({"kind": "nearest", "k": 4}, {"kind": "cone_of_emission", "angle_deg": 80, "radius_cm": 9}):
        observer, seen = links_of_agents()
        stop = {"order_parameter": None, "max_cycles": 2}
        simulation, _ = run("degree", observer, **sections, neighbourhood=rule, stop=stop)
        codes = sorted(sender * 450 + receiver for sender, receiver in seen[-1])
        assert simulation.neighbour_links().tolist() == codes
