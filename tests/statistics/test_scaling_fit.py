"""Claims about `fit`: it recovers known minima, peaks and laws, and reports nothing that the curves do not show."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from epuck_sim.cli.tables import show
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import Estimate
from epuck_sim.runs.reader import SweepTrials, read_points
from epuck_sim.statistics import fit as fitting
from epuck_sim.statistics.extrema import PLACES, Place
from epuck_sim.statistics.fit import LAWS, FittedCurve, fit_curves, fit_laws, fit_offset_law, fit_power_law
from tests.cli.commands import cells
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, COUPLING, HEIGHT, SPEED, WIDTH, ended, store, sweep, weibull

NAMES = ("v_m", "t_m", "v_p", "t_p")
SIZES, COUPLINGS = [40, 60, 90], [0.05, 0.1, 0.2]
BASE = {"epsilon": 0.1, "L": 60.0, "N": 10.0, "tau": 5.0}
SIZE_UNITS = {size: (size / 60, 1.5 * size) for size in SIZES}
"""Units of speed and of time in an arena of each size: both grow like it."""
COUPLING_UNITS = {coupling: (coupling / 0.1, 90.0) for coupling in COUPLINGS}
"""Units at each coupling: that of speed grows like it."""


def fitted(folder, axes, key: str, units) -> list[FittedCurve]:
    """Return the fit of a sweep whose curves have these units, by the values of an axis."""

    def law(point):
        return weibull(point, made_folders.bumpy_mean(point.axes[SPEED], *units[point.axes[key]]))

    return fit_curves(read_points(store(folder, sweep(None, trials=200, sweep=axes), law)))


@pytest.fixture(scope="module")
def sizes(tmp_path_factory) -> list[FittedCurve]:
    axes = {"zip": {WIDTH: SIZES, HEIGHT: SIZES}, "grid": {SPEED: made_folders.MANY_SPEEDS}}
    return fitted(tmp_path_factory.mktemp("sizes"), axes, WIDTH, SIZE_UNITS)


@pytest.fixture(scope="module")
def couplings(tmp_path_factory) -> list[FittedCurve]:
    axes = {"grid": {COUPLING: COUPLINGS, SPEED: made_folders.MANY_SPEEDS}}
    return fitted(tmp_path_factory.mktemp("couplings"), axes, COUPLING, COUPLING_UNITS)


def lawful(run: str = "run", **changes: float) -> FittedCurve:
    """Return a curve that follows the thesis's laws of V_m and V_p, and T_m, T_p = 20, 40 A L e^N / tau^2 + 30."""
    parameters = BASE | changes
    epsilon, size, robots, tau = parameters.values()
    speed, time = epsilon * size, size * math.exp(robots - 10) / tau**2
    found = np.array([0.3 * speed * robots**-1.5, 20 * time + 30, speed * robots**-0.5, 40 * time + 30])
    resampled = found * np.exp(0.02 * np.random.default_rng(0).standard_normal((400, 4)))
    columns = zip(PLACES, found.tolist(), resampled.T, strict=True)
    places = {name: Place(Estimate(value), drawn) for name, value, drawn in columns}
    return FittedCurve(run, {}, parameters, "the same", "embodied", ["mean"], places, 0.001, "")


def printed(capsys, curves, as_json: bool = False) -> str:
    laws = fit_laws(curves)
    record = {"curves": [each.record() for each in curves], "laws": laws}
    show(fitting.fit_tables(curves, laws), record, as_json=as_json)
    return capsys.readouterr().out


def json_of(capsys, curves) -> dict:
    return json.loads(printed(capsys, curves, as_json=True), parse_constant=pytest.fail)


