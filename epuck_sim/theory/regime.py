"""Judge whether a swarm has an intermediate regime, from chains whose links are renewed again and again.

A chain keeps the links of a snapshot for some cycles, its hold, and then takes those of another, as the blinking
networks of Belykh, Belykh and Hasler (2004) do. T_sync over the hold has the shape of T_sync over the speed: with a
shorter hold it falls, because swarms wait for links less long, down to that of the fast limit. In between it may rise,
where links last long enough for clusters to agree, but not for clusters to agree with each other. Beardo, Prignano,
Sagarra and Diaz-Guilera (2018, arXiv 1801.03973) find this where networks are sparse and not reciprocal: clusters are
frustrated there.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from epuck_sim.estimate import Estimate
from epuck_sim.statistics.survival import QUANTILE
from epuck_sim.theory.limits import Limit

EVIDENCE = (-2.9, 3.4, 2.0)
"""Log odds of an intermediate regime without evidence, and what `Rise.log_ratio` and `Rise.excess` add to them per
unit; fixed on trials of 130 random scenarios. docs/theory.md says how well they do on others."""

HIDDEN, BEHIND_FALL = 0.3, 4.0
"""Rise below which the peak is looked for behind the steepest fall, and its hold over that where the fall begins."""

YES, NO = 0.7, 0.3  # least probability for the verdict yes, and largest for no; open in between


class Rise(NamedTuple):
    """The rise of T_sync over the hold that is most certain."""

    log_ratio: float
    """Logarithm of T_sync at the peak over that at the minimum before it, less its standard error; 0 without a rise."""
    excess: float
    """Logarithm of the steepest fall when the hold is halved, over 2, less its standard error; 0 or more.

    A swarm that only waits for links then takes half as long. One that takes much less has left a peak, though chains
    may not end there, nor at the minimum before it."""
    minimum: float  # hold at the minimum, in cycles; NaN where it is not seen
    peak: float  # hold at the peak, in cycles


class Verdict(NamedTuple):
    """Whether there is an intermediate regime."""

    verdict: str  # `yes`, `no` or `open`
    probability: float


def find_rise(course: Sequence[Limit]) -> Rise:
    """Return the most certain rise of a course: T_sync with each hold, from the longest on, at last in the fast limit.

    >>> times = {4: 50, 2: 10, 1: 40}
    >>> find_rise([Limit(hold, Estimate(t, t / 1.1, t * 1.1), Estimate(1.0), t) for hold, t in times.items()])[2:]
    (2, 1)
    """
    known = [(limit, *_log(limit)) for limit in course if limit.hold > 0]
    rises = [(0.0, math.nan, math.nan)]
    for place, (peak, top, top_error) in enumerate(known):
        for minimum, bottom, error in known[:place]:
            if not math.isnan(minimum.cycles.value):
                rises.append((top - bottom - math.hypot(top_error, error), minimum.hold, peak.hold))
    log_ratio, minimum_at, peak_at = max(rises)
    falls = [(0.0, math.nan)]
    for (slower, top, top_error), (faster, bottom, error) in pairwise(known):
        if faster.hold >= 1:
            halved = math.log(slower.hold / faster.hold)
            falls.append((top - bottom - halved - math.hypot(top_error, error), slower.hold))
    excess, begin = max(falls)
    if log_ratio < HIDDEN:
        minimum_at, peak_at = math.nan, BEHIND_FALL * begin
    return Rise(log_ratio, excess, minimum_at, peak_at)


def judge(rise: Rise) -> Verdict:
    """Return the verdict on a swarm whose pulses shift phases."""
    base, by_rise, by_fall = EVIDENCE
    probability = 1 / (1 + math.exp(-base - by_rise * rise.log_ratio - by_fall * rise.excess))
    return Verdict("yes" if probability >= YES else "no" if probability <= NO else "open", probability)


def time_at(course: Sequence[Limit], hold: float) -> Estimate:
    """Return T_sync with a hold, interpolated in a course; below its shortest hold, that of the fast limit."""
    *slower, fast = course
    if slower[0].hold <= hold < math.inf:
        return slower[0].cycles.apply(lambda cycles: cycles * hold / slower[0].hold)
    if hold < slower[-1].hold:
        return fast.cycles
    place, rows = -np.log([limit.hold for limit in slower]), np.array([limit.cycles.ends for limit in slower])
    value, low, high = (math.exp(np.interp(-math.log(hold), place, np.log(column))) for column in rows.T)
    return Estimate(value, low, high)


def _log(limit: Limit) -> tuple[float, float]:
    """Return the logarithm of T_sync and its standard error; if no chain has ended, that of all chains' time, and 1."""
    value, low, _ = limit.cycles.ends
    if math.isnan(value):
        return math.log(max(limit.waited, 1.0)), 1.0
    return math.log(value), math.log(value / low) / QUANTILE
