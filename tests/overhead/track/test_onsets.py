"""The order parameter of onsets, and the first period in which it is that of synchrony."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.order_parameter import order_parameter
from epuck_sim.overhead.synchrony import first_in_order_s, order_over_time

TOGETHER = np.sort(
    np.concatenate([np.arange(6) / 6 + cycle for cycle in range(3)] + [np.full(6, 4.5), np.full(6, 5.5)])
)
"""Onsets of six robots of a period of 1 s that flash together from 4.5 s on."""


@given(st.lists(st.integers(0, 2000), min_size=1, max_size=30), st.integers(100, 3000))
def test_it_is_that_of_the_onsets_within_half_a_period(onsets_ms: list[int], period_ms: int) -> None:
    onsets = np.sort(np.array(onsets_ms, float))
    order, numbers = order_over_time(onsets, float(period_ms))
    for onset, value, number in zip(onsets, order, numbers, strict=True):
        near = onsets[(onsets >= onset - period_ms / 2) & (onsets < onset + period_ms / 2)]
        assert number == len(near)
        assert value == pytest.approx(float(order_parameter(near, float(period_ms))), abs=1e-9)


def test_synchrony_begins_with_the_first_flash_together() -> None:
    assert first_in_order_s(TOGETHER, 1.0, (0.0, 6.0), 5) == 4.5
    assert first_in_order_s(TOGETHER, 1.0, (0.0, 4.9), 5) is None
    assert first_in_order_s(TOGETHER, 1.0, (4.1, 6.0), 5) == 5.5
    assert first_in_order_s(TOGETHER, 1.0, (0.0, 6.0), 7) is None


def test_a_lone_flash_is_in_step_with_nobody() -> None:
    assert first_in_order_s(np.array([1.0, 3.0, 5.0]), 1.0, (0.0, 6.0), 2) is None
    assert first_in_order_s(np.empty(0), 1.0, (0.0, 6.0), 2) is None
