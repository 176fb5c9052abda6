"""Claims about curves: which points make one, where minimum and peak lie, how sure that is, or why there is none."""

import math
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import points, summarize
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.axes import choose_axis, choose_second_axis, distinguishing_axes
from epuck_sim.statistics import Statistic, extrema
from epuck_sim.statistics.curves import Curve, read_curves
from epuck_sim.statistics.extrema import find_minimum, find_minimum_and_peak, find_peak, search_extrema, smooth_logs
from epuck_sim.statistics.fit import MeasureFit, fit_measure, measure_fit_table
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, COUPLING, HEIGHT, SPEED, WIDTH, censored, ended, in_memory, sweep, weibull

METRIC = "stop.metric"


def with_axes(scenario_sweep: dict, trials: int = 5, **changes) -> list[PointTrials]:
    return in_memory(sweep(None, trials=trials, sweep=scenario_sweep, **changes), lambda point: weibull(point, 30))


def axes_of(made: list[PointTrials]) -> list[dict]:
    return [point.axes for point in made]


def test_the_numbers_of_a_curve_are_those_of_the_summary() -> None:
    scenario = sweep({SPEED: made_folders.SPEEDS, COUPLING: [0.1, 0.2]}, trials=60, stop={"max_cycles": 60})
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

    made = in_memory(sweep({SPEED: [1, 2]}), law)
    names = [curve.names for statistic in Statistic for curve in read_curves(made, SPEED, statistic)]
    assert names == [["restricted mean", "mean"], ["median", "median"], ["Weibull mean", "Weibull mean"]]


PLACED = [(x, y, z) for x in (1, 2.5, 4) for y in ("a", None) for z in ([1], {"k": 0.5})]


@given(st.permutations(PLACED), st.sets(st.integers(0, 11)))
@settings(max_examples=15)
def test_every_point_with_trials_is_on_the_curve_of_its_other_axes_once(order, empty) -> None:
    (point,) = points(sweep(None))
    numbered = [point._replace(number=n, axes=dict(zip("xyz", axes, strict=True))) for n, axes in enumerate(order)]
    made = [made_folders.of_point(each, ended([each.number + 1] * (each.number not in empty))) for each in numbered]
    expected: list[tuple[dict, dict]] = []
    for each in made:
        others = {"y": each.axes["y"], "z": each.axes["z"]}
        if others not in [axes for axes, _ in expected]:
            expected.append((others, {}))
        if len(each.times):
            next(ends for axes, ends in expected if axes == others)[each.axes["x"]] = each.times[0]
    found = [(curve.axes, list(zip(curve.x, curve.values, strict=True))) for curve in read_curves(made, "x")]
    assert found == [(axes, sorted(ends.items())) for axes, ends in expected if ends]


def test_axes_that_go_along_and_equal_values_that_are_written_otherwise_make_one_curve() -> None:
    for scenario_sweep, x, expected in (
        ({"zip": {WIDTH: [40, 60, 80], HEIGHT: [40, 60, 80]}}, WIDTH, [40, 60, 80]),
        ({"points": [{WIDTH: 60, SPEED: 1}, {SPEED: 2, WIDTH: 60.0}]}, SPEED, [1, 2]),
    ):
        (curve,) = read_curves(with_axes(scenario_sweep), x)
        assert (curve.axes, curve.x.tolist()) == ({}, expected)


def test_the_axis_is_the_speed_or_else_the_one_with_most_numbers() -> None:
    for grid, expected in [
        ({COUPLING: [0.1, 0.2, 0.3], SPEED: [1, 2]}, SPEED),
        ({SPEED: [1], COUPLING: [0.1, 0.2, 0.3]}, COUPLING),
        ({COUNT: [2, 3], COUPLING: [0.1, 0.2, 0.3]}, COUPLING),
        ({METRIC: ["complex", "reference"], COUNT: [3]}, COUNT),
        ({made_folders.SECONDS: [None, 5, 6], COUNT: [2, 3]}, COUNT),
        ({"robots.0.parameters.once_per_sighting": [True, False], COUNT: [3]}, COUNT),
    ]:
        assert choose_axis(axes_of(with_axes({"grid": grid}))) == expected


