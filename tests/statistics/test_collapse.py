"""How well curves lie on one another, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.statistics.collapse import Course, spread

X = np.linspace(-2, 3, 11)


@given(st.lists(st.floats(-3, 3), min_size=2, max_size=6))
def test_parallel_curves_are_as_far_apart_as_their_heights(heights) -> None:
    courses = [Course(X, np.sin(X) + height) for height in heights]
    assert spread(courses) == pytest.approx(np.std(heights, ddof=1), abs=1e-9)


@given(st.floats(0.1, 5), st.floats(0.2, 2))
def test_shifted_lines_are_apart_by_slope_times_shift_where_both_are(slope, shift) -> None:
    courses = [Course(X, slope * X), Course(X + shift, slope * X)]
    assert spread(courses) == pytest.approx(slope * shift / math.sqrt(2), rel=1e-6)


def test_the_order_of_points_and_of_curves_does_not_matter() -> None:
    rng = np.random.default_rng(1)
    courses = [Course(rng.normal(size=9), rng.normal(size=9)) for _ in range(4)]
    mixed = [Course(*np.array(each)[:, rng.permutation(9)]) for each in courses[::-1]]
    assert spread(mixed) == pytest.approx(spread(courses))


def test_places_that_one_curve_reaches_alone_do_not_count() -> None:
    near, far = Course(X, 0 * X), Course(X + 2, 0 * X + 1)
    longer = Course(np.append(X, 50), np.append(0 * X, 900))
    assert spread([near, far]) == pytest.approx(math.sqrt(0.5))
    assert spread([Course(X[:3], X[:3]), Course(X[-3:], X[-3:])]) != spread([near, far])
    assert math.isnan(spread([Course(X[:3], X[:3]), Course(X[-3:], X[-3:])]))
    assert math.isnan(spread([longer]))
    nowhere = Course(np.full(3, -math.inf), np.zeros(3))
    assert spread([near, nowhere, far]) == spread([near, far])
    assert math.isnan(spread([near, nowhere]))
