"""Claims about curves: which points make one, in which order, against which axis, and what distinguishes them."""

from collections.abc import Collection
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim import points, summarize
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import choose_axis, choose_second_axis, distinguishing_axes
from epuck_sim.statistics.curves import read_curves
from epuck_sim.statistics.names import Statistic
from tests.runs.made_folders import (
    COUNT,
    COUPLING,
    HEIGHT,
    SECONDS,
    SPEED,
    SPEEDS,
    WIDTH,
    ended,
    in_memory,
    of_point,
    sweep,
    weibull,
)

METRIC = "stop.metric"
OTHER_SPEED = SPEED.replace(".0.", ".1.")


def with_axes(scenario_sweep: dict, trials: int = 5, **changes) -> list[PointTrials]:
    """Return the points of a sweep, each with trials."""
    return in_memory(sweep(None, trials=trials, sweep=scenario_sweep, **changes), lambda point: weibull(point, 30))


def axes_of(made: list[PointTrials]) -> list[dict]:
    return [point.axes for point in made]


def rows_of(*rows: dict, empty: Collection[int] = ()) -> list[PointTrials]:
    """Return points with these axis values, whether a scenario has such keys or not, and one trial each, or none."""
    (point,) = points(sweep(None))
    numbered = (point._replace(number=number, axes=row) for number, row in enumerate(rows))
    return [of_point(each, ended([] if each.number in empty else [each.number + 1])) for each in numbered]


def test_the_numbers_of_a_curve_are_those_of_the_summary() -> None:
    scenario = sweep({SPEED: SPEEDS, COUPLING: [0.1, 0.2]}, trials=60, stop={"max_cycles": 60})
    made = in_memory(scenario, lambda point: weibull(point, 30))
    summaries = [SimpleNamespace(**each.record()) for each in summarize(made)]
    for statistic, name in zip(Statistic, ("restricted_mean", "median", "weibull_mean"), strict=True):
        for curve in read_curves(made, SPEED, statistic):
            own = [each for each in summaries if each.axes[COUPLING] == curve.axes[COUPLING]]
            assert curve.values.tolist() == [getattr(each, name) for each in own]
            ends = [[getattr(each, f"{name}_{end}") for end in ("low", "high")] for each in own]
            assert curve.intervals.tolist() == ends
    for curve in read_curves(made, SPEED):
        own = [each for each in summaries if each.axes[COUPLING] == curve.axes[COUPLING]]
        assert curve.censored.tolist() == pytest.approx([each.censored for each in own])
        assert curve.trials.tolist() == [60] * 5
        assert curve.resampled.shape == (1000, 5)


def test_the_statistic_of_a_point_has_the_name_that_its_censoring_makes() -> None:
    def law(point):
        return ended([5, 6, 7], [True, True, point.axes[SPEED] > 1])

    names = {
        statistic: read_curves(in_memory(sweep({SPEED: [1, 2]}), law), SPEED, statistic) for statistic in Statistic
    }
    assert [curve.names for (curve,) in names.values()] == [
        ["restricted mean", "mean"],
        ["median", "median"],
        ["Weibull mean", "Weibull mean"],
    ]


@given(
    st.permutations([(x, y, z) for x in (1, 2.5, 4) for y in ("a", None) for z in ([1], {"k": 0.5})]),
    st.sets(st.integers(0, 11)),
)
@settings(max_examples=15)
def test_every_point_with_trials_is_on_the_curve_of_its_other_axes_once(order, empty) -> None:
    made = rows_of(*({"x": x, "y": y, "z": z} for x, y, z in order), empty=empty)
    expected: list[tuple[dict, dict]] = []
    for each in made:
        others = {"y": each.axes["y"], "z": each.axes["z"]}
        if others not in [axes for axes, _ in expected]:
            expected.append((others, {}))
        if len(each.times):
            next(ends for axes, ends in expected if axes == others)[each.axes["x"]] = each.times[0]
    curves = read_curves(made, "x")
    assert [(curve.axes, list(zip(curve.x, curve.values, strict=True))) for curve in curves] == [
        (axes, sorted(ends.items())) for axes, ends in expected if ends
    ]


