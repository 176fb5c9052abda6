"""Two samples of a measure: the difference and the ratio of their means, and how likely chance makes them so different.

Where all that is censored is censored at one horizon, means restricted to it are those of samples that are known in
full, and trials are permuted between the samples. Where trials are censored sooner, the test is that of log-ranks
(Mantel 1966).

What is permuted is studentised: the difference of the means, or of their logarithms, over its own standard error
(Janssen 1997). So the level of the test is exact where the two have one distribution, also with 5 trials and far in the
tail, where Welch's test is several times too liberal; with many trials it also holds where only the means are alike.
"""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import erfc

from epuck_sim.arrays import FloatArray
from epuck_sim.estimate import MIN_TRIALS, UNDETERMINED, Estimate
from epuck_sim.statistics.measured import Measured, restrict
from epuck_sim.statistics.statistic import mean_and_error, student_estimate

PERMUTATIONS = 4999  # number of permutations: the smallest p-value is 1 / 5,000

_BLOCK_SIZE = 2_000_000  # trials that are permuted at once


class Pair(NamedTuple):
    """Two samples with a common horizon."""

    first: Measured
    second: Measured

    @property
    def is_share(self) -> bool:
        """Whether both are of truth values."""
        return self.first.is_share and self.second.is_share

    @property
    def is_positive(self) -> bool:
        """Whether all values are, so that the means have a ratio."""
        return all(bool((each.values > 0).all()) for each in self)

    @property
    def is_comparable(self) -> bool:
        """Whether there are trials enough, some of which are uncensored."""
        enough = min(len(each.values) for each in self) >= MIN_TRIALS
        return enough and any(each.observed.any() for each in self)

    @property
    def is_censored_early(self) -> bool:
        """Whether trials are censored before the common horizon."""
        return any((~each.observed & (each.values < each.limit)).any() for each in self)


Parts = list[tuple[float, int]]
"""Variance of each term of a sum, and its degrees of freedom."""


class Contrast(NamedTuple):
    """How the means of two samples differ."""

    difference: Estimate  # the second minus the first; no interval where one has few trials, or is without an error
    bound: float  # the largest that it can be, either way: the horizon where trials are censored, else inf
    parts: Parts  # of the difference
    log_ratio: Estimate  # logarithm of the second over the first; undetermined unless both are positive
    log_parts: Parts


def pair_up(first: Measured, second: Measured) -> Pair:
    """Return two samples, cut at the lower of their horizons where trials of either are censored."""
    return Pair(*restrict((first, second)))


def contrast(pair: Pair) -> Contrast:
    """Return how the means of two samples differ, with Student's intervals."""
    first, second = both = [mean_and_error(each) for each in pair]
    is_known = pair.is_comparable and min(first.error, second.error) > 0  # trials that are all censored show no error
    bound = math.inf if all(each.observed.all() for each in pair) else min(each.horizon for each in pair)
    parts = [(each.error**2, each.freedom) for each in both]
    difference, log_parts, log_ratio = Estimate(second.mean - first.mean), [], UNDETERMINED
    if is_known:
        difference = _within(student_estimate(difference.value, *welch(parts)), bound)
    if min(first.mean, second.mean) > 0:
        log_parts = [((each.error / each.mean) ** 2, each.freedom) for each in both]
        log_ratio = Estimate(math.log(second.mean / first.mean))
        if is_known:
            log_ratio = student_estimate(log_ratio.value, *welch(log_parts))
    return Contrast(difference, bound, parts, log_ratio, log_parts)


def mean_log_ratio(contrasts: Sequence[Contrast]) -> Estimate:
    """Return the mean of the log ratios that have intervals, each of which counts alike."""
    known = [each for each in contrasts if each.log_ratio.has_interval]
    return _mean([each.log_ratio for each in known], [each.log_parts for each in known])


def mean_difference(contrasts: Sequence[Contrast]) -> Estimate:
    """Return the mean of the differences that have intervals, each of which counts alike."""
    known = [each for each in contrasts if each.difference.has_interval]
    mean = _mean([each.difference for each in known], [each.parts for each in known])
    return _within(mean, sum(each.bound for each in known) / max(len(known), 1))


def _within(difference: Estimate, bound: float) -> Estimate:
    """Return a difference whose interval has no ends that cannot be."""
    return difference._replace(low=max(difference.low, -bound), high=min(difference.high, bound))


def _mean(terms: Sequence[Estimate], parts: Sequence[Parts]) -> Estimate:
    if not terms:
        return UNDETERMINED
    count = len(terms)
    of_mean = [(part / count**2, freedom) for each in parts for part, freedom in each]
    return student_estimate(sum(term.value for term in terms) / count, *welch(of_mean))


