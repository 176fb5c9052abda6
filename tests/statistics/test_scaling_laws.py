"""Claims about scaling: what the fits recover, how sure they are, and when curves do not determine them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.statistics.fit import LAWS, Quantity, compare_laws, fit_offset_law, fit_power_law

PARAMETERS = {
    "epsilon": np.array([0.1, 0.05, 0.2, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]),
    "L": np.array([60.0, 60, 60, 40, 90, 60, 60, 60, 60]),
    "N": np.array([10, 10, 10, 10, 10, 5, 15, 10, 10]),
    "tau": np.array([5.0, 5, 5, 5, 5, 5, 5, 3, 8]),
}
CURVES = 9

ROBOTS = LAWS["embodied"]


def lawful(law, prefactor, exponents, parameters=PARAMETERS):
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


def held(estimate, truth):
    return estimate.low <= truth <= estimate.high


def test_the_laws_are_those_of_the_thesis():
    base, other = {"epsilon": 0.1, "L": 60, "N": 10, "tau": 5}, {"epsilon": 0.2, "L": 90, "N": 12, "tau": 4}

    def ratio(quantity):
        ends = {name: np.array([base[name], other[name]], float) for name in base}
        first, second = lawful(ROBOTS[quantity], 1.0, thesis(ROBOTS[quantity]), ends)
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
    values = lawful(law, prefactor, truth)
    fit = fit_power_law(law, PARAMETERS, values, np.tile(values, (20, 1)))
    assert {name: estimate.value for name, estimate in fit.exponents.items()} == pytest.approx(truth, abs=1e-9)
    for name, estimate in fit.exponents.items():
        assert estimate.ends == pytest.approx((truth[name],) * 3, abs=1e-9)


@pytest.mark.parametrize("quantity", ["V_m", "T_p"])
def test_the_intervals_hold_the_truth_as_often_as_they_say_and_the_misfit_is_about_1(quantity):
    law = ROBOTS[quantity]
    values = lawful(law, 0.1, thesis(law))
    spread = np.linspace(0.05, 0.3, CURVES)
    fits = [fit_power_law(law, PARAMETERS, *noisy(values, spread, seed)) for seed in range(200)]
    for name, term in law.items():
        assert 0.9 <= np.mean([held(fit.exponents[name], term.exponent) for fit in fits]) <= 0.99
    assert np.mean([fit.misfit**2 for fit in fits]) == pytest.approx(1, abs=0.15)


def test_the_misfit_tells_where_the_law_is_another():
    law = ROBOTS["T_m"]
    values = lawful(law, 1e-3, thesis(law)) + 20
    assert fit_power_law(law, PARAMETERS, *noisy(values, 0.05, 4)).misfit > 5


def test_nothing_is_left_for_a_misfit_where_curves_are_as_many_as_unknowns():
    law = ROBOTS["V_m"]
    sizes = {"L": np.array([40.0, 80.0])}
    assert math.isnan(fit_power_law(law, sizes, *noisy(np.array([1.0, 2.0]), 0.1, 5)).misfit)


def test_gaps_in_the_resamples_cost_no_certainty():
    law = ROBOTS["V_m"]
    values, resampled = noisy(lawful(law, 0.1, thesis(law)), 0.1, 7, 2000)
    full = fit_power_law(law, PARAMETERS, values, resampled)
    resampled[np.random.default_rng(0).random(resampled.shape) < 0.3] = np.nan  # of 2000, 80 are without
    gappy = fit_power_law(law, PARAMETERS, values, resampled)
    for name, estimate in full.exponents.items():
        width = estimate.high - estimate.low
        assert gappy.exponents[name].high - gappy.exponents[name].low == pytest.approx(width, rel=0.1)
    assert np.isnan(resampled).any()  # the caller's are as they were


def test_too_few_curves_are_refused():
    law, few = ROBOTS["V_m"], {name: array[[0, 1, 3, 5]] for name, array in PARAMETERS.items()}
    values = lawful(law, 0.1, thesis(law), few)
    assert len(fit_power_law(law, few, values, np.tile(values, (9, 1))).exponents) == 3
    few["tau"] = np.array([5.0, 5, 5, 8])
    with pytest.raises(ValueError, match="4 curves do not determine 5 unknowns: a prefactor and epsilon, L, N, tau"):
        fit_power_law(law, few, values, np.tile(values, (9, 1)))


@pytest.mark.parametrize("unit", [1e-6, 1, 1e6])
def test_parameters_that_vary_together_are_refused(unit):
    together = {"epsilon": np.array([0.1, 0.2, 0.3, 0.4]), "L": unit * np.array([1.0, 4, 9, 16])}
    with pytest.raises(ValueError, match="do not distinguish epsilon, L: they vary together"):
        fit_power_law(ROBOTS["V_m"], together, *noisy(np.ones(4), 0.1, 0))
    with pytest.raises(ValueError, match="do not distinguish L e"):
        fit_offset_law({"L": np.full(4, unit), "N": np.full(4, 9), "tau": np.full(4, 5.0)}, *noisy(np.ones(4), 0.1, 0))


TERM = PARAMETERS["L"] * np.exp(PARAMETERS["N"]) / PARAMETERS["tau"] ** 2


@given(st.floats(1e-6, 1e-2), st.floats(5, 100))
def test_an_offset_law_without_noise_is_recovered(factor, offset):
    values = factor * TERM + offset
    fit = fit_offset_law(PARAMETERS, values, np.tile(values, (20, 1)))
    assert fit.factor.ends == pytest.approx((factor,) * 3, rel=1e-6)
    assert fit.offset.ends == pytest.approx((offset,) * 3, rel=1e-6)
    assert fit.r_squared == pytest.approx(1)


@pytest.mark.parametrize("model", LAWS)
def test_every_law_is_compared_with_the_thesis_where_it_names_an_exponent(model):
    laws = LAWS[model]
    truths = {name: {key: term.exponent or 0.0 for key, term in law.items()} for name, law in laws.items()}
    values = {name: lawful(law, 0.1, truths[name]) for name, law in laws.items()}
    quantities = {name: Quantity(column, np.tile(column, (20, 1))) for name, column in values.items()}
    rows = compare_laws(laws, PARAMETERS, quantities)
    assert [(row.quantity, row.parameter) for row in rows] == [(q, p) for q in laws for p in PARAMETERS]
    for row in rows:
        assert row.exponent.value == pytest.approx(truths[row.quantity][row.parameter], abs=1e-9)
        assert row.thesis == laws[row.quantity][row.parameter].exponent
        assert row.form == ("exponential" if row.parameter == "N" and row.quantity[0] == "T" else "power")
