"""The tests that claims may name: pure functions from trials of some points, or from curves, to an effect.

They test means, which are restricted to the limit of cycles if trials are censored, and whose ratios are compared in
logarithms; shares; whole distributions; and curves: where they have their minimum, their peak and their fast regime,
and how well they collapse.
"""

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import stats
from scipy.special import bdtr, bdtrc, stdtr

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import LEVEL, MIN_TRIALS, Estimate
from epuck_sim.statistics import statistic
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import Place, find_fast_speed, search_extrema
from epuck_sim.statistics.statistic import MeanError, Measured, cut, estimate_share, mean_and_error, student_estimate
from epuck_sim.statistics.survival import weibull_mean

RESAMPLES = 200  # number of resamples of a ratio of estimators
MIN_POINTS = 3  # fewest points of a slope: two do not tell how well they lie on a line
SCATTERED = 4.0  # mean square of deviations over errors: more trials reduce a slope's variance by a quarter at most
GRID_POINTS = 200  # places at which curves are compared
NEARLY_1 = 1 - 1e-12  # largest correlation to which Fisher's transform is applied

LAWS = {"Weibull": stats.weibull_min, "gamma": stats.gamma, "log-normal": stats.lognorm}
"""Distributions of positive numbers, each of two parameters: a shape and a scale."""

FITTED_TRIALS = 20  # fewest trials of a point whose distribution is fitted
FITTED_VALUES = 6  # fewest values that they have: T_sync of a few cycles is too coarse to tell distributions apart


class Effect(NamedTuple):
    """Effect that a test finds in the trials of some points."""

    estimate: Estimate
    p_above: Callable[[float], float]  # one-sided p-value of an effect above a threshold
    p_below: Callable[[float], float]  # the same for an effect below it
    is_scattered: bool = False
    """Whether points scatter so much about a line that more trials of them would tell little more: `SCATTERED`."""


def student(value: float, error: float, freedom: float) -> Effect:
    """Return a value with Student's interval; without an error nothing is known of it, and all p-values are 1."""
    if not error > 0:
        return Effect(Estimate(value), lambda _: 1.0, lambda _: 1.0)
    return Effect(
        student_estimate(value, error, freedom),
        lambda threshold: float(stdtr(freedom, (threshold - value) / error)),
        lambda threshold: float(stdtr(freedom, (value - threshold) / error)),
    )


NOTHING = student(math.nan, 0.0, 0)  # effect of which nothing is known


def transformed(effect: Effect, back: Callable[[float], float], into: Callable[[float], float]) -> Effect:
    """Return an effect, given that of a rising function of it, `into`, such as its logarithm; `back` is the inverse."""
    return Effect(
        effect.estimate.apply(back),
        lambda threshold: effect.p_above(into(threshold)),
        lambda threshold: effect.p_below(into(threshold)),
    )


def exponentiate(effect: Effect) -> Effect:
    """Return the effect whose logarithm is given; its thresholds are above 0."""
    return transformed(effect, math.exp, math.log)


def resampled(value: float, values: FloatArray, freedom: float) -> Effect:
    """Return a value whose error is the standard deviation of its resamples, (B,), of which some may be NaN."""
    known = values[np.isfinite(values)]
    return student(value, float(known.std(ddof=1)) if len(known) > 1 else 0.0, freedom)


def mean_with_error(measured: Measured) -> MeanError:
    """Return the mean, restricted where trials are censored, and its standard error.

    If all are censored, they show no scatter: the error is then the one that they would have if one of them had ended
    at once. With fewer than `MIN_TRIALS` trials the error is 0, which `student` takes as unknown.
    """
    trials = len(measured.values)
    if trials < MIN_TRIALS:
        return MeanError(float(measured.values.mean()) if trials else math.nan, 0.0, 0)
    if measured.observed.any():
        return mean_and_error(measured)
    return MeanError(measured.horizon, measured.horizon / trials, trials - 1)


def level(sample: Measured) -> Effect:
    """Return the mean of a point's trials; if some are censored, it is never shown to be below the horizon or more."""
    found = student(*mean_with_error(sample))
    end = math.inf if sample.observed.all() else sample.horizon
    return found._replace(p_below=lambda threshold: found.p_below(threshold) if threshold < end else 1.0)


