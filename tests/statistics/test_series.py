"""Statistics of series over cycles, against those of the values at each cycle."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim import StoreError, read_points
from epuck_sim.estimate import UNDETERMINED
from epuck_sim.statistics.series import series_statistics, summarize_series
from epuck_sim.statistics.statistic import estimate_mean, estimate_median
from tests.runs.made_folders import SPEED, store_measured, sweep
from tests.statistics.fits import measured

NUMBERS = st.sampled_from([0.0, 1.0, 1.0, 2.0, 0.25, -3.0, math.nan, 7.5])
POSITIVE = st.sampled_from([1.0, 1.0, 2.0, 0.25, math.nan, 7.5])
SERIES = st.one_of(*(st.lists(st.lists(each, max_size=6), min_size=1, max_size=12) for each in (NUMBERS, POSITIVE)))


def at_cycle(series, cycle):
    """Return the mean and the median of the values at a cycle, by the statistics of single values."""
    values = np.array([each[cycle] for each in series if len(each) > cycle and not math.isnan(each[cycle])])
    if not len(values):
        return 0, UNDETERMINED.ends, UNDETERMINED.ends
    return len(values), estimate_mean(measured(values)).ends, estimate_median(measured(values)).ends


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
    for ours, theirs in zip(one, other, strict=True):
        assert ours.tobytes() == theirs.tobytes()


def test_series_of_a_folder(tmp_path):
    scenario = sweep({SPEED: [1, 2, 3]}, measures=["order_parameter"])
    law = {1: [[0.5, 0.75], [0.25]], 2: [], 3: [[1.0], None]}
    folder = store_measured(tmp_path / "run", scenario, lambda point: law[point.axes[SPEED]])
    found = summarize_series(read_points(folder, "order_parameter"))
    assert [point.axes for point in found] == [{SPEED: 1}, {SPEED: 3}]
    assert found[0].statistics.mean[:, 0].tolist() == [0.375, 0.75]
    assert found[0].statistics.trials.tolist() == [2, 1]
    assert found[1].statistics.trials.tolist() == [1]


def test_what_is_no_series_is_refused(tmp_path):
    scenario = sweep({SPEED: [1]}, measures=["near_walls"])
    folder = store_measured(tmp_path / "run", scenario, lambda _: [0.5, 0.25])
    with pytest.raises(StoreError, match="near_walls is no series"):
        summarize_series(read_points(folder, "near_walls"))
    with pytest.raises(StoreError, match="T_sync is no series"):
        summarize_series(read_points(folder))
