"""Cycles and firings of point-like agents that a core simulates in a CPU second. Run by `make bench`.

Trials have random initial conditions and end with synchrony, or after enough cycles for the beginning hardly to count.
Machines are noisy: compare only numbers of one run.
"""

import pytest

from epuck_sim import ParticleSimulation
from epuck_sim.particles import neighbours
from tests.benchmarks.measuring import cpu_s

CONE = {"kind": "cone_of_vision", "radius_cm": 40, "angle_deg": 60}
RANGE = {"kind": "range", "radius_cm": 40}
CASES = {
    "20, K = 1": (20, {"kind": "nearest", "k": 1}, 100, 8, 20_000, {0.1: 1_300_000, 1: 670_000, 10: 450_000}),
    "20, cone": (20, CONE, 100, 8, 20_000, {0.1: 840_000, 1: 500_000, 10: 350_000}),
    "100, cone": (100, CONE, 100, 3, 1_000, {0.1: 37_000, 1: 37_000, 10: 37_000}),
    "1000, range": (1000, RANGE, 707, 1, 100, {0.1: 850, 1: 850, 10: 850}),
}
"""Agents, neighbourhood, side in cm, trials, limit of cycles, and cycles per second of a C++ model by speed in cm/s."""

SPEEDS = "agents", "cm/s", "cycles/s", "firings/s", "ns a firing", "cycles/s in C++", "ratio"
GROWTH = "agents", "ns a firing", "with a search over all pairs"


def make_simulation(agents: int, neighbourhood: dict, side_cm: float, speed: float, seed: int) -> ParticleSimulation:
    swarm = {"space": {"side_cm": side_cm}, "agents": {"count": agents, "speed_cm_s": speed}}
    return ParticleSimulation({"model": "particles", **swarm, "neighbourhood": neighbourhood}, seed)


def measure(simulations: list[ParticleSimulation], cycles: int) -> tuple[float, float]:
    """Return the cycles, and the firings, simulated per CPU second."""
    spent = cpu_s(lambda: [simulation.run(cycles) for simulation in simulations])
    return sum(each.cycles for each in simulations) / spent, sum(each.firings for each in simulations) / spent


@pytest.mark.parametrize("speed", [0.1, 1, 10])
@pytest.mark.parametrize("name", CASES)
def test_cycles_and_firings_per_second(show, name: str, speed: float) -> None:
    agents, neighbourhood, side_cm, trials, cycles, references = CASES[name]
    found = []
    for _ in range(3):
        simulations = [make_simulation(agents, neighbourhood, side_cm, speed, seed) for seed in range(trials)]
        found.append(measure(simulations, cycles))
    cycles_s, firings_s = max(found)  # the fastest: other processes can only slow it down
    theirs = references[speed]
    show(SPEEDS, name, speed, cycles_s, firings_s, 1e9 / firings_s, theirs, cycles_s / theirs)
    assert cycles_s > theirs / 4  # holds on any machine; the table shows the margin


@pytest.mark.parametrize("agents", [10, 30, 100, 300, 1000, 3000, 10_000])
def test_the_cost_of_a_firing_against_the_number_of_agents(show, agents: int, monkeypatch) -> None:
    side_cm = 707 * (agents / 1000) ** 0.5
    cycles = max(3, 20_000 // agents)
    in_cells = make_simulation(agents, RANGE, side_cm, 1.0, 0)
    monkeypatch.setattr(neighbours, "MIN_CELL_LIST_AGENTS", 10**9)
    all_pairs = make_simulation(agents, RANGE, side_cm, 1.0, 0)
    found = [1e9 / measure([each], cycles)[1] for each in (in_cells, all_pairs)]
    show(GROWTH, agents, *found)
    assert agents < 1000 or found[0] < found[1]
