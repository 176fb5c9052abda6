"""Compare T_sync, or a measure, of run folders, values of an axis, or named points: pair by pair, and over all.

If trials are censored only at a common horizon, samples cut there are known in full, and means are compared. If trials
are censored sooner, the log-rank statistic is (Mantel 1966). Both tests permute trials between the samples.

The permuted statistic is studentised: the difference of the means, or of their logarithms, over its own standard error
(Janssen 1997), and so is the log-rank statistic (Neuhaus 1993). So the level is exact if the two have one distribution,
also with 5 trials and far in the tail, where tests without permutations, Welch's and the log-rank test, are several
times too liberal; with many trials it also holds if only the means are equal, or censoring differs.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.display.table import AtMost, Row, Share, Table, cell_text
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import LEVEL, MIN_TRIALS, UNDETERMINED, Estimate
from epuck_sim.measures.measure import T_SYNC
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text, group_rows, texts_of_values
from epuck_sim.scenario.keys import axis_key
from epuck_sim.statistics import Statistic, statistic
from epuck_sim.statistics.statistic import MeanError, Measured, measure, restrict, share_difference, student_estimate
from epuck_sim.statistics.survival import are_drawn_by_kind, count_events
from epuck_sim.util.messages import comma_list, counted, in_yaml

PERMUTATIONS = 4999  # number of permutations: the smallest p-value is 1 / 5,000
_BLOCK_SIZE = 200_000  # trials that are permuted at once, in the cache of a processor


class Pair(NamedTuple):
    """Two samples with a common horizon."""

    first: Measured
    second: Measured

    @property
    def is_share(self) -> bool:
        """Whether the values of both are truth values."""
        return self.first.is_share and self.second.is_share

    @property
    def is_positive(self) -> bool:
        """Whether all values are positive, so that the means have a ratio."""
        return all(each.is_positive for each in self)

    @property
    def is_comparable(self) -> bool:
        """Whether both have enough trials, and some trials are uncensored at their common horizon."""
        enough = min(len(each.values) for each in self) >= MIN_TRIALS
        return enough and any(each.observed.any() for each in restrict(self))

    @property
    def is_censored_early(self) -> bool:
        """Whether trials are censored before the common horizon."""
        return any((~each.observed & (each.values < each.limit)).any() for each in self)


def pair_up(first: Measured, second: Measured) -> Pair:
    """Return two samples, cut at the lower of their horizons if trials are censored, unless none is known up to it."""
    cut = restrict((first, second))
    return Pair(*cut) if any(each.observed.any() for each in cut) else Pair(first, second)


def contrast(pair: Pair, *, of_logarithms: bool) -> MeanError:
    """Return the difference of the means of two samples, or of their logarithms; its error is 0 if it is not known."""
    first, second = means = [statistic.mean_and_error(each) for each in pair]
    is_known = pair.is_comparable and min(first.error, second.error) > 0  # trials that are all censored show no error
    if of_logarithms:
        first, second = means = [MeanError(math.log(mean), error / mean, freedom) for mean, error, freedom in means]
    return welch(second.mean - first.mean, means if is_known else [])


def mean_contrast(contrasts: Sequence[MeanError]) -> Estimate:
    """Return the unweighted mean of the contrasts whose errors are known."""
    known = [each for each in contrasts if each.error > 0]
    if not known:
        return UNDETERMINED
    shares = [each._replace(error=each.error / len(known)) for each in known]
    return student_estimate(*welch(sum(each.mean for each in known) / len(known), shares))


def mean_share_difference(differences: Sequence[Estimate]) -> Estimate:
    """Return the mean of the differences that have intervals, which are combined as by Zou and Donner (2008)."""
    known = [each for each in differences if each.has_interval]
    if not known:
        return UNDETERMINED
    value = sum(each.value for each in known) / len(known)
    below = math.hypot(*(each.value - each.low for each in known)) / len(known)
    above = math.hypot(*(each.high - each.value for each in known)) / len(known)
    return Estimate(value, value - below, value + above)


def welch(value: float, terms: Sequence[MeanError]) -> MeanError:
    """Return the sum of terms, given as a value, with its standard error and degrees of freedom (Welch 1947)."""
    variance = sum(each.error**2 for each in terms)
    spread = sum(each.error**4 / max(each.freedom, 1) for each in terms)
    return MeanError(value, math.sqrt(variance), variance**2 / spread if spread else math.inf)


Permuted = tuple[FloatArray, FloatArray]
"""Contrast of a pair, as it is and after B permutations, (1 + B,), and the variances of these, (1 + B,)."""


def permute(pair: Pair, seed: int, *, of_logarithms: bool, count: int = PERMUTATIONS) -> Permuted:
    """Return the contrast of two samples, and those after permutations of trials between them.

    Neither may have trials that are censored before the horizon. Equal seeds give the same `count` permutations.
    """
    # sorted, so that the order in which trials are stored does not matter
    pooled = np.concatenate([np.sort(each.values) for each in pair])
    first = len(pair.first.values)
    differences, variances = [], []
    for trials in _permutations(pooled, first, seed, count):
        parts = trials[:, :first], trials[:, first:]
        means = [part.mean(axis=1) for part in parts]
        squares = [part.var(axis=1, ddof=1) / part.shape[1] for part in parts]  # of the means' standard errors
        if of_logarithms:
            squares = [square / mean**2 for square, mean in zip(squares, means, strict=True)]
            means = [np.log(mean) for mean in means]
        differences.append(means[1] - means[0])
        variances.append(squares[0] + squares[1])
    return np.concatenate(differences), np.concatenate(variances)


def _permutations(pooled: FloatArray, first: int, seed: int, count: int) -> Iterator[FloatArray]:
    """Yield the trials, (1, n), and then permutations, (b, n) each, in any order within the `first` and the others."""
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed)))
    yield pooled[None]
    values, numbers = np.unique(pooled, return_counts=True)
    if are_drawn_by_kind(len(pooled), len(values)):
        for drawn in (random.multivariate_hypergeometric(numbers, first) for _ in range(count)):
            yield np.repeat(np.tile(values, 2), np.append(drawn, numbers - drawn))[None]
        return
    rows = max(1, _BLOCK_SIZE // len(pooled))
    for start in range(0, count, rows):
        yield random.permuted(np.tile(pooled, (min(rows, count - start), 1)), axis=1)


def studentised(permuted: Sequence[Permuted]) -> FloatArray:
    """Return the sum of the differences of pairs over its standard error, and that after permutations, (1 + B,)."""
    differences, variances = (np.sum(each, axis=0) for each in zip(*permuted, strict=True))
    scale = float(np.abs(differences).max()) or 1.0
    differences = np.where(np.abs(differences) < 1e-12 * scale, 0.0, differences)  # rounded sums of equal trials
    # without spread, any difference but 0 is beyond chance
    return np.asarray(differences / np.sqrt(np.maximum(variances, (1e-9 * scale) ** 2)))


def share_as_large(statistics: FloatArray) -> float:
    """Return the p-value of the first of some statistics, (1 + B,): the share that is as large, itself included.

    It is a bound if no other is as large.
    """
    sizes = np.abs(statistics)
    are_as_large = sizes >= sizes[0] * (1 - 1e-9)
    return (AtMost if are_as_large.sum() == 1 else float)(are_as_large.mean())


def permute_ranks(pair: Pair, seed: int, count: int = PERMUTATIONS) -> Permuted:
    """Return the events of the first sample beyond those expected (Mantel 1966), as `permute` does the contrast."""
    values, observed = (np.concatenate([getattr(each, name) for each in pair]) for name in ("values", "observed"))
    kinds, cells = np.unique(values + 1j * ~observed, return_inverse=True)  # in the order of time, events before others
    first, is_event = len(pair.first.values), kinds.imag == 0
    d, n = count_events(is_event, np.bincount(cells)[None])
    excesses, variances = [], []
    for trials in _permutations(np.concatenate([np.sort(cells[:first]), np.sort(cells[first:])]), first, seed, count):
        places = trials[:, :first] + len(kinds) * np.arange(len(trials))[:, None]
        counts = np.bincount(places.ravel(), minlength=len(trials) * len(kinds)).reshape(-1, len(kinds))
        events, at_risk = count_events(is_event, counts)
        share = at_risk / n
        excesses.append((events - d * share).sum(axis=1))
        variances.append((d * share * (1 - share) * (n - d) / np.maximum(n - 1, 1)).sum(axis=1))
    return np.concatenate(excesses), np.concatenate(variances)


PERMUTATION, LOG_RANK = "studentised permutation test of the means", "permuted log-rank test"

Points = Sequence[PointTrials]


class Samples(NamedTuple):
    """Samples that are compared: k of them at each of some points."""

    names: list[str]  # (k,) names of the samples
    matches: list[tuple[dict[str, Any], list[PointTrials | None]]]
    """Axis values of each point, and its k samples; None where one has no trials."""


class PointComparison(NamedTuple):
    """Two samples of T_sync, or of a measure, at one point, A and B."""

    axes: dict[str, Any]
    trials: tuple[int, int]
    censored: tuple[float, float]  # share of censored trials of each, at the lower limit if they are compared
    statistic: str  # mean, restricted mean where trials are censored, or share of truth values that are true
    first: Estimate  # undetermined where all trials are censored, as are difference and ratio then
    second: Estimate
    difference: Estimate  # B - A
    ratio: Estimate  # B / A; undetermined unless both are positive
    p_value: float  # probability that chance makes A and B as different; NaN with too few trials
    p_holm: float = math.nan  # the same, corrected for the number of points and pairs (Holm 1979)


class Comparison(NamedTuple):
    """Two samples, A and B, compared at each point and over all."""

    a: str
    b: str
    points: list[PointComparison]
    compared: int  # number of points with enough trials to be compared
    left_out: int  # number of points at which only one of the two has trials
    averaged: int  # number of compared points at which the tested quantity has an interval
    tested: str  # quantity of p-values and intervals: `ratio` if all values are positive, else `difference`
    ratio: Estimate  # geometric mean of B / A over the points averaged; undetermined if differences are tested
    difference: Estimate  # mean of B - A over these; undetermined if ratios are tested
    p_value: float  # probability that chance makes all points as different together; NaN where none is compared
    p_holm: float  # the same, corrected for the number of pairs
    test: str
    of: str | None  # name of the measure that is compared; None for T_sync, `t_sync_s` for T_sync in seconds
    unit: str  # unit of its values; empty if they have none


def match_folders(folders: Sequence[Points], names: Sequence[str]) -> Samples:
    """Match the points of sweeps that have the same axis values, in the order in which these come."""
    statistic.check_units([points[0] for points in folders])
    axes = [sorted(points[0].axes) for points in folders]
    if any(keys != axes[0] for keys in axes):
        instead = "name the points to compare: --points 0,0, one of each folder, by its number"
        raise EpuckSimError(f"the axes differ: {'; '.join(map(comma_list, axes))}; {instead}")
    by_key = [{point.key: point for point in points if len(point.times)} for points in folders]
    every = {point.key: point.axes for points in by_key for point in points.values()}
    return Samples([*names], [(axes, [each.get(key) for each in by_key]) for key, axes in every.items()])


def match_points(folders: Sequence[Points], names: Sequence[str], chosen: Sequence[Sequence[int]]) -> Samples:
    """Match points of sweeps, which may have any axes: each of `chosen` has the number of a point in each folder."""
    chosen_points = []
    for numbers in chosen:
        if len(numbers) != len(folders):
            given = counted(len(numbers), "number")
            raise EpuckSimError(f"--points is given {given}; allowed: {len(folders)}, one of each folder")
        for number, points, name in zip(numbers, folders, names, strict=True):
            if not 0 <= number < len(points):
                raise EpuckSimError(f"--points: {name} has no point {number}; allowed: 0 to {len(points) - 1}")
        chosen_points.append([folder[number] for number, folder in zip(numbers, folders, strict=True)])
    shared = [
        key
        for key in folders[0][0].axes
        if all(len({canonical_text({key: point.axes.get(key)}) for point in points}) == 1 for points in chosen_points)
    ]
    matches = [
        (
            {"points": ", ".join(map(str, numbers)), **{key: points[0].axes[key] for key in shared}},
            [point if len(point.times) else None for point in points],
        )
        for numbers, points in zip(chosen, chosen_points, strict=True)
    ]
    return Samples([*names], matches)


def match_values(points: Points, key: str, values: Sequence[Any]) -> Samples:
    """Match the points of one sweep that have these values of an axis, or an ending of it, and are otherwise alike.

    The axis, and axes that are tied one-to-one to it, are not among the axes of a match.
    """
    rows = [point.axes for point in points]
    key = axis_key(key, rows, "--axis")
    texts = texts_of_values(rows, key, values, "--axis")
    if len(set(texts)) < max(2, len(texts)):
        given = counted(len(set(texts)), "value")
        raise EpuckSimError(f"--axis: {key} is given {given}; allowed: two or more, all different")
    matches = []
    for axes, places in group_rows(rows, key):
        group = [points[place] for place in places if len(points[place].times)]
        found = {canonical_text({key: point.axes[key]}): point for point in group}
        matches.append((axes, [found.get(text) for text in texts]))
    return Samples([f"{key} = {value if isinstance(value, str) else in_yaml(value)}" for value in values], matches)


def compare(samples: Samples, *, with_first: bool = False) -> list[Comparison]:
    """Compare all pairs of samples, or all with the first, with p-values corrected for the number of points and pairs.

    Raises:
        EpuckSimError: No point has trials of two samples.
    """
    if not any(sum(point is not None for point in points) > 1 for _, points in samples.matches):
        raise EpuckSimError("nothing to compare: no point has trials on two sides")
    pairs = [(a, b) for a, b in combinations(range(len(samples.names)), 2) if a == 0 or not with_first]
    compared = [each for a, b in pairs if (each := _compare(samples, a, b))]
    at_points = iter(holm([point.p_value for each in compared for point in each.points]))
    over_all = holm([each.p_value for each in compared])
    return [
        each._replace(points=[point._replace(p_holm=next(at_points)) for point in each.points], p_holm=p_holm)
        for each, p_holm in zip(compared, over_all, strict=True)
    ]


def _compare(samples: Samples, a: int, b: int) -> Comparison | None:
    """Compare two of the samples, without correction; return None where they share no point."""
    sides = [(axes, points[a], points[b]) for axes, points in samples.matches]
    matches = [(axes, first, second) for axes, first, second in sides if first is not None and second is not None]
    if not matches:
        return None
    pairs = [pair_up(measure(first), measure(second)) for _, first, second in matches]
    good = [pair for pair in pairs if pair.is_comparable]
    is_ratio = all(pair.is_positive and not any(each.is_share for each in pair) for pair in good or pairs)
    is_early = any(pair.is_censored_early for pair in good)
    permuting = permute_ranks if is_early else partial(permute, of_logarithms=is_ratio)
    # two samples may be of one seed, and two points of two sweeps too
    seeds = [number + sum(each.seed // 2 for each in pair) for number, pair in enumerate(good)]
    permuted = [permuting(*each) for each in zip(good, seeds, strict=True)]
    p_values = [share_as_large(studentised([each])) for each in permuted]
    p_value = share_as_large(studentised(permuted)) if permuted else math.nan
    contrasts = [contrast(pair, of_logarithms=is_ratio) for pair in good]
    each = zip(good, contrasts, strict=True)
    estimates = [share_difference(*pair) if pair.is_share else student_estimate(*found) for pair, found in each]
    mean = mean_share_difference(estimates) if all(pair.is_share for pair in good) else mean_contrast(contrasts)
    tested = iter(zip(p_values, estimates, strict=True))
    return Comparison(
        a=samples.names[a],
        b=samples.names[b],
        points=[
            _compare_point(axes, pair, *(next(tested) if pair.is_comparable else (math.nan, None)), is_ratio=is_ratio)
            for (axes, *_), pair in zip(matches, pairs, strict=True)
        ],
        compared=len(good),
        left_out=sum((first is None) != (second is None) for _, first, second in sides),
        averaged=sum(each.has_interval for each in estimates),
        tested="ratio" if is_ratio else "difference",
        ratio=mean.apply(math.exp) if is_ratio else UNDETERMINED,
        difference=UNDETERMINED if is_ratio else mean,
        p_value=p_value,
        p_holm=math.nan,
        test=LOG_RANK if is_early else PERMUTATION,
        of=matches[0][1].of,
        unit=pairs[0].first.unit,
    )


def _compare_point(
    axes: dict[str, Any], pair: Pair, p_value: float, tested: Estimate | None, *, is_ratio: bool
) -> PointComparison:
    first, second = (statistic.estimate(each, Statistic.MEAN) for each in pair)
    difference = Estimate(second.value - first.value)
    ratio = Estimate(second.value / first.value) if min(first.value, second.value) > 0 else UNDETERMINED
    if is_ratio and tested is not None and not math.isnan(ratio.value):
        ratio = tested.apply(math.exp)
    elif not is_ratio and tested is not None:
        difference = tested
    return PointComparison(
        axes=axes,
        trials=(first.n, second.n),
        censored=(pair.first.censored, pair.second.censored),
        statistic=first.name if first.censored else second.name,
        first=first,
        second=second,
        difference=difference,
        ratio=ratio,
        p_value=p_value,
    )


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values corrected for their number by Holm's method; NaN do not count, and bounds stay bounds.

    >>> holm([0.01, 0.04, math.nan, 0.03])
    [0.03, 0.06, nan, 0.06]
    """
    corrected, largest = [math.nan] * len(p_values), 0.0
    known = sorted((place for place, p in enumerate(p_values) if not math.isnan(p)), key=lambda each: p_values[each])
    for rank, place in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * p_values[place]))
        corrected[place] = type(p_values[place])(largest)
    return corrected


