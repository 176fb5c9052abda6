"""Claims about the statistics of a sweep's points: whose numbers they are, and the reports where there are none."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from epuck_sim.cli.app import app
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.points import points
from epuck_sim.statistics.mean import estimate_mean
from epuck_sim.statistics.measured import measure_t_sync
from epuck_sim.statistics.statistic import summarize as summaries_of
from epuck_sim.statistics.survival import confidence_interval, median_time, weibull_mean, weibull_resamples
from tests.cli.commands import cells
from tests.runs.made_folders import (
    LIMIT,
    SPEED,
    SPEEDS,
    censored,
    ended,
    in_memory,
    of_point,
    store,
    sweep,
    weibull,
)

COMMAND = [sys.executable, "-m", "epuck_sim"]

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


def one_point(times, observed=None, **changes) -> PointTrials:
    (point,) = points(sweep(None, **changes))
    return of_point(point, ended(times, observed))


def summarize(points) -> list[SimpleNamespace]:
    """Return the fields of the points as JSON has them."""
    return [SimpleNamespace(**each.record()) for each in summaries_of(points)]


def one_summary(times, observed=None, **changes) -> SimpleNamespace:
    return summarize([one_point(times, observed, **changes)])[0]


def no_constant(name: str) -> None:
    raise AssertionError(f"{name} is no JSON")


def summarized(*arguments: str | Path):
    result = CliRunner().invoke(app, ["summarize", *map(str, arguments)])
    assert result.exit_code == 0, result.stderr
    return result


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return store(tmp_path_factory.mktemp("mixed"), MIXED, mixed)


# Whose numbers they are


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


def test_points_stay_in_the_order_of_the_sweep() -> None:
    scenario = sweep({SPEED: [3, 1, 2]})
    summaries = summarize(in_memory(scenario, lambda point: ended([point.number + 1])))
    assert [(each.point, each.axes[SPEED], each.mean) for each in summaries] == [(0, 3, 1), (1, 1, 2), (2, 2, 3)]


def test_where_all_trials_synchronised_the_mean_is_that_of_the_sample_and_so_is_the_restricted_one() -> None:
    times = np.random.default_rng(3).lognormal(4, 0.8, 20).round()
    summary = one_summary(times, stop={"max_cycles": 5000})
    assert summary.mean == summary.restricted_mean == pytest.approx(times.mean())
    assert summary.weibull_mean < 0.95 * times.mean()  # of log-normal times
    assert (summary.censored, summary.horizon) == (0, 5000)


def test_where_trials_are_censored_there_is_no_sample_mean_but_three_others() -> None:
    summary = one_summary([3, 8, 20, 30, 40, 50], [True] * 5 + [False], stop={"max_cycles": 50})
    assert (summary.mean, summary.mean_low, summary.mean_high) == (None, None, None)
    assert None not in (summary.restricted_mean, summary.median, summary.weibull_mean)
    assert summary.restricted_mean_low < summary.restricted_mean < summary.restricted_mean_high <= 50


def test_where_all_trials_took_equally_long_nothing_is_known_of_their_spread() -> None:
    summary = one_summary([7] * 30)
    assert (summary.mean, summary.median, summary.weibull_mean) == (7, 7, 7)
    assert {summary.mean_low, summary.median_low, summary.weibull_mean_low} == {None}


@given(
    st.lists(st.tuples(st.integers(1, 50), st.booleans()), max_size=25),
    st.randoms(use_true_random=False),
)
@settings(max_examples=30)
def test_every_number_is_known_or_none_and_the_order_of_the_trials_does_not_matter(trials, random) -> None:
    times, observed = [time for time, _ in trials], [is_observed for _, is_observed in trials]
    summary = one_summary(times, observed)
    shuffled = random.sample(trials, len(trials))
    assert one_summary([time for time, _ in shuffled], [seen for _, seen in shuffled]) == summary
    numbers = [number for number in list(vars(summary).values())[2:] if number is not None]
    assert np.isfinite(numbers).all()
    assert summary.trials == len(trials)
    fields = list(vars(summary).values())
    for low, high in (fields[5:7], fields[8:10], fields[11:13], fields[14:16]):
        assert high is None or low <= high
    if summary.restricted_mean is not None:
        assert min(times) <= summary.restricted_mean <= summary.horizon
    assert (summary.weibull_mean is None) <= (summary.weibull_mean_low is None)
    assert (summary.mean is None) == (not trials or not all(observed))


# Where there is no number


def test_under_10_percent_uncensored_the_weibull_mean_is_none_and_the_restricted_mean_is_not() -> None:
    few = summarize(in_memory(MIXED, mixed))[2]
    assert few.censored == pytest.approx(55 / 60)
    assert (few.weibull_mean, few.weibull_mean_low, few.weibull_mean_high, few.median, few.median_high) == (None,) * 5
    assert few.restricted_mean == pytest.approx((40 + 41 + 42 + 43 + 44 + 55 * 100) / 60)


def test_where_no_trial_synchronised_all_is_none_but_the_restricted_mean_which_is_the_limit() -> None:
    none = summarize(in_memory(MIXED, mixed))[3]
    assert (none.trials, none.censored, none.restricted_mean, none.horizon) == (60, 1, 100, 100)
    fields = list(vars(none).values())
    assert fields[4:10] + fields[11:16] == [None] * 11


def test_a_point_without_trials_has_no_numbers() -> None:
    without = summarize(in_memory(MIXED, mixed))[4]
    assert list(vars(without).values()) == [4, {SPEED: 5.0}, 0, 0, *[None] * 12, 100, False]


def test_an_end_that_the_resamples_do_not_reach_is_none() -> None:
    at_the_edge = one_summary([*range(40, 47), *[100] * 53], [True] * 7 + [False] * 53, stop={"max_cycles": 100})
    assert at_the_edge.weibull_mean > at_the_edge.weibull_mean_low > 0
    assert at_the_edge.weibull_mean_high is None


# The horizon


def test_the_horizon_is_the_longest_follow_up_where_trials_ran_out_of_time_before() -> None:
    summary = one_summary([10, 20, 30, 30], [True, True, False, False], stop={"max_cycles": 5000, "max_time_s": 150})
    assert summary.horizon == 30
    assert summary.restricted_mean == pytest.approx((10 + 20 + 30 + 30) / 4)


def test_the_horizon_reaches_as_far_as_a_trial_was_followed_that_synchronised_after_others_were_censored() -> None:
    summary = one_summary([10, 20, 40], [True, False, True])
    assert summary.horizon == 40
    assert summary.restricted_mean == pytest.approx(10 + 30 * 2 / 3)


def test_the_horizon_is_each_point_s_own_limit() -> None:
    scenario = sweep({LIMIT: [50, 80]}, stop={})
    summaries = summarize(in_memory(scenario, lambda point: censored(point, 5)))
    assert [(each.horizon, each.restricted_mean) for each in summaries] == [(50, 50), (80, 80)]


# The same numbers again, and independent ones at each point


def test_the_same_results_give_the_same_numbers_in_any_process(folder) -> None:
    environment = {**os.environ, "PYTHONHASHSEED": "17"}  # that of this process is another one
    command = [*COMMAND, "summarize", str(folder), "--json"]
    other = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert other.stdout == summarized(folder, "--json").stdout


def test_every_point_has_a_seed_of_its_own() -> None:
    scenario = sweep({SPEED: SPEEDS, LIMIT: range(10, 60)}, stop={})
    seeds = {point.seed for point in in_memory(scenario, lambda _: ended([]))}
    assert len(seeds) == 5 * 50


def test_a_point_s_seed_is_not_changed_by_trials_points_or_places_added() -> None:
    few = in_memory(sweep({SPEED: [2, 1]}), lambda _: ended([5]))
    more = in_memory(sweep({SPEED: [0.5, 1, 2]}, trials=300), lambda _: ended([5, 6]))
    assert [point.seed for point in few] == [more[2].seed, more[1].seed]


def test_the_resamples_of_two_points_are_uncorrelated_even_if_their_trials_are_the_same() -> None:
    trials = weibull(points(MIXED)[0], 20)
    means = [weibull_resamples(*trials, seed=point.seed) for point in in_memory(MIXED, mixed)]
    correlations = np.corrcoef(means)[np.triu_indices(5, 1)]
    assert np.abs(correlations).max() < 4 / math.sqrt(1000)


def test_the_same_axis_values_of_another_scenario_are_resampled_otherwise() -> None:
    one, other = (in_memory(sweep({SPEED: [1]}, noise=noise), lambda _: ended([5])) for noise in ("on", "off"))
    assert one[0].seed != other[0].seed


# What is printed


def test_json_is_one_array_with_all_fields_of_each_point_and_no_nan(folder) -> None:
    stdout = summarized(folder, "--json").stdout
    read = json.loads(stdout, parse_constant=no_constant)
    assert read == [vars(each) for each in summarize(read_points(folder))]
    assert len(stdout.splitlines()) == 1
    assert [each["mean"] is None for each in read] == [False, True, True, True, True]
    assert [each["weibull_mean"] is None for each in read] == [False, False, True, True, True]
    assert [each["trials"] for each in read] == [60, 60, 60, 60, 0]


def test_the_table_has_a_row_for_each_point(folder) -> None:
    stdout = summarized(folder).stdout
    table = cells(stdout)
    trials = ["60"] * 4 + ["0"]
    assert [row[:3] for row in table] == [[str(n), str(speed), trials[n]] for n, speed in enumerate(SPEEDS)]
    for row, point in zip(table, summaries_of(read_points(folder)), strict=True):
        assert row[3] == f"{100 * point.censored:.0f} %"
        assert row[4:] == [str(each) for each in point.estimates.values()]
    assert stdout.startswith(f"{folder}: T_sync (cycles)")


def test_in_the_table_what_is_undetermined_is_a_dash(folder) -> None:
    few, none, without = cells(summarized(folder).stdout)[2:]
    assert few[4:6] + few[7:] == ["-", "-", "-"]
    assert few[6].startswith("95.2 [")
    assert none[3:] == ["100 %", "-", "-", "100", "-"]
    assert without[3:] == ["0 %", "-", "-", "-", "-"]


def test_the_table_says_what_its_columns_are_and_leaves_out_those_of_censored_trials_where_none_is(
    folder, tmp_path
) -> None:
    assert "Weibull mean: extrapolated by thesis Appendix A." in summarized(folder).stdout
    store(tmp_path, sweep({SPEED: [1, 2]}, trials=9), lambda point: weibull(point, 50))
    stdout = summarized(tmp_path).stdout
    assert "Weibull" not in stdout
    assert "restricted" not in stdout


def test_the_table_says_why_there_are_no_intervals(folder, tmp_path) -> None:
    assert "No intervals" not in summarized(folder).stdout
    store(tmp_path, sweep({SPEED: [1, 2]}), lambda point: weibull(point, 50, trials=4 + point.number))
    assert "No intervals at 1 of 2 points: one takes 5 trials or more." in summarized(tmp_path).stdout


def test_a_scenario_without_a_sweep_is_one_row(tmp_path) -> None:
    store(tmp_path, sweep(None, trials=3), lambda _: ended([5, 5, 5]))
    assert cells(summarized(tmp_path).stdout) == [["0", "3", "0 %", "5", "5"]]