def welch(parts: Parts) -> tuple[float, float]:
    """Return the standard error of a sum of terms, given with their freedom, and its own freedom (Welch 1947)."""
    variance = sum(part for part, _ in parts)
    spread = sum(part**2 / max(freedom, 1) for part, freedom in parts)
    return math.sqrt(variance), variance**2 / spread if spread else math.inf


Permuted = tuple[FloatArray, FloatArray]
"""What a pair has for a difference, and after permutations, (1 + B,), and the variances of these, (1 + B,).

The difference is that of the means, the second minus the first, or of their logarithms; variances are as each
permutation shows them.
"""


def permute(pair: Pair, seed: int, *, of_logarithms: bool, count: int = PERMUTATIONS) -> Permuted:
    """Return the difference of the means of two samples, and those after permutations of trials between them.

    Args:
        pair: Two samples none of which is censored before the horizon.
        seed: Equal seeds give equal permutations.
        of_logarithms: Whether the difference is that of the logarithms of the means; all values are positive then.
        count: Number B of permutations.
    """
    # in order, so that the order in which trials are stored does not matter
    pooled = np.concatenate([np.sort(each.values) for each in pair])
    first = len(pair.first.values)
    blocks = [_contrasts(block, first, of_logarithms) for block in _permutations(pooled, seed, count)]
    differences, variances = (np.concatenate(each) for each in zip(*blocks, strict=True))
    return differences, variances


def _permutations(pooled: FloatArray, seed: int, count: int) -> Iterator[FloatArray]:
    """Yield the trials, (1, n), and then permutations of them, (b, n) each."""
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    yield pooled[None]
    rows = max(1, _BLOCK_SIZE // len(pooled))
    for start in range(0, count, rows):
        yield random.permuted(np.tile(pooled, (min(rows, count - start), 1)), axis=1)


def _contrasts(trials: FloatArray, first: int, of_logarithms: bool) -> tuple[FloatArray, FloatArray]:
    """Return the difference and its variance, (b,) each, of rows of trials, (b, n), of which so many are the first."""
    parts = trials[:, :first], trials[:, first:]
    means = [part.mean(axis=1) for part in parts]
    variances = [part.var(axis=1, ddof=1) / part.shape[1] for part in parts]
    if of_logarithms:
        variances = [variance / mean**2 for variance, mean in zip(variances, means, strict=True)]
        means = [np.log(mean) for mean in means]
    return means[1] - means[0], variances[0] + variances[1]


def studentised(permuted: Sequence[Permuted]) -> FloatArray:
    """Return the sum of the differences of pairs over its standard error, and that after permutations, (1 + B,)."""
    differences, variances = (np.sum(each, axis=0) for each in zip(*permuted, strict=True))
    scale = float(np.abs(differences).max()) or 1.0
    differences = np.where(np.abs(differences) < 1e-12 * scale, 0.0, differences)  # rounded sums of equal trials
    # without spread any difference is beyond chance, and none is none
    return np.asarray(differences / np.sqrt(np.maximum(variances, (1e-9 * scale) ** 2)))


def share_as_large(statistics: FloatArray) -> float:
    """Return the p-value of the first of some statistics, (1 + B,): the share that is as large, itself included."""
    sizes = np.abs(statistics)
    return float((sizes >= sizes[0] * (1 - 1e-9)).mean())


def log_rank_parts(pair: Pair) -> tuple[float, float]:
    """Return by how much the events of the first sample exceed those expected of it, and the variance of that."""
    times = np.unique(np.concatenate([each.values[each.observed] for each in pair]))
    at_risk = [len(each.values) - np.searchsorted(np.sort(each.values), times) for each in pair]
    events = [
        np.searchsorted(ended, times, "right") - np.searchsorted(ended, times)
        for ended in (np.sort(each.values[each.observed]) for each in pair)
    ]
    n, d = at_risk[0] + at_risk[1], events[0] + events[1]
    share = at_risk[0] / n
    variance = d * share * (1 - share) * (n - d) / np.maximum(n - 1, 1)
    return float((events[0] - d * share).sum()), float(variance.sum())


def log_rank(parts: Sequence[tuple[float, float]]) -> float:
    """Return the p-value of the log-rank test, stratified by the pairs whose `log_rank_parts` are given."""
    excess, variance = (sum(part[k] for part in parts) for k in (0, 1))
    return float(erfc(abs(excess) / math.sqrt(2 * variance))) if variance > 0 else 1.0
