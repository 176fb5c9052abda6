"""Whose flashes are whose, by how robots move from one to the next."""

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.flashes import Flash, FlashTable
from epuck_sim.overhead.identities import SURE, Habits, _certainties, _link, commonest_speed, link_flashes, ways_between

FLOOR_CM = (60.0, 60.0)
PERIOD_S = 5.0


def straight(
    places: FloatArray, velocities: FloatArray, phases_s: FloatArray, cycles: int
) -> tuple[FlashTable, IntArray]:
    """Return the flashes of robots that drive straight ahead, in order of their onsets, and whose they are."""
    robots = len(places)
    onsets = (phases_s + PERIOD_S * np.arange(cycles)[:, None]).ravel()
    whose = np.tile(np.arange(robots), cycles)
    at = places[whose] + onsets[:, None] * velocities[whose]
    order = np.argsort(onsets, kind="stable")
    table = FlashTable(onsets[order], onsets[order] + 0.4, at[order], velocities[whose[order]], onsets[order])
    return table, whose[order]


def test_robots_that_cross_each_others_ways_in_step_are_told_apart_by_their_velocities() -> None:
    places = np.array([(10.0, 30.0), (50.0, 31.0), (30.0, 8.0)])
    velocities = np.array([(1.5, 0.0), (-1.5, 0.0), (0.0, 1.5)])
    flashes, whose = straight(places, velocities, np.zeros(3), 5)
    found = link_flashes(flashes, PERIOD_S, FLOOR_CM)
    assert found.robots == 3
    for robot in range(3):
        assert len(set(found.robot[whose == robot])) == 1
        assert found.cycle[whose == robot].tolist() == [1, 2, 3, 4, 5]
    assert found.unsure == 0
    assert found.speed_cm_s == pytest.approx(1.5)


def test_robots_that_cannot_be_told_apart_are_linked_with_half_a_certainty() -> None:
    # two robots that stand 1 cm apart and flash at once: neither place nor time tells
    places = np.array([(30.0, 30.0), (30.3, 30.0), (10.0, 10.0)])
    flashes, _ = straight(places, np.zeros((3, 2)), np.array([0.0, 0.0, 2.0]), 6)
    found = link_flashes(flashes, PERIOD_S, FLOOR_CM)
    is_twin = flashes.places_cm[:, 0] > 20
    certainty = found.certainty[~np.isnan(found.certainty)]
    assert len(certainty) == 15
    assert (found.certainty[is_twin & (found.cycle > 1)] < SURE).all()
    assert (found.certainty[~is_twin & (found.cycle > 1)] > SURE).all()
    assert found.unsure == pytest.approx(10 / 15)


def test_a_flash_that_is_missed_does_not_make_another_robot() -> None:
    places = np.array([(15.0, 15.0), (45.0, 15.0), (30.0, 45.0)])
    flashes, whose = straight(places, np.zeros((3, 2)), np.array([0.0, 1.5, 3.0]), 8)
    keep = np.ones(len(whose), bool)
    keep[np.flatnonzero(whose == 1)[3]] = False
    found = link_flashes(FlashTable(*(column[keep] for column in flashes)), PERIOD_S, FLOOR_CM)
    assert found.robots == 3
    assert found.cycle[whose[keep] == 1].tolist() == [1, 2, 3, 4, 5, 6, 7]


def test_a_robot_too_far_away_is_another_one() -> None:
    places = np.array([(10.0, 10.0), (40.0, 40.0)])
    flashes, whose = straight(places, np.full((2, 2), 0.1), np.array([0.0, 2.5]), 4)
    moved = flashes.places_cm.copy()
    later = np.flatnonzero(whose == 0)[2:]
    moved[later] += (30.0, 0.0)  # someone carried it
    found = link_flashes(flashes._replace(places_cm=moved), PERIOD_S, FLOOR_CM)
    assert found.robots == 3
    assert len(set(found.robot[whose == 1])) == 1


def test_no_flashes_are_of_no_robots() -> None:
    assert link_flashes(FlashTable.of(()), PERIOD_S, FLOOR_CM)[::3] == (pytest.approx(np.empty(0)), 0)
    assert link_flashes(table((1, 30, 30, 0, 0)), PERIOD_S, FLOOR_CM).robot.tolist() == [0]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=8)
def test_a_long_film_is_linked_in_parts_as_whole(seed: int) -> None:
    generator = np.random.default_rng(seed)
    grid = np.array([(x, y) for x in (10.0, 30.0, 50.0) for y in (10.0, 50.0)])
    phases = np.sort(generator.uniform(0, 5, 6))
    flashes, whose = straight(grid, generator.normal(0, 0.02, (6, 2)), phases, 30)
    found = link_flashes(flashes, PERIOD_S, FLOOR_CM)
    assert found.robots == 6
    assert all(len(set(found.robot[whose == robot])) == 1 for robot in range(6))


