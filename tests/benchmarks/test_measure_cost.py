"""What the shipped measures cost for each step and cycle, beside the same trials without. Run by `make bench`."""

import statistics
import time

import pytest

from epuck_sim.measures.loader import SHIPPED
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial, simulate

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


def cpu_s(scenario) -> tuple[float, int]:
    """Return the CPU time of a trial, without its making, and its steps, or, of agents, cycles."""
    simulation = simulate(scenario, 1)
    began = time.process_time()
    result = run_trial(simulation)
    return time.process_time() - began, result.steps if scenario.model == "embodied" else result.cycles


def compare(sections, name: str) -> tuple[float, float]:
    """Return how many times as long trials take with a measure, and how much longer a step or cycle is, in us."""
    parameters = DISPLACEMENT if name in FOR_AGENTS else GIVEN.get(name, {})
    plain, measured = load_scenario(sections), load_scenario({**sections, "measures": [{name: parameters}]})
    _, parts = cpu_s(measured)
    pairs = [(cpu_s(plain)[0], cpu_s(measured)[0]) for _ in range(PAIRS)]
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
