"""What the shipped measures cost for each step and cycle, beside the same trials without. Run by `make bench`."""

import statistics
from contextlib import suppress
from functools import partial
from itertools import product
from typing import Any

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.measures.measure import SHIPPED
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.model import run_trial, simulate
from tests.benchmarks.measuring import cpu_s

SCENARIOS: dict[str, dict[str, Any]] = {}
for _robots, _side_cm, _cycles in [(10, 60, 10), (100, 221, 4), (1000, 700, 2)]:
    _size, _stop = {"width_cm": _side_cm, "height_cm": _side_cm}, {"order_parameter": 1.0, "max_cycles": _cycles}
    SCENARIOS[f"{_robots:,} robots"] = {"robots": [{"count": _robots}], "arena": _size, "stop": _stop}
for _agents, _cycles in [(20, 300), (1000, 5)]:
    _stop = {"order_parameter": None, "max_cycles": _cycles}
    SCENARIOS[f"{_agents:,} agents"] = {"model": "particles", "agents": {"count": _agents}, "stop": _stop}

PAIRS = 5  # trials with and without a measure that take turns; their medians count

GIVEN = {"memory": {"name": "rotation_time"}}  # parameters, where the defaults make no sense


def with_measure(sections: dict[str, Any], name: str) -> Scenario:
    parameters = {"displacement": 1e-6} if name.startswith("perturbation") else GIVEN.get(name, {})
    return load_scenario({**sections, "measures": [{name: parameters}]})


def measured() -> list[tuple[str, str]]:
    """Return the scenarios with the names of the shipped measures that measure them."""
    found = []
    for trials, name in product(SCENARIOS, SHIPPED):
        with suppress(ScenarioError):
            with_measure(SCENARIOS[trials], name)
            found.append((trials, name))
    return found


def compare(sections: dict[str, Any], name: str) -> tuple[float, float]:
    """Return how many times as long trials take with a measure, and how much longer a step or cycle is, in us."""
    scenarios = load_scenario(sections), with_measure(sections, name)
    result = run_trial(simulate(scenarios[1], 1))
    parts = result.steps if scenarios[1].model == "embodied" else result.cycles
    pairs = [tuple(cpu_s(partial(run_trial, simulate(scenario, 1))) for scenario in scenarios) for _ in range(PAIRS)]
    ratio = statistics.median(after / before for before, after in pairs)
    return ratio, statistics.median(after - before for before, after in pairs) / parts * 1e6


COLUMNS = "measure", "trials", "times as long", "us a step or cycle"


@pytest.mark.parametrize(("trials", "name"), measured())
def test_measures(show, trials: str, name: str) -> None:
    show(COLUMNS, name, trials, *compare(SCENARIOS[trials], name))
