"""One trial of robots: a simulation that is watched until the swarm is synchronised, or for as long as it may take."""

import time
from collections.abc import Sequence

from epuck_sim.embodied.history import MOST_STEPS
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.trial.conditions import Conditions, WaitingEntries
from epuck_sim.trial.observer import Observer, OfStretches, Progress
from epuck_sim.trial.result import TrialResult
from epuck_sim.trial.synchrony import SynchronyWatch


def run_robots(
    simulation: Simulation,
    observers: Sequence[Observer],
    progress: Progress | None,
    at_cycles: Sequence[Observer],
    conditions: Conditions,
) -> TrialResult:
    """Run a fresh simulation of robots to the end of its trial; see `trial.model.Model.run`.

    Without observers of each step, only the steps in which the reference fires are looked at, which is much quicker.
    """
    if simulation.steps:
        raise ValueError(f"a trial needs a fresh simulation; this one has taken {simulation.steps} steps")
    watch = SynchronyWatch(simulation)
    waiting = WaitingEntries(simulation.scenario.schedule, conditions, simulation.carry_out_scheduled)
    in_stretches = [isinstance(observer, OfStretches) for observer in observers]
    sees_all, sees_stretches = not all(in_stretches), any(in_stretches)
    began = time.perf_counter()
    while not (watch.is_over or conditions.is_over()):
        waiting.look(watch)
        unseen = 1 if sees_all else min(watch.steps_left, MOST_STEPS)
        cycles = watch.cycles
        stretch = simulation.stretch(unseen) if sees_stretches else None
        step = simulation.advance(unseen, until_firing=True) if stretch is None else simulation.last_step
        watch.look(step, may_fire=sees_all or simulation.is_firing)
        if progress is not None:
            progress(watch)
        for observer, of_stretches in zip(observers, in_stretches, strict=True):
            observer(stretch if of_stretches else step, watch)
        if watch.cycles > cycles:
            for observer in at_cycles:
                observer(step, watch)
    outcome = watch.outcome
    return TrialResult(
        scenario=simulation.scenario.name,
        seed=simulation.seed,
        t_sync_cycles=outcome.cycles if watch.is_synchronised else None,
        censored=not watch.is_synchronised if watch.has_t_sync else None,
        cycles=outcome.cycles,
        order_parameter=outcome.order_parameter,
        steps=simulation.steps,
        simulated_s=simulation.steps * simulation.scenario.timing.step_ms / 1000,
        wall_s=time.perf_counter() - began,
        events=tuple(simulation.events),
    )
