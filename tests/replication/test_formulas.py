"""Numbers that follow from equations, put back into these."""

import math

import numpy as np
import pytest

from epuck_sim.order_parameter import order_parameter, reference_order_parameter
from epuck_sim.replication.claims import largest_shift, order_zero, sigma_a, sigma_b


def test_one_robot_of_twenty_so_far_away_has_the_order_of_the_threshold() -> None:
    phases = np.array([0.0] * 19 + [largest_shift()])
    assert reference_order_parameter(phases, 1.0) == pytest.approx(0.95)


def test_below_this_phase_a_pulse_lowers_the_order_and_above_it_raises_it() -> None:
    assert order_zero() == pytest.approx(1 / 2.1)
    for phase, lower in ((order_zero() - 0.01, True), (order_zero() + 0.01, False)):
        before, after = (order_parameter(np.array([0, each]), 1.0) for each in (phase, 1.1 * phase))
        assert (after < before) == lower


def test_two_halves_so_far_away_have_the_order_of_the_threshold() -> None:
    assert order_parameter(np.repeat([-sigma_a(), sigma_a()], 5), 5.0) == pytest.approx(0.95)


def test_the_sum_of_eq_c_3() -> None:
    robots = 10
    assert sigma_b() == pytest.approx(math.sqrt(2 / (5 * robots) * robots / 2 * (4**2 + 3**2 + 2**2 + 1**2)))
