"""Claims about polygons: the corners of boxes, areas, what is convex, what is inside."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.geometry import box_corners, contains, is_convex, polygon_area, polygon_distance_cm

SQUARE = np.array([(40, 40), (60, 40), (60, 60), (40, 60)], float)

lengths = st.floats(0.1, 40)
angles = st.floats(-10, 10)


def ring(corners, turns=1, first=0.0):
    """Return points that go evenly round the origin, `turns` times."""
    around = first + turns * 2 * math.pi * np.arange(corners) / corners
    return np.column_stack([np.cos(around), np.sin(around)])


@given(st.floats(-50, 50), st.floats(-50, 50), lengths, lengths, angles)
def test_a_turned_box_keeps_its_centre_and_sides_and_goes_counter_clockwise(x, y, width, height, heading):
    corners = box_corners(x, y, width, height, heading)
    sides = np.roll(corners, -1, axis=0) - corners
    along, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    np.testing.assert_allclose(corners.mean(axis=0), (x, y), atol=1e-9)
    np.testing.assert_allclose(sides, [width * along, height * across, -width * along, -height * across], atol=1e-9)
    assert polygon_area(corners) == pytest.approx(width * height)


@pytest.mark.parametrize(
    ("corners", "area"),
    [
        (SQUARE, 400),
        (SQUARE[::-1], -400),
        (SQUARE[:3], 200),
        (np.insert(SQUARE, 1, (50, 50), axis=0), 300),
        (SQUARE[[0, 2, 1, 3]], 0),
        *[(ring(corners), corners / 2 * math.sin(2 * math.pi / corners)) for corners in (3, 6, 100)],
    ],
)
def test_the_area_of_a_polygon_in_closed_form_from_whichever_corner_it_begins(corners, area):
    for shift in range(len(corners)):
        assert polygon_area(np.roll(corners, shift, axis=0)) == pytest.approx(area, abs=1e-9)


CONVEX = [ring(3), SQUARE, box_corners(0, 0, 30, 0.1, 0.7), ring(7, first=0.3), ring(100), ring(5) * (1e-3, 1e3) + 500]
NOT_CONVEX = {
    "clockwise": SQUARE[::-1],
    "star": ring(5, turns=2),
    "sharp star": ring(7, turns=3),
    "twice round": np.vstack([SQUARE, SQUARE]),
    "on a side": np.insert(SQUARE, 1, (50, 40), axis=0),
    "dent": np.insert(SQUARE, 1, (50, 45), axis=0),
    "repeated": np.insert(SQUARE, 1, SQUARE[0], axis=0),
    "flat": np.array([(0, 0), (1, 1), (2, 2)], float),
    "bow tie": SQUARE[[0, 2, 1, 3]],
}


def test_convex_polygons_are_told_from_others_from_whichever_corner_they_begin():
    for expected, polygons in ((True, CONVEX), (False, NOT_CONVEX.values())):
        for corners in polygons:
            assert {is_convex(np.roll(corners, shift, axis=0)) for shift in range(len(corners))} == {expected}


def test_points_inside_and_on_the_edge_are_contained_and_others_are_not():
    points = [(50, 50), (41, 59), (40, 50), (60, 60), (39, 50), (61, 61), (50, 60.5), (50, -50), (200, 50)]
    assert contains(SQUARE, np.array(points, float)).tolist() == [True] * 4 + [False] * 5


@given(st.integers(3, 9), angles, st.integers(0, 2**32 - 1))
def test_a_point_is_contained_where_its_distance_to_the_polygon_is_not_positive(corners, first, seed):
    polygon, points = ring(corners, first=first), np.random.default_rng(seed).uniform(-1.2, 1.2, (4, 5, 2))
    distances = [[polygon_distance_cm(polygon, *point) for point in row] for row in points]
    np.testing.assert_array_equal(contains(polygon, points), np.array(distances) <= 0)
    np.testing.assert_array_equal(contains(polygon, points.astype(np.float32)), contains(polygon, points))