def share(sample: Measured) -> Effect:
    """Return the share of trials that are synchronised within the limit, or in which a truth value is true.

    The interval is Wilson's; the p-values are those of the exact binomial test.
    """
    truths, trials = _truths(sample), len(sample.values)
    if trials < MIN_TRIALS:
        return student(float(truths.values.mean()) if trials else math.nan, 0.0, 0)
    found, true = estimate_share(truths), int(truths.values.sum())
    return Effect(
        found,
        lambda threshold: float(bdtrc(true - 1, trials, threshold)) if true else 1.0,
        lambda threshold: float(bdtr(true, trials, threshold)),
    )


def share_difference(first: Measured, second: Measured) -> Effect:
    """Return the second share minus the first; the p-values, of 0, are those of Fisher's exact test."""
    one, other = _truths(first), _truths(second)
    sizes, true = (len(one.values), len(other.values)), int(other.values.sum())
    if min(sizes) < MIN_TRIALS:
        return NOTHING
    chance = stats.hypergeom(sum(sizes), true + int(one.values.sum()), sizes[1])
    found = statistic.share_difference(one, other)
    return Effect(found, lambda _: float(chance.sf(true - 1)), lambda _: float(chance.cdf(true)))


def _truths(sample: Measured) -> Measured:
    if len(sample.values) and not (sample.is_share or math.isfinite(sample.limit)):
        raise EpuckSimError("a share counts trials in which a measure is true; this measure has other values")
    true = sample.values > 0 if sample.is_share else sample.observed
    return Measured(true.astype(float), np.ones(len(true), bool), math.inf, sample.seed, is_share=True)


def ratio(pairs: Sequence[tuple[Measured, Measured]]) -> Effect:
    """Return the geometric mean, over pairs of points, of the second mean over the first; each pair counts alike."""
    return exponentiate(student(*_log_ratio([mean_with_error(each) for pair in pairs for each in pair])))


def largest_rise(curves: Sequence[Sequence[Measured]]) -> Effect:
    """Return the largest ratio of the mean at a point of a curve to that at any point before it.

    It is below a threshold if all ratios are, each of which is tested by itself: the p-value is the largest of theirs.
    It is above one if any ratio is: the p-value is the least, times the number of ratios (Bonferroni). The ends of the
    interval are the largest ends of all ratios; the lower ones are corrected for the number of ratios.
    """
    rises = [_log_ratio(pair) for curve in curves for pair in combinations(map(mean_with_error, curve), 2)]
    largest = max((value for value, *_ in rises), default=math.nan)
    if not all(error > 0 for _, error, _ in rises) or not rises:
        return exponentiate(student(largest, 0.0, 0))
    effects = [student(*each) for each in rises]
    corrected = 1 - (1 - LEVEL) / len(rises)
    low = max(student_estimate(*each, corrected).low for each in rises)
    return exponentiate(
        Effect(
            Estimate(largest, low, max(each.estimate.high for each in effects)),
            lambda threshold: min(1.0, len(effects) * min(each.p_above(threshold) for each in effects)),
            lambda threshold: max(each.p_below(threshold) for each in effects),
        )
    )


def weighted_slope(x: FloatArray, logs: FloatArray, errors: FloatArray, freedom: int) -> Effect:
    """Return the slope of logarithms over x by weighted least squares; all are (S,).

    If points scatter about the line by more than their errors, which have `freedom`, the slope's error is enlarged by
    as much, and has the freedom of the scatter.
    """
    weights = 1 / errors**2
    away = x - np.average(x, weights=weights)
    spread = float(weights @ away**2)
    found = float(weights @ (away * logs)) / spread
    deviations = logs - np.average(logs, weights=weights) - found * away
    misfit = float(weights @ deviations**2) / (len(x) - 2)
    effect = student(found, math.sqrt(max(misfit, 1.0) / spread), freedom if misfit <= 1 else len(x) - 2)
    return effect._replace(is_scattered=misfit > SCATTERED)


def slope(x: FloatArray, samples: Sequence[Measured]) -> Effect:
    """Return the slope over x, (S,), of the line that fits the logarithms of the means of S points best."""
    means = [mean_with_error(each) for each in samples]
    if len(means) < MIN_POINTS or not all(each.mean > 0 < each.error for each in means):
        return NOTHING
    errors = np.array([each.error / each.mean for each in means])
    return weighted_slope(x, np.log([each.mean for each in means]), errors, len(means) - 2)


