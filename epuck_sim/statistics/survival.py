"""Synchronisation times, some of which are censored (thesis Appendix A).

T_sync is counted in whole cycles. A trial that is not synchronised at its limit is censored there: its T_sync is only
known to be longer. Throughout, `times` is (n,) cycles, finite and not negative, and `observed` (n,), True where the
trial has synchronised. If a synchronised and a censored trial have equal times, the censored one was still at risk.
"""

import math
from collections.abc import Iterator
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.special import log_ndtr

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.estimate import LEVEL

QUANTILE = NormalDist().inv_cdf((1 + LEVEL) / 2)  # number of standard errors that an interval reaches either way

_BLOCK_SIZE = 50_000  # trials drawn at once: a block of resamples fits the processor's cache
_MANY_TRIALS = 10_000  # of more trials, in few kinds, numbers of each kind are drawn at once: the same distribution
_HALF = 0.5 + 1e-12  # R is a product of rounded fractions: one that should be a half may lie above or below


class Sample(NamedTuple):
    """Trials in the order of time; equal ones share one of m cells."""

    times: FloatArray  # (m,) cycles
    observed: BoolArray  # (m,): events come before censorings of the same time
    cell: IntArray  # (n,) cell of each trial, ascending


class SurvivalCurves(NamedTuple):
    """Kaplan-Meier estimates of B samples with k event times in all."""

    times: FloatArray  # (k,) cycles, ascending
    events: IntArray  # (B, k) trials that synchronise then
    at_risk: IntArray  # (B, k) trials still running just before
    survival: FloatArray  # (B, k + 1) R before the first event time and after each


def make_sample(times: npt.ArrayLike, observed: npt.ArrayLike) -> Sample:
    """Sort trials by time, and gather equal ones."""
    t, is_event = np.asarray(times, float), np.asarray(observed, bool)
    order = np.lexsort((~is_event, t))
    t, is_event = t[order], is_event[order]
    is_new = np.append(True, (t[1:] > t[:-1]) | (is_event[1:] != is_event[:-1]))
    return Sample(t[is_new], is_event[is_new], np.cumsum(is_new) - 1)


def count_events(observed: BoolArray, counts: IntArray) -> tuple[IntArray, IntArray]:
    """Return `events` and `at_risk` of `SurvivalCurves`, for cells of a `Sample` with counts (B, m) of trials."""
    return counts[:, observed], counts[:, ::-1].cumsum(axis=1)[:, ::-1][:, observed]


def make_curves(sample: Sample, counts: IntArray) -> SurvivalCurves:
    """Return the estimates of B samples whose cells hold these numbers of trials, counts (B, m)."""
    events, at_risk = count_events(sample.observed, counts)
    survival = np.ones((len(counts), events.shape[1] + 1))
    np.cumprod((at_risk - events) / np.maximum(at_risk, 1), axis=1, out=survival[:, 1:])
    return SurvivalCurves(sample.times[sample.observed], events, at_risk, survival)


def make_curve(times: npt.ArrayLike, observed: npt.ArrayLike) -> SurvivalCurves:
    """Return the estimate of one sample: B = 1."""
    sample = make_sample(times, observed)
    return make_curves(sample, np.bincount(sample.cell)[None])


def are_drawn_by_kind(trials: int, kinds: int) -> bool:
    """Return whether trials are so many, and of so few kinds, that numbers of each kind are drawn sooner."""
    return trials > max(_MANY_TRIALS, 10 * kinds)


