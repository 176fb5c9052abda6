"""How likely a way is from one flash to another."""

import math

import numpy as np
import pytest

from epuck_sim.overhead.identities import FlashTable, Habits, commonest_speed, ways_between

FLOOR_CM = (60.0, 60.0)


def table(*rows: tuple[float, float, float, float, float]) -> FlashTable:
    """Return flashes with an onset, a place and a velocity each."""
    columns = np.array(rows)
    return FlashTable(columns[:, 0], columns[:, 0] + 0.4, columns[:, 1:3], columns[:, 3:5], columns[:, 0])


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
