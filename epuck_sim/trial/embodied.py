"""One trial: a simulation watched until the swarm is synchronised, or for as long as it may take."""

import time
from collections.abc import Callable, Iterable

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.trial.result import TrialResult
from epuck_sim.trial.synchrony import SynchronyWatch

Observer = Callable[[Step, SynchronyWatch], None]


def run_trial(simulation: Simulation, onlookers: Iterable[Observer] = ()) -> TrialResult:
    """Run a fresh simulation to the end of its trial and return the outcome.

    onlookers: each is shown every step and the state of the watch; they cannot change the outcome.
    Raises ValueError for a simulation that has taken steps already: its cycles before would go uncounted.
    """
    if simulation.steps:
        raise ValueError(f"a trial needs a fresh simulation; this one has taken {simulation.steps} steps")
    onlookers = tuple(onlookers)
    watch = SynchronyWatch(simulation)
    began = time.perf_counter()
    for step in simulation:
        watch.look(step)
        for onlooker in onlookers:
            onlooker(step, watch)
        if watch.is_over:
            break
    steps = step.number + 1
    outcome = watch.outcome
    return TrialResult(
        scenario=simulation.scenario.name,
        seed=simulation.seed,
        t_sync_cycles=outcome.cycles if watch.is_synchronised else None,
        censored=not watch.is_synchronised,
        cycles=outcome.cycles,
        order_parameter=outcome.order_parameter,
        steps=steps,
        simulated_s=steps * simulation.scenario.timing.step_ms / 1000,
        wall_s=time.perf_counter() - began,
    )