def resample_counts(cells: IntArray, kinds: int, resamples: int, seed: int) -> Iterator[IntArray]:
    """Yield the number of trials of each kind in resamples, drawn with replacement (Efron 1979), block by block.

    `cells` are the kinds of n trials, (n,), from 0. The counts of a block are (b, kinds); the b of all blocks add up to
    `resamples`.
    """
    random, n = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed))), len(cells)
    draws_numbers = are_drawn_by_kind(n, kinds)
    shares = np.bincount(cells, minlength=kinds) / n
    drawn_at_once = kinds if draws_numbers else n
    for block in np.array_split(np.arange(resamples), max(1, resamples * drawn_at_once // _BLOCK_SIZE)):
        if draws_numbers:
            yield random.multinomial(n, shares, size=len(block))
        else:
            drawn = cells[random.integers(n, size=(len(block), n))]
            places = drawn + kinds * np.arange(len(block))[:, None]
            yield np.bincount(places.ravel(), minlength=kinds * len(block)).reshape(-1, kinds)


def resampled_curves(
    times: npt.ArrayLike, observed: npt.ArrayLike, resamples: int, seed: int
) -> Iterator[SurvivalCurves]:
    """Yield the estimates of resamples, block by block; they do not depend on the order of the trials."""
    sample = make_sample(times, observed)
    for counts in resample_counts(sample.cell, len(sample.times), resamples, seed):
        yield make_curves(sample, counts)


def median_time(times: npt.ArrayLike, observed: npt.ArrayLike) -> tuple[float, float, float]:
    """Return the median T_sync and the lower and upper end of its confidence interval, cycles; inf if not reached.

    The median is the first time with R < 1/2, or the middle between it and the time with R = 1/2; without censoring it
    is the sample's. The interval is from the first time when the lower confidence limit of R is at most 1/2 to the
    first when the upper one is (Brookmeyer and Crowley 1982); the limits are symmetrical in log(-log R), whose variance
    is Greenwood's (1926).
    """
    curve = make_curve(times, observed)
    n, d, survival = curve.at_risk[0], curve.events[0], curve.survival[0, 1:]
    variance = np.cumsum(d / (n * np.maximum(n - d, 1)))  # of log R; at the last n = d both limits are 0 anyway
    power = np.exp(QUANTILE * np.sqrt(variance) / -np.log(np.maximum(survival, 1e-300)))
    limits = survival**power, survival ** (1 / power)
    lower, upper = (float(np.append(curve.times[limit <= _HALF], math.inf)[0]) for limit in limits)
    return float(medians(curve)[0]), lower, upper


def medians(curves: SurvivalCurves) -> FloatArray:
    """Return the medians, (B,) cycles, as `median_time` does; inf where R does not fall below 1/2."""
    times = np.append(curves.times, math.inf)
    first, second = ((curves.survival[:, 1:] > limit).sum(axis=1) for limit in (_HALF, 1 - _HALF))
    return np.asarray((times[first] + times[second]) / 2)


def restricted_means(curves: SurvivalCurves, horizon: float) -> FloatArray:
    """Return the means, (B,) cycles, of the lesser of T_sync and `horizon`: the areas under R up to there (Irwin 1949).

    If the longest trial is censored before the horizon, R is taken as constant after it.
    """
    return curves.survival @ np.diff(np.minimum(curves.times, horizon), prepend=0.0, append=horizon)


MIN_UNCENSORED = 0.1  # smallest share of uncensored trials from which the mean is estimated (Appendix A)

_FEW_EVENT_TIMES = 20  # up to this number resamples differ much: their fits need more starts, and are quick
_TOLERANCE = 1e-8  # in log(-log R), or twice the log-likelihood: a fit has converged when a step would be smaller
_MAX_STEPS = 100  # a fit takes about 5; one that takes more has not converged


def weibull_mean(times: npt.ArrayLike, observed: npt.ArrayLike) -> float:
    """Return the mean T_sync by Appendix A, cycles; NaN where it is undetermined.

    It is undetermined if fewer than `MIN_UNCENSORED` of the trials are uncensored, or if no Weibull distribution fits:
    a fit takes two distinct event times above 0, not counting one at which a single trial brings R to 0. But if all
    trials synchronised at one time, that time is the mean.

    >>> weibull_mean([20, 20, 20], [True, True, True])
    20.0
    >>> weibull_mean([20, 20, 20], [False, False, False])
    nan
    """
    curve = make_curve(times, observed)
    mean = float(_means(curve, np.size(times), local_fits(curve)[:1])[0])
    return mean if mean < math.inf else math.nan


def weibull_resamples(
    times: npt.ArrayLike, observed: npt.ArrayLike, resamples: int = 1000, seed: int = 0
) -> FloatArray:
    """Return Appendix A's mean, (resamples,) cycles, of resamples drawn with replacement (Efron 1979).

    An undetermined mean is inf, as too long to be determined, if trials of the resample are censored, else NaN. Equal
    seeds give equal means, whatever the order of the trials.
    """
    curve = make_curve(times, observed)
    starts = local_fits(curve)
    if len(curve.times) <= _FEW_EVENT_TIMES:
        starts = np.concatenate([starts, starting_lines(curve, 4)])
    blocks = resampled_curves(times, observed, resamples, seed)
    return np.concatenate([_means(block, np.size(times), starts) for block in blocks])


def confidence_interval(means: FloatArray) -> tuple[float, float]:
    """Return the 95 % percentile interval, cycles, of bootstrap means, (b,); its ends are two of these, outwards.

    Either end may be inf. NaN are left out, as they carry no information; if all are NaN, so are both ends.
    """
    known = means[~np.isnan(means)]
    if not len(known):
        return math.nan, math.nan
    tail = (1 - LEVEL) / 2
    # between a finite mean and inf there is nothing to interpolate
    return float(np.quantile(known, tail, method="lower")), float(np.quantile(known, 1 - tail, method="higher"))


def _means(curves: SurvivalCurves, trials: int, starts: FloatArray) -> FloatArray:
    """Return Appendix A's means, (B,), inf and NaN as in `weibull_resamples`; each start, (s, 2), is a line."""
    best, least = np.full((len(curves.events), 2), np.nan), np.full(len(curves.events), math.inf)
    points = points_to_fit(curves)
    for start in starts:
        lines, squares = fit_lines(*points, np.tile(start, (len(best), 1)))
        is_better = squares < least
        best[is_better], least[is_better] = lines[is_better], squares[is_better]
    log_gammas = np.array([math.lgamma(1 + 1 / shape) for shape in best[:, 1].tolist()])
    with np.errstate(over="ignore"):
        means: FloatArray = np.exp(-best[:, 0] / best[:, 1] + log_gammas)  # alpha Gamma(1 + 1 / gamma)
    at_one_time, column = np.nonzero(curves.events == trials)
    means[at_one_time] = curves.times[column]
    uncensored = curves.events.sum(axis=1)
    # divide, because 0.1 * trials may round up
    is_undetermined = np.isnan(means) | (uncensored / trials < MIN_UNCENSORED)
    means[is_undetermined & (uncensored < trials)] = math.inf
    return means


def points_to_fit(curves: SurvivalCurves) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points to fit: x, (k,), their weights, (B, k), and R, (B, k).

    Appendix A multiplies R trial by trial: d trials with one time are d points, with R from (n - 1) / n to (n - d) / n
    of the R before. Up to a constant, their squares add up to d times the square at their mean. At time 0 every Weibull
    distribution has R = 1, so that points there do not matter.
    """
    later = curves.times > 0
    n, d, before = curves.at_risk[:, later], curves.events[:, later], curves.survival[:, :-1][:, later]
    return np.log(curves.times[later]), d.astype(float), before * (n - (d + 1) / 2) / np.maximum(n, 1)


def starting_lines(curve: SurvivalCurves, points: int) -> FloatArray:
    """Return the rising lines, (s, 2), through each pair of up to `points` points of one sample, early to late."""
    x, _, survival = points_to_fit(curve)
    chosen = np.unique(np.linspace(0, max(len(x) - 1, 0), min(len(x), points)).round().astype(int))
    x, y = x[chosen], np.log(-np.log(np.maximum(survival[0, chosen], 0.01)))  # no line reaches R = 0
    first, second = np.triu_indices(len(x), 1)
    is_rising = (y[second] > y[first]) & (x[second] > x[first])
    first, second = first[is_rising], second[is_rising]
    slope = (y[second] - y[first]) / (x[second] - x[first])
    return np.stack([y[first] - slope * x[first], slope], axis=1)


def local_fits(curve: SurvivalCurves) -> FloatArray:
    """Return the lines, (s, 2), at which the squares of one sample have a local minimum, the best first.

    There is usually one; there are two or three if, for example, a few trials are much shorter than all others.
    """
    starts = starting_lines(curve, 6)
    x, weights, survival = points_to_fit(curve)
    shape = (len(starts), len(x))
    lines, squares = fit_lines(x, np.broadcast_to(weights, shape), np.broadcast_to(survival, shape), starts)
    is_found = np.isfinite(squares)
    _, distinct = np.unique(squares[is_found].round(6), return_index=True)
    return lines[is_found][distinct]


def fit_lines(
    x: FloatArray, weights: FloatArray, survival: FloatArray, starts: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Fit a line to each sample by Newton's method, all at once; a step is halved until the squares fall.

    Points are at `x`, (k,), the log of the event times, with R in `survival`, (B, k), and numbers of trials in
    `weights`, (B, k); fits begin at the lines `starts`, (B, 2). Returned are the lines with the least squares, (B, 2),
    and these squares, (B,); NaN and inf where no fit converges.
    """
    lines, least = np.full((len(starts), 2), np.nan), np.full(len(starts), math.inf)
    # Two parameters need two points. With only one above R = 0, the fit is better the steeper a line through it. With
    # two, neither a step nor a constant is best, so that the slope of the best line is finite.
    rows = np.flatnonzero(((weights > 0) & (survival > 0)).sum(axis=1) >= 2)
    weights, survival = weights[rows], survival[rows]
    line, best = starts[rows], np.full(len(rows), math.inf)
    step, length = np.zeros_like(line), best
    for _ in range(_MAX_STEPS):
        tried = line + step
        squares, next_step, next_length = _newton(x, weights, survival, tried)
        is_better = (squares < best) & (tried[:, 1] > 0)  # gamma > 0
        line, best = np.where(is_better[:, None], tried, line), np.where(is_better, squares, best)
        step = np.where(is_better[:, None], next_step, step / 2)
        length = np.where(is_better, next_length, length / 2)
        has_converged, goes_on = length <= _TOLERANCE, length > _TOLERANCE  # neither where it is NaN
        lines[rows[has_converged]], least[rows[has_converged]] = line[has_converged], best[has_converged]
        rows, line, best = rows[goes_on], line[goes_on], best[goes_on]
        step, length = step[goes_on], length[goes_on]
        if not len(rows):
            break
        weights, survival = weights[goes_on], survival[goes_on]
    return lines, least


def _newton(
    x: FloatArray, weights: FloatArray, survival: FloatArray, line: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the squares of each line, (B,), the step to take from it, (B, 2), and the length of this step, (B,).

    Shapes are those of `fit_lines`. The length is the change of the line at the points; it is at most 1, and NaN where
    the squares do not depend on the line.
    """
    z = np.exp(np.minimum(line[:, :1] + line[:, 1:] * x, 6.5))  # -log R; beyond, R is 1e-288 or less
    r = np.exp(-z)
    error, fall = r - survival, r * z  # fall of R per unit of the line
    pull = weights * fall
    w = pull * (fall + error * (z - 1))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        total, centre, away, spread = _moments(x, w)
        is_convex = (total > 0) & (spread > 0)
        if not is_convex.all():  # Newton's step may lead uphill elsewhere; Gauss and Newton's never does
            w = np.where(is_convex[:, None], w, pull * fall)
            total, centre, away, spread = _moments(x, w)
        pull *= error
        # the step is a line too; from the centre, its rise and its turn are independent of each other
        rise, turn = pull.sum(axis=1) / total, np.einsum("ij,ij->i", pull, away) / (spread * total)
        length = np.maximum(np.abs(rise), np.abs(turn) * np.sqrt(spread))
        step = np.stack([rise - turn * centre, turn], axis=1) / np.maximum(length, 1)[:, None]
    return np.einsum("ij,ij,ij->i", weights, error, error), step, np.minimum(length, 1)


def _moments(x: FloatArray, w: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the sums of the weights w, (B,), the means of x, (B,), x minus these, (B, k), and its variances, (B,)."""
    total = w.sum(axis=1)
    centre = np.einsum("ij,j->i", w, x) / total
    away = x - centre[:, None]
    return total, centre, away, np.einsum("ij,ij,ij->i", w, away, away) / total


class LogNormalFit(NamedTuple):
    """A regression on k terms of the logarithms of n times, about which they scatter normally."""

    coefficients: FloatArray  # (k,)
    errors: FloatArray  # (k,) standard errors
    freedom: int  # degrees of freedom of the errors
    slopes: FloatArray  # (n,) slope of each trial's log-likelihood in what the regression says of it, over the scatter
    weights: FloatArray  # (n,) fall of these slopes, which is 1 for trials that are not censored


def fit_log_normal(design: FloatArray, times: FloatArray, observed: BoolArray) -> LogNormalFit:
    """Fit log T = design @ coefficients, design (n, k), by maximum likelihood (Tobin 1958).

    Newton's method finds the coefficients over the scatter, and the inverse of the scatter, in which the likelihood is
    concave (Olsen 1978). Standard errors follow from the slopes (White 1982), so that the scatter need not be the same
    everywhere. Times must be positive; those observed must differ from every combination of the terms.
    """
    terms = np.column_stack([design, -np.log(times)])
    line = np.linalg.lstsq(design, -terms[:, -1])[0]
    solution = np.append(line, 1) / np.std(terms @ np.append(line, 1))
    events, precision = np.count_nonzero(observed), np.eye(len(solution))[-1]
    for _ in range(_MAX_STEPS):  # it takes up to 20
        beyond = terms @ solution
        hazard = np.exp(-(beyond**2) / 2 - log_ndtr(beyond)) / math.sqrt(2 * math.pi)
        slopes, weights = np.where(observed, -beyond, hazard), np.where(observed, 1, hazard * (hazard + beyond))
        scores = slopes[:, None] * terms + np.outer(observed, precision / solution[-1])
        information = terms.T @ (weights[:, None] * terms) + events * np.outer(precision, precision) / solution[-1] ** 2
        step = np.linalg.solve(information, scores.sum(axis=0))
        if scores.sum(axis=0) @ step < _TOLERANCE:
            break
        while step[-1] <= -solution[-1]:  # scatter is positive
            step /= 2
        solution = solution + step
    coefficients, freedom = solution[:-1] / solution[-1], events - design.shape[1]
    # by the solution's own errors, and the rule for a quotient
    quotient = np.column_stack([np.eye(len(coefficients)), -coefficients]) / solution[-1]
    errors = np.linalg.norm(quotient @ np.linalg.solve(information, scores.T), axis=1) * math.sqrt(events / freedom)
    return LogNormalFit(coefficients, errors, freedom, slopes, weights)