def test_minimum_and_peak_lie_in_their_intervals_which_are_narrow(sizes, couplings) -> None:
    units, held = [*SIZE_UNITS.values(), *COUPLING_UNITS.values()], []
    for curve, unit in zip([*sizes, *couplings], units, strict=True):
        for name, place in zip(NAMES, curve.places.values(), strict=True):
            value, low, high = place.estimate.ends
            assert value == pytest.approx(made_folders.extremes(*unit)[name], rel=0.2)
            assert high < 1.9 * low
            held.append(low <= made_folders.extremes(*unit)[name] <= high)
    assert np.mean(held) >= 0.8  # of 95 % intervals; 24 of them
    assert [curve.axes for curve in sizes] == [{WIDTH: size, HEIGHT: size} for size in SIZES]
    assert [curve.parameters for curve in sizes] == [BASE | {"L": size} for size in SIZES]
    assert [curve.parameters for curve in couplings] == [BASE | {"epsilon": coupling} for coupling in COUPLINGS]


def test_a_falling_curve_has_no_extrema_and_there_are_no_laws(tmp_path, capsys) -> None:
    scenario = sweep({SPEED: made_folders.MANY_SPEEDS}, trials=60)
    curves = fit_curves(read_points(store(tmp_path, scenario, made_folders.falling)))
    assert not curves[0].places
    stdout = printed(capsys, curves)
    assert "No laws: no curve has a local minimum and a peak." in stdout
    assert "-: no minimum and peak that stand out from noise" in stdout
    read = json_of(capsys, curves)
    assert read["laws"] == fit_laws(curves) == []
    assert [read["curves"][0][name] for name in NAMES] == [None] * 4
    assert 0.05 < read["curves"][0]["p_value"] <= 1


def test_several_folders_make_one_law(sizes, couplings) -> None:
    (laws,) = fit_laws([*sizes, *couplings])
    rows = laws.exponents
    truths = {"V_m": (1, 1), "T_m": (0, 1), "V_p": (1, 1), "T_p": (0, 1)}
    assert [(row.quantity, row.parameter) for row in rows] == [(q, name) for q in truths for name in ("epsilon", "L")]
    for row in rows:
        value, low, high = row.exponent.ends
        assert low <= value <= high
        # no farther off than the interval is wide: one in 10,000 is
        assert abs(value - truths[row.quantity][row.parameter == "L"]) < high - low


def test_curves_without_extrema_are_left_out_and_those_that_differ_otherwise_have_laws_of_their_own(capsys, sizes):
    (laws,) = fit_laws([sizes[0]._replace(places={}), *sizes[1:]])
    assert laws.curves == 2
    assert {row.parameter for row in laws.exponents} == {"L"}
    assert math.isnan(laws.exponents[0].misfit)  # with as many curves as unknowns
    others = [lawful(), lawful(epsilon=0.2)]
    mixed = [*others, *sizes, lawful()._replace(others="alone")]
    assert fit_laws(mixed) == [*fit_laws(others), *fit_laws(sizes), *fit_laws(mixed[-1:])]
    assert [each.axes["run"] for each in fit_laws(mixed)] == ["run", sizes[0].run, "run"]
    text = " ".join(printed(capsys, mixed).split())
    assert "Scaling laws of 5 curves of robots" in text
    assert "No laws of 1 of 3 groups of curves that differ in more: 1 curve with a minimum and a peak, none of" in text


@pytest.mark.parametrize(
    ("changes", "is_told_apart"),
    [
        ({"stop": {"max_cycles": 4000}}, True),
        ({"robots": [{"parameters": {"rotation_max": 5}}]}, True),
        ({"robots": [{"count": 5}, {"count": 5}]}, True),
        ({"name": "mine", "trials": 5, "seed": 3, "description": "mine"}, False),
        ({"arena": {"width_cm": 50, "height_cm": 60}}, False),
        ({"robots": [{"count": 4, "parameters": {"coupling": 0.3, "period_s": 3}}]}, False),
    ],
    ids=str,
)
def test_what_a_law_does_not_account_for_and_trials_depend_on_tells_scenarios_apart(tmp_path, changes, is_told_apart):
    scenarios = {"base": sweep({SPEED: [1, 2]}), "other": sweep({SPEED: [1, 2]}, **changes)}
    folders = [store(tmp_path / name, scenario, lambda _: ended([5])) for name, scenario in scenarios.items()]
    assert len({fit_curves(read_points(folder))[0].others for folder in folders}) == 1 + is_told_apart


