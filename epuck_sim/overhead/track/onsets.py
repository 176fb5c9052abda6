"""Synchrony by the onsets of flashes, without knowing whose they are: the order parameter over time."""

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.track.period_estimation import ORDER_PARAMETER


def order_over_time(onsets_s: FloatArray, period_s: float) -> tuple[FloatArray, IntArray]:
    """Return (n,) order parameters (eq. 4.2) and numbers of the onsets within half a period of each onset.

    Every robot flashes once a period, so that these are one onset of each; before synchrony some cycles are shortened,
    and a robot may be among them twice.

    Args:
        onsets_s: (n,) onsets of flashes, ascending.
        period_s: Period of the oscillators.
    """
    first = np.searchsorted(onsets_s, onsets_s - period_s / 2)
    end = np.searchsorted(onsets_s, onsets_s + period_s / 2)
    sums = np.concatenate([[0], np.cumsum(np.exp(2j * np.pi * onsets_s / period_s))])
    order: FloatArray = np.abs(sums[end] - sums[first]) / (end - first)
    return np.minimum(order, 1.0), end - first


def first_in_order_s(onsets_s: FloatArray, period_s: float, span_s: tuple[float, float], least: float) -> float | None:
    """Return the first onset around which the order parameter is that of synchrony; None if there is none.

    Args:
        onsets_s: (n,) onsets of flashes, ascending.
        period_s: Period of the oscillators.
        span_s: Beginning and end of what was filmed; the period around the onset must be within.
        least: Number of onsets below which the period around an onset holds too few of the robots.
    """
    order, numbers = order_over_time(onsets_s, period_s)
    is_whole = (onsets_s - span_s[0] >= period_s / 2) & (span_s[1] - onsets_s >= period_s / 2)
    found = onsets_s[is_whole & (order >= ORDER_PARAMETER) & (numbers >= least)]
    return float(found[0]) if len(found) else None
