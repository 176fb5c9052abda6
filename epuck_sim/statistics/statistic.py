"""The values of a measure in the trials of a point, and their statistics, with intervals and resamples.

A mean is that of the sample if no trial is censored, and is restricted to a horizon otherwise. Its interval is
Student's, of the logarithm if all values are positive. With skewed samples of 5 to 200 trials it holds the truth in 90
to 98 % of all cases; percentiles of the bootstrap do in 78 to 96 % (docs/statistics.md).
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import stdtrit

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.display.table import Row, Share, Table, plain
from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.estimate import LEVEL, MIN_TRIALS, UNDETERMINED, Estimate
from epuck_sim.measures.measure import T_SYNC, T_SYNC_S, Measure
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.loader import describe_axes
from epuck_sim.statistics import Statistic, survival
from epuck_sim.util.messages import comma_list, counted

RESAMPLES = 1000  # number of resamples of each point
MOST_CENSORED = 0.5  # least share of censored trials at which figures hatch a point, and minima and peaks leave it out


class Measured(NamedTuple):
    """The values of a measure in n trials."""

    values: FloatArray  # (n,) values; for a censored trial, a lower bound of its value
    observed: BoolArray  # (n,) whether each value is known; otherwise it is censored
    limit: float  # largest value that a trial can have before it is censored; inf for a measure that is never censored
    seed: int  # seed of resamples
    is_share: bool = False
    """Whether the values are truth values, 1 or 0, whose mean is the share of trials in which they are true."""
    unit: str = ""  # unit of the values; empty if they have none

    @property
    def censored(self) -> float:
        """Share of the trials that is censored."""
        return float((~self.observed).mean()) if len(self.observed) else 0.0

    @property
    def is_positive(self) -> bool:
        """Whether all known values are positive; a trial that is censored at 0 is not known to be 0."""
        return bool((self.values[self.observed] > 0).all())

    @property
    def supports_interval(self) -> bool:
        """Whether an interval can be given: there are enough trials, and not all have the same value."""
        return len(self.values) >= MIN_TRIALS and len(np.unique(self.values)) > 1

    @property
    def horizon(self) -> float:
        """Value up to which the distribution is known: the limit, or the longest trial if some are censored sooner.

        Trials that reach their limit of time before that of cycles say nothing about later cycles.
        """
        return self.limit if self.observed.all() else min(self.limit, float(self.values.max()))

    def described(self, found: Estimate, name: str) -> Estimate:
        """Return an estimate with its name, and with the unit, number and censored share of these trials."""
        return found._replace(name=name, unit=self.unit, n=len(self.values), censored=self.censored)


def cut(measured: Measured, limit: float) -> Measured:
    """Return the values as if trials were censored at a lower limit."""
    observed = measured.observed & (measured.values <= limit)
    lowest = min(limit, measured.limit)
    return measured._replace(values=np.minimum(measured.values, limit), observed=observed, limit=lowest)


def restrict(samples: Sequence[Measured]) -> list[Measured]:
    """Return samples, cut at the lowest of their horizons if any trials are censored, so that means are comparable."""
    if all(each.observed.all() for each in samples):
        return list(samples)
    horizon = min(each.horizon for each in samples)
    return [cut(each, horizon) for each in samples]


def quantity(of: str | None, unit: str = "") -> str:
    """Return the name of T_sync, or of a measure, with its unit if it has one.

    >>> quantity(None), quantity("t_sync_s"), quantity("near_walls"), quantity("way", "cm")
    ('T_sync (cycles)', 'T_sync (s)', 'near_walls', 'way (cm)')
    """
    if of is None or of == T_SYNC_S:
        of, unit = "T_sync", "cycles" if of is None else "s"
    return f"{of} ({unit})" if unit else of


def measure_of(point: PointTrials) -> Measure | None:
    """Return the measure of a point; None if it is not found."""
    sections = [section for section in point.scenario.measures if section.name == point.of]
    try:
        return sections[0].find() if sections else None
    except EpuckSimError:  # its file is gone, or is another's
        return None


def measure_unit(point: PointTrials) -> str:
    """Return the unit of a point's values; empty if they are truth values, or the measure has none or is not found."""
    found = measure_of(point)
    return found.unit if found and not any(isinstance(value, bool) for value in point.measured) else ""


