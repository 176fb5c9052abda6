"""Tests of where curves have their minimum, their peak and their fast regime, and of how well curves collapse."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.replication.criteria import MIN_POINTS, weighted_slope
from epuck_sim.replication.effects import Effect, exponentiate, resampled, student
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import search_extrema
from epuck_sim.statistics.fast_regime import find_fast_speed

COLUMNS = ("V_m", "T_m", "V_p", "T_p")
"""Places of a minimum and a peak, as in the resamples of `SpeedExtrema`."""

GRID_POINTS = 200
"""Number of places at which curves are compared."""


class Place(NamedTuple):
    """A place on a curve."""

    value: float
    resampled: FloatArray
    """(B,) that of the resamples; NaN where they have none."""


def find_place(curve: Curve, name: str) -> Place | None:
    """Return a place of a curve of T_sync over speed; None if it has none beyond noise, or with too few trials."""
    if name == "V_f":
        found = find_fast_speed(curve)
        return found and Place(found[0].value, found[1])
    extrema = search_extrema(curve).extrema
    if extrema is None or not extrema.is_found:
        return None
    column = COLUMNS.index(name)
    return Place(float(extrema[column]), extrema.resampled[:, column])


def place_exponent(x: FloatArray, places: Sequence[Place | None], trials: int) -> Effect:
    """Return the exponent of the power of x, (C,), that fits the places of C curves best, in logarithms.

    Curves without the place are left out. Errors are those of the resamples of curves of so many trials a point, and
    larger where places scatter by more than these.
    """
    known = [(float(at), place) for at, place in zip(x, places, strict=True) if place is not None]
    if len(known) < MIN_POINTS:
        return student(math.nan, 0.0, 0)
    errors = np.array([np.nanstd(np.log(place.resampled), ddof=1) for _, place in known])
    if not (errors > 0).all():
        return student(math.nan, 0.0, 0)
    logs = np.log([place.value for _, place in known])
    slope, error = weighted_slope(np.log([at for at, _ in known]), logs, errors)
    return student(slope, error, trials - 1)


class Drawn(NamedTuple):
    """A curve, and what it is drawn over instead of its axis."""

    curve: Curve
    instead: Curve
    """The other quantity at the same points."""


def collapse(drawn: Sequence[Drawn], trials: int) -> Effect:
    """Return how far curves are apart over another quantity, over how far they are apart along their axis.

    It is 0 where they are one curve over the other quantity, and 1 where that does no better than the axis. The error
    is that of resamples of so many trials a point.
    """
    if len(drawn) < 2:
        return student(math.nan, 0.0, 0)
    along = _spreads([(each.curve, np.log(each.curve.x), np.log(each.curve.x)) for each in drawn])
    over = _spreads([(each.curve, *_logs(each.instead)) for each in drawn])
    ratios = np.log(over / along)
    return exponentiate(resampled(float(ratios[0]), ratios[1:], trials - 1))


def _logs(curve: Curve) -> tuple[FloatArray, FloatArray]:
    with np.errstate(divide="ignore"):  # where nothing changes there is no place to compare at
        return np.log(curve.values), np.log(curve.resampled)


def _spreads(curves: Sequence[tuple[Curve, FloatArray, FloatArray]]) -> FloatArray:
    """Return how far curves of T_sync are apart, and how far their resamples are, (1 + B,).

    Args:
        curves: Each with the logarithms of what it is drawn over, (S,), and those of the resamples, (B, S) or (S,).
    """
    first = spread([Course(x, np.log(curve.values)) for curve, x, _ in curves])
    resamples = min(len(curve.resampled) for curve, _, _ in curves)
    others = [
        spread([Course(_row(xs, row), np.log(curve.resampled[row])) for curve, _, xs in curves])
        for row in range(resamples)
    ]
    return np.array([first, *others])


def _row(values: FloatArray, row: int) -> FloatArray:
    return values if values.ndim == 1 else values[row]


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
