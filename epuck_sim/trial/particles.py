"""One trial of point-like agents: a swarm watched until it is synchronised, or for as long as it may take."""

import time
from collections.abc import Callable, Iterable

from epuck_sim.particles.simulation import Event, ParticleSimulation
from epuck_sim.trial.result import TrialResult

Observer = Callable[[ParticleSimulation, Event], None]

SLICE_S = 0.1
"""So long, on the wall, compiled code runs before Python has its turn, for Ctrl-C and to tell how far it is."""


def run_swarm(
    swarm: ParticleSimulation,
    onlookers: Iterable[Observer] = (),
    progress: Callable[[ParticleSimulation], None] = lambda _: None,
) -> TrialResult:
    """Run a fresh swarm to the end of its trial and return the outcome.

    onlookers: each is shown every event; without any, it is much quicker. progress: is shown the swarm now and then.
    Raises ValueError for a swarm that is under way already: its cycles before would go uncounted.
    """
    if swarm.instants:
        raise ValueError(f"a trial needs a fresh swarm; of this one some have fired at {swarm.instants} instants")
    onlookers = tuple(onlookers)
    limit = swarm.scenario.stop.max_cycles
    longest = 2 * limit  # periods: a reference that others hold back for ever must not keep a trial for ever
    began = time.perf_counter()
    periods = 1
    while not swarm.is_synchronised and swarm.cycles < limit and swarm.next_period < longest:
        if onlookers:
            event = next(swarm)
            for onlooker in onlookers:
                onlooker(swarm, event)
        else:
            asked = time.perf_counter()
            swarm.run(limit, min(periods, longest - swarm.period))
            took = time.perf_counter() - asked
            periods = 2 * periods if took < SLICE_S / 2 else max(1, periods // 2) if took > 2 * SLICE_S else periods
        progress(swarm)
    # where the reference was held back for so long, no firing ended the trial
    has_fired = swarm.is_synchronised or swarm.cycles >= limit
    return TrialResult(
        scenario=swarm.scenario.name,
        seed=swarm.seed,
        t_sync_cycles=swarm.cycles if swarm.is_synchronised else None,
        censored=not swarm.is_synchronised,
        cycles=swarm.cycles,
        order_parameter=swarm.order_parameter if has_fired else None,
        steps=swarm.instants,
        simulated_s=swarm.time_s if has_fired else longest * swarm.scenario.clocks.period_s,
        wall_s=time.perf_counter() - began,
    )
