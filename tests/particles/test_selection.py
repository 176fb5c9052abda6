"""The smallest values are selected exactly as a pass over all values for each rank selects them, ties included."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from epuck_sim.particles.neighbours import search_cells, search_nearest
from epuck_sim.particles.selection import FEW, SAMPLED, argmin, find_two_smallest, select_smallest
from tests.particles.simulations import make_simulation, set_trajectories

SIDE_CM = 60.0

many_ties = st.sampled_from([0.0, 5e-324, 1.0, 1.0, 2.0, 2.0000000000000004, 9.0, 1e300])
distances = st.lists(st.one_of(st.floats(0, 1e5), st.floats(0, 1e300), many_ties), min_size=1, max_size=200)


def select_one_by_one(values, k):
    """Return the indices of the k smallest values, which are overwritten with inf, by a pass over all for each."""
    found = []
    for _ in range(k):
        found.append(int(argmin(values, len(values))))
        values[found[-1]] = math.inf
    return found


def select(values, k):
    """Return the indices that `select_smallest` finds, and the largest of their values."""
    scratch, found = np.full((2, len(values)), -7), np.full(len(values), -7)
    largest = select_smallest(values, len(values), k, *scratch, found)
    return found[:k].tolist(), largest


def check_selection(values, k):
    slow, fast = np.array(values), np.array(values)
    expected = select_one_by_one(slow, k)
    found, largest = select(fast, k)
    assert found == expected
    assert largest == values[expected[-1]]
    assert (fast == slow).all()


@given(distances, st.data())
@example([0.0], None)
@example([1.0] * 40, None)
@example([5e-324] * 20 + [0.0] * 20, None)
def test_the_smallest_are_selected_in_order_and_of_equal_ones_the_first(given_distances, data):
    own = 0 if data is None else data.draw(st.integers(0, len(given_distances)))
    values = [*given_distances[:own], math.inf, *given_distances[own:]]
    ranks = range(1, len(values)) if data is None else [data.draw(st.integers(1, len(values) - 1))]
    for k in ranks:
        check_selection(values, k)


@given(st.lists(st.one_of(many_ties, st.just(math.inf), st.floats(0, 1e5)), min_size=1, max_size=30))
def test_one_pass_finds_the_first_minimum_and_the_next_value(values):
    lowest, second = sorted([*values, math.inf])[:2]
    found = find_two_smallest(np.array(values), len(values))
    assert found == (values.index(lowest) if lowest < math.inf else 0, lowest, second)
    assert find_two_smallest(np.array([*values, 0.0]), len(values)) == found  # what is beyond `count` does not count


def test_values_far_above_the_sampled_ones_are_selected_in_order_too():
    values = [1.0 if index % SAMPLED == 0 else 1e6 - index for index in range(100)]
    for k in (7, 13, 14, 50, 100):
        check_selection(values, k)


def place_on_a_grid(count):
    """Return positions at which most distances are equal to others."""
    across = math.ceil(math.sqrt(count))
    return [[(1 + 2 * (index // across)), (1 + 2 * (index % across))] for index in range(count)]


@pytest.mark.parametrize("boundary", ["bounded", "cyclic"])
@pytest.mark.parametrize("uses_cell_list", [False, True])
@pytest.mark.parametrize("is_on_grid", [False, True])
def test_the_nearest_of_a_swarm_are_those_found_one_by_one(is_on_grid, uses_cell_list, boundary):
    count = 450
    for k in (1, 2, FEW, FEW + 1, 10, 30, 100, 300, count - 1):
        swarm = make_simulation(
            k,
            space={"side_cm": SIDE_CM, "boundary": boundary},
            agents={"count": count, "speed_cm_s": 0.0 if is_on_grid else 3.0},
            neighbourhood={"kind": "nearest", "k": k},
        )
        if is_on_grid:
            set_trajectories(swarm, place_on_a_grid(count))
        trajectories = swarm._arrays
        if uses_cell_list and not trajectories.scene.cells:
            continue  # nearly all agents are neighbours
        search = search_cells if uses_cell_list else search_nearest
        for time, agent in enumerate((0, 17, 230, count - 1)):
            search(trajectories.block, swarm._addresses, agent, time / 7)
            offset = swarm_positions(trajectories, time / 7) - swarm_positions(trajectories, time / 7)[agent]
            if boundary == "cyclic":
                offset -= SIDE_CM * np.rint(offset * (1 / SIDE_CM))
            square = offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1]
            square[agent] = math.inf
            members = trajectories.members[agent * k : agent * k + k]
            assert trajectories.counts[agent] == k
            if uses_cell_list:  # equally near ones come in the order of their cells
                assert len(set(members)) == k
                assert (square[members] == np.sort(square)[:k]).all()
            else:
                assert members.tolist() == select_one_by_one(square, k)


def swarm_positions(trajectories, time):
    """Return (agents, 2) cm: positions at a time, along the present trajectories."""
    elapsed = (trajectories.scene.cycle - trajectories.start_cycle) + (time - trajectories.start_time)
    return (trajectories.origin + trajectories.heading * (trajectories.speed * elapsed)).T