LEVEL = lawful()._replace(model="particles", places={"V_f": Place(Estimate(9.0, 8, 10), np.full(400, 9.0))})
"""A curve of agents without a minimum and a peak, and with V_f."""


@pytest.mark.parametrize(
    ("curves", "reason"),
    [
        ([LEVEL], "1 curve with a minimum and a peak, or V_f, none of which differ in epsilon, L, N or tau"),
        ([lawful(run="one"), lawful(run="two")], "2 curves with a minimum and a peak, none of which differ in epsilon"),
        ([lawful(), lawful(L=40, tau=3)], "2 curves for 3 unknowns, a prefactor and L, tau, are too few."),
        ([lawful(L=size, tau=size / 12) for size in (40, 60, 90)], "the curves do not distinguish L, tau: they vary"),
    ],
)
def test_why_curves_make_no_law_is_reported(capsys, curves: list[FittedCurve], reason: str) -> None:
    assert f"No laws: {reason}" in " ".join(printed(capsys, curves).split())
    (found,) = json_of(capsys, curves)["laws"]
    assert (found["exponents"], found["offset_laws"]) == ([], {})


def test_the_exponents_are_next_to_the_thesis_s(capsys, couplings) -> None:
    stdout = printed(capsys, couplings)
    assert "Scaling laws of 3 curves of robots\n" in stdout
    assert "parameter epsilon; form power; curves 3" in " ".join(stdout.split())
    rows = cells(stdout)[-4:]
    assert [(row[0], row[2]) for row in rows] == [("V_m", "1"), ("T_m", "0"), ("V_p", "1"), ("T_p", "0")]
    for row, comparison in zip(rows, fit_laws(couplings)[0].exponents, strict=True):
        assert row[1] == str(comparison.exponent)


PARAMETERS = {
    "epsilon": np.array([0.1, 0.05, 0.2, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]),
    "L": np.array([60.0, 60, 60, 40, 90, 60, 60, 60, 60]),
    "N": np.array([10, 10, 10, 10, 10, 5, 15, 10, 10]),
    "tau": np.array([5.0, 5, 5, 5, 5, 5, 5, 3, 8]),
}

ROBOTS = LAWS["embodied"]


def values_of(law, prefactor, exponents, parameters=PARAMETERS):
    """Return the values of a law with these exponents."""
    values = np.full(len(parameters["L"]), prefactor)
    for name, exponent in exponents.items():
        is_power = law[name].form == "power"
        values = values * (parameters[name] ** exponent if is_power else np.exp(exponent * parameters[name]))
    return values


def noisy(values, spread, seed, resamples=200):
    """Return values with log-normal noise of these spreads of their logs, and resamples about them."""
    rng = np.random.default_rng(seed)
    measured = values * np.exp(spread * rng.standard_normal(len(values)))
    return measured, measured * np.exp(spread * rng.standard_normal((resamples, len(values))))


def thesis(law):
    return {name: term.exponent for name, term in law.items()}


def test_the_laws_are_those_of_the_thesis():
    base, other = {"epsilon": 0.1, "L": 60, "N": 10, "tau": 5}, {"epsilon": 0.2, "L": 90, "N": 12, "tau": 4}

    def ratio(quantity):
        ends = {name: np.array([base[name], other[name]], float) for name in base}
        first, second = values_of(ROBOTS[quantity], 1.0, thesis(ROBOTS[quantity]), ends)
        return second / first

    assert ratio("V_m") == pytest.approx(2 * 1.5 / 1.2**1.5)
    assert ratio("V_p") == pytest.approx(2 * 1.5 / 1.2**0.5)
    assert ratio("T_m") == ratio("T_p") == pytest.approx(1.5 * math.exp(2) / 0.8**2)
    assert list(ROBOTS) == ["V_m", "T_m", "V_p", "T_p"]


