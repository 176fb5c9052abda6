"""Claims about the statistics of points: means and shares against scipy and published examples, summaries, series."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import stats

from epuck_sim import EpuckSimError, StoreError, points, read_points
from epuck_sim.estimate import MIN_TRIALS, UNDETERMINED
from epuck_sim.statistics import Statistic, curves, statistic
from epuck_sim.statistics.comparison import compare, match_values
from epuck_sim.statistics.curves import series_statistics, series_table, summarize_series
from epuck_sim.statistics.statistic import Measured, estimate, estimate_mean, summarize as summaries_of
from tests.cli.commands import called, cells
from tests.runs import made_folders
from tests.runs.made_folders import SPEED, censored, ended, in_memory, store, sweep, weibull
from tests.statistics.fits import measured, truths


def cut(values, limit: float, seed: int = 0) -> Measured:
    return measured(np.minimum(values, limit), np.array(values) <= limit, limit, seed)


values_of_trials = st.lists(st.integers(1, 10**6), min_size=MIN_TRIALS, max_size=30).filter(lambda v: len(set(v)) > 1)


@given(values_of_trials)
def test_uncensored_the_mean_is_the_samples_and_the_interval_students_of_its_logarithm(values) -> None:
    mean, low, high = estimate_mean(measured(values)).ends
    assert mean == pytest.approx(np.mean(values))
    reach = stats.t.ppf(0.975, len(values) - 1) * stats.sem(values) / mean
    assert np.log([low / mean, high / mean]) == pytest.approx([-reach, reach])
    assert not estimate_mean(measured([0.1] * len(values))).has_interval  # whose standard deviation rounds to 1e-17


def test_the_last_trial_at_risk_is_no_median_of_trials_most_of_which_ran_out_of_time_before() -> None:
    ends = np.array([5, 6, 7, 8, 9, 10])
    assert statistic.estimate_median(measured(ends, ends == 10, 100)) == UNDETERMINED
    assert statistic.estimate_median(measured(ends, ends > 7, 100)) == UNDETERMINED
    assert statistic.estimate_median(measured(ends, ends > 6, 100)).value == 8.5


@given(values_of_trials, st.floats(-1e6, 0))
def test_where_values_are_not_positive_the_interval_is_students_own(values, shift) -> None:
    shifted = np.array(values) + shift - min(values)
    expected = stats.t.interval(0.95, len(values) - 1, shifted.mean(), stats.sem(shifted))
    assert estimate_mean(measured(shifted)).ends[1:] == pytest.approx(expected)


@given(values_of_trials, st.integers(0, 29))
def test_values_cut_at_one_limit_have_the_mean_and_the_error_of_the_sample_that_they_are(values, place) -> None:
    limit = sorted(values)[place % len(values)]
    mean, low, high = estimate_mean(cut(values, limit)).ends
    as_sample = np.minimum(values, limit)
    assert mean == pytest.approx(as_sample.mean())
    if np.ptp(as_sample) and max(values) > limit:
        freedom = min(len(values) - 1, np.count_nonzero(np.array(values) <= limit))
        reach = stats.t.ppf(0.975, freedom) * stats.sem(as_sample) / mean
        assert np.log(mean / low) == pytest.approx(reach)
        assert high == pytest.approx(min(mean * math.exp(reach), limit))


@pytest.mark.parametrize("statistic", Statistic)
@pytest.mark.parametrize("trials", [1, 4])
def test_few_trials_have_an_estimate_and_no_interval(statistic: Statistic, trials: int) -> None:
    found = estimate(measured([30, 40, 60, 75][:trials]), statistic)
    assert not found.has_interval
    assert 30 <= found.value <= 75


@pytest.mark.parametrize("limit", [math.inf, 120])
@pytest.mark.parametrize("trials", [5, 200])
def test_resampled_means_are_spread_like_the_means_of_new_trials(trials: int, limit: float) -> None:
    spreads, truth = [], []
    for seed in range(200):
        made = cut(np.ceil(np.random.default_rng(seed).exponential(100, trials)), limit, seed)
        spreads.append(np.log(statistic.resample_means(made, 100)).var())
        truth.append(math.log(estimate_mean(made).value))
    assert np.sqrt(np.mean(spreads)) == pytest.approx(np.std(truth), rel=0.15)


def test_resamples_of_few_trials_are_widened_and_medians_follow_values_that_are_not_positive() -> None:
    found = np.unique(statistic.resample_means(measured([1, 3]), 200))
    assert found == pytest.approx([2 * 0.5 ** math.sqrt(2), 2, 2 * 1.5 ** math.sqrt(2)])
    below_0 = np.unique(statistic.resample_means(measured([-1, 1]), 200))
    assert below_0 == pytest.approx([-math.sqrt(2), 0, math.sqrt(2)])
    values = np.array([3.0, 5, 8, 13, 21])
    above, below = (statistic.resample(measured(each), Statistic.MEDIAN) for each in (values, values - 30))
    assert (below == above - 30).all()


def test_intervals_of_shares_and_of_their_differences_are_those_published():
    for true, trials, interval in (  # Newcombe 1998, Statistics in Medicine 17:857, table I, method 3
        (81, 263, (0.2553, 0.3662)),
        (15, 148, (0.0624, 0.1605)),
        (0, 20, (0.0, 0.1611)),
        (1, 29, (0.0061, 0.1718)),
    ):
        assert statistic.wilson_interval(true / trials, trials) == pytest.approx(interval, abs=5e-5)
    for first, second, interval in (  # Newcombe 1998, Statistics in Medicine 17:873, table II, method 10
        ((48, 80), (56, 70), (0.0524, 0.3339)),
        ((3, 10), (9, 10), (0.1705, 0.8090)),
        ((0, 29), (5, 56), (-0.0381, 0.1926)),
        ((0, 20), (0, 10), (-0.1611, 0.2775)),
        ((0, 10), (10, 10), (0.6075, 1.0)),
    ):
        found = statistic.share_difference(truths(*first), truths(*second))
        assert found.value == pytest.approx(second[0] / second[1] - first[0] / first[1])
        assert (found.low, found.high) == pytest.approx(interval, abs=6e-5)


@given(st.integers(1, 60), st.data())
@settings(max_examples=30)
def test_shares_lie_in_their_intervals_and_these_between_0_and_1(trials, data):
    true = data.draw(st.integers(0, trials))
    found = statistic.estimate_share(truths(true, trials))
    assert found.value == true / trials
    assert found.has_interval == (trials >= 5)
    if found.has_interval:
        assert 0 <= found.low <= found.value <= found.high <= 1
        assert found.low < found.high  # though all trials may have one value


NUMBERS = st.sampled_from([0.0, 1.0, 1.0, 2.0, 0.25, -3.0, math.nan, 7.5])
POSITIVE = st.sampled_from([1.0, 1.0, 2.0, 0.25, math.nan, 7.5])
SERIES = st.one_of(*(st.lists(st.lists(each, max_size=6), min_size=1, max_size=12) for each in (NUMBERS, POSITIVE)))


def at_cycle(series, cycle):
    """Return the mean and the median of the values at a cycle, by the statistics of single values."""
    values = np.array([each[cycle] for each in series if len(each) > cycle and not math.isnan(each[cycle])])
    if not len(values):
        return 0, UNDETERMINED.ends, UNDETERMINED.ends
    return len(values), estimate_mean(measured(values)).ends, statistic.estimate_median(measured(values)).ends


@given(SERIES)
def test_at_each_cycle_they_are_the_statistics_of_the_trials_that_reach_it(series):
    found = series_statistics([np.array(each, float) for each in series])
    longest = max(map(len, series))
    assert found.cycles.tolist() == list(range(1, longest + 1))
    for cycle in range(longest):
        known, mean, median = at_cycle(series, cycle)
        assert found.trials[cycle] == sum(len(each) > cycle for each in series)
        assert found.known[cycle] == known
        assert found.mean[cycle] == pytest.approx(mean, nan_ok=True, rel=1e-12, abs=1e-12)
        assert found.median[cycle] == pytest.approx(median, nan_ok=True, rel=1e-12, abs=1e-12)


@given(SERIES, st.randoms())
def test_the_order_of_the_trials_makes_no_difference_to_the_bit(series, random):
    shuffled = random.sample(series, len(series))
    one, other = (series_statistics([np.array(each, float) for each in some]) for some in (series, shuffled))
    assert [each.tobytes() for each in one[:5]] == [each.tobytes() for each in other[:5]]


def test_ranks_of_medians_are_sought_once_for_each_number_of_values(monkeypatch):
    sought, ranks = [], curves._median_ranks
    monkeypatch.setattr(curves, "_median_ranks", lambda count: sought.append(count) or ranks(count))
    found = series_statistics([np.array([number, 1.0][: 1 + number % 2]) for number in range(100)])
    assert found.known.tolist() == sought[::-1] == [100, 50]
    assert found.median[:, 0].tolist() == [49.5, 1]


def test_series_of_a_folder_have_statistics_and_what_is_no_series_or_statistic_is_refused(tmp_path):
    scenario = sweep({SPEED: [1, 2, 3]}, measures=["order_parameter"])
    law = {1: [[0.5, 0.75], 0.25], 2: [], 3: [[1.0], None]}
    folder = made_folders.store_measured(tmp_path / "run", scenario, lambda point: law[point.axes[SPEED]])
    found = summarize_series(read_points(folder, "order_parameter"))
    assert [point.axes for point in found] == [{SPEED: 1}, {SPEED: 3}]
    assert found[0].statistics.mean[:, 0].tolist() == [0.375, 0.75]
    assert [each.statistics.trials.tolist() for each in found] == [[2, 1], [1]]
    scenario = sweep({SPEED: [1]}, measures=["threshold_cycles"])
    folder = made_folders.store_measured(tmp_path / "over", scenario, lambda _: [[2, None, None, None, None]])
    table = series_table("", summarize_series(read_points(folder, "threshold_cycles")))
    assert (table.rows[0].axes["threshold"], table.rows[0].cells["known"], found[0].statistics.over) == (0, 1, "cycle")
    assert table.to_csv().startswith(f"{SPEED},threshold,point,trials,known,mean,")
    scenario = sweep({SPEED: [1]}, measures=["near_walls"])
    folder = made_folders.store_measured(tmp_path / "short", scenario, lambda _: [[], []])
    with pytest.raises(StoreError, match="no trial reaches a firing"):
        summarize_series(read_points(folder, "near_walls"))
    with pytest.raises(StoreError, match="T_sync is no series"):
        summarize_series(read_points(folder))
    with pytest.raises(ValueError, match="series has none; allowed: one or more"):
        series_statistics([])
    for use in (estimate, statistic.resample):
        with pytest.raises(EpuckSimError, match="statistic is 'mode'; allowed: mean, median, weibull-mean"):
            use(measured([1, 2, 3]), "mode")


# how the trials of the five points end: all, most, few, none synchronised; no trial
MIXED = sweep({SPEED: made_folders.SPEEDS}, trials=60, stop={"max_cycles": 100})


def mixed(point):
    few = ended([*range(40, 45), *[100] * 55], [True] * 5 + [False] * 55)
    return [weibull(point, 20), weibull(point, 90), few, censored(point, 60), ended([])][point.number]


def summarize(points) -> list[SimpleNamespace]:
    """Return the fields of the points as JSON has them."""
    return [SimpleNamespace(**each.record()) for each in summaries_of(points)]


def one_summary(times, observed=None, **changes) -> SimpleNamespace:
    (point,) = points(sweep(None, **changes))
    return summarize([made_folders.of_point(point, ended(times, observed))])[0]


def of_measure(*values) -> SimpleNamespace:
    (point,) = in_memory(sweep(trials=max(len(values), 1)), lambda _: ended([7] * len(values)))
    return summarize([point._replace(measured=tuple(values), of="mine")])[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return store(tmp_path_factory.mktemp("mixed"), MIXED, mixed)


@given(st.lists(st.tuples(st.integers(1, 50), st.booleans()), max_size=25), st.randoms(use_true_random=False))
@settings(max_examples=30)
def test_every_number_is_known_or_none_and_the_order_of_the_trials_does_not_matter(trials, random) -> None:
    times, observed = [time for time, _ in trials], [is_observed for _, is_observed in trials]
    summary = one_summary(times, observed)
    shuffled = random.sample(trials, len(trials))
    assert one_summary([time for time, _ in shuffled], [seen for _, seen in shuffled]) == summary
    *fields, unit = vars(summary).values()
    assert np.isfinite([number for number in fields[2:] if number is not None]).all()
    assert (summary.trials, unit) == (len(trials), "cycles")
    for low, high in (fields[5:7], fields[8:10], fields[11:13], fields[14:16]):
        assert high is None or low <= high
    if summary.restricted_mean is not None:
        assert min(times) <= summary.restricted_mean <= summary.horizon
    assert (summary.weibull_mean is None) <= (summary.weibull_mean_low is None)
    assert (summary.mean is None) == (not trials or not all(observed))


def test_where_there_is_no_spread_or_few_synchronised_some_numbers_are_none() -> None:
    equal = one_summary([7] * 30)
    assert (equal.mean, equal.median, equal.weibull_mean) == (7, 7, 7)
    assert {equal.mean_low, equal.median_low, equal.weibull_mean_low} == {None}
    _, _, few, none, without = summarize(in_memory(MIXED, mixed))
    assert (few.weibull_mean, few.weibull_mean_low, few.weibull_mean_high, few.median, few.median_high) == (None,) * 5
    assert few.restricted_mean == pytest.approx((40 + 41 + 42 + 43 + 44 + 55 * 100) / 60)
    assert (none.censored, none.restricted_mean, none.median) == (1, None, None)
    assert list(vars(without).values()) == [4, {SPEED: 5.0}, 0, *[None] * 13, 100, False, "cycles"]


def test_the_horizon_is_the_longest_follow_up_and_trials_whose_reference_never_fired_are_counted() -> None:
    early = one_summary([10, 20, 30, 30], [True, True, False, False], stop={"max_cycles": 5000, "max_time_s": 150})
    assert early.horizon == 30
    assert early.restricted_mean == pytest.approx((10 + 20 + 30 + 30) / 4)
    followed = one_summary([10, 20, 40], [True, False, True])
    assert (followed.horizon, followed.restricted_mean) == (40, pytest.approx(10 + 30 * 2 / 3))
    summary = summaries_of(in_memory(sweep(), lambda _: ended([10, 0, 0], [True, False, False])))
    assert "Censored at 0 cycles, so without effect: 2 trials, whose reference never fired." in summary.table().notes
    cut_at = {1: 30, 2: 40}
    several = in_memory(sweep({SPEED: [1, 2]}), lambda point: ended([9, cut_at[point.axes[SPEED]]], [True, False]))
    assert [found.table().headings["horizon"] for found in (summary, summaries_of(several))] == ["", "horizon"]


def test_t_sync_in_seconds_is_censored_as_cycles_are_and_unknown_where_trials_go_on_after_synchrony(tmp_path) -> None:
    limits = {"max_cycles": 40}
    store(tmp_path / "run", sweep({SPEED: [1, 2]}, stop=limits), lambda point: weibull(point, 30 * point.axes[SPEED]))
    cycles, seconds = (read_points(tmp_path / "run", of) for of in (None, "t_sync_s"))  # a cycle lasts 5 s there
    assert summaries_of(seconds).label == "T_sync (s)"
    for one, other in zip(summaries_of(cycles), summaries_of(seconds), strict=True):
        assert 0 < one.censored == other.censored
        assert all(5 * end == pytest.approx(own) for end, own in zip(ends(one), ends(other), strict=True))
    of_cycles, of_seconds = (compare(match_values(read, SPEED, [1, 2]))[0] for read in (cycles, seconds))
    assert of_seconds.of == "t_sync_s"
    assert (of_seconds.ratio.ends, of_seconds.p_value) == (pytest.approx(of_cycles.ratio.ends), of_cycles.p_value)
    further = in_memory(sweep(stop={**limits, "further_cycles": 5}), lambda point: weibull(point, 30))
    with pytest.raises(StoreError, match="t_sync_s is unknown where trials go on"):
        summaries_of([point._replace(of="t_sync_s", measured=tuple(point.times)) for point in further])


def ends(summary: statistic.PointSummary) -> list[float]:
    """Return all estimates, and the ends of their intervals, that are known."""
    return [end for each in summary.estimates.values() for end in each.ends if math.isfinite(end)]


def test_statistics_of_a_measure_are_those_of_the_sample_of_truth_values_shares_and_of_known_values_alone() -> None:
    values = [-3.0, -1.0, 0.0, 2.0, 4.0, 5.5]
    summary = of_measure(*values)
    reach = 2.5706 * np.std(values, ddof=1) / math.sqrt(6)
    ends = np.mean(values) - reach, np.mean(values) + reach
    assert (summary.mean, summary.mean_low, summary.mean_high) == pytest.approx((np.mean(values), *ends), rel=1e-4)
    assert -1.0 <= summary.median <= 2.0
    assert (summary.trials, summary.censored, summary.restricted_mean, summary.weibull_mean) == (6, 0.0, None, None)
    assert summary.horizon is None
    assert (of_measure(1.0, 2.0).mean, of_measure(1.0, 2.0).mean_low, of_measure(None).mean) == (1.5, None, None)
    summary = of_measure(True, None, False, True, True, False, True)
    assert (summary.trials, summary.mean, summary.median) == (6, pytest.approx(4 / 6), None)
    assert (summary.mean_low, summary.mean_high) == pytest.approx(statistic.wilson_interval(4 / 6, 6))
    assert summary.is_share
    assert not of_measure(True, 0.5).is_share


@pytest.mark.parametrize("values", [(None, None), (1.0, None, 2.0, None)])
def test_trials_without_a_value_are_left_out_and_counted(values) -> None:
    (point,) = in_memory(sweep(None), lambda _: ended([5]))
    table = summaries_of([point._replace(measured=values, of="mine")]).table()
    assert "Left out: 2 trials, undetermined or not measured yet." in table.notes
    assert "No trial has a value yet." not in table.notes


def test_json_has_all_fields_of_each_point_and_the_table_a_row_that_says_what_its_columns_are(folder, tmp_path):
    stdout = called("summarize", folder, "--json")
    read = json.loads(stdout, parse_constant=pytest.fail)
    assert read == [vars(each) for each in summarize(read_points(folder))]
    with pytest.raises(TypeError, match=r"points is '.*'; allowed: what read_points\(FOLDER\) returns"):
        summarize(str(folder))
    assert len(stdout.splitlines()) == 1
    stdout = called("summarize", folder)
    assert stdout.startswith(f"{folder}: T_sync (cycles)")
    assert "Weibull mean: extrapolated by thesis Appendix A." in stdout
    assert "No intervals" not in stdout
    for row, point in zip(cells(stdout), summaries_of(read_points(folder)), strict=True):
        censored = f"{100 * point.censored:.0f} %" if point.trials else "-"
        assert row[:4] == [str(point.point), str(point.axes[SPEED]), str(point.trials), censored]
        shown = ("median", "restricted_mean", "weibull_mean")
        assert row[4:] == [str(point.estimates[name]) for name in shown]
    assert summaries_of(read_points(folder)).table().headings["restricted_mean"] == "mean or restricted mean"
    assert {"mean", "restricted_mean", "unit", "horizon"} <= {
        *called("summarize", folder, "--csv").splitlines()[0].split(",")
    }
    store(tmp_path, sweep({SPEED: [1, 2]}), lambda point: weibull(point, 50, trials=4 + point.number))
    stdout = called("summarize", tmp_path)
    assert "No intervals at 1 of 2 points: one takes 5 trials or more." in stdout
    assert not {"Weibull", "restricted"} & {*stdout.split()}