def comparison_tables(compared: Sequence[Comparison]) -> list[Table]:
    """Return a table of all points, and for several pairs one of their results over all."""
    first, is_one = compared[0], len(compared) == 1
    names = list(dict.fromkeys(name for each in compared for name in (each.a, each.b)))
    letters = {name: chr(ord("A") + number) if number < 26 else str(number) for number, name in enumerate(names)}
    legend = [f"{letter}: {name}" for name, letter in letters.items()]
    title = "\n".join([f"{statistic.quantity(first.of, first.unit)}, with 95 % intervals", *legend])
    one, other = (letters[first.a], letters[first.b]) if is_one and first.a != first.b else ("first", "second")
    headings = {"first": one, "second": other, "p_value": "p", "p_holm": "p (Holm)", "a": "", "b": "", "unit": ""}
    headings |= {"difference": f"{other} - {one}", "ratio": f"{other} / {one}"}
    for what in ("trials", "censored"):
        headings |= {f"{what}_a": f"{what} {one}", f"{what}_b": f"{what} {other}"}
    pairs = [{} if is_one else {"pair": f"{letters[each.a]}, {letters[each.b]}"} for each in compared]
    rows = []
    for pair, each in zip(pairs, compared, strict=True):
        for point in each.points:
            cells: dict[str, Any] = {"a": each.a, "b": each.b, "unit": each.unit}
            cells |= dict(zip(("trials_a", "trials_b"), point.trials, strict=True))
            if first.of in T_SYNC:
                cells |= dict(zip(("censored_a", "censored_b"), map(Share, point.censored), strict=True))
            others = ("first", "second", "difference", "ratio", "p_value", "p_holm")
            rows.append(Row({**pair, **point.axes}, cells | {name: getattr(point, name) for name in others}))
    is_of_one_point = max(each.compared for each in compared) < 2  # whose row says all
    notes = [*_notes(compared, headings), *([_over_all(first, headings)] if is_one and not is_of_one_point else [])]
    table = Table(title, rows, notes, headings)
    if is_one or is_of_one_point:
        return [table]
    found = list(zip(pairs, compared, strict=True))
    tested = list(dict.fromkeys(each.tested for each in compared))
    totals = [Row(pair, {name: getattr(each, name) for name in (*tested, "p_value", "p_holm")}) for pair, each in found]
    return [table, Table("Over all points", totals, (), headings)]


