"""Claims about `fit`: it recovers known minima, peaks and laws, and reports nothing that the curves do not show."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from epuck_sim.cli.tables import show
from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.estimate import Estimate
from epuck_sim.statistics.extrema import SpeedExtrema
from epuck_sim.statistics.fit import FittedCurve, fit_curves, fit_laws, fit_tables
from tests.cli.commands import cells
from tests.runs.made_folders import (
    COUNT,
    COUPLING,
    HEIGHT,
    MANY_SPEEDS,
    PIXELS,
    SPEED,
    WIDTH,
    bumpy,
    bumpy_mean,
    censored,
    ended,
    extremes,
    falling,
    store,
    sweep,
    weibull,
)

OTHER_COUPLING = COUPLING.replace(".0.", ".1.")
ENDS = ("value", "low", "high")
NAMES = ("v_m", "t_m", "v_p", "t_p")
QUANTITIES = ("V_m", "T_m", "V_p", "T_p")
SIZES, COUPLINGS = [40, 60, 90], [0.05, 0.1, 0.2]
BASE = {"epsilon": 0.1, "L": 60.0, "N": 10.0, "tau": 5.0}


def units_of_size(size: float) -> tuple[float, float]:
    """Return the units of speed and of time in an arena of this size: both grow like it."""
    return size / 60, 1.5 * size


def units_of_coupling(coupling: float) -> tuple[float, float]:
    """Return the units of speed and of time at this coupling: that of speed grows like it."""
    return coupling / 0.1, 90.0


@pytest.fixture(scope="module")
def over_size(tmp_path_factory) -> Path:
    axes = {"zip": {WIDTH: SIZES, HEIGHT: SIZES}, "grid": {SPEED: MANY_SPEEDS}}
    scenario = sweep(None, trials=200, name="sizes", sweep=axes)
    return store(
        tmp_path_factory.mktemp("sizes"),
        scenario,
        lambda point: weibull(point, bumpy_mean(point.axes[SPEED], *units_of_size(point.axes[WIDTH]))),
    )


@pytest.fixture(scope="module")
def over_coupling(tmp_path_factory) -> Path:
    return store(
        tmp_path_factory.mktemp("couplings"),
        sweep({COUPLING: COUPLINGS, SPEED: MANY_SPEEDS}, trials=200, name="couplings"),
        lambda point: weibull(point, bumpy_mean(point.axes[SPEED], *units_of_coupling(point.axes[COUPLING]))),
    )


@pytest.fixture(scope="module")
def sizes(over_size) -> list[FittedCurve]:
    return fit_curves(over_size)


@pytest.fixture(scope="module")
def couplings(over_coupling) -> list[FittedCurve]:
    return fit_curves(over_coupling)


def extrema_of(v_m: float, t_m: float, v_p: float, t_p: float, spread: float = 0.05, seed: int = 0) -> SpeedExtrema:
    """Return a minimum and a peak that are found; `spread` is the standard deviation of the logs of resamples."""
    estimates = np.array([v_m, t_m, v_p, t_p])
    resampled = estimates * np.exp(spread * np.random.default_rng(seed).standard_normal((400, 4)))
    intervals = np.percentile(resampled, [2.5, 97.5], axis=0).T
    return SpeedExtrema(v_m, t_m, v_p, t_p, intervals, math.log(t_p / t_m), 0.001, resampled)


def lawful(others: str = "the same", run: str = "run", spread: float = 0.02, **changes: float) -> FittedCurve:
    """Return a curve that follows the thesis's laws of V_m and V_p, and T_m, T_p = 40, 60 A L e^N / tau^2 + 30."""
    parameters = BASE | changes
    epsilon, size, robots, tau = parameters.values()
    speed, time = epsilon * size, size * math.exp(robots - 10) / tau**2
    found = extrema_of(
        0.3 * speed * robots**-1.5, 20 * time + 30, speed * robots**-0.5, 40 * time + 30, spread, seed_of(parameters)
    )
    return FittedCurve(run, {}, parameters, others, "embodied", ["mean"], found, "", None)