def _log_ratio(means: Sequence[MeanError]) -> tuple[float, float, float]:
    """Return the mean over pairs of the logarithm of the second mean over the first, its error and its freedom.

    The freedom is the least of all means. Welch's, which is larger, rejects too often in the far tail: with 20
    exponential times, in 3.7e-4 of all cases where 2.0e-4 is nominal; the least freedom does in 1.5e-4. The error is 0
    if any mean has none, as nothing is known of its scatter.
    """
    if not all(each.mean > 0 for each in means):  # nor NaN
        return math.nan, 0.0, 0
    logs, pairs = [math.log(each.mean) for each in means], len(means) / 2
    error = math.hypot(*(each.error / each.mean for each in means)) / pairs
    is_known = all(each.error > 0 for each in means)
    return (sum(logs[1::2]) - sum(logs[::2])) / pairs, error if is_known else 0.0, min(each.freedom for each in means)


def superiority(first: Measured, second: Measured) -> Effect:
    """Return the probability that a trial of the second sample takes longer than one of the first.

    Equal trials, such as those censored at one limit, count half: for equal distributions it is 0.5. The test is that
    of Brunner and Munzel (2000); if the samples do not overlap at all, it is that of n independent pairs.
    """
    sizes = len(first.values), len(second.values)
    if min(sizes) < MIN_TRIALS:
        return NOTHING
    ranks = stats.rankdata(np.concatenate([first.values, second.values]))
    own = ranks[: sizes[0]], ranks[sizes[0] :]
    value = float((own[1].mean() - own[0].mean()) / sum(sizes)) + 0.5
    # a rank among all exceeds the rank in its own sample by the number of smaller trials in the other sample
    within = [stats.rankdata(each.values) for each in (first, second)]
    parts = [size * float((mine - among).var(ddof=1)) for size, mine, among in zip(sizes, own, within, strict=True)]
    spread = sum(part**2 / (size - 1) for part, size in zip(parts, sizes, strict=True))
    pairs = min(sizes)  # pairs of trials, one from each sample; they all agree if the samples are apart
    end = ((1 - LEVEL) / 2) ** (1 / pairs)
    if value == 1:
        return Effect(Estimate(1.0, end, 1.0), lambda threshold: threshold**pairs, lambda _: 1.0)
    if value == 0:
        return Effect(Estimate(0.0, 0.0, 1 - end), lambda _: 1.0, lambda threshold: (1 - threshold) ** pairs)
    error = math.sqrt(sum(parts)) / (sizes[0] * sizes[1])
    return student(value, error, sum(parts) ** 2 / spread if spread else 0)


def rank_trend(x: FloatArray, samples: Sequence[Measured]) -> Effect:
    """Return Spearman's correlation of the trials of S points with x, (S,); -1 if each is less than all at smaller x.

    Interval and p-values are those of Fisher's transform, with the error of Bonett and Wright (2000).
    """
    places = np.repeat(x, [len(each.values) for each in samples])
    values = np.concatenate([each.values for each in samples])
    if len(samples) < 2 or len(values) < 2 * MIN_TRIALS or len(np.unique(values)) == 1:
        return NOTHING
    rho = float(np.clip(stats.spearmanr(places, values).statistic, -NEARLY_1, NEARLY_1))
    error = math.sqrt((1 + rho**2 / 2) / (len(values) - 3))
    return transformed(student(math.atanh(rho), error, len(values) - 2), math.tanh, math.atanh)


def likelier(samples: Sequence[Measured], law: str, than: str) -> Effect:
    """Return the log-likelihood of trials by one law minus that by another, in nats per trial, mean over all trials.

    Both are fitted to each point by maximum likelihood. The test is that of Vuong (1989), for laws neither of which is
    a special case of the other. Points with censored trials, with fewer than `FITTED_TRIALS` trials or with fewer than
    `FITTED_VALUES` values are left out.
    """
    gains = []
    for each in samples:
        values, is_known = each.values, each.observed.all() and (each.values > 0).all()
        if is_known and len(values) >= FITTED_TRIALS and len(np.unique(values)) >= FITTED_VALUES:
            one, other = (LAWS[name].logpdf(values, *LAWS[name].fit(values, floc=0)) for name in (law, than))
            gains.append(one - other)
    trials = sum(map(len, gains))
    if not trials:
        return NOTHING
    spread = sum(float(each.var(ddof=1)) * len(each) for each in gains)
    return student(float(np.concatenate(gains).mean()), math.sqrt(spread) / trials, trials - len(gains))