@settings(max_examples=40)
@given(st.lists(st.lists(st.floats(-5, 0), min_size=4, max_size=4), min_size=1, max_size=4))
def test_links_cost_least(costs: list[list[float]]) -> None:
    rows, flashes = len(costs), len(costs) + 4
    table = np.zeros((flashes, flashes))
    table[:rows, rows:] = costs
    parts, links = (_link(np.arange(float(flashes)), csr_array(table), block_s) for block_s in (2.0, 20.0))
    total = sum(table[source, target] for source, target in enumerate(links) if target >= 0)
    least = min(sum(costs[row][target] for row, target in enumerate(each)) for each in permutations(range(4), rows))
    assert total == pytest.approx(least)
    for taken in (parts[parts >= 0].tolist(), links[links >= 0].tolist()):
        assert len(set(taken)) == len(taken)


def test_a_flash_that_follows_one_long_before_or_after_is_no_alternative() -> None:
    links, onset_s = np.array([2, 3, -1, -1]), np.array([0.0, 5.0, 6.0, 7.0])
    costs = csr_array(([-5.0, -5.0, -5.0], ([0, 0, 1], [2, 3, 3])), shape=(4, 4))
    certainty = _certainties(links, costs, onset_s, 1.0)
    assert certainty == pytest.approx([np.nan, np.nan, 1 / (1 + np.exp(-5)), 1 / (1 + np.exp(-5))], nan_ok=True)


def table(*rows: tuple[float, float, float, float, float]) -> FlashTable:
    """Return flashes with an onset, a place and a velocity each."""
    return FlashTable.of([Flash(at, at + 0.4, x, y, at, *velocity) for at, x, y, *velocity in rows])


def test_a_straight_way_is_where_it_leads() -> None:
    flashes = table((0, 10, 10, 2, 0), (5, 20, 10, 2, 0), (5, 20, 13, 2, 0), (5, 17, 10, 2, 0))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    ways = ways_between(flashes, np.zeros(3, int), np.arange(1, 4), habits)
    assert habits.speed_cm_s == 2
    assert ways.along == pytest.approx([0, 0, -3])
    assert ways.aside == pytest.approx([0, 3, 0])
    assert ways.swerve == pytest.approx(0)
    assert ways.distance == pytest.approx([10, math.hypot(10, 3), 7])
    assert np.argmax(habits.log_likelihood(ways)) == 0


def test_a_way_with_a_turn_tells_how_long_the_turn_took() -> None:
    # 2 s ahead to (14, 10), a turn of 1 s to the left, and 2 s upwards
    flashes = table((0, 10, 10, 2, 0), (5, 14, 14, 0, 2))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    ways = ways_between(flashes, np.array([0]), np.array([1]), habits)
    assert ways.has_turn.all()
    assert ways.turn_s == pytest.approx(1.0)
    assert ways.swerve == pytest.approx(math.pi / 2)
    assert ways.wall_s == pytest.approx((60 - 3.7 - 10) / 2, abs=0.1)
    backwards = ways_between(flashes, np.array([1]), np.array([0]), habits)
    assert not backwards.has_turn.any()


def test_what_is_faster_than_robots_drive_is_no_way() -> None:
    flashes = table((0, 10, 10, 1, 0), (5, 14, 10, -0.5, 1), (5, 50, 50, 1, 0))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    near, far = habits.log_likelihood(ways_between(flashes, np.zeros(2, int), np.array([1, 2]), habits))
    assert far < near - 50


def test_cycles_are_learnt() -> None:
    flashes = table(*((5 * k * 0.8, 10 + 0.1 * k, 30, 0.02, 0) for k in range(12)))
    habits = Habits.at_first(flashes, 5.0, FLOOR_CM)
    ways = ways_between(flashes, np.arange(11), np.arange(1, 12), habits)
    learnt = habits.relearnt(ways)
    gained = learnt.log_likelihood(ways) - habits.log_likelihood(ways)
    assert (gained > 1).all()
    assert learnt.kinds.sum() == pytest.approx(1)


def test_the_commonest_speed_is_that_of_robots_that_do_not_turn() -> None:
    generator = np.random.default_rng(0)
    straight, turning = generator.normal(3, 0.2, 200), generator.uniform(0, 2.5, 150)
    assert commonest_speed(np.concatenate([straight, turning])) == pytest.approx(3, rel=0.02)
    assert commonest_speed(np.full(5, 1.5)) == 1.5
    assert commonest_speed(np.zeros(5)) == 0