def seed_of(parameters: dict[str, float]) -> int:
    return int(1e6 * sum((place + 1) * value for place, value in enumerate(parameters.values())))


def without_extrema(curve: FittedCurve) -> FittedCurve:
    return curve._replace(extrema=curve.extrema._replace(p_value=0.4))


def exponents_of(curves) -> dict[tuple[str, str], tuple[float, float, float]]:
    return {(row.quantity, row.parameter): row.exponent.ends for row in fit_laws(curves).exponents}


def no_constant(name: str) -> None:
    raise AssertionError(f"{name} is no JSON")


def printed(capsys, curves, as_json: bool = False) -> str:
    laws = fit_laws(curves)
    show(fit_tables(curves, laws), {"curves": [each.record() for each in curves], "laws": laws}, as_json=as_json)
    return capsys.readouterr().out


def json_of(capsys, curves) -> dict:
    return json.loads(printed(capsys, curves, as_json=True), parse_constant=no_constant)


def assert_held(estimate, truth: float) -> None:
    """Check that the truth is no farther from an estimate than its interval is wide: one in 10,000 is."""
    value, low, high = estimate
    assert low <= value <= high
    assert abs(value - truth) < high - low


# Minimum and peak


def test_minimum_and_peak_lie_in_their_intervals_which_are_narrow(sizes, couplings) -> None:
    units = [units_of_size(size) for size in SIZES] + [units_of_coupling(coupling) for coupling in COUPLINGS]
    held = []
    for curve, unit in zip([*sizes, *couplings], units, strict=True):
        assert curve.extrema.is_found
        for name, (low, high) in zip(NAMES, curve.extrema.intervals, strict=True):
            assert getattr(curve.extrema, name) == pytest.approx(extremes(*unit)[name], rel=0.2)
            assert high < 1.9 * low
            held.append(low <= extremes(*unit)[name] <= high)
    assert np.mean(held) >= 0.8  # of 95 % intervals; 24 of them


def test_each_curve_has_its_run_its_axes_and_what_the_laws_depend_on(over_size, sizes, couplings) -> None:
    assert [curve.run for curve in sizes] == [str(over_size)] * 3
    assert [curve.axes for curve in sizes] == [{WIDTH: size, HEIGHT: size} for size in SIZES]
    assert [curve.parameters for curve in sizes] == [BASE | {"L": size} for size in SIZES]
    assert [curve.parameters for curve in couplings] == [BASE | {"epsilon": coupling} for coupling in COUPLINGS]


def test_l_is_the_side_of_a_square_of_the_same_area_and_n_the_robots_of_all_groups(tmp_path) -> None:
    groups = [{"count": 3}, {"count": 4, "parameters": {"period_s": 2}}]
    scenario = sweep({SPEED: [1, 2]}, arena={"width_cm": 50, "height_cm": 72}, robots=groups)
    store(tmp_path, scenario, lambda _: ended([5]))
    (curve,) = fit_curves(tmp_path)
    assert curve.parameters == BASE | {"L": 60, "N": 7}
    assert curve.extrema is None


def test_a_controller_without_coupling_and_period_has_none(tmp_path) -> None:
    scenario = sweep({SPEED: [1, 2]}, robots=[{"controller": "obstacle_avoidance"}])
    store(tmp_path, scenario, lambda _: ended([5]))
    (curve,) = fit_curves(tmp_path)
    assert math.isnan(curve.parameters["epsilon"])
    assert math.isnan(curve.parameters["tau"])


def test_a_falling_curve_has_no_extrema_and_there_are_no_laws(tmp_path, capsys) -> None:
    store(tmp_path, sweep({SPEED: MANY_SPEEDS}, trials=60), falling)
    curves = fit_curves(tmp_path)
    assert not curves[0].extrema.is_found
    stdout = printed(capsys, curves)
    assert "No laws: no curve has a local minimum and a peak." in stdout
    assert "-: no minimum and peak that noise could not explain" in stdout
    read = json_of(capsys, curves)
    assert read["laws"] == fit_laws(curves)._asdict()
    assert [read["curves"][0][name] for name in NAMES] == [None] * 4
    assert 0.05 < read["curves"][0]["p_value"] <= 1