def test_the_second_axis_is_the_only_other_one_whose_numbers_differ_and_those_that_go_along_count_as_one() -> None:
    for more in ({}, {COUNT: [5]}, {METRIC: ["complex", "reference"]}):
        grid = {SPEED: [1, 2], **more, COUPLING: [0.1, 0.2]}
        assert choose_second_axis(axes_of(with_axes({"grid": grid})), SPEED) == COUPLING
    listed = [{SPEED: 1, SPEED.replace(".0.", ".1."): 2}, {SPEED: 2, SPEED.replace(".0.", ".1."): 4}]
    along = {"points": listed, "zip": {WIDTH: [40, 60], HEIGHT: [40, 60]}}
    made = with_axes(along, robots=[{"count": 2}, {"count": 2}])
    assert choose_second_axis(axes_of(made), SPEED) == WIDTH
    assert choose_second_axis(axes_of(made), HEIGHT) == SPEED


def partition(values: list) -> frozenset:
    """Return which places hold equal values."""
    return frozenset(frozenset(n for n, other in enumerate(values) if other == value) for value in values)


@given(st.integers(1, 6).flatmap(lambda n: st.lists(st.tuples(*[st.integers(0, 2)] * n), min_size=1, max_size=5)))
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


DENSE = np.geomspace(0.05, 12.8, 20)
X = np.log10(DENSE)
GRID_STEP = (X[-1] - X[0]) / (extrema.GRID_POINTS - 1)

# the base case of the thesis, measured by 1000 trials a point
BASE_SPEEDS = np.array([0.05, 0.083, 0.137, 0.227, 0.376, 0.622, 1.029, 1.704, 2.821, 4.67, 7.732, 12.8])
BASE_MEANS = np.array([110.8, 78.0, 58.5, 52.5, 52.3, 56.7, 61.4, 56.6, 42.1, 32.2, 25.3, 22.0])


def base_case(speeds):
    return np.interp(np.log10(speeds), np.log10(BASE_SPEEDS), np.log(BASE_MEANS))


def cubic(x, low=-0.5, peak=0.3, steepness=2.0):
    """Return log T with a local minimum at log10 V = low and a peak at log10 V = peak."""
    return 4 - steepness * (x**3 / 3 - (low + peak) / 2 * x**2 + low * peak * x)


def certain(logs):
    return np.exp(logs), np.tile(np.exp(logs), (50, 1))


def trials(logs, count, seed, resamples=200):
    """Return the means of Weibull trials, a spread of 0.75 of the mean as T_sync has, and their bootstrap."""
    means, resampled = trials_of_mean_one(len(logs), count, seed, resamples)
    return means * np.exp(logs), resampled * np.exp(logs)


@cache  # to draw the resamples takes as long as to look for a pair in them, and many curves are tried with the same
def trials_of_mean_one(speeds, count, seed, resamples):
    rng = np.random.default_rng(seed)
    times = rng.weibull(made_folders.SHAPE, (speeds, count)) / math.gamma(1 + 1 / made_folders.SHAPE)
    drawn = [of_one[rng.integers(count, size=(resamples, count))].mean(axis=1) for of_one in times]
    return times.mean(axis=1), np.column_stack(drawn)


def share_found(logs, count, curves, resamples=200):
    """Return the share of curves, each measured anew, in which a pair is found."""
    measured = (trials(logs, count, seed, resamples) for seed in range(curves))
    return np.mean([find_minimum_and_peak(DENSE, *each).is_found for each in measured])


@pytest.mark.parametrize(("low", "peak", "steepness"), [(-0.5, 0.3, 0.5), (-0.1, 0.2, 5.0)])
def test_a_cubics_extremes_are_found_where_they_are(low, peak, steepness):
    pair = find_minimum_and_peak(DENSE, *certain(cubic(X, low, peak, steepness)))
    assert np.log10(pair.values[::2]) == pytest.approx([low, peak], abs=1.5 * GRID_STEP)
    at_extremes = cubic(np.array([low, peak]), low, peak, steepness)
    assert np.log(pair.values[1::2]) == pytest.approx(at_extremes, abs=2e-3)
    assert pair.p_value == pytest.approx(1 / 51)  # no resample of a certain curve rises as much


