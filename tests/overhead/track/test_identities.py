"""Whose flashes are whose, by how robots move from one to the next."""

from itertools import permutations
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.identities import SURE, FlashTable, _certainties, _link, link_flashes

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
    found = link_flashes(
        FlashTable(np.empty(0), np.empty(0), np.empty((0, 2)), np.empty((0, 2)), np.empty(0)), PERIOD_S, FLOOR_CM
    )
    assert (found.robots, found.unsure) == (0, 0)
    alone = FlashTable(np.array([1.0]), np.array([1.4]), np.array([[30.0, 30.0]]), np.zeros((1, 2)), np.ones(1))
    assert link_flashes(alone, PERIOD_S, FLOOR_CM).robot.tolist() == [0]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_a_long_film_is_linked_in_parts_as_whole(seed: int) -> None:
    generator = np.random.default_rng(seed)
    grid = np.array([(x, y) for x in (10.0, 30.0, 50.0) for y in (10.0, 50.0)])
    phases = np.sort(generator.uniform(0, 5, 6))
    flashes, whose = straight(grid, generator.normal(0, 0.02, (6, 2)), phases, 30)
    found = link_flashes(flashes, PERIOD_S, FLOOR_CM)
    assert found.robots == 6
    assert all(len(set(found.robot[whose == robot])) == 1 for robot in range(6))


class Fixed(NamedTuple):
    """Costs of links from all flashes to some."""

    targets: IntArray
    table: FloatArray

    def of(self, sources: IntArray) -> tuple[IntArray, FloatArray]:
        return self.targets, self.table[sources]


@given(st.lists(st.lists(st.floats(-5, 2), min_size=4, max_size=4), min_size=1, max_size=4))
def test_links_cost_least(costs: list[list[float]]) -> None:
    table = np.minimum(np.array(costs), 0.0)
    links = _link(np.arange(float(len(table))), Fixed(np.arange(4) + 7, table), 10.0)  # type: ignore[arg-type]
    total = sum(table[row, target - 7] for row, target in enumerate(links) if target >= 0)
    least = min(
        sum(table[row, target] for row, target in enumerate(each)) for each in permutations(range(4), len(table))
    )
    assert total == pytest.approx(least)
    taken = [target for target in links if target >= 0]
    assert len(set(taken)) == len(taken)


def test_a_flash_that_follows_one_long_before_or_after_is_no_alternative() -> None:
    links, onset_s = np.array([2, 3, -1, -1]), np.array([0.0, 5.0, 6.0, 7.0])
    costs = Fixed(np.array([2, 3]), np.array([[-5.0, -5.0], [0.0, -5.0], [0.0, 0.0], [0.0, 0.0]]))
    certainty = _certainties(links, costs, onset_s, 1.0)  # type: ignore[arg-type]
    assert certainty == pytest.approx([np.nan, np.nan, 1 / (1 + np.exp(-5)), 1 / (1 + np.exp(-5))], nan_ok=True)