def check_units(points: Sequence[PointTrials]) -> None:
    """Raise EpuckSimError if the unit of a measure differs between folders; a measure whose file is gone fits any."""
    units = dict.fromkeys(found.unit or "none" for found in map(measure_of, points) if found)
    if len(units) > 1:
        raise EpuckSimError(f"the unit of {points[0].of} differs: {comma_list([*units])}; give folders with one unit")


def measure_t_sync(point: PointTrials) -> Measured:
    """Return T_sync of a point's trials, in seconds if these were requested; raise StoreError if they have none."""
    if not point.has_t_sync:
        names = comma_list([section.name for section in point.scenario.measures])
        where = f"point {point.number} ({describe_axes(point.axes)}): " if point.axes else ""
        said = "trials have no T_sync: their reference is no oscillator, or stop.order_parameter is null"
        raise StoreError(f"{where}{said}; what was measured: {names} (--of NAME, or read_points(folder, of=NAME))")
    limit = float(point.scenario.stop.max_cycles)
    if point.of != T_SYNC_S:
        return Measured(point.times, point.observed, limit, point.seed, unit="cycles")
    if getattr(point.scenario.stop, "further_cycles", 0):
        raise StoreError("t_sync_s is unknown where trials go on after synchrony: stop.further_cycles is not 0")
    seconds = np.array(point.measured, float)
    slowest = float((seconds / np.maximum(point.times, 1)).max(initial=1))
    return Measured(seconds, point.observed, limit * slowest, point.seed, unit="s")


def measure(point: PointTrials) -> Measured:
    """Return the values of the measure that was requested from `read_points`, or of T_sync if none was.

    Values that are undetermined are left out. Truth values count as 1 and 0, so that their mean is the share of trials
    in which they are true. StoreError is raised for series, and where trials have no T_sync.
    """
    if point.of in T_SYNC:
        return measure_t_sync(point)
    if any(isinstance(value, list) for value in point.measured):
        said = "is a series, with several values a trial; this needs one"
        raise StoreError(f"{point.of} {said}; allowed: plot --form series and summarize (statistics.curves)")
    known = [value for value in point.measured if value is not None and not isinstance(value, list)]
    is_share = bool(known) and all(isinstance(value, bool) for value in known)
    ones = np.ones(len(known), np.bool_)
    return Measured(np.array(known, float), ones, math.inf, point.seed, is_share, measure_unit(point))


def statistic_name(statistic: Statistic, is_censored: bool, *, is_share: bool = False) -> str:
    """Return the name of a statistic, which depends on whether trials are censored, or values are truth values.

    >>> statistic_name(Statistic.MEAN, False), statistic_name(Statistic.MEAN, True)
    ('mean', 'restricted mean')
    """
    mean = "restricted mean" if is_censored else "mean"
    names = {Statistic.MEAN: mean, Statistic.MEDIAN: "median", Statistic.WEIBULL_MEAN: "Weibull mean"}
    if statistic not in names:
        raise EpuckSimError(f"statistic is {statistic!r}; allowed: {comma_list(Statistic)}")
    return "share" if is_share else names[statistic]


def check_statistic(measured: Measured, statistic: Statistic) -> None:
    """Raise EpuckSimError for a statistic that is not defined for a measure."""
    if statistic == Statistic.WEIBULL_MEAN and measured.limit == math.inf:
        raise EpuckSimError("the Weibull mean is for T_sync alone; allowed for measures: mean or median")
    if statistic != Statistic.MEAN and measured.is_share:
        raise EpuckSimError("truth values have no median; allowed: mean, the share of trials in which they are true")


def estimate(measured: Measured, statistic: Statistic, resampled: FloatArray | None = None) -> Estimate:
    """Return a statistic with its interval; undetermined if all trials are censored.

    The interval of a Weibull mean uses `resampled`, which `resample` returns, if it is given.
    """
    name = statistic_name(statistic, measured.censored > 0, is_share=measured.is_share)
    if not measured.observed.any():
        found = UNDETERMINED
    elif measured.is_share:
        found = estimate_share(measured)
    elif statistic == Statistic.MEAN:
        found = estimate_mean(measured)
    elif statistic == Statistic.MEDIAN:
        found = estimate_median(measured)
    else:
        found = estimate_weibull_mean(measured, resampled)
    return measured.described(found, name)