def test_the_pair_is_the_one_with_the_largest_rise():
    waves = np.cos(2 * math.pi * X) * np.where(X < 0, 0.2, 0.4) - X  # rises towards -1, 0 and 1; the last is largest
    pair = find_minimum_and_peak(DENSE, *certain(waves))
    slope = math.asin(1 / (0.4 * 2 * math.pi)) / (2 * math.pi)  # how far the slope moves extremes
    assert np.log10(pair.values[::2]) == pytest.approx([0.5 + slope, 1 - slope], abs=0.03)


@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.integers(0, 99))
@settings(max_examples=25)
def test_a_parabola_in_logs_is_smoothed_to_itself_whatever_the_noise(coefficients, seed):
    _, resampled = trials(np.polyval(coefficients, X), 30, seed, 100)
    fit = smooth_logs(DENSE, np.exp(np.polyval(coefficients, X)), resampled)
    assert fit.smoother @ fit.logs == pytest.approx(np.polyval(coefficients, np.log10(fit.speeds)), abs=1e-6)


@given(st.floats(0.01, 100), st.floats(0.01, 100), st.integers(0, 99))
@settings(max_examples=10)
def test_the_pair_moves_with_the_units_of_time_and_speed(cycles, speed, seed):
    means, resampled = trials(cubic(X), 200, seed, 100)
    pair = find_minimum_and_peak(DENSE, means, resampled)
    scaled = find_minimum_and_peak(speed * DENSE, cycles * means, cycles * resampled)
    units = np.array([speed, cycles, speed, cycles])
    assert scaled.values == pytest.approx(units * pair.values)
    assert scaled.intervals == pytest.approx(units[:, None] * pair.intervals)
    assert scaled.resampled == pytest.approx(units * pair.resampled, nan_ok=True)
    assert scaled.p_value == pytest.approx(pair.p_value, abs=1e-9)


def assert_same(pair, other):
    for one, two in zip(pair, other, strict=True):
        assert np.array_equal(one, two, equal_nan=True)