@pytest.mark.parametrize(
    ("scenario_sweep", "x", "expected"),
    [
        ({"zip": {WIDTH: [40, 60, 80], HEIGHT: [40, 60, 80]}}, WIDTH, [({}, [40, 60, 80])]),
        ({"points": [{WIDTH: 60, SPEED: 1}, {SPEED: 2, WIDTH: 60.0}]}, SPEED, [({}, [1, 2])]),
    ],
    ids=["with another that goes along", "equal values, written otherwise"],
)
def test_which_curves_a_sweep_makes(scenario_sweep: dict, x: str, expected: list) -> None:
    curves = read_curves(with_axes(scenario_sweep), x)
    assert [(curve.axes, curve.x.tolist()) for curve in curves] == expected


def test_the_axis_is_the_speed_or_else_the_one_with_most_numbers() -> None:
    for grid, expected in [
        ({COUPLING: [0.1, 0.2, 0.3], SPEED: [1, 2]}, SPEED),
        ({SPEED: [1], COUPLING: [0.1, 0.2, 0.3]}, COUPLING),
        ({COUNT: [2, 3], COUPLING: [0.1, 0.2, 0.3]}, COUPLING),
        ({METRIC: ["complex", "reference"], COUNT: [3]}, COUNT),
        ({SECONDS: [None, 5, 6], COUNT: [2, 3]}, COUNT),
        ({"robots.0.parameters.once_per_sighting": [True, False], COUNT: [3]}, COUNT),
    ]:
        assert choose_axis(axes_of(with_axes({"grid": grid}))) == expected


@pytest.mark.parametrize(
    "grid",
    [
        {SPEED: [1, 2], COUPLING: [0.1, 0.2]},
        {SPEED: [1, 2], COUPLING: [0.1, 0.2], COUNT: [5]},
        {SPEED: [1, 2], METRIC: ["complex", "reference"], COUPLING: [0.1, 0.2]},
    ],
)
def test_the_second_axis_is_the_only_other_one_whose_numbers_differ(grid: dict) -> None:
    assert choose_second_axis(axes_of(with_axes({"grid": grid})), SPEED) == COUPLING


def test_axes_that_go_along_count_as_one_and_those_with_x_as_none() -> None:
    both = [{"count": 2}, {"count": 2}]
    scenario_sweep = {
        "points": [{SPEED: 1, OTHER_SPEED: 2}, {SPEED: 2, OTHER_SPEED: 4}],
        "zip": {WIDTH: [40, 60], HEIGHT: [40, 60]},
    }
    made = with_axes(scenario_sweep, robots=both)
    assert choose_second_axis(axes_of(made), SPEED) == WIDTH
    assert choose_second_axis(axes_of(made), HEIGHT) == SPEED


def partition(values: list) -> frozenset:
    """Return which places hold equal values."""
    return frozenset(frozenset(n for n, other in enumerate(values) if other == value) for value in values)


TABLES = st.integers(1, 6).flatmap(
    lambda count: st.lists(st.tuples(*[st.integers(0, 2)] * count), min_size=1, max_size=5)
)


@given(TABLES)
def test_the_axes_that_are_kept_distinguish_as_much_as_all_and_none_is_tied_to_another(columns: list[tuple]) -> None:
    rows = [dict(zip("abcde", row, strict=False)) for row in zip(*columns, strict=True)]
    found = distinguishing_axes(rows)
    kept = list(found[0])
    assert all(each == {key: row[key] for key in kept} for each, row in zip(found, rows, strict=True))
    assert partition(found) == partition(rows)
    partitions = [partition([row[key] for row in rows]) for key in kept]
    assert len(set(partitions)) == len(partitions)
    assert all(len(each) > 1 for each in partitions)
    for key in set(rows[0]) - set(kept):
        own = partition([row[key] for row in rows])
        assert len(own) == 1 or own in partitions
