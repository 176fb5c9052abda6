"""The growth rate of a small perturbation, on series that are made up."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.replication.verdicts import LARGEST, growth

CYCLES = np.arange(300)


@given(st.floats(-0.02, 0.04))
def test_the_rate_of_an_exponential_is_found(rate) -> None:
    assert growth(1e-9 * np.exp(rate * CYCLES)) == pytest.approx(rate, abs=1e-9)


def test_a_factor_that_comes_once_is_no_growth() -> None:
    assert growth(1e-9 * np.minimum(1 + 0.1 * CYCLES, 1.5)) == pytest.approx(0, abs=1e-12)
    assert growth(1e-9 * np.where(CYCLES < 5, 1, 1.5)) == pytest.approx(0, abs=1e-12)


def test_what_comes_after_the_deviation_has_become_large_does_not_count() -> None:
    growing = np.minimum(1e-9 * np.exp(0.07 * CYCLES), 0.3)
    assert growing[-1] > LARGEST
    assert growth(growing) == pytest.approx(0.07, rel=0.02)


def test_one_that_vanishes_shrinks() -> None:
    assert growth(np.where(CYCLES < 40, 1e-9, 0)) < -0.05
    assert growth(1e-9 * np.exp(-0.5 * CYCLES)) == pytest.approx(-0.5, rel=0.05)
