"""Claims about the arena: how far the nearest wall or obstacle is, and where the edges of its obstacles run."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.arena import clearance_cm, make_arena

SQUARE = np.array([(40, 40), (60, 40), (60, 60), (40, 60)], float)


def ring(corners, turns=1, first=0.0):
    """Return points that go evenly round the origin, `turns` times."""
    around = first + turns * 2 * math.pi * np.arange(corners) / corners
    return np.column_stack([np.cos(around), np.sin(around)])


# --- clearance --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("point", "clearance"),
    [((30, 20), 20), ((1, 20), 1), ((99, 20), 1), ((50, 0), 0), ((50, 41), -1), ((-3, 20), -3), ((-3, -4), -4)],
)
def test_clearance_of_an_empty_arena_is_the_distance_to_the_nearest_wall(point, clearance):
    assert clearance_cm(make_arena(100, 40, [], []), *point) == pytest.approx(clearance)


@pytest.mark.parametrize(
    ("point", "clearance"),
    [
        *[((50, 35), 5), ((63, 64), 5), ((37, 36), 5), ((62, 50), 2)],  # beside a side, off a corner
        *[((50, 40), 0), ((60, 60), 0), ((50, 50), -10), ((43, 50), -3)],  # on the edge, inside
        *[((20, 86), 2), ((23, 84), 1), ((20, 84), 0), ((20, 78), -2), ((20, 80), -4)],  # round a circle
        *[((5, 80), 5), ((99, 50), 1)],  # nearer to a wall
    ],
)
def test_clearance_of_obstacles_in_closed_form(point, clearance):
    assert clearance_cm(make_arena(100, 100, [(20, 80, 4)], [SQUARE]), *point) == pytest.approx(clearance, abs=1e-12)


def _on_boundary(corners, share):
    """Return points along all sides of a polygon, at `share` of each."""
    after = np.roll(corners, -1, axis=0)
    return (corners[:, None] + share[:, None] * (after - corners)[:, None]).reshape(-1, 2)


def _is_inside(corners, point):
    """Whether a polygon winds round a point."""
    seen = corners - point
    bearings = np.arctan2(seen[:, 1], seen[:, 0])
    turns = np.diff(bearings, append=bearings[:1])
    return abs(np.sum((turns + math.pi) % (2 * math.pi) - math.pi)) > math.pi


@given(st.integers(0, 2**32 - 1))
def test_clearance_is_that_of_the_nearest_of_many_points_on_walls_and_obstacles(seed):
    random = np.random.default_rng(seed)
    circles = random.uniform((10, 10, 1), (90, 90, 10), (random.integers(3), 3))
    polygons = [
        random.uniform(20, 80, 2) + random.uniform(1, 15) * ring(random.integers(3, 8), first=random.uniform(0, 7))
        for _ in range(random.integers(3))
    ]
    point = random.uniform(0, 100, 2)
    share = np.arange(4001) / 4000
    walls = np.array([(0, 0), (100, 0), (100, 100), (0, 100)], float)
    around = np.column_stack([np.cos(2 * math.pi * share), np.sin(2 * math.pi * share)])
    solids = [(circle[:2] + circle[2] * around, np.hypot(*(circle[:2] - point)) < circle[2]) for circle in circles]
    solids += [(_on_boundary(corners, share), _is_inside(corners, point)) for corners in polygons]
    solids.append((_on_boundary(walls, share), False))
    gaps = [np.hypot(*(points - point).T).min() * (-1 if inside else 1) for points, inside in solids]
    found = clearance_cm(make_arena(100, 100, circles, polygons), *point)
    assert found == pytest.approx(min(gaps), abs=0.015)  # points lie up to 0.025 cm apart


def test_the_edges_of_polygons_run_from_corner_to_corner_and_close():
    triangle = ring(3)
    edges = make_arena(100, 100, [(5, 5, 1)], [SQUARE, triangle]).edges
    np.testing.assert_array_equal(edges[:, :2], np.vstack([SQUARE, triangle]))
    np.testing.assert_array_equal(edges[:4, 2:], np.roll(SQUARE, -1, axis=0))
    np.testing.assert_array_equal(edges[4:, 2:], np.roll(triangle, -1, axis=0))


def test_an_arena_without_obstacles_has_arrays_of_the_documented_shapes():
    arena = make_arena(100, 40, [], [])
    assert (arena.circles.shape, arena.edges.shape, arena.polygons) == ((0, 3), (0, 4), ())
