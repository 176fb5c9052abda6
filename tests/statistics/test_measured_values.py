"""Statistics of measures other than T_sync: those of any sample, without censoring."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from epuck_sim.errors import StoreError
from epuck_sim.statistics.mean import wilson_interval
from epuck_sim.statistics.measured import measure
from epuck_sim.statistics.statistic import summarize
from tests.runs.made_folders import ended, in_memory, sweep


def summary_of(*values):
    (point,) = in_memory(sweep(trials=max(len(values), 1)), lambda _: ended([7] * len(values)))
    (found,) = summarize([point._replace(measured=tuple(values), of="mine")])
    return SimpleNamespace(**found.record())


def test_the_mean_and_the_median_are_those_of_the_sample():
    values = [-3.0, -1.0, 0.0, 2.0, 4.0, 5.5]
    summary = summary_of(*values)
    assert summary.mean == pytest.approx(np.mean(values))
    error = np.std(values, ddof=1) / math.sqrt(6)
    assert (summary.mean_low, summary.mean_high) == pytest.approx(
        (summary.mean - 2.5706 * error, summary.mean + 2.5706 * error), rel=1e-4
    )
    assert -1.0 <= summary.median <= 2.0
    assert (summary.trials, summary.censored) == (6, 0.0)


def test_what_is_for_times_alone_is_left_out():
    summary = summary_of(*range(10))
    assert (summary.restricted_mean, summary.weibull_mean, summary.horizon) == (None, None, None)


def test_undetermined_values_do_not_count_and_truth_values_are_shares():
    summary = summary_of(True, None, False, True, True, False, True)
    assert (summary.trials, summary.mean, summary.median) == (6, pytest.approx(4 / 6), None)
    assert (summary.mean_low, summary.mean_high) == pytest.approx(wilson_interval(4 / 6, 6))
    assert summary.is_share
    assert not summary_of(True, 0.5).is_share


def test_few_trials_have_no_interval():
    assert (summary_of(1.0, 2.0).mean, summary_of(1.0, 2.0).mean_low) == (1.5, None)
    assert summary_of(None).mean is None
    assert summary_of().trials == 0


def test_a_series_is_refused():
    with pytest.raises(StoreError, match="mine is a series"):
        summary_of([1.0, 2.0], [])


def test_what_was_asked_for_is_measured():
    (point,) = in_memory(sweep(trials=2), lambda _: ended([7, 9]))
    assert measure(point).values.tolist() == [7, 9]
    assert measure(point._replace(of="mine", measured=(0.5, None))).values.tolist() == [0.5]


def test_trials_without_t_sync_have_none():
    (point,) = in_memory(sweep(trials=2, measures=["near_walls", "order_parameter"]), lambda _: ended([7, 9]))
    with pytest.raises(StoreError, match=r"no T_sync: .*; what was measured: near_walls, order_parameter \(--of NAME"):
        measure(point._replace(has_t_sync=False))