def resample(measured: Measured, statistic: Statistic) -> FloatArray:
    """Return a statistic of `RESAMPLES` resamples, (B,); inf where it is too long to be determined."""
    statistic_name(statistic, measured.censored > 0)  # refuses one that is not known
    if not measured.observed.any():
        return np.full(RESAMPLES, math.inf)
    if statistic == Statistic.MEAN:
        return resample_means(measured, RESAMPLES)
    if statistic == Statistic.WEIBULL_MEAN:
        return survival.weibull_resamples(measured.values, measured.observed, RESAMPLES, measured.seed)
    shift = _shift(measured)
    curves = survival.resampled_curves(measured.values - shift, measured.observed, RESAMPLES, measured.seed)
    return np.concatenate([survival.medians(block) for block in curves]) + shift


def estimate_median(measured: Measured) -> Estimate:
    """Return the median with its interval; no interval below `MIN_TRIALS` trials, or where all have one value."""
    shift = _shift(measured)
    median, low, high = (end + shift for end in survival.median_time(measured.values - shift, measured.observed))
    if math.isinf(median) or measured.censored >= MOST_CENSORED:
        return UNDETERMINED
    return Estimate(median, low, high) if measured.supports_interval else Estimate(median)


def _shift(measured: Measured) -> float:
    """Return the smallest value if it is negative, else 0.0; minus this shift, no value is negative, as for times."""
    return min(float(measured.values.min()), 0.0)


def estimate_weibull_mean(measured: Measured, resampled: FloatArray | None = None) -> Estimate:
    """Return the mean by Appendix A with the percentile interval of resamples; none below `MIN_TRIALS` trials."""
    mean = survival.weibull_mean(measured.values, measured.observed)
    if math.isnan(mean):
        return UNDETERMINED
    if not measured.supports_interval:
        return Estimate(mean)
    if resampled is None:
        resampled = survival.weibull_resamples(measured.values, measured.observed, seed=measured.seed)
    return Estimate(mean, *survival.confidence_interval(resampled))


class MeanError(NamedTuple):
    """A mean and its standard error."""

    mean: float
    error: float  # standard error; 0 for one trial, and if all trials have one value
    freedom: float  # degrees of freedom of the error


def estimate_mean(measured: Measured, level: float = LEVEL) -> Estimate:
    """Return the mean of the sample, or the mean restricted to the horizon where trials are censored.

    There is no interval with fewer than `MIN_TRIALS` trials, or where all trials have one value.
    """
    mean, error, freedom = mean_and_error(measured)
    if len(measured.values) < MIN_TRIALS or error == 0:
        return Estimate(mean)
    if not measured.is_positive:
        return student_estimate(mean, error, freedom, level)
    factor = math.exp(student_quantile(freedom, level) * error / mean)
    highest = math.inf if measured.observed.all() else measured.horizon
    return Estimate(mean, mean / factor, min(mean * factor, highest))


def student_estimate(value: float, error: float, freedom: float, level: float = LEVEL) -> Estimate:
    """Return a value with Student's interval; without one where its standard error is 0."""
    reach = student_quantile(freedom, level) * error
    return Estimate(value, value - reach, value + reach) if error > 0 else Estimate(value)


def student_quantile(freedom: float, level: float = LEVEL) -> float:
    """Return how many standard errors an interval reaches either way."""
    return float(stdtrit(freedom, (1 + level) / 2))


def resample_means(measured: Measured, resamples: int) -> FloatArray:
    """Return the means, (resamples,), of resamples, spread as widely as the means of new samples of the same size.

    The variance of n trials about their own mean is too small by the factor (n - 1) / n, which matters if they are few.
    """
    mean = mean_and_error(measured).mean
    trials = len(measured.values)
    widening = math.sqrt(trials / max(trials - 1, 1))
    if measured.observed.all():
        # sorted, so that the order of the trials does not matter; many have the same whole number of cycles
        values, cells = np.unique(np.sort(measured.values), return_inverse=True)
        counts = survival.resample_counts(cells, len(values), resamples, measured.seed)
        drawn = np.concatenate([block @ values for block in counts]) / trials
    else:
        curves = survival.resampled_curves(measured.values, measured.observed, resamples, measured.seed)
        drawn = np.concatenate([survival.restricted_means(block, measured.horizon) for block in curves])
    if not measured.is_positive:
        return mean + widening * (drawn - mean)
    return mean * (drawn / mean) ** widening


