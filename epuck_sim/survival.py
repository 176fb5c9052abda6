"""Synchronisation times of which some are censored (thesis Appendix A).

T_sync is counted in whole cycles. A trial that is not synchronised at its limit is censored there: all that is known of
its T_sync is that it is longer. Throughout, `times` is (n,) cycles and `observed` (n,), True where the trial has
synchronised; of two trials with one time, one synchronised and one censored, the censored one was still at risk.
Times that are negative or not finite, no trials, and arrays of different shapes raise ValueError.
"""

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]

LEAST_UNCENSORED = 0.1
"""If a smaller part of the trials is uncensored, the mean is undetermined (Appendix A)."""

_HALF = 0.5 + 1e-12  # R is a product of rounded fractions: one that should be a half may lie above
_LEAST_STEP = 1e-8  # in log(-log R): a fit is found when the next step would be smaller
_MOST_STEPS = 100  # a fit takes about 5; one that takes more than these is not found
_FEW_TIMES = 20  # with so few event times resamples differ: their fits need more starts, and are quick
_BLOCK = 50_000  # numbers: resamples are fitted in blocks that fit the processor's cache


class Weibull(NamedTuple):
    """A Weibull distribution, F(t) = 1 - exp(-(t / scale) ^ shape)."""

    scale: float
    """alpha, cycles."""
    shape: float
    """gamma."""

    @property
    def mean(self) -> float:
        """The mean, alpha Gamma(1 + 1 / gamma), cycles; inf where no float can hold it.

        >>> round(Weibull(scale=50.0, shape=0.5).mean, 9)
        100.0
        """
        return float(_weibull_means(np.array([math.log(self.scale)]), np.array([self.shape]))[0])


def _weibull_means(log_scales: Floats, shapes: Floats) -> Floats:
    log_gammas = np.array([math.lgamma(1 + 1 / shape) for shape in shapes.tolist()])
    with np.errstate(over="ignore"):
        means: Floats = np.exp(log_scales + log_gammas)
    return means


# --- the Kaplan-Meier estimate ----------------------------------------------------------------------


class _Sample(NamedTuple):
    """Trials in the order of time; those that equal each other share one of m cells."""

    times: Floats  # (m,) cycles
    observed: Bools  # (m,): events come before censorings of the same time
    cell: Counts  # (n,) of each trial, ascending


class _Curves(NamedTuple):
    """Kaplan-Meier estimates of B samples, which have k event times between them."""

    times: Floats  # (k,) cycles, ascending
    events: Counts  # (B, k) trials that synchronise then
    at_risk: Counts  # (B, k) trials still running just before
    survival: Floats  # (B, k + 1) R before the first of the times and after each


def _sample(times: npt.ArrayLike, observed: npt.ArrayLike) -> _Sample:
    t, is_event = np.asarray(times, float), np.asarray(observed, bool)
    if t.ndim != 1 or t.shape != is_event.shape:
        raise ValueError(f"times and observed must be (n,) both, but are {t.shape} and {is_event.shape}")
    if not len(t):
        raise ValueError("there are no trials")
    if not (np.isfinite(t) & (t >= 0)).all():
        raise ValueError("times must be finite and not negative")
    order = np.lexsort((~is_event, t))
    t, is_event = t[order], is_event[order]
    is_new = np.append(True, (t[1:] > t[:-1]) | (is_event[1:] != is_event[:-1]))
    return _Sample(t[is_new], is_event[is_new], np.cumsum(is_new) - 1)


def _curves(sample: _Sample, counts: Counts) -> _Curves:
    """Return the estimates of samples with other numbers of trials, counts (B, m), in the cells."""
    at_risk = counts[:, ::-1].cumsum(axis=1)[:, ::-1][:, sample.observed]
    events = counts[:, sample.observed]
    survival = np.ones((len(counts), events.shape[1] + 1))
    np.cumprod((at_risk - events) / np.maximum(at_risk, 1), axis=1, out=survival[:, 1:])
    return _Curves(sample.times[sample.observed], events, at_risk, survival)