def test_too_few_speeds_that_are_not_censored_are_reported(tmp_path, capsys) -> None:
    scenario = sweep({SPEED: MANY_SPEEDS}, trials=30)
    store(tmp_path, scenario, lambda point: bumpy(point) if point.number < 5 else censored(point, 30))
    curves = fit_curves(tmp_path)
    assert curves[0].extrema is None
    reason = "half of the trials or more are censored at 8 of 13 speeds; 6 others are the least: raise stop.max_cycles"
    assert f"Not looked for on 1 of 1 curves: {reason}." in printed(capsys, curves)
    (read,) = json_of(capsys, curves)["curves"]
    assert [read[name] for name in ("p_value", *NAMES)] == [None] * 5


def test_censored_trials_and_undetermined_points_do_not_move_the_extrema(tmp_path) -> None:
    scenario = sweep({COUPLING: [0.1], SPEED: MANY_SPEEDS}, stop={"max_cycles": 300})
    store(tmp_path, scenario, lambda point: censored(point, 50) if point.axes[SPEED] < 0.06 else bumpy(point))
    (curve,) = fit_curves(tmp_path)
    assert curve.extrema.is_found
    for name, ends in zip(NAMES, curve.extrema.intervals, strict=True):
        assert_held((getattr(curve.extrema, name), *ends), extremes()[name])


def test_a_folder_without_a_speed_axis_is_refused_by_name(tmp_path) -> None:
    store(tmp_path / "count", sweep({COUNT: [2, 3]}), lambda _: ended([5]))
    with pytest.raises(EpuckSimError) as caught:
        fit_curves(tmp_path / "count")
    assert str(caught.value).startswith(f"{tmp_path / 'count'}: no axis ends in .speed_cm_s")
    with pytest.raises(StoreError, match="is not a run folder"):
        fit_curves(tmp_path)


@pytest.mark.parametrize("grid", [None, {"stop.metric": ["complex", "reference"]}])
def test_a_folder_without_any_axis_of_numbers_is_refused_by_name(tmp_path, grid: dict | None) -> None:
    store(tmp_path, sweep(grid), lambda _: ended([5]))
    with pytest.raises(EpuckSimError) as caught:
        fit_curves(tmp_path)
    assert str(tmp_path) in str(caught.value)


# The laws


def test_several_folders_make_one_law(sizes, couplings) -> None:
    found = exponents_of([*sizes, *couplings])
    truths = {"V_m": (1, 1), "T_m": (0, 1), "V_p": (1, 1), "T_p": (0, 1)}
    assert list(found) == [(quantity, name) for quantity in truths for name in ("epsilon", "L")]
    for quantity, (of_coupling, of_size) in truths.items():
        assert_held(found[quantity, "epsilon"], of_coupling)
        assert_held(found[quantity, "L"], of_size)


def test_all_exponents_of_the_thesis_are_recovered_from_curves_that_follow_its_laws() -> None:
    changes = [{}, {"epsilon": 0.05}, {"epsilon": 0.2}, {"L": 40}, {"L": 90}, {"N": 5}, {"N": 8}, {"tau": 3}]
    found = exponents_of([lawful(**change) for change in changes])
    for quantity, of_robots in (("V_m", -1.5), ("V_p", -0.5)):
        truths = {"epsilon": 1, "L": 1, "N": of_robots, "tau": 0}
        for name, truth in truths.items():
            assert found[quantity, name][0] == pytest.approx(truth, abs=0.12)


def test_the_offset_laws_are_recovered() -> None:
    laws = fit_laws([lawful(**change) for change in ({}, {"L": 40}, {"L": 90}, {"tau": 3}, {"tau": 8}, {"N": 9})])
    assert list(laws.offset_laws) == ["T_m", "T_p"]
    for name, factor in (("T_m", 20), ("T_p", 40)):
        law = laws.offset_laws[name]
        assert law.factor.value == pytest.approx(factor * math.exp(-10), rel=0.15)
        assert law.offset.value == pytest.approx(30, rel=0.2)
        assert law.r_squared > 0.98


