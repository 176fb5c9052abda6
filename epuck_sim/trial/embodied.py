"""One trial: a simulation watched until the swarm is synchronised, or for as long as it may take."""

import time
from collections.abc import Callable, Iterable
from typing import NamedTuple

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.trial.synchrony import SynchronyWatch

Onlooker = Callable[[Step, SynchronyWatch], None]


class TrialResult(NamedTuple):
    """What came out of a trial."""

    scenario: str
    """The scenario's name."""
    seed: int
    """With it the trial can be run again, alone."""
    t_sync_cycles: int | None
    """Firings of the reference robot until the swarm was synchronised; None if it never was."""
    censored: bool
    """Whether the trial ended, at its limit of cycles or time, before the swarm was synchronised."""
    cycles: int
    """Firings of the reference robot, until synchrony if there was any."""
    order_parameter: float | None
    """At the last of them; None if there was none."""
    steps: int
    """Control steps; of point-like agents, instants at which some fired."""
    simulated_s: float
    wall_s: float

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds in a second on the wall."""
        return self.simulated_s / self.wall_s


def run_trial(simulation: Simulation, onlookers: Iterable[Onlooker] = ()) -> TrialResult:
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