def _curve(sample: _Sample) -> _Curves:
    """Return the estimate of the sample itself: B = 1."""
    return _curves(sample, np.bincount(sample.cell)[None])


def kaplan_meier(times: npt.ArrayLike, observed: npt.ArrayLike) -> tuple[Floats, Floats]:
    """Return the distinct event times, (k,) cycles, ascending, and R after each, (k,) (Appendix A, steps 1 to 5).

    >>> kaplan_meier([3, 5, 5, 8], [True, True, False, True])
    (array([3., 5., 8.]), array([0.75, 0.5 , 0.  ]))
    """
    curve = _curve(_sample(times, observed))
    return curve.times, curve.survival[0, 1:]


def median_time(times: npt.ArrayLike, observed: npt.ArrayLike, level: float = 0.95) -> tuple[float, float, float]:
    """Return the median T_sync and the lower and upper end of its confidence interval, cycles; inf if not reached.

    The median is the first time with R <= 1/2. The interval is from the first time when the lower confidence limit of R
    is at most 1/2 to that when the upper one is (Brookmeyer and Crowley 1982); the limits are symmetrical in
    log(-log R), of which Greenwood (1926) gives the variance.
    """
    curve = _curve(_sample(times, observed))
    n, d, survival = curve.at_risk[0], curve.events[0], curve.survival[0, 1:]
    variance = np.cumsum(d / (n * np.maximum(n - d, 1)))  # of log R; at the last n = d both limits are 0 anyway
    z = NormalDist().inv_cdf((1 + level) / 2)
    power = np.exp(z * np.sqrt(variance) / -np.log(np.maximum(survival, 1e-300)))
    limits = survival, survival**power, survival ** (1 / power)
    median, lower, upper = (float(np.append(curve.times[limit <= _HALF], math.inf)[0]) for limit in limits)
    return median, lower, upper


def restricted_mean(times: npt.ArrayLike, observed: npt.ArrayLike, horizon: float) -> float:
    """Return the mean of T_sync, or of `horizon` where that is less, cycles: the area under R up to there (Irwin 1949).

    NaN, undetermined, where R is not known so far: the longest trial is censored, before the horizon.
    """
    if not 0 <= horizon < math.inf:
        raise ValueError(f"the horizon must be finite and not negative, but is {horizon}")
    sample = _sample(times, observed)
    if sample.times[-1] < horizon and not sample.observed[-1]:
        return math.nan
    curve = _curve(sample)
    edges = np.concatenate([[0.0], np.minimum(curve.times, horizon), [horizon]])
    return float((curve.survival[0] * np.diff(edges)).sum())


# --- the mean ---------------------------------------------------------------------------------------


def fit_weibull(times: npt.ArrayLike, observed: npt.ArrayLike) -> Weibull | None:
    """Return the Weibull distribution that is nearest to the Kaplan-Meier estimate (Appendix A).

    Nearest is the least sum of squares over all uncensored trials. None if no distribution is: it takes two distinct
    event times above 0, and a single trial that brings R to 0 does not count as one.
    """
    lines = _local_fits(_curve(_sample(times, observed)))
    if not len(lines):
        return None
    offset, shape = lines[0].tolist()
    with np.errstate(over="ignore"):
        scale = float(np.exp(-offset / shape))
    return Weibull(scale, shape) if scale < math.inf else None


def mean_time(times: npt.ArrayLike, observed: npt.ArrayLike) -> float:
    """Return the mean T_sync by Appendix A, cycles; NaN where it is undetermined.

    It is undetermined if fewer than `LEAST_UNCENSORED` of the trials are uncensored, or if no Weibull distribution fits
    (see `fit_weibull`). But if all trials synchronised at one time, that time is the mean.

    >>> mean_time([20, 20, 20], [True, True, True])
    20.0
    >>> mean_time([20, 20, 20], [False, False, False])
    nan
    """
    sample = _sample(times, observed)
    curve = _curve(sample)
    mean = float(_means(curve, len(sample.cell), _local_fits(curve)[:1])[0])
    return mean if mean < math.inf else math.nan


