"""Claims about where a ray first meets a disc or a segment."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.embodied.sensors.sight import to_disc, to_segment

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
