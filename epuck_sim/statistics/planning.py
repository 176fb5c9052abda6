"""Number of trials that each point of a sweep needs, estimated from those that are stored."""

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import Any, NamedTuple

from epuck_sim.display.table import Row, Table
from epuck_sim.estimate import MIN_TRIALS
from epuck_sim.measures.measure import T_SYNC
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.statistic import Measured, cut, estimate, mean_and_error, measure, quantity
from epuck_sim.statistics.survival import QUANTILE

POWER = 0.8  # default probability of seeing a difference


class PointPlan(NamedTuple):
    """Trials that one point needs."""

    point: int
    axes: dict[str, Any]
    stored: int  # number of trials that have a value
    statistic: str  # kind of mean: mean, restricted mean, or share of truth values that are true
    mean: float  # cycles, or the measure's unit; NaN where it is undetermined
    spread: float  # standard deviation of a trial over the size of the mean; NaN with too few trials, and of shares
    trials: int | None  # trials of each of two sweeps that show the difference; None where that cannot be said


class TrialPlan(NamedTuple):
    """Trials that a sweep needs for a difference to be seen."""

    difference: float  # relative to the smaller mean; of shares, the difference itself
    power: float  # probability with which it is seen
    points: list[PointPlan]
    over_all: int | None
    """Trials per point that show it over all points together, if all differ alike; None where that cannot be said."""
    of: str | None  # name of the measure; None for T_sync
    unit: str  # unit of its values; empty if they have none
    is_of_shares: bool  # whether the measure is a truth value, so that shares are compared

    def table(self, name: str) -> Table:
        """Return a table of what each point needs; `name` is the sweep's."""
        cells = ("point", "stored", "statistic", "mean", "spread", "trials")
        rows = [Row(point.axes, {cell: getattr(point, cell) for cell in cells}) for point in self.points]
        headings = {"mean": "estimate", "spread": "spread / mean"}
        unit = "percentage points" if self.is_of_shares else "%"
        wanted = f"a difference of {100 * self.difference:g} {unit} in {100 * self.power:g} % of all cases"
        if any(point.trials is not None for point in self.points):
            said = f"Trials: as many as each of two sweeps needs at a point to show {wanted}, with p < 0.05."
        elif known := [point for point in self.points if point.stored >= MIN_TRIALS]:
            why = "no share can differ by so much" if self.is_of_shares else "all have one value, or a mean of 0"
            if censored := [point for point in known if point.statistic == "restricted mean"]:
                why = f"too many are censored at their limit{', or all have one value' * (len(censored) < len(known))}"
            said = f"No number of trials shows {wanted}: {why}."
        else:
            of = "" if self.of in T_SYNC else f" with a value of {self.of}"
            said = f"No point has {MIN_TRIALS} trials{of}, the fewest for a spread; run again with --trials 20 or more."
        over_all = f"Over all points with such a number together, if all differ alike: {self.over_all} at each."
        notes = [said, *[over_all] * (self.over_all is not None)]
        return Table(f"{name}: {quantity(self.of, self.unit)}", rows, notes, headings)


def plan_trials(points: Sequence[PointTrials], difference: float, power: float) -> TrialPlan:
    """Return how many trials show a difference of T_sync, or of the measure that was requested from `read_points`.

    The difference is relative to the smaller mean; for truth values, it is the difference of the shares that are true.
    ValueError: it is not above 0, or the power, a probability, not between 0 and 1.
    """
    if not (difference > 0 and 0 < power < 1):
        given = f"difference is {difference!r}, and power {power!r}"
        raise ValueError(f"{given}; allowed: above 0, and between 0 and 1")
    measured = [measure(point) for point in points]
    known = [each for each in measured if len(each.values)]
    is_of_shares = bool(known) and all(each.is_share for each in known)
    needed = trials_for_shares if is_of_shares else trials_needed
    planned, scatter = [], []
    for point, each in zip(points, measured, strict=True):
        count = len(each.values)
        found, spread = estimate(each, Statistic.MEAN), _spread(each)
        scale, shown = _if_longer(each, spread, difference)
        if is_of_shares and count >= MIN_TRIALS:
            scale = found.value
        trials = None if math.isnan(scale) else needed([scale], shown, power)
        planned.append(PointPlan(point.number, point.axes, count, found.name, found.value, spread, trials))
        if trials is not None:
            scatter.append((scale, shown, found.value))
    # relative differences of means of both signs have no common direction
    is_one_sign = len({mean > 0 for *_, mean in scatter}) == 1 or is_of_shares
    over_all = None
    if scatter and is_one_sign:
        scales, differences, _ = zip(*scatter, strict=True)
        shown = difference if is_of_shares else math.expm1(sum(map(math.log1p, differences)) / len(differences))
        over_all = needed(scales, shown, power)
    return TrialPlan(difference, power, planned, over_all, points[0].of, measured[0].unit, is_of_shares)


