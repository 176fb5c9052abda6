"""Claims about what sensors look with: rays, views that rule out nothing that a ray meets, and how wide cells are."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.cells import count_cells, set_cells
from epuck_sim.embodied.sensors import sight
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.scenario.robot_kind import EPUCK, cell_cm
from tests.embodied.scenes import RADIUS_CM

headings = st.floats(-math.pi, math.pi) | st.integers(-4, 4).map(lambda eighths: eighths * math.pi / 4)
INFRARED_CM = math.hypot(3.35, 1.05) + 12 + 3.7
"""Distance of two e-pucks at which an infrared ray of one can meet the other: sensors 0 and 7 are farthest out."""
sizes = st.floats(7.4, 1000)


def test_a_ray_ends_at_a_disc_and_at_a_segment():
    for disc, distance in [
        ((10, 3, 3), 10),  # grazed, it is met where it touches
        *(((10, side * (3 + 1e-9), 3), math.inf) for side in (-1, 1)),
        *(((10, side * (3 - 1e-9), 3), pytest.approx(10, abs=1e-4)) for side in (-1, 1)),
        ((3, 0, 3), 0),  # where it begins, towards its centre alone
        ((-3, 0, 3), math.inf),
    ]:
        assert sight.to_disc(0.0, 0.0, 1.0, 0.0, *map(float, disc)) == distance
    for ends, distance in [
        *(((5, low, 5, low + 2), 5) for low in (0, -2)),  # met at its very end
        ((0, -1, 0, 1), 0),
        *((ends, math.inf) for y in (0, 1) for ends in ((3, y, 9, y), (9, y, 3, y))),  # parallel to the ray
        *((ends, math.inf) for ends in ((-5, -1, -5, 1), (5, 1, 5, 2), (5, -2, 5, -1))),
    ]:
        assert sight.to_segment(0.0, 0.0, 1.0, 0.0, *map(float, ends)) == distance


def view_of(x: float, y: float, heading: float, width: float) -> sight.FieldOfView:
    left, right = heading + width / 2, heading - width / 2
    edges = math.cos(left), math.sin(left), math.cos(right), math.sin(right)
    return sight.FieldOfView(x, y, *edges, width >= math.pi, RADIUS_CM + sight.SLACK_CM)


@pytest.mark.parametrize("heading", [0.3, 1.4, -2.0, -0.9])
def test_a_search_visits_a_part_of_the_cells_about_one_for_a_robot_and_ends_where_all_is_met(heading):
    assert math.prod(count_cells(700.0, 700.0, 1000, cell_cm([EPUCK]))) == pytest.approx(1000, rel=0.1)
    swarm, view = open_block(make_block({"robots": 1000})), view_of(350.0, 350.0, heading, 0.5)
    set_cells(swarm, 700, 700, cell_cm([EPUCK]))
    scene = swarm.scene[0]
    strips = sight.make_strips(view, scene)
    wedge = sight.make_wedge(view, strips)
    found, strip = [], strips.first
    while 0 <= strip < strips.total:
        cell, spans, length = sight.cells_in_strip(view, wedge, strips, strip, scene)
        found += [cell + span * scene.columns + place for span in range(spans) for place in range(length)]
        strip += strips.step
    assert len(set(found)) == len(found) < 0.25 * scene.columns * scene.rows
    fifth = sight.distance_beyond(wedge, strips, strips.first + 5 * strips.step)
    assert 5 * strips.width_cm - 2 * RADIUS_CM < fifth < 6 * strips.width_cm * math.sqrt(2)


@given(headings, st.floats(0.01, 3), st.floats(-math.pi, math.pi), st.floats(4, 300))
def test_a_robot_well_beside_a_view_is_ruled_out(heading: float, width: float, bearing: float, distance: float) -> None:
    off = abs(math.remainder(bearing - heading, 2 * math.pi)) - width / 2
    view = view_of(0.0, 0.0, heading, width)
    dx, dy = distance * math.cos(bearing), distance * math.sin(bearing)
    if 0 < off < math.pi / 2 and math.sin(off) * distance > RADIUS_CM + 1e-5:
        assert not sight.may_contain_robot(view, dx, dy)
    assert sight.may_contain_robot(view_of(0.0, 0.0, heading, 3.2), dx, dy)


@given(st.floats(-100, 100).filter(bool), st.floats(-100, 100))
def test_the_fast_angle_is_as_good_as_it_says(ahead: float, aside: float) -> None:
    off = sight.fast_atan2(ahead, aside) - math.atan2(aside, ahead)
    assert abs(math.remainder(off, 2 * math.pi)) <= sight.ATAN2_ERROR_RAD


@given(st.floats(3.7, 1000))
def test_the_bound_of_the_angular_radius_is_above_it_and_near_it(distance: float) -> None:
    exact = math.asin(min(RADIUS_CM / distance, 1.0))
    assert exact - 1e-15 <= sight.angular_radius_bound(distance, RADIUS_CM)
    assert distance < 2 * RADIUS_CM or sight.angular_radius_bound(distance, RADIUS_CM) < 1.1 * exact


@settings(max_examples=30)
@given(sizes, sizes, st.integers(1, 500))
def test_cells_share_the_floor_and_are_no_narrower_than_infrared_reaches(width, height, robots):
    swarm = open_block(make_block({"robots": robots}))
    set_cells(swarm, width, height, cell_cm([EPUCK]))
    scene = swarm.scene[0]
    assert scene.columns * scene.cell_width_cm == pytest.approx(width)
    assert scene.rows * scene.cell_height_cm == pytest.approx(height)
    assert scene.columns == 1 or scene.cell_width_cm >= INFRARED_CM - 1e-9
    assert scene.rows == 1 or scene.cell_height_cm >= INFRARED_CM - 1e-9