def test_where_only_the_coupling_varies_there_is_no_offset_law(couplings, capsys) -> None:
    assert fit_laws(couplings).offset_laws == {}
    assert "e^N" not in printed(capsys, couplings)


def test_curves_without_extrema_are_left_out_of_the_laws(sizes) -> None:
    laws = fit_laws([without_extrema(sizes[0]), *sizes[1:], sizes[0]._replace(extrema=None)])
    assert laws.curves == 2
    assert {row.parameter for row in laws.exponents} == {"L"}


def test_curves_that_differ_in_something_else_are_not_mixed(tmp_path, sizes) -> None:
    scenario = sweep({PIXELS: [8], COUPLING: [0.05, 0.2], SPEED: MANY_SPEEDS}, trials=100)
    store(tmp_path, scenario, lambda point: weibull(point, bumpy_mean(point.axes[SPEED], 1, 200)))
    narrow = fit_curves(tmp_path)
    assert all(curve.extrema.is_found for curve in narrow)
    laws = fit_laws([*narrow, *sizes])
    assert (laws.curves, laws.exponents) == (3, fit_laws(sizes).exponents)


@pytest.mark.parametrize(
    ("changes", "is_told_apart"),
    [
        ({"noise": "off"}, True),
        ({"stop": {"max_cycles": 4000}}, True),
        ({"arena": {"obstacles": [{"shape": "circle", "x_cm": 30, "y_cm": 30, "radius_cm": 3}]}}, True),
        ({"robots": [{"parameters": {"rotation_max": 5}}]}, True),
        ({"robots": [{"infrared": {"distance": "firmware_table"}}]}, True),
        ({"robots": [{"count": 5}, {"count": 5}]}, True),
        ({"name": "mine", "trials": 5, "seed": 3, "description": "mine"}, False),
        ({"arena": {"width_cm": 50, "height_cm": 60}}, False),
        ({"robots": [{"count": 4, "parameters": {"coupling": 0.3, "period_s": 3}}]}, False),
    ],
    ids=str,
)
def test_what_a_law_does_not_account_for_and_trials_depend_on_tells_scenarios_apart(
    tmp_path, changes: dict, is_told_apart: bool
) -> None:
    texts = set()
    for name, change in (("base", {}), ("other", changes)):
        store(tmp_path / name, sweep({SPEED: [1, 2]}, **change), lambda _: ended([5]))
        texts.add(fit_curves(tmp_path / name)[0].others)
    assert len(texts) == 1 + is_told_apart


def test_the_coupling_of_a_second_group_is_not_taken_for_that_of_the_first(tmp_path) -> None:
    scenario = sweep({OTHER_COUPLING: [0.1, 0.3], SPEED: [1, 2]}, robots=[{"count": 5}, {"count": 5}])
    store(tmp_path, scenario, lambda _: ended([5]))
    first, second = fit_curves(tmp_path)
    assert (first.parameters, first.others) != (second.parameters, second.others)


@pytest.mark.parametrize(
    ("curves", "reason"),
    [
        ([lawful()], "1 curves with a minimum and a peak, none of which differ in epsilon, L, N or tau"),
        ([lawful(run="one"), lawful(run="two")], "2 curves with a minimum and a peak, none of which differ in"),
        ([lawful(), lawful(L=40, tau=3)], "2 curves do not determine 3 unknowns: a prefactor and L, tau."),
        ([lawful(L=size, tau=size / 12) for size in (40, 60, 90)], "the curves do not distinguish L, tau: they vary"),
    ],
)
def test_why_curves_make_no_law_is_reported(capsys, curves: list[FittedCurve], reason: str) -> None:
    assert f"No laws: {reason}" in " ".join(printed(capsys, curves).split())
    found = json_of(capsys, curves)["laws"]
    assert (found["exponents"], found["offset_laws"]) == ([], {})


