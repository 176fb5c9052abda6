"""Claims about what sensors look with: rays end at the first surface, and views rule out nothing that a ray meets."""

import math
from typing import Any, NamedTuple

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.cells import cell_index, set_cells
from epuck_sim.embodied.sensors.sight import (
    ATAN2_ERROR_RAD,
    SECTOR_RAD,
    SLACK_CM,
    FieldOfView,
    angular_radius_bound,
    cells_in_strip,
    distance_beyond,
    fast_atan2,
    make_strips,
    make_wedge,
    may_contain_robot,
    to_disc,
    to_segment,
)
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.scenario.robot_kind import EPUCK, cell_cm
from tests.embodied.scenes import RADIUS_CM

places = st.floats(-100, 100)
turns = st.floats(-math.pi, math.pi)
lengths = st.floats(0.01, 100)


def test_a_disc_that_is_grazed_is_met_where_it_touches():
    assert to_disc(0.0, 0.0, 1.0, 0.0, 10.0, 3.0, 3.0) == 10.0


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_disc_just_short_of_the_ray_is_missed(side):
    assert to_disc(0.0, 0.0, 1.0, 0.0, 10.0, side * (3.0 + 1e-9), 3.0) == math.inf
    assert to_disc(0.0, 0.0, 1.0, 0.0, 10.0, side * (3.0 - 1e-9), 3.0) == pytest.approx(10.0, abs=1e-4)


@given(places, places, lengths, turns, st.floats(-1.5, 1.5), st.floats(0.01, 0.999))
def test_from_inside_a_disc_is_met_at_once_towards_its_centre_and_never_away_from_it(cx, cy, radius, at, slant, share):
    x, y = cx + share * radius * math.cos(at), cy + share * radius * math.sin(at)
    towards = at + math.pi + slant
    assert to_disc(x, y, math.cos(towards), math.sin(towards), cx, cy, radius) == 0.0
    assert to_disc(x, y, -math.cos(towards), -math.sin(towards), cx, cy, radius) == math.inf


def test_a_disc_touched_by_the_start_is_met_towards_its_centre_alone():
    assert to_disc(0.0, 0.0, 1.0, 0.0, 3.0, 0.0, 3.0) == 0.0
    assert to_disc(0.0, 0.0, -1.0, 0.0, 3.0, 0.0, 3.0) == math.inf


@pytest.mark.parametrize("ends", [(5.0, 0.0, 5.0, 2.0), (5.0, -2.0, 5.0, 0.0)])
def test_a_segment_is_met_at_its_very_end(ends):
    assert to_segment(0.0, 0.0, 1.0, 0.0, *ends) == 5.0


def test_a_ray_that_starts_on_a_segment_meets_it_at_once():
    assert to_segment(5.0, 1.0, 1.0, 0.0, 5.0, 0.0, 5.0, 2.0) == 0.0


@pytest.mark.parametrize("y", [0.0, 1.0])
def test_a_segment_parallel_to_the_ray_is_missed(y):
    assert to_segment(0.0, 0.0, 1.0, 0.0, 3.0, y, 9.0, y) == math.inf
    assert to_segment(0.0, 0.0, 1.0, 0.0, 9.0, y, 3.0, y) == math.inf


# --- views ------------------------------------------------------------------------------------------

WIDTH_CM, HEIGHT_CM = 150.0, 230.0
REACH_CM = RADIUS_CM + SLACK_CM
headings = st.floats(-math.pi, math.pi) | st.integers(-4, 4).map(lambda eighths: eighths * math.pi / 4)
shares = st.floats(0, 1) | st.sampled_from([0.0, 1.0])


class Sight(NamedTuple):
    """A camera somewhere in an arena, and a robot that one of its rays meets."""

    view: FieldOfView
    scene: Any
    """SCENE with the grid."""
    x: float
    y: float
    reach: float
    """Distance in cm along the ray."""


def view_of(x: float, y: float, heading: float, width: float) -> FieldOfView:
    left, right = heading + width / 2, heading - width / 2
    edges = math.cos(left), math.sin(left), math.cos(right), math.sin(right)
    return FieldOfView(x, y, *edges, width >= math.pi, REACH_CM)


def scene_of(width_cm: float, height_cm: float, robots: int) -> Any:
    swarm = open_block(make_block({"robots": robots}))
    set_cells(swarm, width_cm, height_cm, cell_cm([EPUCK]))
    return swarm.scene[0]


