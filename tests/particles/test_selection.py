"""The smallest values are selected exactly as a pass over all values for each rank selects them, ties included."""

import math

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim.particles.selection import SAMPLED, find_two_smallest, select_smallest

many_ties = st.sampled_from([0.0, 5e-324, 1.0, 1.0, 2.0, 2.0000000000000004, 9.0, 1e300])
distances = st.lists(st.one_of(st.floats(0, 1e5), st.floats(0, 1e300), many_ties), min_size=1, max_size=60)


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
