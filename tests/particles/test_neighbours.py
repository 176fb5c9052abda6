"""Receivers are those of a brute-force search, whatever was cached before; links; and the selection of the smallest."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from scipy import stats

from epuck_sim import ScenarioError
from epuck_sim.particles.selection import SAMPLED, find_two_smallest, select_smallest
from tests.particles.naive_model import receivers_of
from tests.particles.simulations import BY_POSITION, TOO_CLOSE, UNLIKELY, as_set, make_resting, make_simulation, rules

SEEDS = st.integers(0, 2**32 - 1)
by_position = pytest.mark.parametrize("kind", BY_POSITION)
boundaries = st.sampled_from(["bounded", "cyclic", "mirrored"])
SIDE_CM = 60.0
many_ties = st.sampled_from([0.0, 5e-324, 1.0, 1.0, 2.0, 2.0000000000000004, 9.0, 1e300])
distances = st.lists(st.one_of(st.floats(0, 1e5), st.floats(0, 1e300), many_ties), min_size=1, max_size=60)


def brute_force_receivers(swarm, firing):
    """Return a mask of the agents that receive a pulse, and a mask of those too close to the edge to decide."""
    receives, margin = receivers_of(swarm.scenario, swarm.positions(), swarm.headings(), firing)
    return receives, margin < TOO_CLOSE


def uncoupled(seed, agents, speed_cm_s, dimensions, boundary, rule):
    space = {"dimensions": dimensions, "side_cm": SIDE_CM, "boundary": boundary}
    motion = {"count": agents, "speed_cm_s": speed_cm_s, "speed_distribution": "exponential"}
    return make_simulation(seed, space=space, agents=motion, neighbourhood=rule, response={"coupling": 0})


def compare_receivers(swarm, firings):
    """Compare receivers with brute force at some instants of uncoupled oscillators; return the number compared."""
    compared = 0
    for _ in range(firings):
        event = next(swarm)
        while event.turned is not None:
            event = next(swarm)
        if len(event.fired) > 1:
            continue
        inside, close = brute_force_receivers(swarm, int(event.fired[0]))
        received = np.zeros(len(inside), bool)
        received[event.received] = True
        assert (received == inside)[~close].all()
        compared += not close.any()
    return compared


@by_position
@given(st.data(), SEEDS, boundaries)
@settings(max_examples=12)
def test_receivers_are_the_agents_in_the_neighbourhood_at_that_time(kind, data, seed, boundary):
    agents = data.draw(st.integers(20, 60))
    # slow enough for neighbours to be cached, and for enough cycles for them to change many times; and faster
    pace = data.draw(st.sampled_from([0.0, 1e-3, 0.02, 0.3, 2.0, 50.0]))
    dimensions, rule = data.draw(st.integers(1, 3)), data.draw(rules(kind, agents, SIDE_CM))
    swarm = uncoupled(seed, agents, pace, dimensions, boundary, rule)
    firings = 300 if 0 < pace <= 2 else 80
    assert compare_receivers(swarm, firings) > 0.85 * firings


CONES = [{"kind": kind, "angle_deg": 40, "radius_cm": 9} for kind in ("cone_of_vision", "cone_of_emission")]
NARROW, RANGE = {"kind": "cone_of_vision", "angle_deg": 5}, {"kind": "range", "radius_cm": 4}
RULES = [*({"kind": "nearest", "k": k} for k in (3, 30)), RANGE, *CONES, NARROW]


@pytest.mark.parametrize("rule", RULES, ids=str)
@pytest.mark.parametrize(("agents", "speed_cm_s"), [(600, 1.0), (1500, 0.01), (1500, 40.0)])
def test_receivers_in_large_swarms_are_the_agents_in_the_neighbourhood(agents, speed_cm_s, rule):
    for dimensions, boundary in ((1, "cyclic"), (2, "bounded"), (2, "cyclic"), (3, "bounded")):
        swarm = uncoupled(2, agents, speed_cm_s, dimensions, boundary, rule)
        assert dimensions != 2 or (swarm._arrays.scene.cells > 0) == (rule.get("angle_deg") != 5)
        compared = compare_receivers(swarm, 20)
        swarm.run_to(1.4)
        assert compared + compare_receivers(swarm, 20) > 35


def test_all_agents_within_a_range_receive_including_its_edge():
    places = [[50.0, 50.0], [60.0, 50.0], [50.0, 65.0], [30.0, 50.0], [50.0, 45.0]]
    for radius_cm, received in ((4.9, set()), (5, {4}), (10, {4, 1}), (19, {4, 1, 2}), (20, {1, 2, 3, 4})):
        for kind in ("range", "cone_of_vision", "cone_of_emission"):
            rule = {"kind": kind, "radius_cm": radius_cm, **({} if kind == "range" else {"angle_deg": 360})}
            swarm = make_resting([0.9, 0.5, 0.5, 0.5, 0.5], places, [[1, 0]] * 5, neighbourhood=rule)
            assert as_set(next(swarm).received) == received, rule


@pytest.mark.parametrize(("agents", "k"), [(6, 1), (6, 2), (6, 4), (5, 4), (2, 1)])
def test_each_set_of_random_agents_is_drawn_as_often_whoever_fires_and_wherever_agents_are(agents, k):
    sections = {"neighbourhood": {"kind": "random", "k": k}, "response": {"coupling": 0}}
    swarm = make_resting(np.linspace(0.1, 0.9, agents), **sections)
    drawn = {}
    for event in itertools.islice(swarm, 400 * agents):
        (firing,) = event.fired.tolist()
        assert firing not in event.received
        key = firing, tuple(sorted(event.received.tolist()))
        drawn[key] = drawn.get(key, 0) + 1
    sets = math.comb(agents - 1, k)
    assert len(drawn) == agents * sets
    assert all(len(received) == k for _, received in drawn)
    for firing in range(agents):
        counts = [number for (sender, _), number in drawn.items() if sender == firing]
        assert sets == 1 or stats.chisquare(counts).pvalue > UNLIKELY


@by_position
@given(st.data(), SEEDS, boundaries)
@settings(max_examples=8)
def test_the_adjacency_matrix_is_that_of_brute_force_at_any_time_and_asking_changes_nothing(kind, data, seed, boundary):
    agents = data.draw(st.integers(2, 30))
    sections = {
        "space": {"dimensions": 2, "side_cm": SIDE_CM, "boundary": boundary},
        "agents": {"count": agents, "speed_cm_s": 11.0},
        "neighbourhood": data.draw(rules(kind, agents, SIDE_CM)),
    }
    swarm, untouched = make_simulation(seed, **sections), make_simulation(seed, **sections)
    for time_s in (0.0, 0.31, 7.77):
        swarm.run_to(time_s)
        matrix = swarm.adjacency()
        assert matrix.shape == (agents, agents)
        for sender in range(agents):
            inside, close = brute_force_receivers(swarm, sender)
            assert (matrix[sender] == inside)[~close].all()
    untouched.run_to(7.77)
    assert (untouched.phases() == swarm.phases()).all()


def test_agents_drawn_at_random_have_no_links():
    agents = {"count": 12, "speed_cm_s": 20.0, "reorient_on": ["arriving"]}
    simulation = make_simulation(4, agents=agents, neighbourhood={"kind": "random", "k": 3})
    simulation.run(3)
    assert len(simulation.last_instant().fired)
    assert simulation.pulse_links().shape == (0, 3)
    for ask in (simulation.neighbour_links, simulation.adjacency):
        with pytest.raises(ScenarioError, match="receivers are drawn anew for each pulse"):
            ask()


@settings(max_examples=40)
@given(distances, st.data())
@example([0.0], None)
@example([1.0] * 40, None)
@example([5e-324] * 20 + [0.0] * 20, None)
@example([1.0 if index % SAMPLED == 0 else 1e6 - index for index in range(100)], None)  # far above the sampled ones
def test_the_smallest_are_selected_in_order_and_of_equal_ones_the_first(given_distances, data):
    own = 0 if data is None else data.draw(st.integers(0, len(given_distances)))
    values = [*given_distances[:own], math.inf, *given_distances[own:]]
    for wanted in range(1, len(values) + 1) if data is None else [data.draw(st.integers(1, len(values)))]:
        scratch, found = np.full((2, len(values)), -7), np.full(len(values), -7)
        select_smallest(np.array(values), len(values), wanted, *scratch, found)
        assert found[:wanted].tolist() == np.argsort(values, kind="stable")[:wanted].tolist()


@settings(max_examples=40)
@given(st.lists(st.one_of(many_ties, st.just(math.inf), st.floats(0, 1e5)), min_size=1, max_size=30))
def test_one_pass_finds_the_first_minimum_and_the_next_value(values):
    lowest, second = sorted([*values, math.inf])[:2]
    found = find_two_smallest(np.array(values), len(values))
    assert found == (values.index(lowest) if lowest < math.inf else 0, lowest, second)
    assert find_two_smallest(np.array([*values, 0.0]), len(values)) == found  # what is beyond `count` does not count
