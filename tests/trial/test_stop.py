"""Trials that end at a time, after cycles, or when a measure has passed a value."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial, simulate
from tests.measures.files import COUNTER, TELLTALE, write
from tests.trial import without_wall
from tests.trial.test_measuring import onlooking, without_measures

MODELS = ["embodied", "particles"]
SERIES = """
class Series:
    def __init__(self, simulation):
        self.seen = []

    def cycle(self, event, state):
        self.seen.append(None if len(self.seen) == 1 else state.cycles % 4)

    def value(self):
        return {kind}(self.seen)
"""


def trial(model, stop, measures=(), seed=3, observers=(), **sections):
    given = {"model": model, "measures": list(measures), "stop": {"max_cycles": 12, **stop}, **sections}
    return run_trial(simulate(load_scenario(given), seed), observers)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("observers", [(), (onlooking,)])
@pytest.mark.parametrize(("kind", "when", "cycles"), [("list", "> 2", 3), ("tuple", "<= 0", 4), ("list", "> 3", 12)])
def test_a_trial_ends_at_the_cycle_at_which_the_last_value_of_a_series_satisfies_it(
    model, observers, kind, when, cycles, tmp_path
):
    path = write(tmp_path / "mine.py", SERIES.format(kind=kind))
    result = trial(model, {"when": f"Series {when}"}, [str(path)], observers=observers)
    assert (result.cycles, len(result.measures["Series"])) == (cycles, cycles)
    assert (result.t_sync_cycles, result.censored) == (None, None)
    assert result.order_parameter is not None
    plain = trial(model, {"order_parameter": None, "max_cycles": cycles})
    assert without_measures(result) == without_measures(plain)


@pytest.mark.parametrize("model", MODELS)
def test_a_condition_on_the_order_parameter_listed_or_not_ends_trials_where_synchrony_would(model):
    stop = {"order_parameter": 0.9, "max_cycles": 400}
    usual = [trial(model, stop, seed=seed) for seed in range(4)]
    when = {"when": "order_parameter >= 0.9", "max_cycles": 400}
    ended = [trial(model, when, ["order_parameter"], seed=seed) for seed in range(4)]
    assert without_measures(trial(model, when, seed=3)) == without_measures(ended[3])
    assert not all(result.censored for result in usual)
    for one, other in zip(usual, ended, strict=True):
        assert one.t_sync_cycles in (None, other.cycles)
        assert other.measures["order_parameter"][-1] == other.order_parameter == one.order_parameter
        assert (one.cycles, one.steps, one.simulated_s) == (other.cycles, other.steps, other.simulated_s)


@pytest.mark.parametrize("model", MODELS)
def test_a_measure_that_is_told_of_every_event_ends_the_trial_after_any(model, tmp_path):
    told = TELLTALE.replace("return self.seen", "return len(self.seen)")
    path = write(tmp_path / "mine.py", told)
    result = trial(model, {"when": "Telltale >= 7"}, [str(path)])
    assert result.measures["Telltale"] == 7
    if model == "embodied":
        assert result.steps == 7


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(("value", "cycles"), [("self.told > 4", 5), ("None", 12), ("[]", 12), ("float('nan')", 12)])
def test_true_counts_as_one_and_what_is_undetermined_ends_nothing(model, value, cycles, tmp_path):
    path = write(tmp_path / "mine.py", COUNTER.replace("self.offset + self.weight * self.told", value))
    assert trial(model, {"when": "Counter >= 1"}, [str(path)]).cycles == cycles


@settings(max_examples=15, deadline=None)
@given(st.floats(0.01, 30), st.integers(0, 5), st.floats(0.2, 3))
def test_agents_end_at_a_time_observed_or_not(time_s, seed, period_s):
    clocks = {"period_s": period_s}
    stop = {"order_parameter": None, "max_time_s": time_s, "max_cycles": 1000}
    events = []
    measures = [{"density": {"cells": 2}}]
    fast = trial("particles", stop, measures, seed=seed, clocks=clocks)
    seen = [lambda event, _: events.append(event.time_s)]
    slow = trial("particles", stop, measures, seed=seed, observers=seen, clocks=clocks)
    assert without_wall(fast) == without_wall(slow)
    assert fast.simulated_s == pytest.approx(time_s, rel=1e-12)
    assert all(time <= time_s * (1 + 1e-12) for time in events)
    simulation = simulate(load_scenario({"model": "particles", "stop": stop, "clocks": clocks}), seed)
    simulation.run_to(time_s)
    assert (fast.cycles, fast.steps) == (simulation.cycles, simulation.instants)
    assert fast.order_parameter == simulation.order_parameter


def test_agents_that_are_synchronised_before_the_time_end_then():
    stop = {"order_parameter": 0.5, "max_cycles": 10_000}
    usual = trial("particles", stop)
    later = trial("particles", {**stop, "max_time_s": 2 * usual.simulated_s})
    assert without_wall(later) == without_wall(usual)
    cut = trial("particles", {**stop, "max_time_s": usual.simulated_s / 2})
    assert (cut.censored, cut.t_sync_cycles) == (True, None)
    assert cut.cycles < usual.cycles


@pytest.mark.parametrize("model", MODELS)
def test_no_time_at_all_is_a_trial_too(model):
    result = trial(model, {"order_parameter": None, "max_time_s": 1e-3})
    assert (result.cycles, result.order_parameter, result.censored) == (0, None, None)
