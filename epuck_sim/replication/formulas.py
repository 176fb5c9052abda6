"""Numbers of the thesis that follow from its equations, without a trial."""

import math
from collections.abc import Callable, Mapping

from scipy.optimize import brentq

THRESHOLD = 0.95
"""Threshold of eq. 3.4 for robots (section 3.3), and of eq. C.2."""


def largest_shift() -> float:
    """Return how far one of 20 robots (3.3) may be from the others, in cycles, at the threshold (eq. 3.4)."""
    return math.acos(1 - 20 * (1 - THRESHOLD)) / (2 * math.pi)


def order_zero() -> float:
    """Return the phase, in cycles, below which a pulse lowers the order parameter of two oscillators (eq. 5.8).

    The sender is at 0, and the multiplicative curve takes the phase phi to (1 + epsilon) phi, with the epsilon of
    section 5.1; the order parameter of two is |cos(pi phi)|.
    """
    return float(brentq(lambda phase: abs(math.cos(math.pi * 1.1 * phase)) - abs(math.cos(math.pi * phase)), 0.3, 0.7))


def sigma_a() -> float:
    """Return how early or late, in s, two halves of a swarm fire at the threshold (eq. C.2, its fraction inverted)."""
    period_s = 5.0  # section 4.3
    return period_s * math.acos(THRESHOLD) / (2 * math.pi)


def sigma_b() -> float:
    """Return the bound of eq. C.3, in frames, with 1 squared inside N / 2 where the text has 1 ^ 1 outside of it."""
    return math.sqrt(2 / 5 * sum(frame**2 for frame in (4, 3, 2, 1)) / 2)


FORMULAS: Mapping[str, Callable[[], float]] = {
    function.__name__: function for function in (largest_shift, order_zero, sigma_a, sigma_b)
}
"""Each number, by the name that claims give."""