def test_the_misfit_of_a_law_through_as_many_curves_as_it_has_unknowns_is_null_and_no_nan_in_the_table(capsys) -> None:
    curves = [lawful(), lawful(epsilon=0.2)]
    assert [row["misfit"] for row in json_of(capsys, curves)["laws"]["exponents"]] == [None] * 4
    assert "nan" not in printed(capsys, curves)


def test_many_robots_are_no_trouble(capsys) -> None:
    curves = [lawful(L=robots / 10)._replace(parameters=BASE | {"N": robots}) for robots in (600.0, 800.0, 1000.0)]
    assert "nan" not in printed(capsys, curves)
    json_of(capsys, curves)


# What is printed


def test_the_table_has_a_row_for_each_curve(capsys, sizes, couplings) -> None:
    curves = [*(each._replace(run="a") for each in sizes), *(each._replace(run="b") for each in couplings)]
    table = cells(printed(capsys, curves))[: len(curves)]
    assert [row[0] for row in table] == [*"aaabbb"]
    for row, curve in zip(table, curves, strict=True):
        numbers = zip(NAMES, curve.extrema.intervals, strict=True)
        expected = [str(Estimate(getattr(curve.extrema, name), low, high)) for name, (low, high) in numbers]
        assert [cell for cell in row if "[" in cell] == expected
        assert set(map(str, curve.axes.values())) <= set(row)


def test_the_exponents_are_next_to_the_thesis_s(capsys, couplings) -> None:
    stdout = printed(capsys, couplings)
    assert "Scaling laws of 3 curves of robots" in stdout
    assert "parameter epsilon; form power" in stdout
    rows = cells(stdout)[-4:]
    assert [(row[0], row[2]) for row in rows] == [("V_m", "1"), ("T_m", "0"), ("V_p", "1"), ("T_p", "0")]
    for row, comparison in zip(rows, fit_laws(couplings).exponents, strict=True):
        assert row[1] == str(comparison.exponent)


def test_json_has_all_estimates_with_their_intervals_and_no_nan(capsys, sizes, couplings) -> None:
    curves = [*sizes, *couplings]
    read = json_of(capsys, curves)
    assert [(each["run"], each["axes"]) for each in read["curves"]] == [(curve.run, curve.axes) for curve in curves]
    for each, curve in zip(read["curves"], curves, strict=True):
        for place, name in enumerate(NAMES):
            low, high = curve.extrema.intervals[place]
            assert each[name] == {"value": curve.extrema[place], "low": low, "high": high}
        assert each["p_value"] == curve.extrema.p_value
    laws = fit_laws(curves)
    assert read["laws"]["curves"] == 6
    assert read["laws"]["reason"] == ""
    assert read["laws"]["exponents"] == [
        {**row._asdict(), "exponent": dict(zip(ENDS, row.exponent.ends, strict=True))} for row in laws.exponents
    ]
    assert list(read["laws"]["offset_laws"]) == ["T_m", "T_p"]
    assert len(printed(capsys, curves, as_json=True).splitlines()) == 1


def test_the_same_folder_gives_the_same_fit(over_coupling, couplings, capsys) -> None:
    assert printed(capsys, fit_curves(over_coupling), as_json=True) == printed(capsys, couplings, as_json=True)


def test_runs_that_differ_in_what_is_no_axis_are_resampled_apart(tmp_path) -> None:
    found = []
    for coupling in (0.1, 0.2):
        robots = [{"parameters": {"coupling": coupling, "period_s": 5}}]
        scenario = sweep({SPEED: MANY_SPEEDS}, trials=40, robots=robots, seed=int(10 * coupling))
        store(tmp_path / str(coupling), scenario, bumpy)
        found.append(fit_curves(tmp_path / str(coupling))[0].extrema)
    correlations = [np.corrcoef(*(np.log(each.resampled[:, n]) for each in found))[0, 1] for n in range(4)]
    assert np.abs(correlations).max() < 0.2