@pytest.mark.parametrize("quantity", ROBOTS)
@given(st.lists(st.floats(-3, 3), min_size=4, max_size=4), st.floats(1e-3, 1e3))
def test_a_power_law_without_noise_is_recovered(quantity, exponents, prefactor):
    law = ROBOTS[quantity]
    truth = dict(zip(PARAMETERS, exponents, strict=True))
    values = values_of(law, prefactor, truth)
    fit = fit_power_law(law, PARAMETERS, values, np.tile(values, (20, 1)))
    assert {name: estimate.value for name, estimate in fit.exponents.items()} == pytest.approx(truth, abs=1e-9)
    for name, estimate in fit.exponents.items():
        assert estimate.ends == pytest.approx((truth[name],) * 3, abs=1e-9)


@pytest.mark.parametrize("quantity", ["V_m", "T_p"])
def test_the_intervals_hold_the_truth_as_often_as_they_say_and_the_misfit_is_about_1_or_the_law_is_another(quantity):
    law = ROBOTS[quantity]
    values = values_of(law, 0.1, thesis(law))
    spread = np.linspace(0.05, 0.3, len(PARAMETERS["L"]))
    fits = [fit_power_law(law, PARAMETERS, *noisy(values, spread, seed)) for seed in range(200)]
    for name, term in law.items():
        found = [fit.exponents[name] for fit in fits]
        assert 0.9 <= np.mean([each.low <= term.exponent <= each.high for each in found]) <= 0.99
    assert np.mean([fit.misfit**2 for fit in fits]) == pytest.approx(1, abs=0.15)
    other = values_of(ROBOTS["T_m"], 1e-3, thesis(ROBOTS["T_m"])) + 20
    assert fit_power_law(ROBOTS["T_m"], PARAMETERS, *noisy(other, 0.05, 4)).misfit > 5


def test_gaps_in_the_resamples_cost_no_certainty():
    law = ROBOTS["V_m"]
    values, resampled = noisy(values_of(law, 0.1, thesis(law)), 0.1, 7, 2000)
    full = fit_power_law(law, PARAMETERS, values, resampled)
    resampled[np.random.default_rng(0).random(resampled.shape) < 0.3] = np.nan  # of 2000, 80 are without
    gappy = fit_power_law(law, PARAMETERS, values, resampled)
    for name, estimate in full.exponents.items():
        width = estimate.high - estimate.low
        assert gappy.exponents[name].high - gappy.exponents[name].low == pytest.approx(width, rel=0.1)
    assert np.isnan(resampled).any()  # the caller's are as they were


TERM = PARAMETERS["L"] * np.exp(PARAMETERS["N"]) / PARAMETERS["tau"] ** 2


@given(st.floats(1e-6, 1e-2), st.floats(5, 100))
def test_an_offset_law_without_noise_is_recovered(factor, offset):
    values = factor * TERM + offset
    fit = fit_offset_law(PARAMETERS, values, np.tile(values, (20, 1)))
    assert fit.factor.ends == pytest.approx((factor,) * 3, rel=1e-6)
    assert fit.offset.ends == pytest.approx((offset,) * 3, rel=1e-6)
    assert fit.r_squared == pytest.approx(1)


def test_r_squared_of_an_offset_law_is_that_of_a_weighted_correlation():
    values, resampled = noisy(1e-3 * TERM + 30, 0.3, 3)
    deviations = np.cov(TERM, values, aweights=1 / resampled.var(axis=0, ddof=1))
    r_squared = deviations[0, 1] ** 2 / (deviations[0, 0] * deviations[1, 1])
    assert fit_offset_law(PARAMETERS, values, resampled).r_squared == pytest.approx(r_squared)


