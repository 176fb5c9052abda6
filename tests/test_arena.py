"""Claims about polygons and the arena: corners, areas and what is inside; clearance, edges, the brightness of the floor
and the light of lamps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from epuck_sim.arena import brightness_at, clearance_cm, floor_levels, light_at, make_arena, make_floor
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


def test_areas_and_convexity_of_polygons_are_found_from_whichever_corner_they_begin():
    areas = [
        *((SQUARE, 400), (SQUARE[::-1], -400), (SQUARE[:3], 200), (SQUARE[[0, 2, 1, 3]], 0)),
        (np.insert(SQUARE, 1, (50, 50), axis=0), 300),
        *((ring(corners), corners / 2 * math.sin(2 * math.pi / corners)) for corners in (3, 6, 100)),
    ]
    for corners, area in areas:
        for shift in range(len(corners)):
            assert polygon_area(np.roll(corners, shift, axis=0)) == pytest.approx(area, abs=1e-9)
    rings = [ring(3), ring(7, first=0.3), ring(100), ring(5) * (1e-3, 1e3) + 500]
    convex = [SQUARE, box_corners(0, 0, 30, 0.1, 0.7), *rings]
    not_convex = {
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
    for expected, polygons in ((True, convex), (False, not_convex.values())):
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


def test_clearance_is_negative_beyond_walls_and_in_obstacles_and_edges_of_polygons_run_from_corner_to_corner():
    arena = make_arena(100, 40, [(20, 20, 4)], [])
    for point, clearance in [((50, 41), -1), ((-3, 20), -3), ((-3, -4), -4), ((20, 24), 0), ((20, 20), -4)]:
        assert clearance_cm(arena, *point) == pytest.approx(clearance, abs=1e-12)
    triangle = ring(3)
    edges = make_arena(100, 100, [(5, 5, 1)], [SQUARE, triangle]).edges
    np.testing.assert_array_equal(edges[:, :2], np.vstack([SQUARE, triangle]))
    np.testing.assert_array_equal(edges[:4, 2:], np.roll(SQUARE, -1, axis=0))
    np.testing.assert_array_equal(edges[4:, 2:], np.roll(triangle, -1, axis=0))


def _on_boundary(corners, share):
    """Return points along all sides of a polygon, at `share` of each."""
    after = np.roll(corners, -1, axis=0)
    return (corners[:, None] + share[:, None] * (after - corners)[:, None]).reshape(-1, 2)


def _is_inside(corners, point):
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


def test_a_picture_is_stretched_between_the_walls_and_a_floor_is_white_without_one_and_dark_without_lamps():
    arena = make_arena(60, 40, [], [])
    assert arena.floor.is_white
    assert brightness_at(arena, [[0, 30], [60, 99]], 7.0).tolist() == [[1, 1], [1, 1]]
    assert light_at(arena, [0, 30], [0, 20]).tolist() == [0, 0]
    ladder = np.array([(0, 51, 102), (153, 204, 255)], np.uint8)  # 0, 0.2, 0.4 above 0.6, 0.8, 1
    arena = replace(make_arena(90, 40, [], []), floor=make_floor(1, [(0.5, (45, 20, 1))], ladder))
    x, y = np.array([5, 45, 85, 85, 45, 5, 45, -9, 99]), np.array([39, 21.5, 39, 1, 1, 1, 20, 50, -1])
    expected = [0, 0.2, 0.4, 1, 0.8, 0.6, 0.5, 0, 1]
    np.testing.assert_allclose(brightness_at(arena, x, y), expected, atol=1e-15)
    bare = replace(make_arena(90, 60, [], []), floor=make_floor(1, [], ladder))
    np.testing.assert_array_equal(floor_levels(bare, 3), ladder)


def _slow_brightness(point, width, height, brightness, patches, picture):
    """The brightness of the topmost patch at a point, or else of the picture, or else of the floor."""
    for level, shape in reversed(patches):
        if _is_inside(shape, point) if np.ndim(shape) == 2 else math.dist(point, shape[:2]) <= shape[2]:
            return level
    if picture is None:
        return brightness
    rows, columns = picture.shape
    return picture[int((height - point[1]) / height * rows), int(point[0] / width * columns)] / 255


@given(st.integers(0, 2**32 - 1))
def test_brightness_is_that_of_a_slow_twin(seed):
    random = np.random.default_rng(seed)
    width, height, brightness = *random.uniform(10, 100, 2), random.random()
    patches = []
    for _ in range(random.integers(8)):
        centre, radius = random.uniform(0, (width, height)), random.uniform(1, 40)
        corners = centre + radius * ring(random.integers(3, 7), first=random.uniform(0, 7))
        patches.append((random.random(), corners if random.random() < 0.5 else [*centre, radius]))
    picture = random.integers(0, 256, random.integers(1, 9, 2)).astype(np.uint8) if random.random() < 0.5 else None
    arena = replace(make_arena(width, height, [], []), floor=make_floor(brightness, patches, picture))
    points = random.uniform(0, (width, height), (30, 2))
    slow = [_slow_brightness(point, width, height, brightness, patches, picture) for point in points]
    np.testing.assert_allclose(brightness_at(arena, *points.T), slow, rtol=1e-15)


@given(st.integers(0, 2**32 - 1))
def test_light_is_that_of_rays_from_each_lamp(seed):
    random = np.random.default_rng(seed)
    lamps = random.uniform(1, 100, (random.integers(1, 5), 4))
    points = random.uniform(0, 100, (5, 2))
    slow = []
    for point in points:
        ways = [math.dist((*point, 0), lamp[:3]) for lamp in lamps]
        slow.append(sum(s * h**2 / way**2 * (h / way) for (_, _, h, s), way in zip(lamps, ways, strict=True)))
    arena = replace(make_arena(100, 100, [], []), lamps=np.reshape(lamps, (-1, 4)))
    np.testing.assert_allclose(light_at(arena, *points.T), slow, rtol=1e-12)
