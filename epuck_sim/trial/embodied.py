"""One trial of robots: a simulation that is watched until the swarm is synchronised, or for as long as it may take."""

import time
from collections.abc import Sequence

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.trial.observer import Observer
from epuck_sim.trial.result import TrialResult
from epuck_sim.trial.synchrony import SynchronyWatch


def run_robots(simulation: Simulation, observers: Sequence[Observer]) -> TrialResult:
    """Run a fresh simulation of robots to the end of its trial; see `trial.model.run_trial`."""
    if simulation.steps:
        raise ValueError(f"a trial needs a fresh simulation; this one has taken {simulation.steps} steps")
    watch = SynchronyWatch(simulation)
    began = time.perf_counter()
    for step in simulation:
        watch.look(step)
        for observer in observers:
            observer(step, watch)
        if watch.is_over:
            break
    outcome = watch.outcome
    return TrialResult(
        scenario=simulation.scenario.name,
        seed=simulation.seed,
        t_sync_cycles=outcome.cycles if watch.is_synchronised else None,
        censored=not watch.is_synchronised,
        cycles=outcome.cycles,
        order_parameter=outcome.order_parameter,
        steps=simulation.steps,
        simulated_s=simulation.steps * simulation.scenario.timing.step_ms / 1000,
        wall_s=time.perf_counter() - began,
    )