@pytest.mark.parametrize("model", LAWS)
def test_every_law_is_compared_with_the_thesis_where_it_names_an_exponent(model):
    laws = LAWS[model]
    truths = {name: {key: term.exponent or 0.0 for key, term in law.items()} for name, law in laws.items()}
    values = {name: values_of(law, 0.1, truths[name]) for name, law in laws.items()}
    curves = []
    for place in range(len(PARAMETERS["L"])):
        parameters = {name: float(column[place]) for name, column in PARAMETERS.items()}
        places = {name: Place(Estimate(column[place]), np.tile(column[place], 20)) for name, column in values.items()}
        curves.append(FittedCurve("run", {}, parameters, "the same", model, ["mean"], places, None, ""))
    rows = fit_laws(curves)[0].exponents
    assert [(row.quantity, row.parameter) for row in rows] == [(q, p) for q in laws for p in PARAMETERS]
    for row in rows:
        assert row.exponent.value == pytest.approx(truths[row.quantity][row.parameter], abs=1e-9)
        assert row.thesis == laws[row.quantity][row.parameter].exponent
        assert row.form == ("exponential" if row.parameter == "N" and row.quantity[0] == "T" else "power")


POWERS = {COUNT: -1.2, SPEED: -0.5}


def powers(grid, law, seed: int = 0) -> list[fitting.PowersFit]:
    """Return the powers of numbers and speeds in a sweep whose trials a law draws."""
    points = SweepTrials(made_folders.in_memory(sweep(grid, trials=20, seed=seed), law))
    points.folder = Path("mine")
    return fitting.fit_powers(points, ["count", "speed_cm_s"])


def powerful(point) -> made_folders.Trials:
    """Return the trials of a point, whose median is 40 L N^-1.2 V^-0.5; some are censored, as are all at L = 1e6."""
    median = 40 * point.axes[WIDTH] * math.prod(point.axes[key] ** power for key, power in POWERS.items())
    times = median * np.random.default_rng(point.seed(0)).lognormal(0, 0.8, 20)
    return ended(np.minimum(times, 300), times < 300)


def test_powers_of_axes_lie_in_their_intervals_as_often_as_they_say_though_trials_are_censored() -> None:
    grid = {WIDTH: [40, 60], COUNT: [5, 10, 20], SPEED: [0.5, 1, 2, 4]}
    fits = [fit for seed in range(60) for fit in powers(grid, powerful, seed)]
    assert {fit.axes[WIDTH] for fit in fits} == {40, 60}
    assert {(fit.trials, fit.points) for fit in fits} == {(240, 12)}
    assert 0.1 < np.mean([fit.censored for fit in fits]) < 0.4
    for key, power in POWERS.items():
        found = [fit.exponents[key] for fit in fits]
        assert 0.9 <= np.mean([each.low <= power <= each.high for each in found]) <= 0.99
        assert np.mean([each.value for each in found]) == pytest.approx(power, abs=0.03)
    assert np.mean([fit.factor.low <= 40 * fit.axes[WIDTH] <= fit.factor.high for fit in fits]) >= 0.9
    assert np.mean([fit.misfit**2 for fit in fits]) == pytest.approx(1, abs=0.15)


def test_powers_that_do_not_hold_have_a_large_misfit_and_those_of_censored_trials_alone_a_reason() -> None:
    grid = {COUNT: [5, 10], SPEED: made_folders.SPEEDS}
    (bent,) = powers(grid, lambda point: weibull(point, 90 * math.exp(4 * math.log(point.axes[SPEED]) ** 2), 200))
    assert bent.misfit > 5
    found, censored = fits = powers({WIDTH: [60, 1e6], **grid}, powerful)
    assert (found.reason, censored.censored, censored.factor.has_interval) == ("", 1, False)
    text = " ".join(fitting.powers_table(fits).to_text().split())
    assert "1 of 2 combinations of the other axes: 0 known points for 3 unknowns" in text
    refusal = r"mine: --power: \S*speed_cm_s is 0; allowed: axes of several values, all pos"
    with pytest.raises(EpuckSimError, match=refusal):
        powers({COUNT: [5, 10], SPEED: [0, 1]}, lambda _: ended([5, 6]))
