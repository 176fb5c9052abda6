"""Phases of the robots of a film, once it is known whose flashes are whose, and what follows from them."""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.track.flash_motion import LONGEST
from epuck_sim.overhead.track.period_estimation import ORDER_PARAMETER

MOST_KNOWN = 0.75
"""Share of the robots whose phase must be known for an order parameter."""


class Pair(NamedTuple):
    """Two robots, and how often they flash together."""

    robot: int
    other: int
    flashes: int
    """Number of flashes of the one with fewer."""
    together: int
    """Number of these that overlap with one of the other."""


def phase_shares(
    onset_s: FloatArray, robot: IntArray, robots: IntArray, times_s: FloatArray, period_s: float
) -> FloatArray:
    """Return (times, robots) the phases of robots, as shares of their cycles; NaN where they are not known.

    A phase rises evenly from one flash of a robot to its next. It is not known before its first flash, after a period
    since its last, and where flashes are missing.

    Args:
        onset_s: (flashes,) onsets, ascending.
        robot: (flashes,) whose they are.
        robots: (robots,) numbers of the robots.
        times_s: (times,) times at which phases are wanted.
        period_s: Period of the oscillators.
    """
    shares = np.full((len(times_s), len(robots)), np.nan)
    for column, number in enumerate(robots):
        own_s = onset_s[robot == number]
        if not len(own_s):
            continue
        cycle_s = np.append(np.diff(own_s), period_s)
        begun = np.searchsorted(own_s, times_s, side="right") - 1
        since_s = times_s - own_s[np.maximum(begun, 0)]
        lasts_s = cycle_s[np.maximum(begun, 0)]
        is_known = (begun >= 0) & (lasts_s <= LONGEST * period_s) & (since_s < lasts_s)
        shares[is_known, column] = (since_s / lasts_s)[is_known]
    return shares


def order_of_shares(shares: FloatArray) -> FloatArray:
    """Return (times,) order parameters (eq. 4.2) of (times, robots) phases; NaN where too few are known."""
    known = ~np.isnan(shares)
    number = known.sum(axis=1)
    total = np.where(known, np.exp(2j * np.pi * np.nan_to_num(shares)), 0.0).sum(axis=1)
    enough = number >= max(2.0, MOST_KNOWN * shares.shape[1])
    order: FloatArray = np.where(enough, np.abs(total) / np.maximum(number, 1), np.nan)
    return order


def first_in_order(times_s: FloatArray, order: FloatArray) -> float | None:
    """Return the first time at which the order parameter is that of synchrony; None if there is none."""
    found = times_s[np.nan_to_num(order) >= ORDER_PARAMETER]
    return float(found[0]) if len(found) else None


def pairs(onset_s: FloatArray, end_s: FloatArray, robot: IntArray, robots: IntArray) -> list[Pair]:
    """Return how often each two robots flash together, those that do so most often first."""
    spans = [(onset_s[robot == number], end_s[robot == number]) for number in robots]
    found = []
    for one in range(len(robots)):
        for two in range(one + 1, len(robots)):
            few, many = sorted((spans[one], spans[two]), key=lambda span: len(span[0]))
            begun = np.searchsorted(many[0], few[1])  # flashes of the other that begin before each ends
            over = np.searchsorted(many[1], few[0], side="right")  # and those that end before it begins
            found.append(Pair(int(robots[one]), int(robots[two]), len(few[0]), int((begun > over).sum())))
    return sorted(found, key=lambda pair: (-pair.together / max(pair.flashes, 1), pair.robot, pair.other))