def weibull_ratio(sample: Measured, limit: float) -> Effect:
    """Return the Weibull mean of trials as if they had been censored at a limit, over the mean of all (Appendix A).

    The error is that of resamples; nothing is known where trials are censored, or too few.
    """
    if len(sample.values) < MIN_TRIALS or not sample.observed.all():
        return NOTHING

    def log_ratio(values: FloatArray) -> float:
        seen = cut(sample._replace(values=values), limit)
        return math.log(weibull_mean(seen.values, seen.observed) / float(values.mean()))

    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(sample.seed)))
    resamples = [log_ratio(random.choice(sample.values, len(sample.values))) for _ in range(RESAMPLES)]
    return exponentiate(resampled(log_ratio(sample.values), np.array(resamples), len(sample.values) - 1))


def find_place(curve: Curve, name: str) -> Place | None:
    """Return a place of a curve of T_sync over speed; None if it has none beyond noise, or with too few trials."""
    return find_fast_speed(curve) if name == "V_f" else search_extrema(curve).places.get(name)


def place_exponent(x: FloatArray, places: Sequence[Place | None], trials: int) -> Effect:
    """Return the exponent of the power of x, (C,), that fits the places of C curves best, in logarithms.

    Curves without the place are left out. Errors are those of the resamples of curves with `trials` trials per point,
    and larger if places scatter by more than these.
    """
    known = [(float(at), place) for at, place in zip(x, places, strict=True) if place is not None]
    if len(known) < MIN_POINTS:
        return NOTHING
    errors = np.array([np.nanstd(np.log(place.resampled), ddof=1) for _, place in known])
    if not (errors > 0).all():
        return NOTHING
    logs = np.log([place.estimate.value for _, place in known])
    return weighted_slope(np.log([at for at, _ in known]), logs, errors, trials - 1)


def collapse(drawn: Sequence[tuple[Curve, Curve]], trials: int) -> Effect:
    """Return the distance of curves over another quantity, relative to their distance along their axis.

    Each curve is given with that of the other quantity at the same points. The effect is 0 if they are one curve over
    the other quantity, and 1 if that does no better than the axis. The error is that of resamples of `trials` trials.
    """
    if len(drawn) < 2:
        return NOTHING
    courses = [(np.log(curve.x), _log_rows(instead), _log_rows(curve)) for curve, instead in drawn]
    rows = range(min(len(y) for *_, y in courses))
    along = np.array([spread([(x, y[row]) for x, _, y in courses]) for row in rows])
    over = np.array([spread([(instead[row], y[row]) for _, instead, y in courses]) for row in rows])
    ratios = np.log(over / along)
    return exponentiate(resampled(float(ratios[0]), ratios[1:], trials - 1))


def _log_rows(curve: Curve) -> FloatArray:
    """Return (1 + B, S) logarithms of a curve's values and of its resamples."""
    with np.errstate(divide="ignore"):  # 0, as where nothing changes, is no place to compare at
        return np.asarray(np.log(np.vstack([curve.values, curve.resampled])))


def spread(courses: Sequence[tuple[FloatArray, FloatArray]]) -> float:
    """Return the distance of curves drawn over each other: the root of their variance, averaged over places.

    A curve is x, in any order, and y, both (S,) and in logarithms. Curves are interpolated, and compared at places
    equally far apart in the logarithm; places that only one curve reaches do not count, nor do points whose x is
    infinite. The distance is 0 if all curves are one; NaN if no two share a place.
    """
    courses = [(x[known], y[known]) for x, y in courses if (known := np.isfinite(x)).any()]
    if len(courses) < 2:
        return math.nan
    ends = np.concatenate([x for x, _ in courses])
    grid, heights = np.linspace(ends.min(), ends.max(), GRID_POINTS), []
    for x, y in courses:
        order = np.argsort(x, kind="stable")
        heights.append(np.interp(grid, x[order], y[order], left=np.nan, right=np.nan))
    shared = np.isfinite(heights).sum(axis=0) > 1
    if not shared.any():
        return math.nan
    return float(np.sqrt(np.nanvar(np.array(heights)[:, shared], axis=0, ddof=1).mean()))
