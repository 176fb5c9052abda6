"""Columns of millions of rows, which SQLite gives as one text: an object of Python for each value takes far longer."""

import numpy as np

from epuck_sim.arrays import IntArray

NULL = -1
"""Number that stands for NULL in a column of numbers that are never negative."""


def read_numbers(text: str | None) -> IntArray:
    """Return the whole numbers of a text in which commas part them, as `group_concat` makes it; none of NULL."""
    return np.fromstring(text or "", np.int64, sep=",")
