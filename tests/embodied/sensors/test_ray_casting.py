"""Claims about where a ray first meets a disc or a segment."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.embodied.sensors.ray_casting import to_disc, to_segment

places = st.floats(-100, 100)
turns = st.floats(-math.pi, math.pi)
lengths = st.floats(0.01, 100)


@given(places, places, turns, lengths, lengths)
def test_a_disc_straight_ahead_is_met_at_its_gap(x, y, heading, gap, radius):
    dx, dy = math.cos(heading), math.sin(heading)
    cx, cy = x + (gap + radius) * dx, y + (gap + radius) * dy
    assert to_disc(x, y, dx, dy, cx, cy, radius) == pytest.approx(gap, rel=1e-9)


@given(places, places, turns, st.floats(-1.5, 1.5), lengths, lengths)
def test_a_disc_is_met_where_the_ray_enters_it(cx, cy, facing, slant, distance, radius):
    px, py = cx + radius * math.cos(facing), cy + radius * math.sin(facing)
    dx, dy = -math.cos(facing + slant), -math.sin(facing + slant)
    reach = to_disc(px - distance * dx, py - distance * dy, dx, dy, cx, cy, radius)
    assert reach == pytest.approx(distance, rel=1e-7)


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


@given(places, places, turns, st.floats(-1.5, 1.5), lengths, lengths)
def test_a_disc_behind_is_missed(x, y, heading, slant, gap, radius):
    cx, cy = x - (gap + radius) * math.cos(heading + slant), y - (gap + radius) * math.sin(heading + slant)
    assert to_disc(x, y, math.cos(heading), math.sin(heading), cx, cy, radius) == math.inf


def _segment_through(px, py, heading, slant, length, share):
    """Return the ends of a segment that has (px, py) at `share` of it, `slant` off the heading."""
    ex, ey = length * math.cos(heading + slant), length * math.sin(heading + slant)
    return px - share * ex, py - share * ey, px + (1 - share) * ex, py + (1 - share) * ey


slants = st.floats(0.1, math.pi - 0.1) | st.floats(0.1 - math.pi, -0.1)
segments = (places, places, turns, slants, lengths, lengths)


@given(*segments, st.floats(0.001, 0.999))
def test_a_segment_is_met_where_the_ray_crosses_it(x, y, heading, slant, distance, length, share):
    dx, dy = math.cos(heading), math.sin(heading)
    ends = _segment_through(x + distance * dx, y + distance * dy, heading, slant, length, share)
    assert to_segment(x, y, dx, dy, *ends) == pytest.approx(distance, rel=1e-9)


@given(*segments, st.floats(1.001, 9) | st.floats(-9, -0.001))
def test_a_segment_that_ends_beside_the_ray_is_missed(x, y, heading, slant, distance, length, share):
    dx, dy = math.cos(heading), math.sin(heading)
    ends = _segment_through(x + distance * dx, y + distance * dy, heading, slant, length, share)
    assert to_segment(x, y, dx, dy, *ends) == math.inf


@given(*segments, st.floats(0, 1))
def test_a_segment_behind_is_missed(x, y, heading, slant, distance, length, share):
    dx, dy = math.cos(heading), math.sin(heading)
    ends = _segment_through(x - distance * dx, y - distance * dy, heading, slant, length, share)
    assert to_segment(x, y, dx, dy, *ends) == math.inf


@pytest.mark.parametrize("ends", [(5.0, 0.0, 5.0, 2.0), (5.0, -2.0, 5.0, 0.0)])
def test_a_segment_is_met_at_its_very_end(ends):
    assert to_segment(0.0, 0.0, 1.0, 0.0, *ends) == 5.0


def test_a_ray_that_starts_on_a_segment_meets_it_at_once():
    assert to_segment(5.0, 1.0, 1.0, 0.0, 5.0, 0.0, 5.0, 2.0) == 0.0


@pytest.mark.parametrize("y", [0.0, 1.0])
def test_a_segment_parallel_to_the_ray_is_missed(y):
    assert to_segment(0.0, 0.0, 1.0, 0.0, 3.0, y, 9.0, y) == math.inf
    assert to_segment(0.0, 0.0, 1.0, 0.0, 9.0, y, 3.0, y) == math.inf