def mean_and_error(measured: Measured) -> MeanError:
    """Return the mean of the sample, or the restricted mean, and its standard error."""
    values, trials = measured.values, len(measured.values)
    if not trials:
        return MeanError(math.nan, 0.0, 0)
    # the spread is known from uncensored trials alone, which may be few
    freedom = min(trials - 1, int(np.count_nonzero(measured.observed)))
    if measured.observed.all():
        if values.min() == values.max():  # rounding would change the mean, and give it an error
            return MeanError(float(values[0]), 0.0, freedom)
        return MeanError(float(values.mean()), float(values.std(ddof=1)) / math.sqrt(trials), freedom)
    curve, horizon = survival.make_curve(values, measured.observed), measured.horizon
    areas = curve.survival[0] * np.diff(np.minimum(curve.times, horizon), prepend=0.0, append=horizon)
    after = areas[::-1].cumsum()[::-1][1:]  # 0 where the last trial at risk synchronises
    at_risk, events = curve.at_risk[0], curve.events[0]
    variance = float((after**2 * events / (at_risk * np.maximum(at_risk - events, 1))).sum())  # Greenwood's formula
    error = math.sqrt(variance * trials / max(trials - 1, 1))
    return MeanError(float(survival.restricted_means(curve, horizon)[0]), error, freedom)


def estimate_share(measured: Measured) -> Estimate:
    """Return the share of trials in which a truth value is true; no interval below `MIN_TRIALS` trials."""
    trials = len(measured.values)
    share = float(measured.values.mean())
    if trials < MIN_TRIALS:
        return Estimate(share)
    return Estimate(share, *wilson_interval(share, trials))


def wilson_interval(share: float, trials: int) -> tuple[float, float]:
    """Return the lower and the upper end of the 95 % interval of a share.

    >>> [round(end, 3) for end in wilson_interval(1.0, 10)]
    [0.722, 1.0]
    """
    weight = survival.QUANTILE**2 / trials
    centre = (share + weight / 2) / (1 + weight)
    reach = math.sqrt(weight * (share * (1 - share) + weight / 4)) / (1 + weight)
    return max(0.0, min(centre - reach, share)), min(1.0, max(centre + reach, share))  # whatever is rounded


def share_difference(first: Measured, second: Measured) -> Estimate:
    """Return the second share minus the first, with Newcombe's interval if both have one."""
    return difference(estimate_share(first).ends, estimate_share(second).ends)


def difference(first: Sequence[float], second: Sequence[float]) -> Estimate:
    """Return the second of two values minus the first; each is given with the ends of its interval.

    Distances from the values to the ends of their intervals are added in squares (Zou and Donner 2008).
    """
    (a, a_low, a_high), (b, b_low, b_high) = first, second
    value = b - a
    return Estimate(value, value - math.hypot(b - b_low, a_high - a), value + math.hypot(b_high - b, a - a_low))


OF_CENSORED = ("restricted_mean", "weibull_mean")  # estimates that tables show if any trials are censored


class PointSummary(NamedTuple):
    """A measure at one point."""

    point: int
    axes: dict[str, Any]
    trials: int  # number of trials that have a result, or a value of the measure
    censored: float  # share of these trials that is censored; 0 without trials
    estimates: dict[str, Estimate]
    """The statistics, by their names in JSON and CSV; a mean of truth values is the share that is true.

    One that is not defined for the measure is undetermined, and has no name."""
    unit: str  # unit of the estimates; empty if they have none
    horizon: float
    """Limit of cycles of T_sync, or the longest trial where some were censored before this limit; inf for a measure."""
    is_share: bool = False  # whether the mean is the share of trials in which a truth value is true
    unbegun: int = 0  # number of trials that are censored at 0 cycles
    undetermined: int = 0  # number of further trials without a value of the measure

    def record(self) -> dict[str, Any]:
        """Return the point as JSON holds it: each estimate with `_low` and `_high`, null where there is none."""
        censored = self.censored if self.trials else None
        head = {"point": self.point, "axes": self.axes, "trials": self.trials, "censored": censored}
        tail = {"horizon": plain(self.horizon), "is_share": self.is_share, "unit": self.unit}
        return {**head, **Row({}, self.estimates).record(), **tail}