def _spread(measured: Measured) -> float:
    """Return the standard deviation of a trial over the size of the mean; NaN with too few trials, and of shares."""
    (mean, error, _), count = mean_and_error(measured), len(measured.values)
    has_spread = count >= MIN_TRIALS and error != 0 and mean != 0 and not measured.is_share
    return error * math.sqrt(count) / abs(mean) if has_spread else math.nan


def _if_longer(measured: Measured, own_spread: float, difference: float) -> tuple[float, float]:
    """Return the spread of trials and of others that take longer, and the difference of their means, both relative.

    Where trials are censored, the others, too, are cut at the limit: their mean is longer by less than their times.
    """
    others = cut(measured, measured.horizon / (1 + difference))  # as many as the limit lets synchronise
    spread = math.hypot(own_spread, _spread(others)) / math.sqrt(2)
    if math.isnan(spread):
        return math.nan, difference
    return spread, (1 + difference) * mean_and_error(others).mean / mean_and_error(measured).mean - 1


def trials_needed(spreads: Sequence[float], difference: float, power: float = POWER) -> int:
    """Return the trials per point that each of two samples needs to show their difference with this probability.

    To show it takes p < 0.05. The difference is relative to the smaller mean. With one relative spread, it is shown at
    that point; with several, over all points together, if all differ alike. Logarithms of means are taken as normal,
    and the spreads as those of both samples.

    >>> trials_needed([0.8], 0.2), trials_needed([0.8] * 20, 0.2)
    (303, 16)
    """
    both_sides = QUANTILE + NormalDist().inv_cdf(power)
    variance = 2 * sum(spread**2 for spread in spreads) / len(spreads) ** 2
    return max(MIN_TRIALS, math.ceil(variance * (both_sides / math.log1p(difference)) ** 2))


def trials_for_shares(shares: Sequence[float], difference: float, power: float = POWER) -> int | None:
    """Return `trials_needed` for shares of truth values; None if they can neither rise nor fall by the difference.

    The other shares may be higher or lower by the difference: the case that takes more trials counts. The number is for
    a test with the correction for continuity, and nearly that for an exact or a permutation test (Casagrande, Pike,
    Smith 1978); with several points, the test is of their mean difference.

    >>> trials_for_shares([0.3], 0.2), trials_for_shares([0.5], 0.6)
    (103, None)
    """
    found = [
        _trials_between(shares, others, power)
        for others in ([share + difference for share in shares], [share - difference for share in shares])
        if min(others) >= 0 and max(others) <= 1
    ]
    return max(found, default=None)


def _trials_between(shares: Sequence[float], others: Sequence[float], power: float) -> int:
    """Return the trials per point that tell shares, (P,), from others that all differ by the same amount."""
    seen = NormalDist().inv_cdf(power)  # standard errors by which the difference exceeds the bound of the test
    count, difference = len(shares), abs(others[0] - shares[0])
    pairs = list(zip(shares, others, strict=True))
    alike = sum(2 * mean * (1 - mean) for mean in ((one + other) / 2 for one, other in pairs))
    apart = sum(one * (1 - one) + other * (1 - other) for one, other in pairs)
    trials = (QUANTILE * math.sqrt(alike) + seen * math.sqrt(apart)) ** 2 / (count * difference**2)  # at all points
    corrected = trials / 4 * (1 + math.sqrt(1 + 4 / (trials * difference))) ** 2
    return max(MIN_TRIALS, math.ceil(corrected / count))
