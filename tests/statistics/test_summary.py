"""Claims about the statistics of a sweep's points: whose numbers they are, and the reports where there are none."""

import json
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim import points, read_points
from epuck_sim.statistics.measured import measure_t_sync
from epuck_sim.statistics.statistic import estimate_mean, wilson_interval
from epuck_sim.statistics.statistic import summarize as summaries_of
from epuck_sim.statistics.survival import confidence_interval, median_time, weibull_mean, weibull_resamples
from tests.cli.commands import called, cells
from tests.runs.made_folders import SPEED, SPEEDS, censored, ended, in_memory, of_point, store, sweep, weibull

# how the trials of the five points end: all, most, few, none synchronised; no trial
MIXED = sweep({SPEED: SPEEDS}, trials=60, stop={"max_cycles": 100})


def mixed(point):
    match point.number:
        case 0:
            return weibull(point, 20)
        case 1:
            return weibull(point, 90)
        case 2:
            return ended([*range(40, 45), *[100] * 55], [True] * 5 + [False] * 55)
        case 3:
            return censored(point, 60)
    return ended([])


def summarize(points) -> list[SimpleNamespace]:
    """Return the fields of the points as JSON has them."""
    return [SimpleNamespace(**each.record()) for each in summaries_of(points)]


def one_summary(times, observed=None, **changes) -> SimpleNamespace:
    (point,) = points(sweep(None, **changes))
    return summarize([of_point(point, ended(times, observed))])[0]


def of_measure(*values) -> SimpleNamespace:
    (point,) = in_memory(sweep(trials=max(len(values), 1)), lambda _: ended([7] * len(values)))
    return summarize([point._replace(measured=tuple(values), of="mine")])[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return store(tmp_path_factory.mktemp("mixed"), MIXED, mixed)


# T_sync


def test_the_numbers_are_those_of_the_survival_functions_on_the_same_trials() -> None:
    given_points = in_memory(MIXED, mixed)[:2]
    assert not given_points[1].observed.all()
    for point, summary in zip(given_points, summarize(given_points), strict=True):
        trials = point.times, point.observed
        restricted = estimate_mean(measure_t_sync(point))
        expected = [
            *(restricted.ends if point.observed.all() else [math.nan] * 3),
            *median_time(*trials),
            *restricted.ends,
            weibull_mean(*trials),
            *confidence_interval(weibull_resamples(*trials, seed=point.seed)),
        ]
        assert list(vars(summary).values())[4:16] == [number if math.isfinite(number) else None for number in expected]
        assert (summary.point, summary.axes, summary.trials, summary.horizon) == (point.number, point.axes, 60, 100)
        assert summary.censored == pytest.approx((~point.observed).mean())


@given(st.lists(st.tuples(st.integers(1, 50), st.booleans()), max_size=25), st.randoms(use_true_random=False))
@settings(max_examples=30)
def test_every_number_is_known_or_none_and_the_order_of_the_trials_does_not_matter(trials, random) -> None:
    times, observed = [time for time, _ in trials], [is_observed for _, is_observed in trials]
    summary = one_summary(times, observed)
    shuffled = random.sample(trials, len(trials))
    assert one_summary([time for time, _ in shuffled], [seen for _, seen in shuffled]) == summary
    fields = list(vars(summary).values())
    assert np.isfinite([number for number in fields[2:] if number is not None]).all()
    assert summary.trials == len(trials)
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
    assert list(vars(without).values()) == [4, {SPEED: 5.0}, 0, 0, *[None] * 12, 100, False]


def test_the_horizon_is_the_longest_follow_up_where_trials_ran_out_of_time_before() -> None:
    early = one_summary([10, 20, 30, 30], [True, True, False, False], stop={"max_cycles": 5000, "max_time_s": 150})
    assert early.horizon == 30
    assert early.restricted_mean == pytest.approx((10 + 20 + 30 + 30) / 4)
    followed = one_summary([10, 20, 40], [True, False, True])
    assert (followed.horizon, followed.restricted_mean) == (40, pytest.approx(10 + 30 * 2 / 3))


def test_statistics_of_a_measure_are_those_of_the_sample() -> None:
    values = [-3.0, -1.0, 0.0, 2.0, 4.0, 5.5]
    summary = of_measure(*values)
    reach = 2.5706 * np.std(values, ddof=1) / math.sqrt(6)
    ends = np.mean(values) - reach, np.mean(values) + reach
    assert (summary.mean, summary.mean_low, summary.mean_high) == pytest.approx((np.mean(values), *ends), rel=1e-4)
    assert -1.0 <= summary.median <= 2.0
    assert (summary.trials, summary.censored, summary.restricted_mean, summary.weibull_mean) == (6, 0.0, None, None)
    assert summary.horizon is None
    assert (of_measure(1.0, 2.0).mean, of_measure(1.0, 2.0).mean_low, of_measure(None).mean) == (1.5, None, None)


def test_undetermined_values_do_not_count_and_truth_values_are_shares() -> None:
    summary = of_measure(True, None, False, True, True, False, True)
    assert (summary.trials, summary.mean, summary.median) == (6, pytest.approx(4 / 6), None)
    assert (summary.mean_low, summary.mean_high) == pytest.approx(wilson_interval(4 / 6, 6))
    assert summary.is_share
    assert not of_measure(True, 0.5).is_share


def test_json_is_one_array_with_all_fields_of_each_point_and_no_nan(folder) -> None:
    stdout = called("summarize", folder, "--json")
    read = json.loads(stdout, parse_constant=pytest.fail)
    assert read == [vars(each) for each in summarize(read_points(folder))]
    assert len(stdout.splitlines()) == 1


def test_the_table_has_a_row_for_each_point_and_says_what_its_columns_are(folder, tmp_path) -> None:
    stdout = called("summarize", folder)
    assert stdout.startswith(f"{folder}: T_sync (cycles)")
    assert "Weibull mean: extrapolated by thesis Appendix A." in stdout
    assert "No intervals" not in stdout
    for row, point in zip(cells(stdout), summaries_of(read_points(folder)), strict=True):
        assert row[:4] == [str(point.point), str(point.axes[SPEED]), str(point.trials), f"{100 * point.censored:.0f} %"]
        assert row[4:] == [str(each) for each in point.estimates.values()]
    store(tmp_path, sweep({SPEED: [1, 2]}), lambda point: weibull(point, 50, trials=4 + point.number))
    stdout = called("summarize", tmp_path)
    assert "No intervals at 1 of 2 points: one takes 5 trials or more." in stdout
    assert not {"Weibull", "restricted"} & {*stdout.split()}
