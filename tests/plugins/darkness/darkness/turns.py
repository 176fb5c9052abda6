"""Turns of a walk."""

import math

from epuck_sim.util.rng import uniform


def next_turn(random):
    """Return the angle of the next turn, rad."""
    return math.pi * (2 * uniform(random) - 1)