class Summaries(list[PointSummary]):
    """The statistics of the points of a sweep; notebooks show them as a table."""

    def __init__(self, points: Sequence[PointSummary], label: str) -> None:
        super().__init__(points)
        self.label = label

    def table(self, folder: str = "") -> Table:
        """Return a table of the statistics that apply to some of the points; people see one mean."""
        names = {name: each.name for point in reversed(self) for name, each in point.estimates.items() if each.name}
        if any(point.censored for point in self):
            every = "restricted mean" if all(point.censored for point in self) else "mean or restricted mean"
            names |= {"mean": "", "restricted_mean": every}
        else:
            names = {name: names[name] for name in names if name not in OF_CENSORED} or {"mean": "mean"}
        is_time = any(point.horizon < math.inf for point in self)
        rows = []
        for point in self:
            censored = {"censored": Share(point.censored) if point.trials else None} if is_time else {}
            estimates = {name: point.estimates[name] for name in names}
            cells = {**censored, **estimates, "unit": point.unit, **({"horizon": point.horizon} if is_time else {})}
            rows.append(Row(point.axes, {"point": point.point, "trials": point.trials, **cells}))
        title = f"{folder}{': ' * bool(folder)}{self.label}, with 95 % intervals"
        has_several = len({point.horizon for point in self if point.censored}) > 1
        return Table(title, rows, [*self._notes()], {**names, "unit": "", "horizon": "horizon" * has_several})

    def _notes(self) -> Iterator[str]:
        if undetermined := sum(point.undetermined for point in self):
            yield f"Left out: {counted(undetermined, 'trial')}, undetermined or not measured yet."
        elif not any(point.trials for point in self):
            yield "No trial has a value yet."
        if any(point.censored for point in self):
            yield (
                "Mean: of all trials, where none is censored. Restricted mean: of the lesser of T_sync and the horizon "
                "(limit of cycles, or longest trial). Weibull mean: extrapolated by thesis Appendix A. -: undetermined."
            )
        if unbegun := sum(point.unbegun for point in self):
            yield f"Censored at 0 cycles, so without effect: {counted(unbegun, 'trial')}, whose reference never fired."
        if few := sum(0 < point.trials < MIN_TRIALS for point in self):
            yield f"No intervals at {few} of {len(self)} points: one takes {MIN_TRIALS} trials or more."

    def _repr_html_(self) -> str:
        return self.table()._repr_html_()


def summarize(points: Iterable[PointTrials]) -> Summaries:
    """Return the statistics of T_sync, or of the measure that was requested from `read_points`, at each point.

    Equal results give equal numbers.

    Args:
        points: What `read_points` returns.

    Raises:
        StoreError: The measure is a series (see `statistics.curves`), or trials have no T_sync.
    """
    if isinstance(points, str | Path):
        raise TypeError(f"points is {str(points)!r}; allowed: what read_points(FOLDER) returns")
    of, made = None, list[PointSummary]()
    for point in points:
        of = point.of
        made.append(_summarize_point(point))
    return Summaries(made, quantity(of, made[0].unit if made else ""))


def _summarize_point(point: PointTrials) -> PointSummary:
    measured = measure(point)
    estimates = dict.fromkeys(("mean", "median", *OF_CENSORED), UNDETERMINED)
    if len(measured.values):
        mean = estimate(measured, Statistic.MEAN)
        estimates["mean"] = measured.described(UNDETERMINED, "mean") if measured.censored else mean
        if not measured.is_share:
            estimates["median"] = estimate(measured, Statistic.MEDIAN)
        if measured.limit < math.inf:
            estimates["restricted_mean"] = mean._replace(name="restricted mean")
            estimates["weibull_mean"] = estimate(measured, Statistic.WEIBULL_MEAN)
    return PointSummary(
        point=point.number,
        axes=point.axes,
        trials=len(measured.values),
        censored=measured.censored,
        estimates=estimates,
        unit=measured.unit,
        horizon=measured.horizon,
        is_share=measured.is_share,
        unbegun=int(np.count_nonzero(measured.values[~measured.observed] == 0)),
        undetermined=sum(value is None for value in point.measured),
    )