def _notes(compared: Sequence[Comparison], headings: Mapping[str, str]) -> Iterator[str]:
    points = [point for each in compared for point in each.points]
    statistics = " or ".join(dict.fromkeys(point.statistic for point in points))
    tests = " or ".join(dict.fromkeys(each.test for each in compared))
    tested = " or ".join(dict.fromkeys(headings[each.tested] for each in compared))
    whose = " (Newcombe's)" if statistics == "share" else ""
    yield f"Compared: {statistics}. p and interval{whose}: of {tested}; p: {tests}; Holm: corrected for their number."
    if any(isinstance(point.p_value, AtMost) and point.p_holm > 1 - LEVEL for point in points):
        count = sum(each.compared for each in compared)
        yield f"{count} comparisons are too many: of {PERMUTATIONS} permutations, no p (Holm) is below 0.05."
    if restricted := sum(max(point.censored) > 0 and point.ratio.has_interval for point in points):
        where = counted(restricted, "point")
        yield f"Restricted at {where}: a factor that makes all times of a side longer is farther from 1 than the ratio."
    if few := len(points) - sum(each.compared for each in compared):
        none = "that synchronised" if compared[0].of in T_SYNC else "with a value"
        yield f"-: fewer than {MIN_TRIALS} trials on one side, or none {none}, at {counted(few, 'point')}."
    if unaveraged := sum(each.compared - each.averaged for each in compared):
        where = "the trials of one side are all censored or alike"
        yield f"p alone: {counted(unaveraged, 'point')}, where {where}."
    if left_out := sum(each.left_out for each in compared):
        yield f"Left out: {counted(left_out, 'point')} with trials on one side only."


def _over_all(each: Comparison, headings: Mapping[str, str]) -> str:
    mean = "geometric mean" if each.tested == "ratio" else "mean"
    found = f"{headings[each.tested]} = {getattr(each, each.tested)}, the {mean} of {counted(each.averaged, 'point')}; "
    equals = "" if isinstance(each.p_value, AtMost) else "= "
    return f"Over all: {found * bool(each.averaged)}p {equals}{cell_text(each.p_value)}"
