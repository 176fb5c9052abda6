"""How well curves lie on one another when they are drawn over one quantity, and over another instead."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray

GRID_POINTS = 200
"""Number of places at which curves are compared."""


class Course(NamedTuple):
    """A curve through S points, in logarithms."""

    x: FloatArray
    """(S,) logarithms of what it is drawn over, in any order."""
    y: FloatArray
    """(S,) logarithms of what is drawn."""


def spread(courses: Sequence[Course]) -> float:
    """Return how far curves are apart where they are drawn over each other: the root of their mean variance about it.

    Curves are interpolated, and compared at places equally far apart in the logarithm; those that only one curve
    reaches do not count, nor do points whose x is infinite. It is 0 where all curves are one; NaN where no two share a
    place.
    """
    courses = [Course(each.x[known], each.y[known]) for each in courses if (known := np.isfinite(each.x)).any()]
    if len(courses) < 2:
        return float("nan")
    lowest, highest = min(each.x.min() for each in courses), max(each.x.max() for each in courses)
    grid = np.linspace(lowest, highest, GRID_POINTS)
    heights = np.array([_interpolate(each, grid) for each in courses])
    reach = np.isfinite(heights)
    shared = reach.sum(axis=0) > 1
    if not shared.any():
        return float("nan")
    return float(np.sqrt(np.nanvar(heights[:, shared], axis=0, ddof=1).mean()))


def _interpolate(course: Course, grid: FloatArray) -> FloatArray:
    order = np.argsort(course.x, kind="stable")
    return np.interp(grid, course.x[order], course.y[order], left=np.nan, right=np.nan)
