"""The local minimum and the peak of a curve of T_sync against speed, or why they cannot be looked for."""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import MIN_SPEEDS, MIN_TRIALS, SpeedExtrema, find_minimum_and_peak
from epuck_sim.statistics.statistic import MOST_CENSORED


class ExtremaSearch(NamedTuple):
    """What has been found on a curve."""

    extrema: SpeedExtrema | None
    """The pair, which may be noise (`SpeedExtrema.is_found`); None where it cannot be looked for."""
    reason: str
    """Why it cannot, and what would be enough; empty where it can."""


def search_extrema(curve: Curve) -> ExtremaSearch:
    """Look for the local minimum and the peak of a curve over speed.

    Speeds with fewer than `extrema.MIN_TRIALS` trials, or where half of them or more are censored, are left out.
    """
    moving = curve.x > 0
    tried = moving & (curve.trials >= MIN_TRIALS)
    usable = tried & (curve.censored < MOST_CENSORED) & np.isfinite(curve.values)
    reason = _reason_against(curve, moving, tried, usable)
    if reason:
        return ExtremaSearch(None, reason)
    found = find_minimum_and_peak(curve.x[usable], curve.values[usable], curve.resampled[:, usable])
    return ExtremaSearch(found, "" if found else f"at fewer than {MIN_SPEEDS} speeds T_sync is known well enough")


def _reason_against(curve: Curve, moving: BoolArray, tried: BoolArray, usable: BoolArray) -> str:
    speeds, enough, left = (np.count_nonzero(chosen) for chosen in (moving, tried, usable))
    if speeds < MIN_SPEEDS:
        return f"{speeds} speeds; a minimum and a peak take {MIN_SPEEDS}"
    if enough < MIN_SPEEDS:
        return (
            f"fewer than {MIN_TRIALS} trials at {speeds - enough} of {speeds} speeds, which noise alone makes rise; "
            f"--trials {MIN_TRIALS} is the least, and 200 show a rise of a fifth"
        )
    if left < MIN_SPEEDS:
        return (
            f"half of the trials or more are censored at {enough - left} of {enough} speeds; {MIN_SPEEDS} others are "
            "the least: raise stop.max_cycles"
        )
    first, last = np.flatnonzero(usable)[[0, -1]]
    hidden = curve.x[first:last][(tried & ~usable)[first:last]]
    if len(hidden):
        return (
            f"half of the trials or more are censored from V = {hidden[0]:g} to {hidden[-1]:g} cm/s, where a peak may "
            "be: raise stop.max_cycles"
        )
    return ""
