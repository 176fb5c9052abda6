"""Claims about results as a DataFrame: a row for each trial, with its axes, its end and its measure."""

import math
import sys

import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.reader import SweepTrials, read_points
from tests.runs.made_folders import COUNT, SPEED, ended, in_memory, store, sweep

SCENARIO = sweep({COUNT: [3, 5], SPEED: [1, 2]}, trials=2)


def law(point):
    return ended([10 * point.axes[COUNT], 90], [True, False])


def test_there_is_a_row_for_each_trial_in_the_order_of_the_sweep(tmp_path) -> None:
    read = read_points(store(tmp_path / "run", SCENARIO, law))
    frame = read.to_pandas()
    assert [*frame.columns] == ["point", COUNT, SPEED, "seed", "cycles", "censored", "t_sync_cycles"]
    assert frame["point"].tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert frame[COUNT].tolist() == [3] * 4 + [5] * 4
    assert frame["seed"].tolist() == [seed for point in read for seed in point.seeds]
    assert frame["cycles"].tolist() == [30, 90, 30, 90, 50, 90, 50, 90]
    assert frame["censored"].tolist() == [False, True] * 4
    assert frame["t_sync_cycles"].mean() == 40  # pandas leaves out what is NaN
    assert math.isnan(frame["t_sync_cycles"][1])


def test_the_measure_that_was_asked_for_is_a_column() -> None:
    points = [point._replace(measured=(0.5, [1, 2]), of="order") for point in in_memory(SCENARIO, law)]
    frame = SweepTrials(points).to_pandas()
    assert frame["order"].tolist() == [0.5, [1, 2]] * 4


def test_trials_without_t_sync_are_neither_censored_nor_not() -> None:
    points = SweepTrials(
        point._replace(has_t_sync=False, observed=point.observed & False) for point in in_memory(SCENARIO, law)
    )
    frame = points.to_pandas()
    assert frame["censored"].tolist() == [None] * 8
    assert frame["t_sync_cycles"].isna().all()
    assert points._repr_html_().count("<td>-</td>") == 4


def test_without_pandas_it_says_what_is_missing(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(EpuckSimError, match="to_pandas needs pandas, which is not installed: pip install pandas"):
        SweepTrials(in_memory(SCENARIO, law)).to_pandas()
