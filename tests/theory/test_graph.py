"""The graph of who hears whom, against slow twins, closed forms and the simulations' own links."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from epuck_sim import ParticleSimulation, Simulation, load_scenario
from epuck_sim.theory.graph import count_components, measure_graphs
from epuck_sim.theory.snapshots import changed_links, take_snapshots

graphs = (
    st.integers(2, 6)
    .flatmap(lambda n: arrays(np.bool_, (3, n, n)))
    .map(lambda found: found & ~np.eye(found.shape[1], dtype=bool))
)


def reachable(links):
    """Return who reaches whom along links, each itself included, by powers of the matrix."""
    reach = np.eye(len(links), dtype=bool) | links
    for _ in range(len(links)):
        reach = reach @ reach
    return reach


@given(graphs)
def test_components_are_who_reach_each_other_and_those_without_a_way_in_are_reached_by_nobody_else(snapshots) -> None:
    components, without_way_in = count_components(snapshots)
    for links, found, closed in zip(snapshots, components, without_way_in, strict=True):
        reach = reachable(links)
        both = reach & reach.T
        kinds = {tuple(np.flatnonzero(row)) for row in both}
        assert found == len(kinds)
        others = [[agent for agent in range(len(links)) if agent not in kind] for kind in kinds]
        assert closed == sum(not reach[np.ix_(rest, kind)].any() for rest, kind in zip(others, kinds, strict=True))


@given(graphs)
def test_degrees_and_sources_are_counted_agent_by_agent(snapshots) -> None:
    measured = measure_graphs(snapshots)
    count, agents, _ = snapshots.shape
    deaf = [(g, a) for g in range(count) for a in range(agents) if not snapshots[g, :, a].any()]
    heard = [(g, a) for g, a in deaf if snapshots[g, a].any()]
    assert measured.sources.value == pytest.approx(len(heard) / (count * agents))
    assert measured.links.value == pytest.approx(snapshots.sum() / (count * agents))
    assert measured.frustrated.value + measured.joined.value == pytest.approx(1)


def test_links_of_agents_are_those_of_their_simulation() -> None:
    scenario = load_scenario("particles", ["agents.count=7", "neighbourhood={kind: cone_of_vision, angle_deg: 90}"])
    snapshots = take_snapshots(scenario, 3, seed=4)
    for snapshot, seed in zip(snapshots, range(4, 7), strict=True):
        assert (snapshot == ParticleSimulation(scenario, seed).adjacency()).all()


def test_a_range_is_reciprocal_and_the_nearest_of_a_plane_are_in_the_known_share() -> None:
    """Of random points in a plane, 6 pi / (8 pi + 3 sqrt 3) are nearest to their nearest (Clark and Evans 1955)."""
    within = load_scenario("particles", ["neighbourhood={kind: range, radius_cm: 30}"])
    assert measure_graphs(take_snapshots(within, 20)).reciprocity.value == 1
    nearest = load_scenario("particles", ["space.boundary=cyclic", "agents.count=40"])
    found = measure_graphs(take_snapshots(nearest, 300)).reciprocity
    assert found.low - 0.01 < 6 * math.pi / (8 * math.pi + 3 * math.sqrt(3)) < found.high + 0.01


def test_robots_see_whom_the_observers_of_a_trial_see() -> None:
    scenario = load_scenario("thesis")
    (snapshot,) = take_snapshots(scenario, 1, seed=3)
    simulation = Simulation(scenario, seed=3)
    stretch = simulation.stretch(1)
    views = {(seen, looks) for _, looks, seen in stretch.views}
    links = {(sender, receiver) for sender, receiver in np.argwhere(snapshot)}
    assert len(links) > 3
    assert len(views ^ links) <= 2  # they have moved for a step


def test_radio_reaches_whoever_is_in_range_through_bodies() -> None:
    everybody = load_scenario("thesis", ["robots.0.signal={kind: radio}"])
    assert take_snapshots(everybody, 2).sum() == 2 * 10 * 9
    near = load_scenario("thesis", ["robots.0.signal={kind: radio, range_cm: 20}"])
    assert measure_graphs(take_snapshots(near, 20)).reciprocity.value == 1


@pytest.mark.parametrize("name", ["particles", "thesis"])
def test_the_faster_swarms_move_the_more_links_change_and_the_fewest_where_they_stand(name: str) -> None:
    changed = changed_links(load_scenario(name), [0.0, 0.2, 1.0, 5.0], 20)
    assert changed[0] == 0
    assert (np.diff(changed) > 0).all()