@pytest.mark.parametrize("missing", [np.nan, np.inf])
def test_a_few_undetermined_resamples_count_as_the_longest_and_many_or_no_mean_leave_a_speed_out(missing):
    means, resampled = trials(cubic(X), 200, 4)
    without = find_minimum_and_peak(DENSE[2:], means[2:], resampled[:, 2:])
    worst = np.argsort(resampled[:, 0])[-10:]
    resampled[worst[:9], 0] = resampled[worst[9], 0]
    full = find_minimum_and_peak(DENSE, means, resampled)
    resampled[worst[:9], 0] = missing
    assert_same(find_minimum_and_peak(DENSE, means, resampled), full)
    means[0] = missing
    resampled[: len(resampled) // 15, 1] = missing
    assert_same(find_minimum_and_peak(DENSE, means, resampled), without)


def test_a_pair_takes_six_determined_speeds_and_a_certain_curve_without_both_extremes_has_none():
    for determined in (0, extrema.MIN_SPEEDS - 1, extrema.MIN_SPEEDS):
        means, resampled = certain(cubic(X))
        means[determined:] = np.nan
        assert (find_minimum_and_peak(DENSE, means, resampled) is None) == (determined < 6)
    for logs in (-X, -(X**3), X, 0.3 * X**2, -0.3 * X**2):
        pair = find_minimum_and_peak(DENSE, *certain(logs))
        assert np.isnan([*pair.values, *np.ravel(pair.intervals)]).all()
        assert (pair.p_value, pair.places) == (1, [])


PLATEAU, POWER_LAW = 4 - 1.6 * np.minimum(X + 0.5, 0) - 1.3 * np.maximum(X - 0.3, 0), 4 - 0.8 * X
NEVER_FALLS_AGAIN = base_case(np.minimum(DENSE, 1.029))


@pytest.mark.parametrize("curves", [40, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("logs", [PLATEAU, POWER_LAW, np.full(20, 4.0), 4 + 0.5 * X**2, NEVER_FALLS_AGAIN])
def test_noise_is_rarely_taken_for_a_pair(logs, curves):
    # 100 curves: 5 % are within it but for one seed in 80
    assert share_found(logs, 200, curves, 100) <= 2 * extrema.SIGNIFICANCE


@pytest.mark.parametrize(("kept", "is_found"), [(1.0, True), (0.96, True), (0.94, False), (0.5, False)])
def test_a_pair_that_noise_would_undo_is_none(kept, is_found):
    pair = find_minimum_and_peak(DENSE, *trials(cubic(X), 1000, 1))
    assert pair.is_found
    lost = pair.resampled.copy()
    lost[round(kept * len(lost)) :] = np.nan
    assert pair._replace(resampled=lost).is_found == is_found
    assert pair._replace(p_value=0.06).places == []


@pytest.mark.parametrize(
    ("count", "curves", "least", "most"), [(30, 25, 0.2, 0.6), (200, 50, 0.85, 1), (1000, 10, 1, 1)]
)
def test_the_base_case_is_found_mostly_at_200_trials_and_always_at_1000(count, curves, least, most):
    assert least <= share_found(base_case(DENSE), count, curves) <= most


def test_intervals_are_percentiles_of_the_resamples_that_have_a_pair():
    pair = find_minimum_and_peak(DENSE, *trials(base_case(DENSE), 30, 11))
    without = np.isnan(pair.resampled).any(axis=1)
    assert 0 < np.count_nonzero(without) < len(without)
    low, high = np.nanpercentile(pair.resampled, [2.5, 97.5], axis=0)
    assert pair.intervals == pytest.approx(np.column_stack([low, high]))
    slow, fast = pair.resampled[~without, 0], pair.resampled[~without, 2]
    assert (slow < fast).all()


def curve_of(law, speeds=made_folders.MANY_SPEEDS, trials: int = 60, **changes) -> Curve:
    (curve,) = read_curves(in_memory(sweep({SPEED: speeds}, trials=trials, **changes), law), SPEED)
    return curve


def test_with_few_trials_there_is_no_p_value_but_how_many_are_the_least_and_speeds_with_few_are_left_out() -> None:
    for trials in (1, extrema.ENOUGH_TRIALS - 1):
        found = search_extrema(curve_of(made_folders.bumpy, trials=trials))
        assert (found.places, found.p_value) == ({}, None)
        assert found.reason.startswith("fewer than 20 trials at 13 of 13 speeds")
        assert "give --trials 20 or more" in found.reason
    assert search_extrema(curve_of(made_folders.bumpy, trials=extrema.ENOUGH_TRIALS)).reason == ""
    curve = curve_of(lambda point: weibull(point, 50, trials=60 if point.number % 2 else 3))
    assert curve.trials.tolist() == [3, 60] * 6 + [3]
    pair = find_minimum_and_peak(curve.x[1::2], curve.values[1::2], curve.resampled[:, 1::2])
    assert search_extrema(curve).p_value == pair.p_value


def test_why_there_is_none_is_said_of_few_speeds_without_the_one_at_rest_and_where_censoring_may_hide_a_peak() -> None:
    few = search_extrema(curve_of(made_folders.falling, [1, 2, 3, 4, 5]))
    assert few.reason == "5 speeds above 0; a minimum and a peak need 6"
    assert search_extrema(curve_of(lambda _: ended(range(1, 40)), range(6))).reason.startswith("5 speeds above 0;")
    assert search_extrema(curve_of(made_folders.falling, range(1, extrema.MIN_SPEEDS + 1))).reason == ""
    half_censored = ended([20, 30] * 15 + [50] * 30, [True] * 30 + [False] * 30)
    found = search_extrema(curve_of(lambda p: half_censored if 5 <= p.number <= 7 else made_folders.bumpy(p)))
    why = "half of the trials or more are censored from 0.5 to 1.3 cm/s, where a peak may be: raise stop.max_cycles"
    assert found.reason == why


@pytest.mark.parametrize(("known", "why"), [(30, "half of the trials or more"), (32, "it is known well enough")])
def test_t_sync_along_any_axis_has_the_same_reasons_and_one_of_medians_that_few_resamples_reach(known, why) -> None:
    law = ended([20, 30] * 15 + [50] * 30, [True] * known + [False] * (60 - known))
    points = in_memory(sweep({SPEED: made_folders.MANY_SPEEDS}), lambda _: law)
    (curve,) = read_curves(points, SPEED, Statistic.MEDIAN)
    assert extrema.search_measure(curve._replace(of="t_sync_s"))[2].startswith(why)


def level_beyond(speed: float, power: float = 2):
    """Return T_sync that falls like a power of the speed to 50 cycles at `speed`, and is level from there on."""
    return lambda v: 50 * max(1, (speed / v) ** power)


def fast_curve(mean, trials: int = 200, stop: int = 5000, hidden: int = 0) -> Curve:
    def law(point):
        return censored(point, trials) if point.number < hidden else weibull(point, mean(point.axes[SPEED]))

    return curve_of(law, trials=trials, stop={"max_cycles": stop})


@pytest.mark.parametrize("speed", [0.5, 1.5, 4.0])
@pytest.mark.parametrize("hidden", [0, 2])
def test_v_f_is_where_t_sync_is_twice_that_at_the_largest_speed(speed: float, hidden: int) -> None:
    estimate, _ = extrema.find_fast_speed(fast_curve(level_beyond(speed), hidden=hidden))
    assert estimate.low < estimate.value < estimate.high < 1.5 * estimate.low
    assert estimate.value == pytest.approx(speed / math.sqrt(2), rel=0.12)


def test_where_nothing_becomes_level_or_nothing_is_known_there_is_none_and_a_bump_before_it_does_not_count() -> None:
    still_falls, level_curve = fast_curve(lambda v: 60 / v**0.5), fast_curve(lambda _: 50)
    few_trials, all_censored = fast_curve(level_beyond(1.5), trials=19), fast_curve(lambda _: 5000, stop=3000)
    for curve in (still_falls, level_curve, few_trials, all_censored):
        assert extrema.find_fast_speed(curve) is None
    bump = fast_curve(lambda v: 150 if v < 0.3 else 60 if v < 0.9 else 200 if v < 2.2 else 50)
    estimate, _ = extrema.find_fast_speed(bump)  # what is before V_f does not count
    assert 2.0 < estimate.value < 3.2
    falls = np.array([[80.0, 40, 10, 10], [10, 10, 10, 10]])
    four = level_curve._replace(x=2.0 ** np.arange(4), trials=np.full(4, 99), values=falls[0], resampled=falls)
    estimate, resampled = extrema.find_fast_speed(four)
    assert resampled == pytest.approx([2**1.5, math.nan], nan_ok=True)  # halfway in logs; that of no level curve
    assert estimate.ends == pytest.approx([2**1.5] * 3)


PLACES = np.array([0.1, 0.2, 0.4, 0.8, 1.5, 3.0, 6.0, 12.0])
LOG_PLACES = np.log10(PLACES)


def curve(logs, noise=0.01, seed=0, resamples=1000):
    """Return the smoother of a curve whose logarithms are known, with noisy resamples."""
    random = np.random.default_rng(seed)
    observed = logs + random.normal(0, noise, len(logs))
    return smooth_logs(PLACES, np.exp(observed), np.exp(observed + random.normal(0, noise, (resamples, len(logs)))))


def test_the_peak_of_a_parabola_is_found_and_there_is_no_minimum():
    fit = curve(2 - (LOG_PLACES - 0.3) ** 2)
    peak = find_peak(fit)
    (at, height) = (place.estimate for place in peak.places)
    assert at.value == pytest.approx(10**0.3, rel=0.05)
    assert height.value == pytest.approx(np.e**2, rel=0.02)
    assert at.low < 10**0.3 < at.high
    assert height.low < np.e**2 < height.high
    assert not find_minimum(fit).is_found


def test_a_curve_with_both_has_both_and_its_inverse_has_them_turned_over():
    x = LOG_PLACES
    logs = -4 * (x**3 / 3 - 0.15 * x**2 - 0.18 * x)  # minimum at 10 ** -0.3, peak at 10 ** 0.6
    for fit, minimum_at, peak_at in ((curve(logs), -0.3, 0.6), (curve(-logs), 0.6, -0.3)):
        for found, place in ((find_minimum(fit), minimum_at), (find_peak(fit), peak_at)):
            at, value = (each.estimate for each in found.places)
            assert at.value == pytest.approx(10**place, rel=0.05)
            assert value.low < value.value < value.high


def test_steep_curves_have_neither_noisy_points_count_less_and_the_highest_peak_is_not_always_the_most_prominent():
    fit = curve(LOG_PLACES)._replace(logs=np.array([3.0, 1, 2]), variances=np.array([1.0, 1, 3]))
    assert extrema._monotone(fit, True, False) == pytest.approx([3, 1.25, 1.25])  # noisy points count less
    steep = curve(LOG_PLACES), curve(-LOG_PLACES)
    for found in (find(each) for each in steep for find in (find_peak, find_minimum)):
        assert (found.p_value, found.places) == (1, [])
        assert np.isnan(found.values).all()
    curves = np.array([[5, 6, 5.9, 0, 3, 0.5, 4], [0, 1, 2, 3, 4, 5, 6], [3, 1, 2, 1, 0, 0, 0]], float)
    peaks, prominences, _ = extrema.most_prominent(np.arange(7.0), curves)
    assert prominences.tolist() == [2.5, 0.0, 1.0]
    assert peaks[[0, 2]] == pytest.approx(np.array([[4, np.exp(3)], [2, np.exp(2)]]))


@pytest.mark.parametrize("shape", [lambda x: 0 * x, lambda x: np.minimum(x, 0), lambda x: -np.clip(x, -0.5, 0.5)])
def test_noise_makes_few_of_them(shape):
    fits = [curve(shape(LOG_PLACES), noise=0.2, seed=seed, resamples=200) for seed in range(60)]
    assert np.mean([find(fit).is_found for fit in fits for find in (find_minimum, find_peak)]) < 0.08


def folder_of(path, law, trials=30, **grid):
    scenario, random = sweep({SPEED: PLACES.tolist(), **grid}, measures=["near_walls"]), np.random.default_rng(4)
    return made_folders.store_measured(
        path, scenario, lambda point: [law(point.axes[SPEED], random) for _ in range(trials)]
    )


def bump(x, random):
    return float(np.exp(1 - (np.log10(x) - 0.3) ** 2 + random.normal(0, 0.05)))


def test_a_folder_has_one_for_each_curve_and_what_is_0_where_nothing_moves_is_no_reason_against_it(tmp_path):
    folder = folder_of(tmp_path / "two", bump, **{COUPLING: [0.1, 0.2]})
    fits = fit_measure(read_points(folder, "near_walls"))
    assert [fit.axes for fit in fits] == [{COUPLING: 0.1}, {COUPLING: 0.2}]
    for fit in fits:
        assert (fit.axis, fit.of, fit.statistic, fit.reason) == (SPEED, "near_walls", "mean", "")
        assert fit.peak.places[0].estimate.value == pytest.approx(10**0.3, rel=0.1)
        assert not fit.minimum.is_found
    folder = folder_of(tmp_path / "one", lambda x, r: bump(x, r) if x else 0.0, **{SPEED: [0.0, *PLACES.tolist()]})
    (fit,) = fit_measure(read_points(folder, "near_walls"))
    assert fit.peak.places[0].estimate.value == pytest.approx(10**0.3, rel=0.1)


@pytest.mark.parametrize(
    ("law", "trials", "said"),
    [
        (lambda x, _: x - 1, 30, "not all values are positive, and the search is in logarithms"),
        (lambda x, random: bool(random.random() < x / 20), 30, "the measure is a truth value"),
        (bump, 19, "20 trials with a value at 8 of 8 points, where noise can look like a rise; give --trials 20"),
        (lambda x, random: bump(x, random) if x > 1 else None, 30, "fewer than 20 trials with a value at 4 of 8"),
    ],
)
def test_where_it_makes_no_sense_it_says_why(law, trials, said, tmp_path):
    (fit,) = fit_measure(read_points(folder_of(tmp_path, law, trials=trials), "near_walls"))
    assert (fit.minimum, fit.peak) == (None, None)
    assert said in fit.reason


def test_csv_has_the_same_columns_whatever_is_found():
    found = extrema.Extrema(np.array([1.0, 2.0]), np.ones((2, 2)), 0.001, np.ones((9, 2)))
    fits = [
        MeasureFit("run", "x", SPEED, {}, "mean", each, each, "") for each in (None, found, found._replace(p_value=1))
    ]
    heads = [measure_fit_table([fit]).to_csv().splitlines()[0] for fit in fits]
    assert heads == heads[:1] * 3
    assert "minimum_place_low" in heads[0]
