"""Comparing T_sync, or a measure, of two run folders or at two values of an axis, at each point and over all."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text
from epuck_sim.statistics.curves import group_by_other_axes
from epuck_sim.statistics.estimate import Estimate, without_interval
from epuck_sim.statistics.mean import estimate_mean
from epuck_sim.statistics.measured import Measured, measure
from epuck_sim.statistics.names import Statistic, statistic_name
from epuck_sim.statistics.shares import estimate_share, share_difference
from epuck_sim.statistics.two_samples import (
    Pair,
    contrast,
    log_rank,
    log_rank_parts,
    mean_difference,
    mean_log_ratio,
    pair_up,
    permuted_differences,
    share_as_large,
)
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

PERMUTATION, LOG_RANK = "permutation test of the means", "log-rank test"


class PointComparison(NamedTuple):
    """Two samples of T_sync, in cycles, or of a measure at one point, A and B."""

    axes: dict[str, Any]
    trials: tuple[int, int]
    censored: tuple[float, float]
    """Share of the trials of each, at the lower of the two limits."""
    statistic: str
    """What is compared: mean, restricted mean where trials are censored, or share of truth values that are true."""
    first: Estimate
    """A."""
    second: Estimate
    """B."""
    difference: Estimate
    """B - A."""
    ratio: Estimate
    """B / A; undetermined unless both are positive."""
    p_value: float
    """Probability that chance makes A and B as different; NaN with too few trials."""
    p_holm: float
    """The same, corrected for the number of points (Holm 1979): below 0.05 anywhere by chance in 5 % of all cases."""


class Comparison(NamedTuple):
    """Two sweeps, compared."""

    points: list[PointComparison]
    compared: int
    """Number of points with trials enough to be compared."""
    left_out: int
    """Number of points that only one of the two has trials at."""
    averaged: int
    """Number of these at which B / A has an interval."""
    ratio: Estimate
    """Geometric mean of B / A over these, each of which counts alike."""
    p_value: float
    """Probability that chance makes all points as different together; NaN where none is compared."""
    test: str
    """Name of the test."""
    of: str | None
    """Name of the measure that is compared; None for T_sync."""
    difference: Estimate
    """Mean of B - A over all points that have an interval of it, each of which counts alike."""


Match = tuple[dict[str, Any], PointTrials, PointTrials]
"""Axis values that two points share, and the two."""


def match_folders(first: Sequence[PointTrials], second: Sequence[PointTrials]) -> tuple[list[Match], int]:
    """Match the points of two sweeps that have the same axis values.

    Returns:
        The matches in the order of the first sweep, and how many points only one of the two has trials at.

    Raises:
        EpuckSimError: The sweeps have different axes, or no point in common.
    """
    axes = [sorted(points[0].axes) for points in (first, second)]
    if axes[0] != axes[1]:
        raise EpuckSimError(f"the axes differ: {comma_list(axes[0])}; {comma_list(axes[1])}")
    others = {point.key: point for point in second if len(point.times)}
    tried = [point for point in first if len(point.times)]
    matches = [(point.axes, point, others[point.key]) for point in tried if point.key in others]
    return _check(matches), len(tried) + len(others) - 2 * len(matches)


def match_values(points: Sequence[PointTrials], key: str, values: Sequence[Any]) -> tuple[list[Match], int]:
    """Match the points of one sweep at which an axis has the first and the second of two values.

    Returns:
        As `match_folders`; the axis, and what is tied one-to-one to it, is not among the axes of a match.

    Raises:
        EpuckSimError: There is no such axis, it does not have these values, or no two points match.
    """
    if key not in points[0].axes:
        raise EpuckSimError(f"--axis: {did_you_mean(key, points[0].axes)}; axes: {comma_list(points[0].axes)}")
    if len(values) != 2:
        raise EpuckSimError(f"--axis: {key} is given {len(values)} values; allowed: two, as in {key}=VALUE,VALUE")
    texts = [canonical_text({key: value}) for value in values]
    known = {canonical_text({key: point.axes[key]}): point.axes[key] for point in points}
    for value, text in zip(values, texts, strict=True):
        if text not in known:
            values_known = comma_list([*map(short_repr, known.values())])
            raise EpuckSimError(f"--axis: {key} is never {short_repr(value)}; its values: {values_known}")
    matches, left_out = [], 0
    for axes, group in group_by_other_axes(points, key):
        found = {canonical_text({key: point.axes[key]}): point for point in group if len(point.times)}
        chosen = [found[text] for text in texts if text in found]
        if len(chosen) == 2:
            matches.append((axes, chosen[0], chosen[1]))
        left_out += len(chosen) == 1
    return _check(matches), left_out


def _check(matches: list[Match]) -> list[Match]:
    if not matches:
        raise EpuckSimError("there are no two points to compare that both have trials")
    return matches


def compare(matches: Sequence[Match], left_out: int = 0) -> Comparison:
    """Compare the first and the second points of matches, A and B."""
    pairs = [pair_up(measure(first), measure(second)) for _, first, second in matches]
    good = [pair for pair in pairs if pair.is_comparable]
    is_early = any(pair.is_censored_early for pair in good)
    p_values, p_value = _log_rank_test(good) if is_early else _permutation_test(good)
    tested = iter(zip(p_values, holm(p_values), strict=True))
    points = [
        _compare_point(axes, pair, *(next(tested) if pair.is_comparable else (math.nan, math.nan)))
        for (axes, *_), pair in zip(matches, pairs, strict=True)
    ]
    known = [each for each in map(contrast, good) if each.has_interval]
    test = LOG_RANK if is_early else PERMUTATION
    ratio, difference = _exp(mean_log_ratio(known)), mean_difference(list(map(contrast, good)))
    return Comparison(points, len(good), left_out, len(known), ratio, p_value, test, matches[0][1].of, difference)


def _compare_point(axes: dict[str, Any], pair: Pair, p_value: float, p_holm: float) -> PointComparison:
    is_censored = not all(each.observed.all() for each in pair)
    means = contrast(pair)
    difference, log_ratio = means.difference, means.log_ratio
    if not pair.is_comparable or not means.has_interval:
        log_ratio = without_interval(log_ratio.value)
    if not pair.is_comparable or not means.is_spread:
        difference = without_interval(difference.value)
    if pair.is_share:
        difference = share_difference(*pair)
    return PointComparison(
        axes=axes,
        trials=(len(pair.first.values), len(pair.second.values)),
        censored=(pair.first.censored, pair.second.censored),
        statistic=statistic_name(Statistic.MEAN, is_censored, is_share=pair.is_share),
        first=_mean_or_share(pair.first),
        second=_mean_or_share(pair.second),
        difference=difference,
        ratio=_exp(log_ratio),
        p_value=p_value,
        p_holm=p_holm,
    )


def _mean_or_share(measured: Measured) -> Estimate:
    return estimate_share(measured) if measured.is_share else estimate_mean(measured)


def _permutation_test(pairs: Sequence[Pair]) -> tuple[list[float], float]:
    """Return the p-value of each pair, and of all together."""
    if not pairs:
        return [], math.nan
    # two samples may be of one seed, and two points of two sweeps too
    statistics = [
        permuted_differences(pair, number + pair.first.seed // 2 + pair.second.seed // 2)
        for number, pair in enumerate(pairs)
    ]
    return [share_as_large(each) for each in statistics], share_as_large(np.sum(statistics, axis=0))


def _log_rank_test(pairs: Sequence[Pair]) -> tuple[list[float], float]:
    """Return the p-value of each pair, and of all together."""
    parts = [log_rank_parts(pair) for pair in pairs]
    return [log_rank([each]) for each in parts], log_rank(parts)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values corrected for their number by Holm's method.

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    corrected, largest = [0.0] * len(p_values), 0.0
    for rank, place in enumerate(sorted(range(len(p_values)), key=lambda each: p_values[each])):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[place]))
        corrected[place] = largest
    return corrected


def _exp(logs: Estimate) -> Estimate:
    return Estimate(*(math.exp(number) for number in logs))
