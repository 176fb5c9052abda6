"""The minimum and the peak of a measure along an axis of a sweep, told from noise on a curve that only rises or falls.

Where the minimum and peak of T_sync are a pair with a rise between them (`extrema`), these stand for themselves.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import isotonic_regression

from epuck_sim.arrays import FloatArray
from epuck_sim.estimate import Estimate
from epuck_sim.statistics.extrema import SIGNIFICANCE, SmoothedLogs


class TurningPoint(NamedTuple):
    """A minimum or a peak between the ends of the axis."""

    place: Estimate
    """Value of the axis, with its 95 % interval."""
    value: Estimate
    """Value of the measure there, with its 95 % interval."""
    p_value: float
    """Probability that noise on a curve that only rises or only falls makes one as prominent."""
    kept: float
    """Share of resamples that have one."""

    @property
    def is_found(self) -> bool:
        """Whether it is more than noise: noise neither makes it nor removes it."""
        return self.p_value < SIGNIFICANCE and self.kept > 1 - SIGNIFICANCE

    def record(self) -> dict[str, Estimate | float | None]:
        """Return place and value, None where they may be noise, and the p-value, as JSON and tables hold them."""
        found = {"place": self.place, "value": self.value} if self.is_found else {"place": None, "value": None}
        return {**found, "p_value": self.p_value}


def find_peak(fit: SmoothedLogs) -> TurningPoint | None:
    """Find the most prominent peak of a smoothed curve; None if it only rises, only falls, or has only a minimum.

    Its prominence is how far the logarithm of the measure falls on the side on which it falls less. The p-value
    compares it with those of the best curve that only rises or only falls, under the noise of the resamples.
    """
    (place,), (prominence,) = most_prominent((fit.smoother @ fit.logs)[None])
    if prominence <= 0:
        return None
    noise = fit.resampled - fit.resampled.mean(axis=0)
    _, by_chance = most_prominent((_monotone(fit) + noise) @ fit.smoother.T)
    p_value = (1 + np.count_nonzero(by_chance >= prominence)) / (1 + len(noise))
    curves = fit.resampled @ fit.smoother.T
    places, prominences = most_prominent(curves)
    own = prominences > 0
    x = fit.speeds[places[own]] if own.any() else fit.speeds[[place]]
    values = np.exp(curves[own, places[own]]) if own.any() else np.exp((fit.smoother @ fit.logs)[[place]])
    return TurningPoint(
        Estimate(float(fit.speeds[place]), *np.percentile(x, [2.5, 97.5]).tolist()),
        Estimate(float(np.exp((fit.smoother @ fit.logs)[place])), *np.percentile(values, [2.5, 97.5]).tolist()),
        p_value,
        float(own.mean()),
    )


def find_minimum(fit: SmoothedLogs) -> TurningPoint | None:
    """Find the most prominent minimum of a smoothed curve, as `find_peak` finds the peak."""
    found = find_peak(fit._replace(logs=-fit.logs, resampled=-fit.resampled))
    if found is None:
        return None
    value, low, high = found.value.ends
    return found._replace(value=Estimate(1 / value, 1 / high, 1 / low))


def most_prominent(curves: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where the most prominent peak of each curve, (B, G), is, (B,), and its prominence, (B,); 0 for none."""
    before = np.minimum.accumulate(curves, axis=1)
    after = np.minimum.accumulate(curves[:, ::-1], axis=1)[:, ::-1]
    prominences = curves - np.maximum(before, after)
    places = prominences.argmax(axis=1)
    return places, prominences[np.arange(len(curves)), places]


def _monotone(fit: SmoothedLogs) -> FloatArray:
    """Return the curve, (K,), that only rises or only falls, whichever fits better."""
    weights = 1 / fit.variances
    both = [isotonic_regression(fit.logs, weights=weights, increasing=way).x for way in (False, True)]
    best: FloatArray = min(both, key=lambda curve: float((weights * (fit.logs - curve) ** 2).sum()))
    return best
