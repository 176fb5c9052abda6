"""What the shipped measures cost for each step and cycle, beside the same trials without. Run by `make bench`."""

import statistics
from functools import partial

import pytest

from epuck_sim.measures.loader import SHIPPED
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial, simulate
from tests.benchmarks.measuring import cpu_s

ROBOTS = {10: (60, 10), 100: (221, 4), 1000: (700, 2)}
"""Robots: side of their arena in cm, cycles of a trial."""

AGENTS = {20: 300, 1000: 5}
"""Agents: cycles of a trial."""

PAIRS = 5
"""Trials with and without a measure that take turns; their medians count."""

GIVEN = {"memory": {"name": "rotation_time"}}
"""Parameters, where the defaults make no sense."""

DISPLACEMENT = {"displacement": 1e-6}

FOR_AGENTS = ("perturbation", "perturbation_exponent", "perturbation_growth", "perturbation_transient")
FOR_ROBOTS = ("avoiding", "flashes_missed", "flashes_repeated", "flashes_seen", "in_contact", "memory")


def compare(sections, name: str) -> tuple[float, float]:
    """Return how many times as long trials take with a measure, and how much longer a step or cycle is, in us."""
    parameters = DISPLACEMENT if name in FOR_AGENTS else GIVEN.get(name, {})
    plain, measured = load_scenario(sections), load_scenario({**sections, "measures": [{name: parameters}]})
    result = run_trial(simulate(measured, 1))
    parts = result.steps if measured.model == "embodied" else result.cycles
    pairs = [
        tuple(cpu_s(partial(run_trial, simulate(scenario, 1))) for scenario in (plain, measured)) for _ in range(PAIRS)
    ]
    ratio = statistics.median(after / before for before, after in pairs)
    return ratio, statistics.median(after - before for before, after in pairs) / parts * 1e6


COLUMNS = "measure", "trials", "times as long", "us a step or cycle"


@pytest.mark.parametrize("name", [name for name in SHIPPED if name not in FOR_AGENTS])
@pytest.mark.parametrize("robots", ROBOTS)
def test_measures_of_robots(benchmark, show, robots: int, name: str) -> None:
    side_cm, cycles = ROBOTS[robots]
    sections = {
        "robots": [{"count": robots}],
        "arena": {"width_cm": side_cm, "height_cm": side_cm},
        "stop": {"order_parameter": 1.0, "max_cycles": cycles},
    }
    show(COLUMNS, name, f"{robots:,} robots", *benchmark.pedantic(compare, (sections, name), rounds=1))


@pytest.mark.parametrize("name", [name for name in SHIPPED if name not in FOR_ROBOTS])
@pytest.mark.parametrize("agents", AGENTS)
def test_measures_of_agents(benchmark, show, agents: int, name: str) -> None:
    cycles = AGENTS[agents]
    stop = {"order_parameter": None, "max_cycles": cycles}
    sections = {"model": "particles", "agents": {"count": agents}, "stop": stop}
    show(COLUMNS, name, f"{agents:,} agents", *benchmark.pedantic(compare, (sections, name), rounds=1))
