"""What a firing costs in swarms of any size: `python -m tests.benchmarks.many_agents SPEED AGENTS ...`.

Agents send pulses to the nearest one, K = 1, at the density of 20 in a square metre. CPU time in ns a firing in the
first, the second and the last of the cycles, and the memory of the process; the first search for neighbours is in the
first two.
"""

import resource
import sys
import time

from epuck_sim.particles.simulation import ParticleSimulation
from tests.benchmarks.measuring import cpu_s
from tests.benchmarks.test_particle_speed import make_simulation

NEAREST = {"kind": "nearest", "k": 1}
CYCLES = 4
FIRINGS = 100_000  # before the last cycle, at least


def cost_ns(simulation: ParticleSimulation, periods: int) -> float:
    firings = simulation.firings
    spent_s = cpu_s(lambda: simulation.run(10**9, periods))
    return 1e9 * spent_s / max(simulation.firings - firings, 1)


def main(speed: float, counts: list[int]) -> None:
    make_simulation(5000, NEAREST, 1000, speed, 0).run(1)  # compiles
    for agents in counts:
        began = time.process_time()
        simulation = make_simulation(agents, NEAREST, 100 * (agents / 20) ** 0.5, speed, 0)
        made_s = time.process_time() - began
        first, second = cost_ns(simulation, 1), cost_ns(simulation, 1)
        cost_ns(simulation, 1 + FIRINGS // agents)
        later = min(cost_ns(simulation, 1 + FIRINGS // agents) for _ in range(CYCLES))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        costs = f"{first:6.0f} {second:6.0f} {later:6.0f} ns"
        print(f"{agents:9,} agents: made in {made_s:.2f} s; {costs}; {memory:.0f} MB")


if __name__ == "__main__":
    main(float(sys.argv[1]), [int(count) for count in sys.argv[2:]])
