"""Phases between flashes, the order parameter of robots, and pairs that flash together."""

import numpy as np
import pytest

from epuck_sim.order_parameter import order_parameter
from epuck_sim.overhead.robots import first_in_order, order_of_shares, pairs, phase_shares

ONSETS = np.array([0.0, 0.5, 1.0, 1.4, 2.0, 2.4, 4.0])
ROBOT = np.array([0, 1, 0, 1, 0, 1, 0])
ROBOTS = np.array([0, 1])


def test_phases_rise_from_flash_to_flash() -> None:
    times = np.array([0.0, 0.25, 0.5, 0.95, 2.2, 2.5, 3.0, 4.5, 5.5])
    shares = phase_shares(ONSETS, ROBOT, ROBOTS, times, 1.0)
    nan = np.nan
    # robot 0 was not seen for two periods from 2.0 on; robot 1 flashed early, and last at 2.4
    assert shares[:, 0] == pytest.approx([0, 0.25, 0.5, 0.95, nan, nan, nan, 0.5, nan], nan_ok=True)
    assert shares[:, 1] == pytest.approx([nan, nan, 0, 0.5, 0.8, 0.1, 0.6, nan, nan], nan_ok=True)


def test_a_robot_that_never_flashes_has_no_phase() -> None:
    shares = phase_shares(ONSETS, ROBOT, np.array([0, 1, 2]), np.array([0.25, 0.7]), 1.0)
    assert np.isnan(shares[:, 2]).all()
    both = phase_shares(ONSETS, ROBOT, ROBOTS, np.array([0.25, 0.7]), 1.0)
    assert shares[:, :2] == pytest.approx(both, nan_ok=True)
    assert pairs(ONSETS, ONSETS + 0.1, ROBOT, np.array([0, 2])) == [(0, 2, 0, 0)]


def test_the_order_parameter_is_that_of_the_phases() -> None:
    shares = np.array([[0.1, 0.2, 0.3, 0.9], [0.5, 0.5, 0.5, np.nan], [0.5, 0.5, np.nan, np.nan]])
    order = order_of_shares(shares)
    assert order[0] == pytest.approx(float(order_parameter(shares[0], 1.0)))
    assert order[1] == pytest.approx(1)  # three of four are enough
    assert np.isnan(order[2])
    assert first_in_order(np.array([3.0, 4.0, 5.0]), order) == 4.0
    assert first_in_order(np.array([3.0]), order[:1]) is None


def test_pairs_are_those_whose_flashes_overlap() -> None:
    onsets = np.array([0.0, 0.05, 0.5, 1.0, 1.2, 1.5, 2.0, 2.05])
    robot = np.array([0, 1, 2, 0, 1, 2, 0, 1])
    first, *others = pairs(onsets, onsets + 0.1, robot, np.array([0, 1, 2]))
    assert first == (0, 1, 3, 2)
    assert [pair[:2] for pair in others] == [(0, 2), (1, 2)]
    assert all(pair.together == 0 for pair in others)
