"""Claims about comparisons: which points are compared, what their difference is, and how rarely chance makes one."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from lifelines.statistics import logrank_test
from scipy import stats

from epuck_sim.display.table import cell_text
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics import comparison, survival
from epuck_sim.statistics.comparison import compare, comparison_tables, contrast, match_points, match_values, pair_up
from epuck_sim.statistics.statistic import Measured, student_estimate
from tests.runs.made_folders import COUNT, COUPLING, HEIGHT, SPEED, SPEEDS, WIDTH, ended, in_memory, sweep, weibull
from tests.statistics.fits import measured

FIRST, SECOND = 2, 5


def drawn(mean: float, trials: int, seed, limit: float = math.inf) -> Measured:
    times = np.ceil(mean * np.random.default_rng(seed).exponential(1, trials))
    return measured(np.minimum(times, limit), times <= limit, limit)


def folders(*sweeps) -> comparison.Samples:
    return comparison.match_folders(sweeps, [f"folder {number}" for number, _ in enumerate(sweeps)])


def compared(*sweeps) -> comparison.Comparison:
    (found,) = compare(folders(*sweeps))
    return found


def permuted(pair, seed: int, of_logarithms: bool = True, **options) -> np.ndarray:
    return comparison.studentised([comparison.permute(pair, seed, of_logarithms=of_logarithms, **options)])


def both(mean, trials: int = 40, stop: int = 5000, **changes):
    """Return the points of two sweeps: `mean` gives that of each, from the speed and the number of the sweep."""
    made = (sweep({SPEED: SPEEDS}, trials=trials, seed=seed, stop={"max_cycles": stop}, **changes) for seed in (0, 1))
    return [
        in_memory(each, lambda point: weibull(point, mean(point.axes[SPEED], point.scenario.seed))) for each in made
    ]


def test_points_of_two_folders_are_matched_by_their_axis_values_and_others_are_counted() -> None:
    first, _ = both(lambda *_: 30)
    second = in_memory(sweep({SPEED: [5.0, 1, 7]}), lambda _: ended([5] * 5))
    matches = folders(first, second).matches
    both_sides = [(axes, *points) for axes, points in matches if None not in points]
    assert [axes for axes, *_ in both_sides] == [{SPEED: 1.0}, {SPEED: 5.0}]
    assert all(one is first[n] for (_, one, _), n in zip(both_sides, (2, 4), strict=True))
    assert all(two.axes[SPEED] == axes[SPEED] for axes, _, two in both_sides)
    assert len(matches) == 6
    assert compared(first, second).left_out == 4


def test_two_values_of_an_axis_with_or_without_an_order_are_matched_over_the_others_that_are_not_tied_to_it() -> None:
    sizes = {"zip": {WIDTH: [40, 60, 80], HEIGHT: [40, 60, 80]}, "grid": {SPEED: [1, 2], COUNT: [3]}}
    made = in_memory(sweep(None, sweep=sizes), lambda point: ended([point.axes[WIDTH] + point.axes[SPEED]]))
    samples = match_values(made, "width_cm", [80, 40.0])
    assert samples.names == [f"{WIDTH} = 80", f"{WIDTH} = 40.0"]
    found = [(axes, one.times[0], two.times[0]) for axes, (one, two) in samples.matches]
    assert found == [({SPEED: 1, COUNT: 3}, 81, 41), ({SPEED: 2, COUNT: 3}, 82, 42)]
    values = [None, 30, {"kind": "cone"}]  # which have no order
    made = in_memory(sweep({SPEED: [1, 2], COUNT: [3, 4, 5]}), lambda point: ended([point.number]))
    made = [p._replace(axes={SPEED: p.axes[SPEED], "mixed": values[p.number % 3]}) for p in made]
    matches = match_values(made, "mixed", values[:2]).matches
    found = [(axes, *(point.number for point in both)) for axes, both in matches]
    assert found == [({SPEED: 1}, 0, 1), ({SPEED: 2}, 3, 4)]


def test_points_of_folders_of_other_axes_are_matched_by_their_numbers() -> None:
    one = in_memory(sweep({SPEED: [1, 2], COUNT: [3]}), lambda point: ended([point.number + 1] * 5))
    other = in_memory(sweep({COUPLING: [0.1, 0.2, 0.3], COUNT: [3]}), lambda point: ended([point.number + 11] * 5))
    samples = match_points([one, other], ["one", "other"], [[1, 2], [0, 0]])
    found = [(axes, a.times[0], b.times[0]) for axes, (a, b) in samples.matches]
    assert found == [({"points": "1, 2", COUNT: 3}, 2, 13), ({"points": "0, 0", COUNT: 3}, 1, 11)]
    third = in_memory(sweep({SPEED: [2], COUNT: [3, 4]}), lambda _: ended([5] * 5))
    samples = match_points([one, third], ["one", "third"], [[1, 0], [0, 1]])  # of which one has two axes alike
    assert [axes for axes, _ in samples.matches] == [{"points": "1, 0"}, {"points": "0, 1"}]
    assert comparison_tables(compare(samples))[0].to_csv().count(",one,third,cycles,") == 2
    beside_itself = match_points([one, one], ["one", "one"], [[0, 1]])
    assert comparison_tables(compare(beside_itself))[0].headings["difference"] == "second - first"


@given(*[st.lists(st.integers(1, 999), min_size=5, max_size=20, unique=True)] * 2)
def test_uncensored_the_difference_is_welchs(first, second) -> None:
    found = student_estimate(*contrast(pair_up(measured(first), measured(second)), of_logarithms=False))
    expected = stats.ttest_ind(second, first, equal_var=False).confidence_interval(0.95)
    assert found.value == pytest.approx(np.mean(second) - np.mean(first))
    assert (found.low, found.high) == pytest.approx(tuple(expected))


def test_where_trials_are_censored_both_are_cut_at_the_lower_horizon() -> None:
    pair = pair_up(measured([10, 20, 50], [True, True, False], 50), measured([10, 45, 70, 80], limit=5000))
    assert pair.second.values.tolist() == [10, 45, 50, 50]
    assert pair.second.observed.tolist() == [True, True, False, False]
    assert not pair.is_censored_early
    assert pair_up(measured([10, 20, 50], [True, False, True], 50), measured([5])).is_censored_early


@given(st.integers(0, 10**6), st.floats(20, 300))
@settings(max_examples=15)
def test_the_log_rank_statistic_is_lifelines(seed: int, mean: float) -> None:
    random = np.random.default_rng(seed)
    samples = []
    for each in (100, mean):
        times, limits = np.ceil(each * random.exponential(1, 30)), random.integers(1, 200, 30)
        samples.append(measured(np.minimum(times, limits), times <= limits))
    with_last_alone = measured([1, 2, 3, 4], limit=99), measured([2, 3, 7, 9], [True, False, True, True], 99)
    for pair in (pair_up(*samples), pair_up(*with_last_alone)):
        theirs = logrank_test(pair.first.values, pair.second.values, pair.first.observed, pair.second.observed)
        ours, _ = comparison.studentised([comparison.permute_ranks(pair, seed, count=1)])
        assert ours**2 == pytest.approx(theirs.test_statistic, rel=1e-6)


def log_ratio(x, y, axis):
    means = [each.mean(axis=axis) for each in (x, y)]
    variances = [each.var(axis=axis, ddof=1) / each.shape[axis] for each in (x, y)]
    parts = [variance / mean**2 for variance, mean in zip(variances, means, strict=True)]
    return (np.log(means[1]) - np.log(means[0])) / np.sqrt(sum(parts))


@pytest.mark.parametrize("of_logarithms", [True, False])
def test_one_permutation_test_is_scipys(of_logarithms: bool) -> None:
    first, second = drawn(50, 5, 1), drawn(90, 6, 2)
    statistic = log_ratio if of_logarithms else lambda x, y, axis: -stats.ttest_ind(x, y, equal_var=False, axis=axis)[0]
    samples = first.values, second.values
    theirs = stats.permutation_test(samples, statistic, vectorized=True, n_resamples=math.inf)  # all 462 of them
    ours = permuted(pair_up(first, second), 0, of_logarithms, count=40_000)
    assert ours[0] == pytest.approx(theirs.statistic)
    one_sided = [float((ours >= ours[0] - 1e-9).mean()), float((ours <= ours[0] + 1e-9).mean())]
    assert 2 * min(one_sided) == pytest.approx(theirs.pvalue, abs=0.02)


@given(*[st.lists(st.integers(1, 50), min_size=5, max_size=9, unique=True)] * 2)
def test_what_is_permuted_is_the_contrast_over_its_error(first, second) -> None:
    pair = pair_up(measured(first), measured(second))
    for of_logarithms in (False, True):
        found = contrast(pair, of_logarithms=of_logarithms)
        differences, variances = comparison.permute(pair, 0, of_logarithms=of_logarithms, count=3)
        assert differences[0] == pytest.approx(found.mean, abs=1e-12)
        assert variances[0] == pytest.approx(found.error**2, abs=1e-12)


def test_many_trials_are_permuted_by_the_numbers_of_their_values_to_the_same_distribution(monkeypatch) -> None:
    pair = pair_up(measured([1, 2, 2, 3] * 20), measured([1, 1, 3, 4] * 15))
    monkeypatch.setattr(comparison, "_BLOCK_SIZE", 100_000)
    usual = permuted(pair, 0, of_logarithms=True, count=4000)
    assert len(usual) == 4001
    monkeypatch.setattr(survival, "_MANY_TRIALS", 0)
    assert 0.01 < stats.ks_2samp(permuted(pair, 0, of_logarithms=True, count=4000)[1:], usual[1:]).pvalue < 1


@pytest.mark.parametrize(("values", "p"), [([7] * 6, 1), ([9] * 6, 1 / 462)])
def test_samples_without_spread_differ_if_their_values_do(values, p: float) -> None:
    found = comparison.share_as_large(permuted(pair_up(measured([7] * 5), measured(values)), 0, of_logarithms=False))
    assert found == pytest.approx(p, abs=0.003)


def test_points_with_few_trials_have_values_and_no_interval_or_p_and_do_not_count() -> None:
    first, second = both(lambda *_: 50)
    second[1] = second[1]._replace(times=second[1].times[:4], observed=second[1].observed[:4])
    found = compared(first, second)
    few = found.points[1]
    assert few.difference.value == pytest.approx(few.second.value - few.first.value)
    assert (few.difference.has_interval, few.ratio.has_interval) == (False, False)
    assert np.isnan([few.p_value, few.p_holm]).all()
    assert found.compared == 4
    assert not np.isnan([point.p_value for point in found.points if point is not few]).any()


def test_of_one_side_all_censored_there_is_a_p_value_and_no_interval_and_what_is_known_of_the_other_stays() -> None:
    def between(*sides):
        return compared(*(in_memory(sweep({SPEED: [1]}), lambda _, side=side: side) for side in sides)).points

    (point,) = between(ended([5000] * 20, [False] * 20), ended(range(50, 70)))
    assert point.statistic == "restricted mean"
    assert point.p_value < 0.001
    for unknown in (point.first, point.difference, point.ratio):
        assert math.isnan(unknown.value)
    known = ended([0, 0, 40, 60, 100, 100, 100], [False, False, True, True, False, False, False])
    (point,) = between(known, ended([0] * 7, [False] * 7))
    assert point.censored == (5 / 7, 1)
    assert (point.first.value, point.first.high) == (80, 100)  # zeros have no effect, and no mean exceeds its horizon
    assert np.isnan([point.second.value, point.difference.value, point.ratio.value, point.p_value]).all()


def test_a_ratio_of_restricted_means_is_nearer_to_1_than_that_of_whole_ones_and_the_table_says_so() -> None:
    whole, cut = (both(lambda _, seed: 40 + 60 * seed, stop=stop) for stop in (5000, 60))
    found = [compared(*each) for each in (whole, cut)]
    assert found[0].ratio.value > found[1].ratio.value > 1
    said = [any("Restricted at 5 points" in note for note in comparison_tables([each])[0].notes) for each in found]
    assert said == [False, True]


def test_a_p_value_of_which_no_permutation_is_as_large_is_shown_as_a_bound_and_one_point_once() -> None:
    sides = [in_memory(sweep(), lambda _, low=low: ended(range(low, low + 20))) for low in (10, 60, 60)]
    found = compare(folders(*sides))
    (table,) = comparison_tables(found)
    shown = [[*map(cell_text, (row.cells["p_value"], row.cells["p_holm"]))] for row in table.rows]
    assert shown == [["<= 0.0002", "<= 0.0006"], ["<= 0.0002", "<= 0.0006"], ["1", "1"]]
    assert table.records()[0]["p_value"] == 0.0002
    assert not any("Over all" in note for note in comparison_tables(found[:1])[0].notes)


def test_a_table_says_where_comparisons_are_too_many_for_a_bound_to_be_below_005_after_holm() -> None:
    speeds = [number / 2 for number in range(1, 24)]
    many = in_memory(sweep({SPEED: speeds}), lambda point: ended(np.arange(20) + 10 * point.number + 1))
    for count, says in ((22, False), (23, True)):  # 231 and 253 pairs
        (table, *_) = comparison_tables(compare(match_values(many[:count], SPEED, speeds[:count])))
        said = f"{count * (count - 1) // 2} comparisons are too many: of 4999 permutations, no p (Holm) is below 0.05."
        assert (said in table.notes) == says


def test_the_interval_is_of_what_is_tested() -> None:
    for low, tested, other, shown in ((1, "ratio", "difference", "B / A"), (-20, "difference", "ratio", "B - A")):
        values = [[*range(low, 40 + low)], [*range(low, 80 + low, 2)]]
        points = in_memory(sweep({SPEED: [1, 2]}, trials=40), lambda _: ended([7] * 40))
        found = compared(*([point._replace(measured=tuple(each), of="x") for point in points] for each in values))
        assert found.tested == tested
        assert getattr(found, tested).has_interval
        assert math.isnan(getattr(found, other).value)
        assert [getattr(found.points[0], name).has_interval for name in (tested, other)] == [True, False]
        assert comparison_tables([found])[0].notes[-1].startswith(f"Over all: {shown} = ")


def test_the_mean_of_differences_of_shares_has_every_point_and_of_one_is_that_ones() -> None:
    def shares(*true: int) -> list[PointTrials]:
        made = in_memory(sweep({SPEED: [1, 2][: len(true)]}, trials=5), lambda _: ended([1] * 5))
        values = [(True,) * count + (False,) * (5 - count) for count in true]
        return [point._replace(of="x", measured=each) for point, each in zip(made, values, strict=True)]

    both = compared(shares(4, 3), shares(0, 1))
    assert (both.difference.value, both.averaged) == (pytest.approx(-0.6), 2)
    assert both.difference.low > -1
    alone = compared(shares(0), shares(4))
    assert alone.difference == alone.points[0].difference
    assert math.isnan(alone.points[0].ratio.value)
    unknown = [point._replace(measured=(None,) * 5) for point in shares(0)]
    assert compared(unknown, shares(4)).tested == "difference"


def test_points_in_the_p_value_over_all_that_are_not_in_its_ratio_are_named() -> None:
    def slow(point):
        return ended([5000] * 20, [False] * 20) if point.axes[SPEED] == 1 else ended(range(40, 60))

    first, second = (in_memory(sweep({SPEED: [1, 2]}), law) for law in (slow, lambda _: ended(range(20, 40))))
    found = compared(first, second)
    assert found.ratio.ends == pytest.approx(found.points[1].ratio.ends)
    (table,) = comparison_tables([found])
    assert any(note.startswith("p alone: 1 point, where") for note in table.notes)
    assert "the geometric mean of 1 point; p <= 0.0002" in table.notes[-1]


def test_trials_that_ran_out_of_time_are_compared_by_their_ranks() -> None:
    def early(point):
        made = weibull(point, 60)
        return ended(np.minimum(made.times, 40 + made.times % 7), made.times <= 40 + made.times % 7)

    first = in_memory(sweep({SPEED: SPEEDS}, trials=30), early)
    second = in_memory(sweep({SPEED: SPEEDS}, trials=30, seed=1), lambda point: weibull(point, 30))
    found = compared(first, second)
    assert found.test == comparison.LOG_RANK
    assert found.p_value < min(point.p_value for point in found.points) < 0.01


TIME = "stop.max_time_s"


def test_of_several_values_all_pairs_are_compared_or_each_with_the_first_and_p_values_corrected_for_all() -> None:
    grid = sweep({COUNT: [2, 4, 8], SPEED: [1, 2]}, trials=40)
    samples = match_values(in_memory(grid, lambda point: weibull(point, 10 * point.axes[COUNT])), COUNT, [2, 4, 8])
    names = [f"{COUNT} = {value}" for value in (2, 4, 8)]
    bounded = in_memory(sweep({TIME: [None, 90]}), lambda point: weibull(point, 10))
    assert match_values(bounded, TIME, [None, 90]).names == [f"{TIME} = null", f"{TIME} = 90"]
    assert [(each.a, each.b) for each in compare(samples)] == [*combinations(names, 2)]
    with_first = [(each.a, each.b) for each in compare(samples, with_first=True)]
    assert with_first == [(names[0], names[1]), (names[0], names[2])]
    found = compare(samples)
    points = [point for each in found for point in each.points]
    smallest = min(points, key=lambda point: point.p_value)
    assert smallest.p_holm == pytest.approx(min(1, 6 * smallest.p_value))
    assert min(each.p_holm for each in found) == pytest.approx(3 * min(each.p_value for each in found))