def bootstrap_means(times: npt.ArrayLike, observed: npt.ArrayLike, resamples: int = 1000, seed: int = 0) -> Floats:
    """Return Appendix A's mean, (resamples,) cycles, of as many trials drawn with replacement (Efron 1979).

    Where it is undetermined it is inf, longer than can be said, if trials of the resample are censored, else NaN.
    Equal seeds give equal means, in whatever order the trials come.
    """
    sample = _sample(times, observed)
    curve, n, m = _curve(sample), len(sample.cell), len(sample.times)
    starts = _local_fits(curve)
    if len(curve.times) <= _FEW_TIMES:
        starts = np.concatenate([starts, _rough_lines(curve, 4)])
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    means = np.empty(resamples)
    for block in np.array_split(means, max(1, resamples * n // _BLOCK)):
        drawn = sample.cell[random.integers(n, size=(len(block), n))]
        places = drawn + m * np.arange(len(block))[:, None]
        counts = np.bincount(places.ravel(), minlength=m * len(block)).reshape(-1, m)
        block[:] = _means(_curves(sample, counts), n, starts)
    return means


def confidence_interval(means: npt.ArrayLike, level: float = 0.95) -> tuple[float, float]:
    """Return the percentile interval, cycles, of bootstrap means, (b,): two of them, rounded outwards.

    Either end may be inf. NaN are left out, for they say nothing of the length; if all are NaN, so are both ends.
    """
    known = np.asarray(means, float)
    known = known[~np.isnan(known)]
    if not len(known):
        return math.nan, math.nan
    tail = (1 - level) / 2
    # between a finite mean and inf there is nothing to interpolate
    return float(np.quantile(known, tail, method="lower")), float(np.quantile(known, 1 - tail, method="higher"))


def _means(curves: _Curves, trials: int, starts: Floats) -> Floats:
    """Return Appendix A's means, (B,), inf and NaN as in `bootstrap_means`; fits start from each line, (s, 2)."""
    best, least = np.full((len(curves.events), 2), np.nan), np.full(len(curves.events), math.inf)
    points = _points(curves)
    for start in starts:
        lines, squares = _fit(*points, np.tile(start, (len(best), 1)))
        is_better = squares < least
        best[is_better], least[is_better] = lines[is_better], squares[is_better]
    means = _weibull_means(-best[:, 0] / best[:, 1], best[:, 1])
    at_one_time, column = np.nonzero(curves.events == trials)
    means[at_one_time] = curves.times[column]
    uncensored = curves.events.sum(axis=1)
    # a quotient, for 0.1 times the trials may be rounded up
    is_undetermined = np.isnan(means) | (uncensored / trials < LEAST_UNCENSORED)
    means[is_undetermined & (uncensored < trials)] = math.inf
    return means


# --- the fit ----------------------------------------------------------------------------------------
#
# log(-log R) of a Weibull distribution is a line over x = log t, offset + slope x, with gamma = slope and
# log alpha = -offset / slope. A fit is such a line, (offset, slope).


def _points(curves: _Curves) -> tuple[Floats, Floats, Floats]:
    """Return the points to fit: x, (k,), their weights, (B, k), and R, (B, k).

    Appendix A multiplies R trial by trial: d trials of one time are d points, with R from (n - 1) / n to (n - d) / n of
    that before. Their squares add up, but for a constant, to d times the square at their mean. At time 0 every Weibull
    distribution has R = 1: points there cannot matter.
    """
    later = curves.times > 0
    n, d, before = curves.at_risk[:, later], curves.events[:, later], curves.survival[:, :-1][:, later]
    return np.log(curves.times[later]), d.astype(float), before * (n - (d + 1) / 2) / np.maximum(n, 1)


def _rough_lines(curve: _Curves, points: int) -> Floats:
    """Return (s, 2) the lines through each two of up to so many points of one sample, early to late."""
    x, _, survival = _points(curve)
    chosen = np.unique(np.linspace(0, max(len(x) - 1, 0), min(len(x), points)).round().astype(int))
    x, y = x[chosen], np.log(-np.log(np.maximum(survival[0, chosen], 0.01)))  # no line reaches R = 0
    first, second = np.triu_indices(len(x), 1)
    is_rising = (y[second] > y[first]) & (x[second] > x[first])
    first, second = first[is_rising], second[is_rising]
    slope = (y[second] - y[first]) / (x[second] - x[first])
    return np.stack([y[first] - slope * x[first], slope], axis=1)


def _local_fits(curve: _Curves) -> Floats:
    """Return (s, 2) the lines of one sample whose squares are less than their neighbours', the best first.

    As a rule there is one; two or three if, say, a few of the trials are much shorter than all others.
    """
    starts = _rough_lines(curve, 6)
    x, weights, survival = _points(curve)
    shape = (len(starts), len(x))
    lines, squares = _fit(x, np.broadcast_to(weights, shape), np.broadcast_to(survival, shape), starts)
    is_found = np.isfinite(squares)
    _, distinct = np.unique(squares[is_found].round(6), return_index=True)
    return lines[is_found][distinct]


def _fit(x: Floats, weights: Floats, survival: Floats, starts: Floats) -> tuple[Floats, Floats]:
    """Return (B, 2) the lines with the least squares and (B,) these, NaN and inf where none is found.

    x: (k,), weights and survival: (B, k), starts: (B, 2). Newton's method for all samples at once; a step is halved
    until the squares fall.
    """
    lines, least = np.full((len(starts), 2), np.nan), np.full(len(starts), math.inf)
    # Two parameters take two points. With but one above R = 0, the steeper a line through it, the better it fits. With
    # two, neither a step nor a constant is best: there is a line of finite slope.
    rows = np.flatnonzero(((weights > 0) & (survival > 0)).sum(axis=1) >= 2)
    weights, survival = weights[rows], survival[rows]
    line, best = starts[rows], np.full(len(rows), math.inf)
    step, length = np.zeros_like(line), best
    for _ in range(_MOST_STEPS):
        tried = line + step
        squares, next_step, next_length = _newton(x, weights, survival, tried)
        is_better = (squares < best) & (tried[:, 1] > 0)  # gamma > 0
        line, best = np.where(is_better[:, None], tried, line), np.where(is_better, squares, best)
        step = np.where(is_better[:, None], next_step, step / 2)
        length = np.where(is_better, next_length, length / 2)
        is_found, goes_on = length <= _LEAST_STEP, length > _LEAST_STEP  # neither where it is NaN
        lines[rows[is_found]], least[rows[is_found]] = line[is_found], best[is_found]
        rows, line, best = rows[goes_on], line[goes_on], best[goes_on]
        step, length = step[goes_on], length[goes_on]
        if not len(rows):
            break
        weights, survival = weights[goes_on], survival[goes_on]
    return lines, least


def _newton(x: Floats, weights: Floats, survival: Floats, line: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the squares of each line, (B,), the step to take from it, (B, 2), and that step's length, (B,).

    Shapes as for `_fit`. The length is how much the line changes where it matters; it is at most 1, and NaN where the
    squares do not depend on the line.
    """
    z = np.exp(np.minimum(line[:, :1] + line[:, 1:] * x, 6.5))  # -log R; beyond, R is 1e-288 or less
    r = np.exp(-z)
    error, fall = r - survival, r * z  # R falls so much per unit of the line
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


def _moments(x: Floats, w: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the sums of w, (B,), and by the weights w, (B, k): x's means, (B,), x less these, and its variances."""
    total = w.sum(axis=1)
    centre = np.einsum("ij,j->i", w, x) / total
    away = x - centre[:, None]
    return total, centre, away, np.einsum("ij,ij,ij->i", w, away, away) / total