@st.composite
def sights(draw: st.DrawFn) -> Sight:
    x, y = draw(shares) * WIDTH_CM, draw(shares) * HEIGHT_CM
    heading, width = draw(headings), draw(st.floats(0, SECTOR_RAD) | st.just(SECTOR_RAD))
    ray = heading + (draw(shares) - 0.5) * width
    along, beside = draw(st.floats(1e-3, 5) | st.floats(1e-3, 60)), (2 * draw(shares) - 1) * RADIUS_CM
    at_x = min(max(x + along * math.cos(ray) - beside * math.sin(ray), 0.0), WIDTH_CM)
    at_y = min(max(y + along * math.sin(ray) + beside * math.cos(ray), 0.0), HEIGHT_CM)
    scene = scene_of(WIDTH_CM, HEIGHT_CM, draw(st.sampled_from([1, 20, 90])))
    reach = to_disc(x, y, math.cos(ray), math.sin(ray), at_x, at_y, RADIUS_CM)
    return Sight(view_of(x, y, heading, width), scene, at_x, at_y, reach)


def visited(sight: Sight) -> dict[int, int]:
    """Return the strip of each cell that a search visits."""
    view, scene = sight.view, sight.scene
    strips = make_strips(view, scene)
    wedge = make_wedge(view, strips)
    strip, found = strips.first, {}
    while 0 <= strip < strips.total:
        cell, spans, length = cells_in_strip(view, wedge, strips, strip, scene)
        for span in range(spans):
            start = cell + span * scene.columns
            assert not found.keys() & set(range(start, start + length))
            found.update(dict.fromkeys(range(start, start + length), strip))
        strip += strips.step
    return found


def cell_of(sight: Sight) -> int:
    scene = sight.scene
    column = cell_index(sight.x, scene.cell_width_cm, scene.columns)
    return cell_index(sight.y, scene.cell_height_cm, scene.rows) * scene.columns + column


@settings(max_examples=200)
@given(sights())
def test_a_robot_that_a_ray_meets_is_in_a_cell_that_is_visited_and_not_beyond_an_earlier_strip(sight: Sight) -> None:
    assume(sight.reach < math.inf)  # or else it was moved back into the arena, out of the ray's way
    assert may_contain_robot(sight.view, sight.x - sight.view.x, sight.y - sight.view.y)
    strips = make_strips(sight.view, sight.scene)
    wedge = make_wedge(sight.view, strips)
    strip = visited(sight)[cell_of(sight)]
    for earlier in range(strips.first, strip, strips.step):
        assert distance_beyond(wedge, strips, earlier) <= sight.reach


@pytest.mark.parametrize("heading", [0.3, 1.4, -2.0, -0.9])
def test_a_search_visits_a_part_of_the_cells_and_ends_where_all_is_met(heading: float) -> None:
    scene = scene_of(700, 700, 1000)
    view = view_of(350, 350, heading, 0.5)
    sight = Sight(view, scene, 350, 350, 0.0)
    assert len(visited(sight)) < 0.25 * scene.columns * scene.rows
    strips = make_strips(view, scene)
    wedge = make_wedge(view, strips)
    fifth = distance_beyond(wedge, strips, strips.first + 5 * strips.step)
    assert 5 * strips.width_cm - 2 * RADIUS_CM < fifth < 6 * strips.width_cm * math.sqrt(2)


@given(headings, st.floats(0.01, 3), st.floats(-math.pi, math.pi), st.floats(4, 300))
def test_a_robot_well_beside_a_view_is_ruled_out(heading: float, width: float, bearing: float, distance: float) -> None:
    off = abs(math.remainder(bearing - heading, 2 * math.pi)) - width / 2
    view = view_of(0, 0, heading, width)
    dx, dy = distance * math.cos(bearing), distance * math.sin(bearing)
    if 0 < off < math.pi / 2 and math.sin(off) * distance > RADIUS_CM + 1e-5:
        assert not may_contain_robot(view, dx, dy)
    assert may_contain_robot(view_of(0, 0, heading, 3.2), dx, dy)


@given(st.floats(-100, 100).filter(bool), st.floats(-100, 100))
def test_the_fast_angle_is_as_good_as_it_says(ahead: float, aside: float) -> None:
    assert abs(math.remainder(fast_atan2(ahead, aside) - math.atan2(aside, ahead), 2 * math.pi)) <= ATAN2_ERROR_RAD


@given(st.floats(3.7, 1000))
def test_the_bound_of_the_angular_radius_is_above_it_and_near_it(distance: float) -> None:
    exact = math.asin(min(RADIUS_CM / distance, 1.0))
    assert exact - 1e-15 <= angular_radius_bound(distance, RADIUS_CM)
    assert distance < 2 * RADIUS_CM or angular_radius_bound(distance, RADIUS_CM) < 1.1 * exact
